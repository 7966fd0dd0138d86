//! What Ctrl-C and other signals do.

use std::sync::Arc;

use chainage::run::CancelToken;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::flag;
use signal_hook::iterator::Signals;

use crate::cli::exit::{self, CliError};

/// The first Ctrl-C finishes what is in flight; the second leaves at once. Both resume. The end of the
/// session and `kill` do the same. `nohup` has the program ignore the end of the session, and it does.
/// Ctrl-C is heard even if it is ignored, as in the background of a script: `kill -INT` ends a run there.
pub(crate) fn listen(cancel: &Arc<CancelToken>) -> Result<(), CliError> {
    let cancel = Arc::clone(cancel);
    let hang_up = (!is_ignored(SIGHUP)).then_some(SIGHUP);
    let heard = [SIGINT, SIGTERM].into_iter().chain(hang_up);
    let failed = |source| CliError::Write { target: "the handler of Ctrl-C".to_owned(), source };
    let mut signals = Signals::new(heard).map_err(failed)?;
    // With a handler that does nothing, a file above the limit of its size is an error with a path. The
    // system would end the process without a word.
    flag::register(SIGXFSZ, Arc::default()).map_err(failed)?;
    let wait = move || {
        for (count, _) in signals.forever().enumerate() {
            if count > 0 {
                // The state is consistent at every moment, so leaving at once loses only what is in flight.
                leave();
            }
            cancel.cancel();
        }
    };
    std::thread::Builder::new().name("signals".to_owned()).spawn(wait).map(drop).map_err(failed)
}

/// Whether this process ignored a signal when it began. Only Linux tells: as bits, counted from signal 1.
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    mask >> (signal - 1) & 1 == 1
}

#[expect(clippy::disallowed_methods, reason = "a second Ctrl-C must not wait for the workers")]
fn leave() -> ! {
    std::process::exit(i32::from(exit::INTERRUPTED))
}

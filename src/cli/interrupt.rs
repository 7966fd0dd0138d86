//! The effect of Ctrl-C and other signals.

use std::sync::Arc;

use chainage::run::CancelToken;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::flag;
use signal_hook::iterator::Signals;

use crate::cli::exit::{self, CliError};

/// Installs the handlers. The first Ctrl-C finishes the units in flight; the second one exits at once. After
/// both, a run can resume. The end of the session and `kill` do the same. Under `nohup`, the program ignores
/// the end of the session. Ctrl-C is handled even if it was ignored, as in the background of a script, so
/// that `kill -INT` ends a run there.
pub(crate) fn listen(cancel: &Arc<CancelToken>) -> Result<(), CliError> {
    let cancel = Arc::clone(cancel);
    let hang_up = (!is_ignored(SIGHUP)).then_some(SIGHUP);
    let heard = [SIGINT, SIGTERM].into_iter().chain(hang_up);
    let failed = |source| CliError::Write { target: "the handler of Ctrl-C".to_owned(), source };
    let mut signals = Signals::new(heard).map_err(failed)?;
    // With a handler that does nothing, a file above the limit of file sizes gives an error with a path.
    // Otherwise, the system would silently end the process.
    flag::register(SIGXFSZ, Arc::default()).map_err(failed)?;
    let wait = move || {
        for (count, _) in signals.forever().enumerate() {
            if count > 0 {
                // The state is consistent at every moment, so exiting at once loses only the units in flight.
                leave();
            }
            cancel.cancel();
        }
    };
    std::thread::Builder::new().name("signals".to_owned()).spawn(wait).map(drop).map_err(failed)
}

/// Whether this process ignored a signal when it started. Only Linux reports this: as bits, counted from
/// signal 1.
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

//! What Ctrl-C does.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use chainage::run::CancelToken;

use crate::cli::exit::{self, CliError};

/// The first Ctrl-C finishes what is in flight; the second leaves at once. Both resume.
pub(crate) fn listen(cancel: &Arc<CancelToken>) -> Result<(), CliError> {
    let (cancel, asked) = (Arc::clone(cancel), AtomicBool::new(false));
    ctrlc::set_handler(move || {
        if asked.swap(true, Ordering::Relaxed) {
            // The state is consistent at every moment, so leaving at once loses only what is in flight.
            leave();
        }
        cancel.cancel();
    })
    .map_err(|error| CliError::Write {
        target: "the handler of Ctrl-C".to_owned(),
        source: std::io::Error::other(error),
    })
}

#[expect(clippy::disallowed_methods, reason = "a second Ctrl-C must not wait for the workers")]
fn leave() -> ! {
    std::process::exit(i32::from(exit::INTERRUPTED))
}

//! Long work beside the interpreter: the lock of the interpreter is released, Ctrl-C stops the work, and
//! events are passed to a function.

use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use chainage::Result;
use chainage::run::{CancelToken, Event, Observer};
use pyo3::prelude::*;

use crate::failure::{bug, raised};

/// Time between two looks for Ctrl-C. Chosen: a person does not notice it.
const LOOK: Duration = Duration::from_millis(50);

/// Sends the events of a run to the thread of the interpreter, as JSON.
struct Told(Mutex<Sender<String>>);

impl Observer for Told {
    fn event(&self, event: &Event<'_>) {
        if let Ok(sender) = self.0.lock() {
            // The receiver is gone only after a failure, which is reported anyway.
            let _ = sender.send(event.to_json().to_string());
        }
    }
}

/// Does the work on a thread of its own, and waits for its end. If the interpreter was interrupted, or the
/// function for events raised an exception, the work is stopped, and the exception is returned after the
/// tiles in flight are finished.
pub(crate) fn beside<T: Send + 'static>(
    py: Python<'_>,
    tell: Option<&Py<PyAny>>,
    work: impl FnOnce(&dyn Observer, &CancelToken) -> Result<T> + Send + 'static,
) -> PyResult<T> {
    let cancel = Arc::new(CancelToken::default());
    let (sender, events) = channel();
    let token = Arc::clone(&cancel);
    let thread = std::thread::spawn(move || work(&Told(Mutex::new(sender)), &token));
    // Receivers are not shared between threads, and releasing the lock counts as that.
    let events = Mutex::new(events);
    let mut failed: Option<PyErr> = None;
    loop {
        let event = py.detach(|| match events.lock() {
            Ok(events) => events.recv_timeout(LOOK),
            Err(_) => Err(RecvTimeoutError::Disconnected),
        });
        let seen = match event {
            Ok(event) => match tell.filter(|_| failed.is_none()) {
                Some(tell) => tell.call1(py, (event,)).map(|_| ()),
                None => Ok(()),
            },
            Err(RecvTimeoutError::Timeout) => Ok(()),
            Err(RecvTimeoutError::Disconnected) => break,
        };
        if let Err(error) = seen.and_then(|()| py.check_signals()) {
            cancel.cancel();
            failed.get_or_insert(error);
        }
    }
    let ended = py.detach(|| thread.join());
    match (failed, ended) {
        (Some(error), _) => Err(error),
        (None, Ok(result)) => result.map_err(|error| raised(&error)),
        (None, Err(_)) => Err(bug("a thread ended without a result")),
    }
}

//! The one exception of the native part: (kind, text, hint). The Python part raises the exception of that
//! kind.

use std::path::Path;

use chainage::{Error, ErrorKind};
use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;

create_exception!(_native, Failure, PyException);

/// Name of a kind of failure, as the Python part knows it.
fn name(kind: ErrorKind) -> &'static str {
    match kind {
        ErrorKind::Bug => "bug",
        ErrorKind::Config => "config",
        ErrorKind::Input => "input",
        ErrorKind::Output => "output",
        ErrorKind::State => "state",
        ErrorKind::Locked => "locked",
        ErrorKind::UnitsFailed => "units-failed",
        ErrorKind::Difference => "difference",
        ErrorKind::Interrupted => "interrupted",
    }
}

/// An error of the library as an exception, with its causes.
pub(crate) fn raised(error: &Error) -> PyErr {
    failure(error, text(error))
}

/// The same, of a file that the caller knows by another `name`.
pub(crate) fn raised_of(error: &Error, file: &Path, name: &str) -> PyErr {
    failure(error, text(error).replace(&file.display().to_string(), name))
}

/// The text of an error with its causes.
fn text(error: &Error) -> String {
    let mut text = error.to_string();
    let mut cause = std::error::Error::source(error);
    while let Some(source) = cause {
        text.push_str(&format!(": {source}"));
        cause = source.source();
    }
    text
}

fn failure(error: &Error, text: String) -> PyErr {
    Failure::new_err((name(error.kind()), text, error.hint().map(|hint| hint.into_owned())))
}

/// A violated invariant of the package itself.
pub(crate) fn bug(text: impl std::fmt::Display) -> PyErr {
    raised(&Error::bug(text.to_string()))
}

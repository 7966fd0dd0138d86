//! The one error type of the library. It knows no other module. Each area of the library has its own error,
//! which implements [`Failure`] and becomes an [`Error`] by `?`.
//!
//! Rules: a text is a lower-case fragment without a full stop that names the object (path, tile, key) and
//! both numbers. The cause is [`std::error::Error::source`] and is never repeated in the text.
//! [`Failure::hint`] is the next command to type, or nothing. Every failure has an [`ErrorKind`], and the
//! program maps every kind to an exit code. Neither mapping has a wildcard.

use std::any::Any;
use std::borrow::Cow;

/// A failure, with the object that it concerns.
///
/// ```
/// use chainage::config::ConfigError;
/// use chainage::{Error, ErrorKind};
///
/// let error = Error::from(ConfigError::value("euclidean.max_gap_m", 0.0, "0.001 to 10 metres"));
/// assert_eq!(error.kind(), ErrorKind::Config);
/// assert!(error.cause::<ConfigError>().is_some());
/// ```
pub struct Error(Box<dyn Failure>);

/// Result with the library's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What every error of an area of the library provides.
pub trait Failure: std::error::Error + Send + Sync + 'static {
    /// The kind of failure, for exit codes.
    fn kind(&self) -> ErrorKind;

    /// The next command to type or thing to do, if there is one.
    fn hint(&self) -> Option<Cow<'static, str>> {
        None
    }

    /// Whether every other unit of a pass would fail for the same reason, so that the pass stops.
    fn stops_all(&self) -> bool {
        false
    }

    /// Whether an input file is the cause and the text names it.
    fn concerns_input(&self) -> bool {
        false
    }
}

/// The kinds of failure that a caller can distinguish. The program gives each an exit code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorKind {
    /// A defect of chainage itself.
    Bug,
    /// The configuration is invalid.
    Config,
    /// An input is missing, unreadable or not acceptable.
    Input,
    /// Writing failed.
    Output,
    /// The run directory does not match this configuration, input or version.
    State,
    /// The run directory is in use by another process.
    Locked,
    /// Some units failed, and the others were finished.
    UnitsFailed,
    /// Two things that should be the same are not.
    Difference,
    /// Stopped on request.
    Interrupted,
}

impl Error {
    /// A violated invariant of chainage itself.
    pub fn bug(text: impl Into<String>) -> Self {
        Self::from(Bug(text.into()))
    }

    /// A caught panic: a violated invariant as well.
    #[must_use]
    pub fn from_panic(panic: &(dyn Any + Send)) -> Self {
        Self::bug(panic_text(panic))
    }

    /// The kind of failure, for exit codes.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        self.0.kind()
    }

    /// The next command to type or thing to do, if there is one.
    #[must_use]
    pub fn hint(&self) -> Option<Cow<'static, str>> {
        self.0.hint().or_else(|| hint_of_the_system(&*self.0))
    }

    /// Whether every other unit of a pass would fail for the same reason.
    #[must_use]
    pub fn stops_all(&self) -> bool {
        self.0.stops_all()
    }

    /// Whether an input file is the cause and the text names it.
    #[must_use]
    pub fn concerns_input(&self) -> bool {
        self.0.concerns_input()
    }

    /// The failure itself, if it is an `E`.
    #[must_use]
    pub fn cause<E: Failure>(&self) -> Option<&E> {
        let failure: &(dyn std::error::Error + 'static) = &*self.0;
        failure.downcast_ref()
    }
}

impl<E: Failure> From<E> for Error {
    fn from(failure: E) -> Self {
        Self(Box::new(failure))
    }
}

impl std::fmt::Display for Error {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(out)
    }
}

impl std::fmt::Debug for Error {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        std::fmt::Debug::fmt(&self.0, out)
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.0.source()
    }
}

/// The hint against an error of the system that can occur in any area.
fn hint_of_the_system(failure: &dyn Failure) -> Option<Cow<'static, str>> {
    // Numbers of `errno(3)`. A wrapped error keeps only the text, and not every number has an `ErrorKind`.
    const HINTS: [(&str, &str); 3] = [
        (
            "(os error 24)", // EMFILE
            "raise the hard limit of open files (ulimit -Hn; nofile in /etc/security/limits.conf) and type the same \
             command again",
        ),
        (
            "(os error 21)", // EISDIR
            "a folder is in the place of this file: move it away and type the same command again",
        ),
        (
            "(os error 20)", // ENOTDIR
            "a file is in the place of a folder of this path: move it away, or choose another path",
        ),
    ];
    let causes = std::iter::successors(failure.source(), |cause| cause.source());
    let texts: Vec<String> = causes.map(ToString::to_string).collect();
    let met = |(number, _): &&(&str, &str)| texts.iter().any(|text| text.ends_with(number));
    HINTS.iter().find(met).map(|(_, hint)| (*hint).into())
}

/// The text of a caught panic.
pub(crate) fn panic_text(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied().map(str::to_owned);
    text.or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "panic without a message".to_owned())
}

/// A violated invariant of chainage itself.
#[derive(Debug, thiserror::Error)]
#[error("internal error: {0}")]
struct Bug(String);

impl Failure for Bug {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Bug
    }

    fn hint(&self) -> Option<Cow<'static, str>> {
        Some("please report this with the command line and report.json".into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, thiserror::Error)]
    #[error("cannot read a.las")]
    struct Unread(#[source] std::io::Error);

    impl Failure for Unread {
        fn kind(&self) -> ErrorKind {
            ErrorKind::Input
        }
    }

    #[test]
    fn the_limit_of_open_files_has_a_hint_in_every_area() {
        let hint = |source| Error::from(Unread(source)).hint();
        let met = || std::io::Error::from_raw_os_error(24);
        assert!(hint(met()).is_some_and(|hint| hint.contains("ulimit -Hn")));
        let wrapped = std::io::Error::other(format!("failed to open file: {}", met()));
        assert!(hint(wrapped).is_some_and(|hint| hint.contains("ulimit -Hn")));
        assert_eq!(hint(std::io::ErrorKind::NotFound.into()), None);
    }
}

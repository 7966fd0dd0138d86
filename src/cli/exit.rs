//! Exit codes, and the report of an error: once, with its causes and the next command to type.

use std::borrow::Cow;
use std::io::{self, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use chainage::{Error, ErrorKind};
use serde_json::json;

use crate::cli::colour;

pub(crate) const DONE: u8 = 0;
pub(crate) const BUG: u8 = 1;
// 2 is clap's own code for wrong usage.
pub(crate) const CONFIG: u8 = 3;
pub(crate) const INPUT: u8 = 4;
pub(crate) const OUTPUT: u8 = 5;
pub(crate) const STATE: u8 = 6;
pub(crate) const LOCKED: u8 = 7;
pub(crate) const UNITS_FAILED: u8 = 8;
pub(crate) const DIFFERENCE: u8 = 9;
pub(crate) const INTERRUPTED: u8 = 130;

/// Result of a command: its exit code.
pub(crate) type Outcome = Result<u8, CliError>;

/// Why a command failed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CliError {
    /// The library returned an error.
    #[error(transparent)]
    Library(#[from] Error),
    /// Standard output or a file of the command line itself cannot be written.
    #[error("cannot write {target}")]
    Write { target: String, source: io::Error },
    /// A run in a process of its own failed. It has reported its error in `text`.
    #[error("{}", text.trim_end())]
    Run { code: u8, text: String },
    /// The folder has no page to show.
    #[error("{path} has no report.html", path = path.display())]
    NoPage { path: PathBuf },
    /// The server cannot be started.
    #[error("cannot serve on 127.0.0.1{}", port_text(*port))]
    Serve { port: u16, source: io::Error },
}

/// The port, if the user has chosen one.
fn port_text(port: u16) -> String {
    if port == 0 { String::new() } else { format!(":{port}") }
}

impl CliError {
    /// Standard output cannot be written.
    pub(crate) fn stdout(source: io::Error) -> Self {
        Self::Write { target: "to standard output".to_owned(), source }
    }

    /// Whether the reader closed the pipe. This is not a failure.
    pub(crate) fn is_broken_pipe(&self) -> bool {
        matches!(self, Self::Write { source, .. } if source.kind() == io::ErrorKind::BrokenPipe)
    }

    /// The exit code.
    pub(crate) fn code(&self) -> u8 {
        match self {
            Self::Write { .. } | Self::Serve { .. } => OUTPUT,
            Self::NoPage { .. } => INPUT,
            Self::Run { code, .. } => *code,
            Self::Library(error) => match error.kind() {
                ErrorKind::Bug => BUG,
                ErrorKind::Config => CONFIG,
                ErrorKind::Input => INPUT,
                ErrorKind::Output => OUTPUT,
                ErrorKind::State => STATE,
                ErrorKind::Locked => LOCKED,
                ErrorKind::UnitsFailed => UNITS_FAILED,
                ErrorKind::Difference => DIFFERENCE,
                ErrorKind::Interrupted => INTERRUPTED,
            },
        }
    }

    /// The next command to type.
    fn hint(&self) -> Option<Cow<'static, str>> {
        match self {
            Self::Library(error) => error.hint(),
            Self::NoPage { .. } => Some(
                "chainage run FILES... -o OUT writes it, unless --no-report or --outputs leaves it out"
                    .into(),
            ),
            Self::Serve { .. } => Some("choose another --port, or none".into()),
            Self::Write { .. } | Self::Run { .. } => None,
        }
    }

    /// Reports the error on standard error: as text, or as a line of JSON if standard error is lines of JSON.
    pub(crate) fn print(&self) {
        let text = if IS_JSON.load(Ordering::Relaxed) { self.line() } else { self.text() };
        // If standard error is closed, nothing can be reported.
        let _ = io::stderr().write_all(text.as_bytes());
    }

    fn causes(&self) -> impl Iterator<Item = String> {
        let first = std::error::Error::source(self);
        std::iter::successors(first, |cause| cause.source()).map(ToString::to_string)
    }

    fn text(&self) -> String {
        if let Self::Run { text, .. } = self {
            return text.clone();
        }
        let mut text = format!("{} {self}\n", colour::coloured("error:", colour::RED));
        self.causes().for_each(|cause| text.push_str(&format!("caused by: {cause}\n")));
        if let Some(hint) = self.hint() {
            text.push_str(&format!("hint: {hint}\n"));
        }
        text
    }

    fn line(&self) -> String {
        let causes: Vec<String> = self.causes().collect();
        let (error, code) = (self.to_string(), self.code());
        let event = json!({
            "event": "error", "error": error, "causes": causes, "hint": self.hint(), "exit_code": code,
        });
        format!("{event}\n")
    }
}

/// Whether standard error is lines of JSON.
static IS_JSON: AtomicBool = AtomicBool::new(false);

/// From now on, errors are reported as lines of JSON.
pub(crate) fn report_as_json() {
    IS_JSON.store(true, Ordering::Relaxed);
}

/// Runs the program, and returns its exit code. A panic outside a tile is a bug and is reported as one.
pub(crate) fn guarded(program: impl FnOnce() -> u8) -> u8 {
    // After a panic, no state of the program is used again.
    catch_unwind(AssertUnwindSafe(program)).unwrap_or_else(|panic| {
        let error = CliError::from(Error::from_panic(&*panic));
        error.print();
        error.code()
    })
}

#[cfg(test)]
mod tests {
    use chainage::run::RunError;

    use super::*;

    #[test]
    fn a_panic_outside_a_tile_is_a_bug_and_has_its_code() {
        assert_eq!(guarded(|| DONE), DONE);
        assert_eq!(guarded(|| panic!("not expected: {}", 3)), BUG);
        let text = "byte index 2 is not a char boundary";
        let error = CliError::from(Error::from_panic(&text));
        assert_eq!(error.to_string(), format!("internal error: {text}"));
        assert!(error.hint().is_some_and(|hint| hint.contains("report")));
    }

    #[test]
    fn every_kind_of_failure_has_its_code() {
        let units = || {
            let pass = "ground".to_owned();
            let first = "unit 3: internal error: no".to_owned();
            Error::from(RunError::UnitsFailed { pass, failed: 1, total: 9, first })
        };
        let interrupted = Error::from(RunError::Interrupted { pass: "ground".to_owned(), done: 1, total: 9 });
        for (error, code) in [(Error::bug("no"), 1), (units(), 8), (interrupted, 130)] {
            assert_eq!(CliError::from(error).code(), code);
        }
        let closed = CliError::stdout(io::Error::other("no"));
        assert_eq!(closed.code(), 5);
        let line: serde_json::Value = serde_json::from_str(&closed.line()).unwrap();
        let expected = json!({
            "event": "error", "error": "cannot write to standard output", "causes": ["no"], "hint": null,
            "exit_code": 5,
        });
        assert_eq!(line, expected);
    }
}

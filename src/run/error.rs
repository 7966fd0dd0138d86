//! Errors of a pass that is incomplete although the run directory and the input are valid.

use std::borrow::Cow;

use crate::error::{ErrorKind, Failure};

/// A pass is incomplete. Its finished units are kept.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// The run was asked to stop.
    #[error("interrupted with {done} of {total} units of pass {pass} done")]
    Interrupted {
        /// Name of the interrupted pass.
        pass: String,
        /// Number of its finished units, which are kept.
        done: usize,
        /// Number of its units.
        total: usize,
    },
    /// A step that repeats until it has settled did not settle.
    #[error("pass {pass} has not settled after {rounds} rounds: {tiles} tiles would run again")]
    NotSettled {
        /// Name of the pass.
        pass: String,
        /// Maximum number of rounds.
        rounds: u32,
        /// Number of tiles whose neighbours still change.
        tiles: usize,
    },
    /// Some tiles failed; the others were finished.
    #[error("{failed} of {total} units of pass {pass} failed, the first: {first}")]
    UnitsFailed {
        /// Name of the pass.
        pass: String,
        /// Number of failed units.
        failed: usize,
        /// Number of units of the pass.
        total: usize,
        /// Text of the first failure.
        first: String,
    },
}

impl Failure for RunError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Interrupted { .. } => ErrorKind::Interrupted,
            Self::UnitsFailed { .. } => ErrorKind::UnitsFailed,
            Self::NotSettled { .. } => ErrorKind::Bug,
        }
    }

    fn hint(&self) -> Option<Cow<'static, str>> {
        Some(match self {
            Self::Interrupted { .. } => "the same command resumes".into(),
            Self::NotSettled { .. } => "please report this with the command line and report.json".into(),
            Self::UnitsFailed { .. } => "the same command tries the failed units again".into(),
        })
    }
}

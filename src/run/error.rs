//! Why a pass did not complete although nothing is wrong with the run directory or the input.

use std::borrow::Cow;

use crate::error::{ErrorKind, Failure};

/// A pass did not complete; what was finished is kept.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// The run was asked to stop.
    #[error("interrupted with {done} of {total} units of pass {pass} done")]
    Interrupted {
        /// Name of the pass that was under way.
        pass: String,
        /// Units of it that are kept.
        done: usize,
        /// Units of it in all.
        total: usize,
    },
    /// A step that is repeated until it has settled did not.
    #[error("pass {pass} has not settled after {rounds} rounds: {tiles} tiles would run again")]
    NotSettled {
        /// Name of the pass.
        pass: String,
        /// Rounds after which it gives up.
        rounds: u32,
        /// Tiles whose neighbours still change.
        tiles: usize,
    },
    /// Some tiles failed; the others were finished.
    #[error("{failed} of {total} units of pass {pass} failed, the first: {first}")]
    UnitsFailed {
        /// Name of the pass.
        pass: String,
        /// Units that failed.
        failed: usize,
        /// Units of the pass in all.
        total: usize,
        /// What the first failure said.
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

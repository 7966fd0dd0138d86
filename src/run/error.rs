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
    /// The drive has no points in the section that the settings choose.
    #[error(
        "there are no points {}: the chainage of this drive is 0 to {length_m:.0} m", range(*from_m, *to_m)
    )]
    NoSection {
        /// Chainage where the section begins, in metres.
        from_m: f64,
        /// Chainage where it ends, in metres; infinite for the end of the drive.
        to_m: f64,
        /// Length of the axis in metres.
        length_m: f64,
    },
    /// A value of the whole drive is to be estimated, but only a section of it is processed.
    #[error("{method} estimates a value over the whole drive, and --from or --to choose a section of it")]
    EstimatedOverSection {
        /// Name of the method.
        method: String,
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

/// A range of chainage.
fn range(from_m: f64, to_m: f64) -> String {
    if to_m.is_finite() { format!("from {from_m} to {to_m} m") } else { format!("from {from_m} m on") }
}

impl Failure for RunError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Interrupted { .. } => ErrorKind::Interrupted,
            Self::UnitsFailed { .. } => ErrorKind::UnitsFailed,
            Self::NotSettled { .. } => ErrorKind::Bug,
            Self::NoSection { .. } | Self::EstimatedOverSection { .. } => ErrorKind::Config,
        }
    }

    fn hint(&self) -> Option<Cow<'static, str>> {
        Some(match self {
            Self::Interrupted { .. } => "the same command resumes".into(),
            Self::NotSettled { .. } => "please report this with the command line and report.json".into(),
            Self::NoSection { .. } => "chainage info FILES prints the length of the axis".into(),
            Self::EstimatedOverSection { .. } => {
                "estimate it first with chainage estimate-epsilon FILES, and give the value".into()
            }
            Self::UnitsFailed { .. } => "the same command tries the failed units again".into(),
        })
    }
}

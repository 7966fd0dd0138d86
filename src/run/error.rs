//! Errors of a pass that is incomplete although the run directory and the input are valid.

use std::borrow::Cow;
use std::path::PathBuf;

use crate::error::{ErrorKind, Failure};
use crate::words::counted;

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
    /// The learning of a model was asked to stop.
    #[error("interrupted in pass {pass}")]
    TrainingInterrupted {
        /// Name of the interrupted pass, with the name of the drive if the pass works on one.
        pass: String,
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
    /// A pass that no run with these settings has.
    #[error("{pass} is not a pass of this run")]
    NoSuchPass {
        /// The name that was given.
        pass: String,
        /// The passes of this run.
        known: Vec<String>,
    },
    /// A unit with a number that the pass does not have.
    #[error("pass {pass} has {}, and none has the number {unit}", counted(*units as u64, "unit"))]
    NoSuchUnit {
        /// Title of the pass.
        pass: String,
        /// The number that was given.
        unit: usize,
        /// Number of its units.
        units: usize,
    },
    /// Workers may not compute units of this pass yet.
    #[error("pass {pass} has not been opened for workers with these settings")]
    NotOpened {
        /// Title of the pass.
        pass: String,
    },
    /// An earlier pass is not complete.
    #[error("pass {pass}, before {asked}, is not complete")]
    NotReduced {
        /// Title of the earlier pass.
        pass: String,
        /// Title of the pass that was asked for.
        asked: String,
    },
    /// Units of a pass are missing at its end.
    #[error("{} of {units} units of pass {pass} are missing{}: {}", missing.len(), waited(*waited_s), ranges(missing))]
    UnitsMissing {
        /// Title of the pass.
        pass: String,
        /// The missing units.
        missing: Vec<usize>,
        /// Number of its units.
        units: usize,
        /// Seconds spent waiting for them.
        waited_s: u64,
    },
    /// A unit was stored, but its file cannot be used.
    #[error("unit {unit} of pass {pass} cannot be used, {path}: {why}", path = path.display())]
    UnitRefused {
        /// Title of the pass.
        pass: String,
        /// Number of the unit.
        unit: usize,
        /// Its file.
        path: PathBuf,
        /// Why it cannot be used.
        why: String,
    },
    /// The settings of a worker are not those of the run.
    #[error("the run has {key} = {of_run}, this worker {key} = {here}")]
    OtherSettings {
        /// The first setting that differs.
        key: String,
        /// Its value in the run.
        of_run: String,
        /// Its value here.
        here: String,
    },
    /// The drive has no points in the section that the settings choose.
    #[error(
        "there are no points {}: the chainage of this drive is 0 to {length_m:.1} m", range(*from_m, *to_m)
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

/// The time spent waiting, in words; empty if it is zero.
fn waited(seconds: u64) -> String {
    if seconds == 0 { String::new() } else { format!(" after {seconds} s") }
}

/// Numbers in ascending order as half-open ranges, in the form that `work --units` takes: `3..7,12`.
pub(crate) fn ranges(numbers: &[usize]) -> String {
    let run = |run: &[usize]| match run {
        [one] => one.to_string(),
        [first, .., last] => format!("{first}..{}", last + 1),
        [] => String::new(),
    };
    numbers.chunk_by(|a, b| a + 1 == *b).map(run).collect::<Vec<_>>().join(",")
}

/// A range of chainage.
fn range(from_m: f64, to_m: f64) -> String {
    if to_m.is_finite() { format!("from {from_m} to {to_m} m") } else { format!("from {from_m} m on") }
}

impl Failure for RunError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Interrupted { .. } | Self::TrainingInterrupted { .. } => ErrorKind::Interrupted,
            Self::UnitsFailed { .. } => ErrorKind::UnitsFailed,
            Self::NotSettled { .. } => ErrorKind::Bug,
            Self::NoSuchPass { .. } | Self::NoSuchUnit { .. } => ErrorKind::Config,
            Self::NotOpened { .. }
            | Self::NotReduced { .. }
            | Self::UnitsMissing { .. }
            | Self::UnitRefused { .. }
            | Self::OtherSettings { .. } => ErrorKind::State,
            Self::NoSection { .. } | Self::EstimatedOverSection { .. } => ErrorKind::Config,
        }
    }

    /// Whether no unit of the pass can be stored any more.
    fn stops_all(&self) -> bool {
        matches!(self, Self::NotOpened { .. })
    }

    fn hint(&self) -> Option<Cow<'static, str>> {
        Some(match self {
            Self::Interrupted { .. } => "the same command resumes".into(),
            Self::TrainingInterrupted { .. } => "the same command starts from the beginning".into(),
            Self::NotSettled { .. } => "please report this with the command line and report.json".into(),
            Self::NoSection { .. } => "chainage info FILES prints the length of the axis".into(),
            Self::EstimatedOverSection { .. } => {
                "estimate it first with chainage estimate-epsilon FILES, and give the value".into()
            }
            Self::UnitsFailed { .. } => "the same command tries the failed units again".into(),
            Self::NoSuchPass { known, .. } => format!("its passes are: {}", known.join(", ")).into(),
            Self::NoSuchUnit { .. } => "chainage next OUT says which pass and which units are due".into(),
            Self::NotOpened { .. } => {
                "chainage next OUT says which pass is due, and chainage plan --units opens it".into()
            }
            Self::NotReduced { pass, .. } => {
                format!("chainage reduce OUT --after {pass} completes it").into()
            }
            Self::UnitsMissing { pass, missing, .. } => {
                format!("chainage work OUT --pass {pass} --units {} computes them", ranges(missing)).into()
            }
            Self::UnitRefused { pass, unit, .. } => {
                format!("chainage work OUT --pass {pass} --units {unit} computes it again").into()
            }
            Self::OtherSettings { .. } => {
                "leave settings out: a worker takes those of the run; chainage plan --units changes them"
                    .into()
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_units_are_named_in_ranges() {
        assert_eq!(ranges(&[0, 1, 4, 6, 7, 8]), "0..2,4,6..9");
        let error =
            RunError::UnitsMissing { pass: "ground".to_owned(), missing: vec![3, 4], units: 9, waited_s: 60 };
        assert_eq!(error.to_string(), "2 of 9 units of pass ground are missing after 60 s: 3..5");
    }
}

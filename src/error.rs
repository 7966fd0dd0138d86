//! The one error type of the library.
//!
//! Rules: a text is a lower-case fragment without a final stop that names the object (path, tile, key) and both
//! numbers; the cause is [`std::error::Error::source`] and is never repeated in the text; [`Error::hint`] is the
//! next command to type, or nothing. Every variant has an [`ErrorKind`], and the program maps every kind to an
//! exit code; neither step has a wildcard.

use std::borrow::Cow;

use crate::config::ConfigError;
use crate::cluster::dbscan::epsilon::EpsilonError;
use crate::eval::EvalError;
use crate::input::InputError;
use crate::output::OutputError;
use crate::spatial::SpatialError;
use crate::store::StoreError;
use crate::survey::SurveyError;
use crate::table::TableError;

/// What went wrong, with the object it went wrong with.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The settings cannot be used.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// An input file is missing, damaged or not acceptable.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The drive as a whole cannot be surveyed.
    #[error(transparent)]
    Survey(#[from] SurveyError),
    /// A result could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The run directory is locked, does not match, or is damaged.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A prediction and a reference cannot be compared.
    #[error(transparent)]
    Eval(#[from] EvalError),
    /// Epsilon cannot be estimated.
    #[error(transparent)]
    Epsilon(#[from] EpsilonError),
    /// Points of n dimensions cannot be clustered.
    #[error(transparent)]
    Space(#[from] SpatialError),
    /// A table cannot be read.
    #[error(transparent)]
    Table(#[from] TableError),
    /// The run was asked to stop; finished tiles are kept.
    #[error("interrupted with {done} of {total} units of pass {pass} done")]
    Interrupted {
        /// Name of the pass that was under way.
        pass: String,
        /// Units of it that are kept.
        done: usize,
        /// Units of it in all.
        total: usize,
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
    /// A method cannot process the points of a tile.
    #[error(transparent)]
    Algorithm(#[from] AlgorithmError),
    /// A promise of our own did not hold.
    #[error("internal error: {0}")]
    Bug(String),
}

/// Result with the library's [`enum@Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// The kinds of failure that a caller can tell apart; the program gives each an exit code.
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
    /// Some units failed, the rest was finished.
    UnitsFailed,
    /// Two things that should be the same are not.
    Difference,
    /// Stopped on request.
    Interrupted,
}

impl Error {
    /// The kind of failure, for exit codes.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::Config(_) => ErrorKind::Config,
            Self::Input(_) | Self::Survey(_) => ErrorKind::Input,
            Self::Output(_) => ErrorKind::Output,
            Self::Store(error) => error.kind(),
            Self::Eval(error) => error.kind(),
            Self::Algorithm(_) | Self::Epsilon(_) | Self::Space(_) | Self::Table(_) => ErrorKind::Input,
            Self::Interrupted { .. } => ErrorKind::Interrupted,
            Self::UnitsFailed { .. } => ErrorKind::UnitsFailed,
            Self::Bug(_) => ErrorKind::Bug,
        }
    }

    /// The next thing to type or do, where there is one.
    #[must_use]
    pub fn hint(&self) -> Option<Cow<'static, str>> {
        match self {
            Self::Config(error) => error.hint(),
            Self::Input(error) => error.hint(),
            Self::Survey(error) => error.hint(),
            Self::Output(error) => error.hint(),
            Self::Store(error) => error.hint(),
            Self::Eval(error) => error.hint(),
            Self::Epsilon(error) => error.hint(),
            Self::Space(error) => error.hint(),
            Self::Table(error) => error.hint(),
            Self::Algorithm(error) => error.hint(),
            Self::Interrupted { .. } => Some("the same command resumes".into()),
            Self::UnitsFailed { .. } => Some("the same command tries the failed units again".into()),
            Self::Bug(_) => Some("please report this with the command line and report.json".into()),
        }
    }
}

impl AlgorithmError {
    /// What to do next.
    #[must_use]
    pub fn hint(&self) -> Option<Cow<'static, str>> {
        match self {
            Self::ReachBeyondTile { .. } => Some(
                "give x and y larger weights, or a smaller epsilon; or longer tiles with --tile-length or --memory".into(),
            ),
            Self::TooManyCells { .. } | Self::TooManyPoints { .. } => None,
        }
    }
}

/// A kernel (ground filter or clustering method) cannot process the points it was given.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AlgorithmError {
    /// The points extend over more cells than the method's index can hold.
    #[error(
        "{method}: the points span {cells} cells of {edge_units} lattice units along one axis, at most {limit} fit"
    )]
    TooManyCells {
        /// Name of the method.
        method: &'static str,
        /// Cells along the axis.
        cells: u64,
        /// Edge of a cell in lattice units.
        edge_units: u32,
        /// Cells that the index can hold.
        limit: u64,
    },
    /// Neighbours may lie further away than a tile is long: tiles would read each other over and over.
    #[error(
        "{method}: neighbours may be {reach_m:.1} m apart in the chosen fields, the longest tile has {longest_m:.1} m"
    )]
    ReachBeyondTile {
        /// Name of the method.
        method: &'static str,
        /// Reach in metres.
        reach_m: f64,
        /// Length of the longest tile in metres.
        longest_m: f64,
    },
    /// More points in one tile than its index can count.
    #[error("{method}: {points} points in one tile, at most {limit} can be counted", limit = u32::MAX)]
    TooManyPoints {
        /// Name of the method.
        method: &'static str,
        /// Points of the tile.
        points: u64,
    },
}

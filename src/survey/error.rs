//! Errors that concern a drive as a whole: its positions, its trajectory.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use crate::error::{ErrorKind, Failure};
use crate::table::TableError;
use crate::words::counted;

/// A drive that cannot be surveyed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SurveyError {
    /// The trajectory is not a table of numbers.
    #[error(transparent)]
    Table(#[from] TableError),
    /// The first line does not name the columns.
    #[error("the trajectory {path} has no column {column} in its first line ({found})", path = path.display())]
    Column {
        /// The file.
        path: PathBuf,
        /// The column that is missing.
        column: &'static str,
        /// The columns that it has.
        found: String,
    },
    /// Fewer than two positions.
    #[error("the trajectory {path} has too few positions: {positions}, at least 2 are needed", path = path.display())]
    TooShort {
        /// The file.
        path: PathBuf,
        /// Positions in it.
        positions: usize,
    },
    /// No scanner reaches from the trajectory to the points.
    #[error("the trajectory {path} is {kilometres:.0} km away from the points", path = path.display())]
    Elsewhere {
        /// The file.
        path: PathBuf,
        /// Distance between the boxes around both.
        kilometres: f64,
    },
    /// A record whose position is too far from the origin.
    #[error("record {record} of {path} has the coordinates {xyz:?}, too far from the origin for any position on earth", path = path.display())]
    Position {
        /// The file.
        path: PathBuf,
        /// The record, from 0.
        record: u64,
        /// Its x, y and z as stored.
        xyz: [i32; 3],
    },
    /// Heights that differ by more than those of any landscape.
    #[error(
        "heights range from {lowest_m:.0} m to {highest_m:.0} m; the largest range that can be processed is {limit_m:.0} m"
    )]
    Heights {
        /// Lowest height in metres.
        lowest_m: f64,
        /// Highest height in metres.
        highest_m: f64,
        /// Largest range of heights in metres.
        limit_m: f64,
    },
    /// Files whose points are all withheld.
    #[error("all {} are withheld: the flag of LAS for points that are not to be processed", counted(*points, "point"))]
    Withheld {
        /// Number of points.
        points: u64,
    },
    /// Files without a single point.
    #[error("there are no points in {}", one_or_counted(file.as_deref(), *files))]
    Empty {
        /// Number of files.
        files: usize,
        /// The file, if it is the only one.
        file: Option<PathBuf>,
    },
}

/// The file, or the number of files.
fn one_or_counted(file: Option<&Path>, files: usize) -> String {
    file.map_or_else(|| counted(files as u64, "file"), |file| file.display().to_string())
}

impl Failure for SurveyError {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Input
    }

    fn concerns_input(&self) -> bool {
        true
    }

    fn hint(&self) -> Option<Cow<'static, str>> {
        match self {
            Self::Table(error @ TableError::Read { .. }) => error.hint(),
            Self::Column { .. } | Self::Table(_) => {
                Some("a trajectory is a CSV file whose first line is gps_time,x,y,z".into())
            }
            Self::Position { .. } => Some(
                "these are the integers of the record: if all records are like it, scale or offset in the header are wrong; otherwise remove it"
                    .into(),
            ),
            Self::Heights { .. } => Some("remove records that are not positions".into()),
            Self::Elsewhere { .. } => {
                Some("the trajectory must be of this drive, in the coordinate system and the unit of the points".into())
            }
            Self::Empty { .. } => Some("chainage info FILES... shows how many points each file has".into()),
            Self::Withheld { .. } => {
                Some("clear the flag in the files first if these points are to be processed".into())
            }
            Self::TooShort { .. } => None,
        }
    }
}

//! Why points cannot be clustered.

use std::borrow::Cow;

use crate::error::{ErrorKind, Failure};
use crate::spatial::dimensions::LARGEST;
use crate::words::counted;

/// Points that a method cannot cluster.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SpatialError {
    /// Too few or too many columns.
    #[error("points have {}; only {} to {} can be clustered", counted(*dimensions as u64, "dimension"), super::DIMENSIONS.start(), super::DIMENSIONS.end())]
    Dimensions {
        /// Dimensions of the points.
        dimensions: usize,
    },
    /// More points than an index can count.
    #[error("there are {points} points, the limit is {}", u32::MAX)]
    TooManyPoints {
        /// Number of points.
        points: usize,
    },
    /// A number that is too large to be squared, or not a number.
    #[error("point {point} has the value {value:e}; numbers above {:e} cannot be clustered", LARGEST)]
    TooLarge {
        /// The point, from 1.
        point: usize,
        /// The number.
        value: f64,
    },
    /// A dimension without spread cannot be standardised.
    #[error("dimension {dimension} has the same value in every row: it cannot be standardised")]
    NoSpread {
        /// The dimension, from 1.
        dimension: usize,
    },
    /// The cut-off distance of `p-linkage` would be 0.
    #[error(
        "more than half of the {points} points are repeated: the cut-off distance of p-linkage would be 0"
    )]
    NoCutoff {
        /// Number of points.
        points: usize,
    },
}

impl Failure for SpatialError {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Input
    }

    fn hint(&self) -> Option<Cow<'static, str>> {
        match self {
            Self::Dimensions { .. } => Some("choose columns with --columns".into()),
            Self::NoSpread { .. } => Some("leave it out with --columns".into()),
            Self::NoCutoff { .. } => Some("remove repeated rows, or cluster with --method dbscan".into()),
            Self::TooLarge { .. } => {
                Some("leave the column out with --columns, or divide it by a number".into())
            }
            Self::TooManyPoints { .. } => None,
        }
    }
}

//! What keeps points from being clustered.

use std::borrow::Cow;

use crate::error::{ErrorKind, Failure};

/// Points that a method cannot cluster.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SpatialError {
    /// Too few or too many columns.
    #[error("points of {dimensions} dimensions cannot be clustered, only of {} to {}", super::DIMENSIONS.start(), super::DIMENSIONS.end())]
    Dimensions {
        /// Dimensions of the points.
        dimensions: usize,
    },
    /// More points than an index counts.
    #[error("{points} points cannot be indexed, at most {} can", u32::MAX)]
    TooManyPoints {
        /// Points there are.
        points: usize,
    },
    /// A dimension without spread cannot be standardised.
    #[error("dimension {dimension} has the same value in every row: it cannot be standardised")]
    NoSpread {
        /// The dimension, from 1.
        dimension: usize,
    },
    /// The cut-off distance of `p-linkage` is 0.
    #[error(
        "more than half of the {points} points have an equal point: the cut-off distance of p-linkage would be 0"
    )]
    NoCutoff {
        /// Points there are.
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
            Self::TooManyPoints { .. } => None,
        }
    }
}

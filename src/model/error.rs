//! Errors of a kernel (ground filter or clustering method) that cannot process its points.

use std::borrow::Cow;

use crate::error::{ErrorKind, Failure};

/// A kernel (ground filter or clustering method) cannot process the points it was given.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AlgorithmError {
    /// The points extend over more cells than the method's index can hold.
    #[error(
        "{method}: the points span {cells} cells of {edge_units} lattice units along one axis, the limit is {limit}"
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
    /// Neighbours may be further away than a tile is long: tiles would read each other over and over.
    #[error(
        "{method}: neighbours may be {reach_m:.1} m apart in the chosen fields, the longest tile is {longest_m:.1} m long"
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
    #[error("{method}: a tile has {points} points, the limit is {limit}", limit = u32::MAX)]
    TooManyPoints {
        /// Name of the method.
        method: &'static str,
        /// Points of the tile.
        points: u64,
    },
}

impl Failure for AlgorithmError {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Input
    }

    fn hint(&self) -> Option<Cow<'static, str>> {
        match self {
            Self::ReachBeyondTile { .. } => Some(
                "give x and y larger weights, or a smaller epsilon; or longer tiles with --tile-length or --memory".into(),
            ),
            Self::TooManyCells { .. } | Self::TooManyPoints { .. } => None,
        }
    }
}

//! Limits of points: their number of dimensions, and the size of their numbers.

use std::ops::RangeInclusive;

/// Numbers of dimensions that can be clustered. The code is compiled for each of them.
pub const DIMENSIONS: RangeInclusive<usize> = 2..=8;

/// Largest number of a point. The squares of distances must be finite numbers.
pub(super) const LARGEST: f64 = 1e150;

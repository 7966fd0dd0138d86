//! How many dimensions points may have, and how large their numbers may be.

use std::ops::RangeInclusive;

/// Dimensions that can be clustered; every one of them is compiled.
pub const DIMENSIONS: RangeInclusive<usize> = 2..=8;

/// Largest number of a point. The squares of distances must be finite numbers.
pub(super) const LARGEST: f64 = 1e150;

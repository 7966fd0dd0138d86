//! How many dimensions points may have.

use std::ops::RangeInclusive;

/// Dimensions that can be clustered; every one of them is compiled.
pub const DIMENSIONS: RangeInclusive<usize> = 2..=8;

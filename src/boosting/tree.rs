//! A tree as the list of its splits, in the order of its growth.

use serde::{Deserialize, Serialize};

/// Largest number of leaves of a tree: the number of a leaf has five bits.
pub(super) const MOST_LEAVES: usize = 32;

/// A split of a leaf. Rows with a value above the threshold go to a new leaf, and the others stay. The new
/// leaf of split number n has number n + 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Split {
    /// The leaf.
    pub(super) leaf: u8,
    /// Number of the threshold among the thresholds of its feature.
    pub(super) threshold: u8,
    /// The feature.
    pub(super) feature: u16,
}

/// A tree. It starts with one leaf, number 0.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Tree {
    pub(super) splits: Vec<Split>,
    /// The value that each leaf adds to the score of the class, see [`UNITS`](super::exponential::UNITS).
    pub(super) values: Vec<i32>,
}

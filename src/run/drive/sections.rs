//! Sections of the payload of a unit of the pass `ground`.

/// Counts and heights.
pub(crate) const SUMMARY: usize = 0;
/// The blocks that the tile owns records of.
pub(crate) const BLOCKS: usize = 1;
/// Which records of each block these are.
pub(crate) const RUNS: usize = 2;
/// Class code of each record, in order.
pub(crate) const CLASSES: usize = 3;

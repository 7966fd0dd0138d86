//! Sections of the payload of a unit of the pass `ground`.

/// Counts and heights.
pub(crate) const SUMMARY: usize = 0;
/// The blocks with records that the tile owns.
pub(crate) const BLOCKS: usize = 1;
/// The owned records of each of these blocks.
pub(crate) const RUNS: usize = 2;
/// Class code of each record, in order.
pub(crate) const CLASSES: usize = 3;

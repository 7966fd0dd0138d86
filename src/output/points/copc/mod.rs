//! The cloud-optimised point cloud of a drive: octree, records, file.

mod file;
mod octree;
mod record;
mod squares;
mod totals;

pub(crate) use file::{Compression, CopcSchema, WorldCube};
pub(crate) use octree::{Cube, LEAF_POINTS, NodeKey, Spot, leaf_levels, levels, rank, undecided_levels};
pub(crate) use record::CopcFormat;
pub(crate) use squares::Squares;
pub(crate) use totals::Totals;

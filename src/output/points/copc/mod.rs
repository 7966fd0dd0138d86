//! The cloud-optimised point cloud of a drive: octree, records, file.

mod file;
mod octree;
mod record;
mod totals;

pub(crate) use file::{Compression, CopcSchema, WorldCube};
pub(crate) use octree::{Cube, LEAF_POINTS, NodeKey, Spot, levels, rank, undecided_levels};
pub(crate) use record::CopcFormat;
pub(crate) use totals::Totals;

//! The nouns every other module shares: frames and units, point classes, reach, the points of one tile.

mod class;
mod cloud;
mod disjoint;
mod frame;
mod hull;
mod linker;
mod object;
mod reach;
mod voxels;

pub use class::PointClass;
pub use cloud::{TileCloud, VoxelGrid};
pub use disjoint::DisjointSets;
pub use frame::{AxisTransform, Lattice, LatticeTransform};
pub use linker::Linker;
pub use object::ObjectPart;
pub use reach::Reach;
pub use voxels::{TileView, VoxelIndex};

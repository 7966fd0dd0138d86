//! What is near what: cells of the plane, voxels, nearest neighbours, and disjoint sets.

mod all_nearest;
mod cells;
mod disjoint;
mod error;
mod linker;
mod nearest;
mod neighbours;
mod packed;
mod points;
mod voxels;
mod zone;

pub(crate) use all_nearest::Neighbours;
pub use cells::{Cell, CellCounter, CellCursor, CellGrid, CellMap};
pub use disjoint::DisjointSets;
pub use error::SpatialError;
pub use linker::Linker;
pub use nearest::NearestIndex;
pub(crate) use neighbours::Index;
pub use packed::{PackedCells, PackedCursor};
pub use points::{DIMENSIONS, Points};
pub use voxels::{TileView, VoxelIndex};
pub use zone::{Area, BlockZone};

//! What is near what: cells of the plane, voxels, nearest neighbours, and sets of what is joined. Knows points and
//! lengths; no files and no methods.

mod all_nearest;
mod cells;
mod dimensions;
mod disjoint;
mod error;
mod linker;
mod looked_at;
mod nearest;
mod neighbours;
mod packed;
mod points;
mod voxels;
mod zone;

pub(crate) use all_nearest::Neighbours;
pub use cells::{Cell, CellCounter, CellCursor, CellGrid, CellMap};
pub use dimensions::DIMENSIONS;
pub use disjoint::DisjointSets;
pub use error::SpatialError;
pub use linker::Linker;
pub(crate) use looked_at::LookedAt;
pub use nearest::NearestIndex;
pub(crate) use neighbours::Index;
pub use packed::{PackedCells, PackedCursor};
pub use points::Points;
pub use voxels::{TileView, VoxelIndex};
pub use zone::{Area, BlockZone};

//! What is near what: cells of the plane, voxels, nearest neighbours, and disjoint sets.
//!
//! ```
//! use chainage::model::{Lattice, TileCloud};
//! use chainage::spatial::VoxelIndex;
//!
//! // Voxels of 0.3 m: two points share one, and the third is in the voxel above it.
//! let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, &[[0, 0, 0], [100, 0, 100], [0, 0, 400]]);
//! let voxels = VoxelIndex::build("example", &cloud, 300)?;
//! assert_eq!(voxels.counts(), [2, 1]);
//! assert_eq!(voxels.columns().len(), 1);
//! # Ok::<(), chainage::model::AlgorithmError>(())
//! ```

mod all_nearest;
mod cells;
mod dimensions;
mod disjoint;
mod error;
mod k_nearest;
mod linker;
mod looked_at;
mod nearest;
mod neighbours;
mod packed;
mod points;
mod ranks;
mod vectors;
mod voxels;
mod zone;

pub(crate) use all_nearest::Neighbours;
pub(crate) use cells::LARGEST_EXTENT;
pub use cells::{Cell, CellCounter, CellCursor, CellGrid, CellMap};
pub use dimensions::DIMENSIONS;
pub use disjoint::DisjointSets;
pub use error::SpatialError;
pub(crate) use k_nearest::{KNearest, LARGEST_REACH, NO_POINT};
pub use linker::Linker;
pub(crate) use looked_at::LookedAt;
pub use nearest::NearestIndex;
pub(crate) use neighbours::Index;
pub use packed::{PackedCells, PackedCursor};
pub use points::Points;
pub(crate) use ranks::{ROW, fill_up, median, threshold};
pub(crate) use vectors::{Block, Boxes, Columns, Look, Loops, Work, run};
pub use voxels::{TileView, VoxelIndex};
pub use zone::{Area, BlockZone};

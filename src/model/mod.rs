//! The nouns every other module shares: frames and units, cells and zones, point classes, reach, the points of one
//! tile and the voxels they are looked at through.

mod cells;
mod chart;
mod class;
mod cloud;
mod disjoint;
mod field;
mod frame;
mod hull;
mod linker;
mod nearest;
mod object;
mod packed;
mod reach;
mod records;
mod voxels;
mod zone;

pub use cells::{Cell, CellCounter, CellCursor, CellGrid, CellMap};
pub use chart::{Chart, ChartAxis, Series};
pub use class::PointClass;
pub use cloud::{TileCloud, VoxelGrid};
pub use disjoint::DisjointSets;
pub use field::{Field, FieldAxis, FieldSpace, FieldSums};
pub use frame::{AxisTransform, Lattice, LatticeTransform};
pub use linker::Linker;
pub use nearest::NearestIndex;
pub use object::ObjectPart;
pub use packed::{PackedCells, PackedCursor};
pub use reach::Reach;
pub use records::{RecordView, record_xyz};
pub use voxels::{TileView, VoxelIndex};
pub use zone::{Area, BlockZone};

//! The nouns every other module shares: frames and units, point classes, reach, the points of one tile.

mod cells;
mod class;
mod cloud;
mod frame;
mod nearest;
mod reach;
mod records;
mod zone;

pub use cells::{Cell, CellCounter, CellCursor, CellGrid, CellMap};
pub use class::PointClass;
pub use cloud::{TileCloud, VoxelGrid};
pub use frame::{AxisTransform, Lattice, LatticeTransform};
pub use nearest::NearestIndex;
pub use reach::Reach;
pub use records::{RecordView, record_xyz};
pub use zone::{Area, BlockZone};

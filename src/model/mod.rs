//! The nouns every other module shares: frames and units, point classes, reach, the points of one tile.

mod class;
mod cloud;
mod frame;
mod reach;

pub use class::PointClass;
pub use cloud::{TileCloud, VoxelGrid};
pub use frame::{AxisTransform, Lattice, LatticeTransform};
pub use reach::Reach;

//! The nouns that all modules share: frames and units, point classes, reach, the points of one tile, the
//! records of a file, the parts of an object.

mod chart;
mod class;
mod cloud;
mod error;
mod field;
mod frame;
mod hull;
mod object;
mod reach;
mod records;

pub use chart::{Chart, ChartAxis, Series};
pub use class::PointClass;
pub use cloud::{TileCloud, VoxelGrid};
pub use error::AlgorithmError;
pub use field::{Field, FieldAxis, FieldSpace, FieldSums};
pub use frame::{AxisTransform, Lattice, LatticeTransform};
pub use object::ObjectPart;
pub use reach::Reach;
pub use records::{RecordView, record_xyz};

//! The nouns that every other module shares: frames and units, point classes, reach, the points of one tile, the
//! records of a file, the parts of an object, the columns of the table of objects.

mod chart;
mod class;
mod cloud;
mod column;
mod error;
mod field;
mod field_space;
mod frame;
mod hull;
mod ids;
mod object;
mod reach;
mod records;

pub use chart::{Chart, ChartAxis, Series};
pub use class::PointClass;
pub use cloud::{TileCloud, VoxelGrid};
pub use column::{Column, ColumnType, ColumnUnit, Value};
pub use error::AlgorithmError;
pub use field::{Field, FieldSums};
pub use field_space::{FieldAxis, FieldSpace};
pub use frame::{AxisTransform, Lattice, LatticeTransform};
pub use ids::{FileId, TileId};
pub use object::ObjectPart;
pub use reach::Reach;
pub use records::{RecordView, record_xyz};

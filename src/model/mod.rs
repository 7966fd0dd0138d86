//! The nouns that all modules share: frames and units, point classes, reach, the points of one tile, the
//! records of a file, the parts of an object, the columns of the table of objects.
//!
//! ```
//! use chainage::model::{FileId, Lattice, ObjectPart, TileCloud};
//!
//! // A triangle of 4 m by 3 m, in two parts: merged in any order, they make the same object.
//! let points = [[0, 0, 0], [4_000, 0, 500], [0, 3_000, 1_000]];
//! let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, &points);
//! let part = |core: &dyn Fn(usize) -> bool| {
//!     ObjectPart::collect(&cloud, &[1, 1, 1], 1, core, |_| FileId::new(0)).remove(0)
//! };
//! let mut object = part(&|point| point == 2);
//! object.merge(&part(&|point| point != 2));
//! assert_eq!(object.points, 3);
//! assert_eq!(object.hi, [4_000, 3_000, 1_000]);
//! assert_eq!(object.hull, [[0, 0], [4_000, 0], [0, 3_000]]);
//! ```

mod chance;
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
mod kind;
mod object;
mod plane;
mod reach;
mod records;

pub(crate) use chance::{Chance, GOLDEN_GAMMA, splitmix64};
pub use chart::{Chart, ChartAxis, Series};
pub use class::PointClass;
pub use cloud::{TileCloud, VoxelGrid};
pub(crate) use column::rounded;
pub use column::{Column, ColumnType, ColumnUnit, Value};
pub use error::AlgorithmError;
pub use field::{Field, FieldSums};
pub use field_space::{FieldAxis, FieldSpace};
pub use frame::{AxisTransform, Lattice, LatticeTransform};
pub(crate) use hull::convex_hull;
pub(crate) use ids::in_u32;
pub use ids::{FileId, PointId, TileId};
pub use kind::{Hedge, Kind};
pub use object::ObjectPart;
pub use plane::Plane;
pub use reach::Reach;
pub use records::{FlagPlace, RecordView, record_xyz};

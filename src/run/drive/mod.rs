//! The drive as passes see it: files and blocks, values per point, the results of the survey, and the points
//! of tiles.

mod axis;
mod border;
mod fields;
mod groups;
pub(crate) mod identity;
mod opened;
mod overview;
mod per_point;
mod quantiles;
mod scattered;
pub(crate) mod section;
pub(crate) mod sections;
mod strays;
mod tiles;
mod verdicts;
mod warnings;

pub use axis::AxisFacts;
pub(crate) use border::Border;
pub(crate) use fields::{StoredFields, stored_fields};
pub(crate) use groups::Groups;
pub(crate) use opened::{BlockRun, Drive, Positions, Unpacked};
pub(crate) use overview::Surveyed;
pub(crate) use per_point::PerPoint;
pub(crate) use quantiles::Rows;
pub(crate) use scattered::{RECORD_BITS, STRIDE, Scattered, ScatteredUnit, WITHHELD};
pub(crate) use section::Section;
pub(crate) use tiles::{Classified, Tiled};
pub(crate) use verdicts::{OwnedBlock, TileVerdicts, is_object, lengths, scatter};

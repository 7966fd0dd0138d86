//! Input: a drive as a catalog of LAS/LAZ files, and the records of any block of them.
//!
//! Nothing that a file says is believed before it is checked against the size of the file; types of `las`, `laz`
//! and `memmap2` stay inside.

mod catalog;
mod chunks;
mod crs;
pub(crate) mod decode;
mod error;
mod file;
mod geokeys;
pub(crate) mod header;
pub(crate) mod layout;
pub(crate) mod mapped;
mod options;
pub(crate) mod vlr;
mod wkt;

pub use crate::config::LengthUnit;
pub use crate::model::record_xyz;
pub use catalog::Catalog;
pub use chunks::Block;
pub use crs::{Crs, CrsKind};
pub use error::{ChunkProblem, ChunkTableProblem, InputError};
pub use file::InputFile;
pub use layout::{ExtraDimension, RecordLayout};
pub use options::InputOptions;

/// The fields of a record that a caller will look at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Fields {
    /// Every byte is as written.
    All,
    /// Only x, y, z and the GPS time are as written; the other bytes are unspecified, because layered compression
    /// (point formats 6 to 10) lets a decoder skip them, which is faster.
    Geometry,
}

//! Input: a drive as a catalog of LAS/LAZ files, and the records of each block.
//!
//! Nothing in a file is trusted before it is checked against the size of the file. Types of `las`, `laz` and
//! `memmap2` are not visible outside.

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
pub(crate) mod vlr;
mod wkt;

pub use crate::model::record_xyz;
pub use catalog::{Catalog, InputOptions};
pub use chunks::Block;
pub use crs::{Crs, CrsKind, LengthUnit};
pub use error::{ChunkProblem, ChunkTableProblem, InputError};
pub use file::InputFile;
pub use layout::{ExtraDimension, RecordLayout};

/// The fields of a record that a caller needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Fields {
    /// Every byte is as written.
    All,
    /// Only x, y, z and the GPS time are as written. The other bytes are undefined: layered compression
    /// (point formats 6 to 10) lets a decoder skip them, which is faster.
    Geometry,
}

//! Input: a drive as a catalog of LAS/LAZ files, and the records of each block.
//!
//! Nothing in a file is trusted before it is checked against the size of the file. Types of `las`, `laz` and
//! `memmap2` are not visible outside.
//!
//! ```
//! use chainage::input::{Catalog, Fields, InputOptions};
//!
//! let catalog = Catalog::open(&["tests/data/mls_profiles.las".into()], &InputOptions::default())?;
//! assert_eq!(catalog.point_count(), 10_310);
//!
//! // The first point of the first block, on the lattice of the drive.
//! let file = &catalog.files()[0];
//! let mut buffer = Vec::new();
//! let bytes = file.records(0, Fields::Geometry, &mut buffer)?;
//! let record = chainage::input::record_xyz(bytes);
//! let [x, _, _] = file.transform().apply(record);
//! assert_eq!(x % 1_000, catalog.lattice().units(catalog.lattice().metres(x)) % 1_000);
//! # Ok::<(), chainage::input::InputError>(())
//! ```

mod boxes;
mod catalog;
mod chunks;
pub(crate) mod copc;
mod crs;
mod crs_claim;
mod crs_records;
mod crs_text;
pub(crate) mod decode;
mod epsg_units;
mod error;
mod file;
mod geokeys;
pub(crate) mod header;
pub(crate) mod layout;
pub(crate) mod mapped;
mod names;
mod options;
mod problem;
mod projection;
mod twins;
mod uncounted;
mod unit;
pub(crate) mod vlr;
mod wkt;

pub use crate::config::LengthUnit;
pub use crate::model::record_xyz;
pub(crate) use catalog::CLOUD_NAME;
pub use catalog::Catalog;
pub use chunks::Block;
pub use crs::Crs;
pub use crs_claim::CrsKind;
pub use error::{ChunkProblem, ChunkTableProblem, CopcProblem, InputError};
pub use file::InputFile;
pub use layout::{ExtraDimension, FieldPlace, RecordLayout};
pub use options::InputOptions;
pub use unit::{unit_in_words, unit_symbol};

/// The fields of a record that a caller needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Fields {
    /// Every byte is as written.
    All,
    /// Only x, y, z, the flags and the GPS time are as written. The other bytes are undefined: layered
    /// compression (point formats 6 to 10) lets a decoder skip them, which is faster.
    Geometry,
}

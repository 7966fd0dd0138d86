//! Output: labelled copies of the input files, the object table, the report.

mod error;
mod objects;

pub use error::OutputError;
pub use objects::{ObjectRow, write_csv, write_geojson};

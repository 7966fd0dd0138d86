//! Output: labelled copies of the input files, the object table, the report.

mod error;
pub(crate) mod laz_chunk;
pub(crate) mod new_file;

pub use error::OutputError;

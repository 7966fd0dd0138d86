//! Output: labelled copies of the input files, the object table, the report.

mod error;

pub use error::OutputError;

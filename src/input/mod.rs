//! Input: a drive as a catalog of LAS/LAZ files, and the records of any block of them.

mod error;

pub use error::InputError;

//! The run directory: lock, fingerprints, tile files, atomic writes, resume.

mod error;

pub use error::StoreError;

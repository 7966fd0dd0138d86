//! The run directory: lock, fingerprints, unit files, columns, atomic writes. Knows bytes and names; nothing of points.

mod column;
mod error;
mod fingerprint;
mod run_dir;
mod unit_file;

pub(crate) use column::Column;
pub use error::StoreError;
pub use fingerprint::{Fingerprint, Inputs, StaleReason};
pub(crate) use run_dir::UnitReader;
pub use run_dir::{PassDir, RunDir, STATE_FOLDER, UnitState};
pub use unit_file::{FORMAT_VERSION, Refusal};

//! The run directory: lock, fingerprints, unit files, columns, atomic writes. This module knows bytes and
//! names, but no points.
//!
//! ```
//! use chainage::store::Inputs;
//!
//! let old = Inputs::new().with("euclidean.max_gap_m", 0.3);
//! let new = Inputs::new().with("euclidean.max_gap_m", 0.4);
//! assert_ne!(old.fingerprint(), new.fingerprint());
//! let reasons = new.differences(&old);
//! assert_eq!(reasons[0].to_string(), "euclidean.max_gap_m: 0.3 -> 0.4");
//! ```

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

//! The run directory: lock, fingerprints, unit files, atomic writes. This module knows bytes and
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

mod error;
mod fingerprint;
mod lock;
mod pass_dir;
mod run_dir;
mod unit_file;
mod wait;

pub use error::StoreError;
pub use fingerprint::{Fingerprint, Inputs, StaleReason};
pub(crate) use pass_dir::UnitReader;
pub use pass_dir::{PassDir, UnitState};
pub use run_dir::{RunDir, STATE_FOLDER};
pub use unit_file::{FORMAT_VERSION, Refusal};

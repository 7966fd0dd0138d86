//! `chainage` divides mobile laser scanning data into ground and objects.
//!
//! A drive is a set of LAS or LAZ files. The result is a copy of each file with three more facts per point
//! (whether it is ground, the id of its object, and what the object is), and a table of the objects. Drives
//! can be longer than memory, runs can be interrupted and resumed, and the division into tiles does not
//! change the result.
//!
//! ```
//! use chainage::config::Config;
//! use chainage::run::{CancelToken, Registries, RunRequest, Silent, run};
//!
//! let out = tempfile::tempdir()?;
//! let request = RunRequest {
//!     inputs: vec!["tests/data/tree_road_sweep.laz".into()],
//!     out: out.path().to_owned(),
//!     config: Config::resolve(None, &["street.min_points=10".to_owned()])?,
//!     fresh: false,
//!     registries: Registries::default(),
//! };
//! let summary = run(&request, &Silent, &CancelToken::default())?;
//! assert_eq!(summary.points, 71_841);
//! assert!(summary.objects > 10);
//!
//! let table = std::fs::read_to_string(out.path().join("objects.csv"))?;
//! assert_eq!(table.lines().count(), 1 + summary.objects);
//! assert!(out.path().join("tree_road_sweep.laz").is_file());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`run`] does the work of the program's main command. To write a method of your own, implement
//! [`ground::GroundFilter`] or one of the traits of [`cluster`], and name it in [`run::Registries`].
//!
//! The modules are listed in the order of the data flow.

pub mod error;
pub mod model;
pub mod spatial;
pub mod words;

mod codec;
mod host;
pub mod scratch_folder;
mod spill;
mod whole_file;

pub mod boosting;

pub mod config;

pub mod input;

pub mod survey;

pub mod tiling;

pub mod ground;

pub mod cluster;

pub mod stitch;

pub mod inventory;

pub mod output;

pub mod eval;

pub mod table;

pub mod store;

pub mod run;

pub mod synth;

pub use error::{Error, ErrorKind, Failure, Result};

#[cfg(test)]
#[path = "../tests/util/numbers.rs"]
mod numbers;

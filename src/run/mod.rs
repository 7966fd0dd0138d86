//! Runs a drive. This module joins all modules above: `open -> catalog -> survey -> plan -> passes over tiles
//! -> stitch -> relabel -> inventory -> export`. The state is on disk after every unit. Read `flow.rs` first.
//!
//! ```
//! use chainage::config::Config;
//! use chainage::run::{CancelToken, Registries, RunRequest, Silent, run};
//!
//! let out = std::env::temp_dir().join(format!("chainage-example-{}", std::process::id()));
//! let request = RunRequest {
//!     inputs: vec!["tests/data/mls_profiles.las".into()],
//!     out: out.clone(),
//!     config: Config::resolve(None, &[])?,
//!     fresh: false,
//!     registries: Registries::default(),
//! };
//! let summary = run(&request, &Silent, &CancelToken::default())?;
//! std::fs::remove_dir_all(&out)?;
//! assert!(summary.objects > 0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod chain;
mod cloud;
mod drive;
mod engine;
mod error;
mod estimate;
mod finish;
mod flow;
mod foreign;
mod look;
mod open;
mod passes;
mod plan;
mod request;
mod shared;
mod summary;
mod train;

use std::path::Path;

use crate::config::RunConfig;
use crate::error::{Error, Result};
use crate::store::STATE_FOLDER;

use engine::{Driver, Here};
use finish::outputs::{self, Course};
use request::Begun;

pub use crate::cluster::street::StreetModel;
pub use chain::Registries;
pub use drive::AxisFacts;
pub use engine::{CancelToken, Event, Observer, PassFigures, Silent, Units};
pub use error::RunError;
pub use estimate::{EstimateRequest, estimate_epsilon};
pub use finish::names::is_output;
pub use look::{
    DriveFacts, FileFacts, PlanFacts, TileFacts, check_settings, codec_floor, copy_floor, files_of, look_at,
    plan_of,
};
pub use look::{PassStatus, RunStatus, status};
pub use request::RunRequest;
pub use shared::{DueUnits, Reduced, SharedRun, next, open_for_workers, reduce, work};
pub use summary::{Counts, RunSummary, SectionFacts};
pub use train::{
    TrainRequest, Trained, built_in_model, read_model, read_model_of_voxels, score_model, train,
    train_objects,
};

/// Processes a drive. The labelled copies, object table and report are in `request.out`. Resumes from stored
/// results.
///
/// # Errors
/// Any [`Error`]. Finished units are kept, and the next call uses them, unless the state itself is refused.
pub fn run(request: &RunRequest<'_>, observer: &dyn Observer, cancel: &CancelToken) -> Result<RunSummary> {
    let started = std::time::Instant::now();
    let Begun { run_dir, open, labelled, warnings } = Begun::from(request)?;
    let mut driver = Here::new(&run_dir, open.budget.limits(), open.config.run.fail_fast, observer, cancel);

    let surveyed = computed(flow::survey(&open, &mut driver, Some(&run_dir))?)?;
    for text in warnings.iter().chain(&surveyed.warnings) {
        driver.tell(&Event::Warning { text });
    }
    let planned = computed(flow::plan(&open, &mut driver, surveyed)?)?;
    let outcome = computed(flow::to_files(&open, &mut driver, &run_dir, &planned, labelled)?)?;
    let course = Course { started, warnings: driver.warnings.take(), passes: driver.figures };
    outputs::finish(&run_dir, &open, &planned, outcome, course, observer)
}

/// Whether a folder is the output directory of a run.
#[must_use]
pub fn holds_run(folder: &Path) -> bool {
    folder.join(STATE_FOLDER).is_dir()
}

/// The memory budget of a run in bytes: the given one, or half of the memory that is free now.
#[must_use]
pub fn memory_budget(config: &RunConfig) -> u64 {
    plan::Budget::resolve(config).memory
}

/// The result of a driver that computes every pass.
fn computed<T>(complete: Option<T>) -> Result<T> {
    complete.ok_or_else(|| Error::bug("a pass was not computed"))
}

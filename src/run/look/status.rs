//! What a run directory holds: which units are done, which are left, which are stale and why. Changes nothing: it walks the
//! flow with a driver that computes nothing.

use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::config::Config;
use crate::error::Result;
use crate::run::chain::Registries;
use crate::run::engine::{Nobody, PassState};
use crate::run::flow::{self, Outcome};
use crate::run::open::{self, Opened};
use crate::store::{RunDir, StaleReason};

/// The state of one pass.
#[derive(Debug, Clone, Serialize)]
pub struct PassStatus {
    /// Its name.
    pub pass: &'static str,
    /// Units in all; `None` where that is not known before an earlier pass is complete.
    pub units: Option<usize>,
    /// Units whose result is there and fits.
    pub done: usize,
    /// Units whose result is there but is damaged or depends on something that has changed.
    pub stale: usize,
    /// What has changed.
    pub why: Vec<StaleReason>,
}

/// The state of a run.
#[derive(Debug, Clone, Serialize)]
pub struct RunStatus {
    /// Output directory.
    pub out: PathBuf,
    /// Input files.
    pub inputs: Vec<PathBuf>,
    /// Passes in order.
    pub passes: Vec<PassStatus>,
    /// Whether all outputs are there and fit.
    pub finished: bool,
}

/// The state of the run in `out`, compared with its last configuration or with the settings that `resolve` makes of
/// the path of that configuration.
///
/// # Errors
/// When there is no run, or its input cannot be opened any more.
pub fn status(
    out: &Path,
    registries: &Registries<'_>,
    resolve: impl FnOnce(&Path) -> Result<Config>,
) -> Result<RunStatus> {
    let run_dir = RunDir::inspect(out)?;
    let (inputs, configuration) = open::recorded(&run_dir)?;
    let config = resolve(&configuration)?;
    let open = Opened::to_look(&inputs, &config, registries)?;
    let mut driver = Nobody::new(&run_dir);
    let outcome = walk(&open, &mut driver, &run_dir)?;
    let finished = outcome.is_some_and(|outcome| outcome.unmarked.is_none());
    let passes = driver.finish()?.into_iter().map(PassStatus::of).collect();
    Ok(RunStatus { out: out.to_owned(), inputs, passes, finished })
}

/// Walks as far as everything is there.
fn walk(open: &Opened<'_>, driver: &mut Nobody<'_>, run_dir: &RunDir) -> Result<Option<Outcome>> {
    let Some(surveyed) = flow::survey(open, driver, None)? else { return Ok(None) };
    let Some(planned) = flow::plan(open, driver, surveyed)? else { return Ok(None) };
    flow::to_files(open, driver, run_dir, &planned, Vec::new())
}

impl PassStatus {
    fn of(state: PassState) -> Self {
        let PassState { outline, units, done, stale, why } = state;
        Self { pass: outline.name, units, done, stale, why }
    }
}

//! Running: joins everything above. `open -> catalog -> survey -> plan -> passes over tiles -> stitch -> relabel ->
//! export`, with the state on disk after every unit.

mod budget;
mod cluster_pass;
mod clustered;
mod curve_pass;
mod drive;
mod engine;
mod error;
mod estimate;
mod export_pass;
mod fields_pass;
mod finish;
mod floor;
mod flow;
mod ground_pass;
mod held;
mod identity;
mod in_flight;
mod inputs;
mod look;
mod map;
mod methods;
mod observe;
mod prepare;
mod rows;
mod scatter_pass;
mod scene;
mod staged_pass;
mod status;
mod street;
mod survey_pass;
mod tiles;

use std::path::PathBuf;

use serde::Serialize;

use crate::config::Config;
use crate::error::Result;
use crate::store::RunDir;

use drive::Drive;
use flow::Flow;
use methods::Chain;

pub use engine::{CancelToken, PassFigures};
pub use error::RunError;
pub use estimate::{EstimateRequest, estimate_epsilon};
pub use finish::Counts;
pub use floor::{codec_floor, copy_floor, files_of};
pub use look::{DriveFacts, FileFacts, PlanFacts, TileFacts, look_at, plan_of};
pub use methods::Registries;
pub use observe::{Event, Observer, Silent};
pub use prepare::{Cost, DriveEpsilon};
pub use scene::AxisFacts;
pub use status::{PassStatus, RunStatus, status};

/// What to run.
#[derive(Debug, Clone)]
pub struct RunRequest<'a> {
    /// LAS/LAZ files, folders and patterns.
    pub inputs: Vec<PathBuf>,
    /// Output directory.
    pub out: PathBuf,
    /// Settings.
    pub config: Config,
    /// Discard the state of an earlier run in `out`.
    pub fresh: bool,
    /// Where methods are looked up.
    pub registries: Registries<'a>,
}

/// What a run came to.
#[derive(Debug, Clone, Serialize)]
pub struct RunSummary {
    /// Points of the drive.
    pub points: u64,
    /// Points by class.
    pub counts: Counts,
    /// Objects.
    pub objects: usize,
    /// Tiles.
    pub tiles: usize,
    /// Wall time of this call in seconds.
    pub seconds: f64,
    /// Whether everything had been there already.
    pub nothing_to_do: bool,
    /// Figures of the stages of the clustering method, where it has stages and they were reduced by this call.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stages: Option<serde_json::Value>,
    /// The epsilon that was estimated, with its curve, where the method asked for one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub epsilon: Option<DriveEpsilon>,
    /// Passes with their times.
    pub passes: Vec<PassFigures>,
    /// What the user should know.
    pub warnings: Vec<String>,
    /// Peak resident set in bytes, mapped pages included, where the system says.
    pub peak_resident_bytes: Option<u64>,
}

/// Processes a drive: labelled copies, object table and report in `request.out`; resumes what is there.
///
/// # Errors
/// Any [`Error`](crate::Error); what was finished before it is kept and used by the next call, unless the state itself is refused.
pub fn run(request: &RunRequest<'_>, observer: &dyn Observer, cancel: &CancelToken) -> Result<RunSummary> {
    let started = std::time::Instant::now();
    let config = &request.config;
    let catalog = look::open_catalog(&request.inputs, config)?;
    identity::check_apart(&catalog, &request.out)?;
    let run_dir = RunDir::open(&request.out, request.fresh)?;
    let chain = Chain::build(config, &request.registries, catalog.lattice())?;
    let (labelled, file_warnings) = finish::plan_files(&catalog, config, &run_dir)?;
    let mut warnings = catalog.warnings().to_vec();
    warnings.extend(file_warnings);
    identity::check_input(&run_dir, &catalog)?;
    status::record_request(&run_dir, &request.inputs, config)?;
    let drive = Drive::open(catalog, config, &run_dir)?;
    let mut flow = Flow::new(&run_dir, config, &drive, &chain, observer, cancel);
    let scene = flow.survey()?;
    warnings.extend(scene.warnings.iter().cloned());
    for text in &warnings {
        flow.engine.tell(&Event::Warning { text });
    }
    let plan = flow.plan(&scene)?;
    let outcome = flow.tiles_to_files(&scene, &plan, labelled)?;
    let summary = RunSummary {
        points: scene.survey.points(),
        counts: outcome.counts,
        objects: outcome.objects,
        tiles: plan.tiles.len(),
        seconds: started.elapsed().as_secs_f64(),
        nothing_to_do: outcome.unmarked.is_none(),
        stages: outcome.stages,
        epsilon: outcome.epsilon,
        passes: flow.passes,
        warnings,
        peak_resident_bytes: budget::peak_resident_bytes(),
    };
    if let Some((export, finished)) = outcome.unmarked {
        finish::write_report(&run_dir, &drive, config, &scene, &summary)?;
        finish::mark_finished(&run_dir, &export, &finished)?;
    }
    Ok(summary)
}

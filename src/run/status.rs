//! What a run directory holds: which units are done, which are left, which are stale and why. Changes nothing.

use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::cluster::Method;
use crate::config::Config;
use crate::error::Result;
use crate::run::drive::Drive;
use crate::run::engine::Pass;
use crate::run::look::open_catalog;
use crate::run::methods::{Chain, Registries};
use crate::run::scene::Scene;
use crate::run::street::Street;
use crate::run::survey_pass::SurveyPass;
use crate::run::{finish, inputs, prepare};
use crate::store::{PassDir, RunDir, StaleReason, UnitState};
use crate::tiling::TileSize;

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

const REQUEST: &str = "request.json";

/// Records the input paths and the configuration of a run, for [`status`].
pub(crate) fn record_request(run_dir: &RunDir, inputs: &[PathBuf], config: &Config) -> Result<()> {
    let paths: Vec<PathBuf> =
        inputs.iter().map(|path| fs_err::canonicalize(path).unwrap_or_else(|_| path.clone())).collect();
    run_dir.write_json(REQUEST, &paths)?;
    let text = format!(
        "# configuration of the last call, chainage {}\n{}",
        env!("CARGO_PKG_VERSION"),
        config.to_toml()
    );
    Ok(run_dir.write_text(CONFIGURATION, &text)?)
}

const CONFIGURATION: &str = "run.toml";

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
    let paths: Vec<PathBuf> = run_dir.read_json(REQUEST)?.unwrap_or_default();
    let config = resolve(&run_dir.path(CONFIGURATION))?;
    let drive = Drive::without_columns(open_catalog(&paths, &config)?, &config);
    let chain = Chain::build(&config, registries, drive.lattice())?;
    let mut status = RunStatus { out: out.to_owned(), inputs: paths, passes: Vec::new(), finished: false };

    let dir = run_dir.pass(inputs::SURVEY, inputs::survey(&drive, &config));
    let pass = SurveyPass { drive: &drive, runs: drive.block_runs() };
    let survey = pass_status("survey", &dir, Some(pass.units()))?;
    let complete = survey.units == Some(survey.done);
    status.passes.push(survey);
    let size: Option<TileSize> = run_dir.read_json("plan.json")?;
    if let (true, Some(size)) = (complete, size) {
        let length = config.tiling.tile_length;
        let size = if length > 0.0 { TileSize::Metres(length) } else { size };
        let scene = Scene::new(&drive, pass.reduce(&dir)?, &config)?;
        let plan = Street::of(&scene, &drive).plan(&size);
        let ground = inputs::ground(&scene, &plan, &config, &chain);
        let clusters = inputs::clusters(&ground, &config, &chain.method);
        let export = inputs::export(&clusters, &scene, &config, &chain.method);
        let tiles = Some(plan.tiles.len());
        status.passes.push(pass_status("ground", &run_dir.pass(inputs::GROUND, ground.clone()), tiles)?);
        if let Method::Prepared(method) = &chain.method {
            let needs = method.needs();
            if !needs.fields.is_empty() {
                let dir = run_dir.pass(inputs::FIELDS, inputs::fields(&scene, &needs.fields));
                status.passes.push(pass_status("fields", &dir, Some(pass.units()))?);
            }
            if needs.epsilon {
                let settings = prepare::epsilon_settings(&config)?;
                let first = usize::try_from(settings.k).unwrap_or(usize::MAX);
                let (folder, inputs) = inputs::epsilon(&ground, needs, &settings, first);
                status.passes.push(pass_status("epsilon", &run_dir.pass(&folder, inputs), tiles)?);
            }
        }
        let names: Vec<&'static str> = match &chain.method {
            Method::Local(_) | Method::Prepared(_) => vec!["cluster"],
            Method::Staged(method) => method.stages().iter().map(|stage| stage.name).collect(),
        };
        for (name, (folder, inputs)) in names.into_iter().zip(clusters) {
            status.passes.push(pass_status(name, &run_dir.pass(&folder, inputs), tiles)?);
        }
        let export = run_dir.pass(inputs::EXPORT, export);
        status.finished = finish::already_finished(&run_dir, &export)?.is_some();
        status.passes.push(pass_status("export", &export, None)?);
    }
    Ok(status)
}

fn pass_status(pass: &'static str, dir: &PassDir, units: Option<usize>) -> Result<PassStatus> {
    let (mut done, mut stale) = (0, 0);
    for unit in dir.stored_units()? {
        match dir.state(unit)? {
            UnitState::Done if units.is_none_or(|units| unit < units) => done += 1,
            UnitState::Done | UnitState::Missing => {}
            UnitState::Refused(_) => stale += 1,
        }
    }
    Ok(PassStatus { pass, units, done, stale, why: dir.stale_reasons()? })
}

//! Estimating epsilon over a drive without clustering it: survey, plan, ground, curve.

use std::path::PathBuf;

use crate::cluster::Method;
use crate::config::{Config, ConfigError};
use crate::error::Result;
use crate::run::drive::Drive;
use crate::run::engine::{CancelToken, PassFigures};
use crate::run::flow::Flow;
use crate::run::methods::{Chain, Registries};
use crate::run::observe::{Event, Observer};
use crate::run::prepare::DriveEpsilon;
use crate::run::{identity, look, status};
use crate::store::RunDir;

/// What epsilon is to be estimated over.
#[derive(Debug, Clone)]
pub struct EstimateRequest<'a> {
    /// LAS/LAZ files, folders and patterns.
    pub inputs: Vec<PathBuf>,
    /// Where the state goes: a run with the same settings in the same place goes on from it.
    pub out: PathBuf,
    /// Settings; the method is one that estimates epsilon.
    pub config: Config,
    /// Where methods are looked up.
    pub registries: Registries<'a>,
}

/// Estimates epsilon over the points of a drive that are neither ground nor noise. Resumes what is there.
///
/// # Errors
/// Any [`Error`](crate::Error); a [`ConfigError`] when the method does not estimate an epsilon.
pub fn estimate_epsilon(
    request: &EstimateRequest<'_>,
    observer: &dyn Observer,
    cancel: &CancelToken,
) -> Result<(DriveEpsilon, Vec<PassFigures>)> {
    let config = &request.config;
    let catalog = look::open_catalog(&request.inputs, config)?;
    identity::check_apart(&catalog, &request.out)?;
    let chain = Chain::build(config, &request.registries, catalog.lattice())?;
    if !matches!(&chain.method, Method::Prepared(method) if method.needs().epsilon) {
        let expected = "a method whose epsilon is \"auto\", as in dbscan";
        return Err(ConfigError::value("cluster.method", &config.cluster.method, expected).into());
    }
    let run_dir = RunDir::open(&request.out, false)?;
    identity::check_input(&run_dir, &catalog)?;
    status::record_request(&run_dir, &request.inputs, config)?;
    let warnings = catalog.warnings().to_vec();
    let drive = Drive::open(catalog, config, &run_dir)?;
    let mut flow = Flow::new(&run_dir, config, &drive, &chain, observer, cancel);
    let scene = flow.survey()?;
    for text in warnings.iter().chain(&scene.warnings) {
        flow.engine.tell(&Event::Warning { text });
    }
    let plan = flow.plan(&scene)?;
    let found = flow.estimate(&scene, &plan)?;
    let found = found.ok_or_else(|| crate::Error::bug("nothing was estimated".to_owned()))?;
    Ok((found, flow.passes))
}

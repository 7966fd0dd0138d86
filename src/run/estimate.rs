//! Estimates epsilon over a drive without clustering it: the flow stops after the step that estimates.

use std::path::PathBuf;

use crate::cluster::dbscan::epsilon::{DriveEpsilon, STEP};
use crate::config::{Config, ConfigError};
use crate::error::Result;
use crate::run::chain::{Chain, Registries};
use crate::run::engine::{CancelToken, Driver, Event, Here, Observer, PassFigures};
use crate::run::open::{self, Opened};
use crate::run::{computed, flow};

/// A request to estimate epsilon.
#[derive(Debug, Clone)]
pub struct EstimateRequest<'a> {
    /// LAS/LAZ files, folders and patterns.
    pub inputs: Vec<PathBuf>,
    /// Folder of the state. A run with the same settings in the same folder continues from it.
    pub out: PathBuf,
    /// Settings. The method must be one that estimates epsilon.
    pub config: Config,
    /// The registries of methods.
    pub registries: Registries<'a>,
}

/// Estimates epsilon over the points of a drive that are neither ground nor noise. Resumes from stored
/// results.
///
/// # Errors
/// Any [`Error`](crate::Error); a [`ConfigError`] when the method does not estimate an epsilon.
pub fn estimate_epsilon(
    request: &EstimateRequest<'_>,
    observer: &dyn Observer,
    cancel: &CancelToken,
) -> Result<(DriveEpsilon, Vec<PassFigures>)> {
    let config = &request.config;
    let catalog = open::catalog_beside(&request.inputs, config, Some(&request.out))?;
    let chain = Chain::build(config, &request.registries, catalog.lattice())?;
    let Some(step) = chain.method.steps().iter().position(|step| step.name == STEP) else {
        let expected = "a method whose epsilon is \"auto\", as in dbscan";
        return Err(ConfigError::value("cluster.method", &config.cluster.method, expected).into());
    };
    let run_dir = open::lock(&catalog, &request.out)?;
    run_dir.begin(false)?;
    let mut warnings = config.warnings().to_vec();
    warnings.extend(chain.warnings.iter().cloned());
    warnings.extend(catalog.warnings().iter().cloned());
    let open = Opened::to_run(catalog, chain, config, &run_dir)?;
    open.record(&run_dir, &request.inputs)?;
    let mut driver = Here::new(&run_dir, open.budget.limits(), config.run.fail_fast, observer, cancel);
    let surveyed = computed(flow::survey(&open, &mut driver, Some(&run_dir))?)?;
    for text in warnings.iter().chain(&surveyed.warnings) {
        driver.tell(&Event::Warning { text });
    }
    let planned = computed(flow::plan(&open, &mut driver, surveyed)?)?;
    let global = computed(flow::global_of_step(&open, &mut driver, &run_dir, &planned, step)?)?;
    Ok((DriveEpsilon::decode(&global)?, driver.figures))
}

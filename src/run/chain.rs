//! The chain of methods of a run (noise, ground filter, clustering), with their reach and the values that
//! they depend on.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::path::PathBuf;

use crate::cluster::{self, ClusterEntry, Method};
use crate::config::{self, Config, ConfigError};
use crate::error::Result;
use crate::ground::{self, GroundEntry, GroundFilter, IsolatedNoise, NoGround, NoiseConfig};
use crate::input::InputError;
use crate::model::Lattice;
use crate::run::finish::{effect, names};
use crate::store::Inputs;

/// The registries of methods. A test or another program may add methods.
#[derive(Debug, Clone, Copy)]
pub struct Registries<'a> {
    /// Ground filters.
    pub ground: &'a [GroundEntry],
    /// Clustering methods.
    pub cluster: &'a [ClusterEntry],
}

impl Default for Registries<'_> {
    fn default() -> Self {
        Self { ground: ground::REGISTRY, cluster: cluster::REGISTRY }
    }
}

/// The methods of a run.
#[derive(Debug)]
pub(crate) struct Chain {
    pub(crate) noise: Option<IsolatedNoise>,
    pub(crate) filter: Box<dyn GroundFilter>,
    pub(crate) method: Box<dyn Method>,
    /// Reach of noise and filter together, in lattice units.
    pub(crate) ground_reach: i64,
    /// Reach with which the plan allows for the clustering method, in lattice units.
    pub(crate) cluster_reach: i64,
    /// Warnings about settings and outputs that the methods of the chain do not use.
    pub(crate) warnings: Vec<String>,
}

impl Chain {
    /// Builds the methods that the configuration names, after a check of the output settings and of the
    /// settings of all methods. A value that is out of range is probably a mistake, also where this run does
    /// not use it.
    pub(crate) fn build(config: &Config, registries: &Registries<'_>, lattice: Lattice) -> Result<Self> {
        names::check_settings(config)?;
        for entry in registries.ground {
            (entry.build)(&config.method_table(entry.name))?;
        }
        for entry in registries.cluster {
            (entry.build)(&|section| config.method_table(section))?;
        }
        let noise_config: NoiseConfig = config::section("noise", &config.method_table("noise"))?;
        let noise = IsolatedNoise::new(&noise_config)?;
        let filter = ground_filter(config, registries)?;
        let name = &config.cluster.method;
        let entry = registries.cluster.iter().find(|entry| entry.name == name).ok_or_else(|| {
            let known = registries.cluster.iter().map(|entry| entry.name.to_owned()).collect();
            ConfigError::UnknownMethod { kind: "clustering method", name: name.clone(), known }
        })?;
        let asked = RefCell::new(BTreeSet::from(["noise".to_owned(), config.ground.method.clone()]));
        let mut method = (entry.build)(&|section| {
            asked.borrow_mut().insert(section.to_owned());
            config.method_table(section)
        })?;
        let mut warnings = without_effect(config, &asked.into_inner())?;
        warnings.extend(effect::warnings(config, &*method)?);
        if let Some(file) = method.model_file().map(str::to_owned) {
            let content = std::fs::read(&file)
                .map_err(|source| InputError::Model { path: PathBuf::from(&file), source })?;
            method.use_model(&file, &content)?;
        }
        let verdicts = noise.height_reach(lattice).metres().max(filter.reach(lattice).metres());
        let ground_reach = lattice.units_up(noise.reach(lattice).metres()) + lattice.units_up(verdicts);
        let cluster_reach = lattice.units_up(method.planning_reach(lattice).metres());
        let noise = noise_config.enabled.then_some(noise);
        Ok(Self { noise, filter, method, ground_reach, cluster_reach, warnings })
    }

    /// Whether ground is searched for, and whether noise is.
    pub(crate) fn finds(&self) -> (bool, bool) {
        (self.filter.name() != NoGround::NAME, self.noise.is_some())
    }

    /// Distance within which points decide on an object, in lattice units: on its ground, and on the result
    /// of the method.
    pub(crate) fn deciding_reach(&self, lattice: Lattice) -> i64 {
        self.ground_reach + lattice.units_up(self.method.deciding_reach_m(lattice))
    }

    /// The same noise and ground filters before another method.
    pub(crate) fn before(mut self, method: Box<dyn Method>, lattice: Lattice) -> Self {
        self.cluster_reach = lattice.units_up(method.planning_reach(lattice).metres());
        self.method = method;
        self
    }
}

/// Warnings about changed settings that no method has `asked` for: they belong to other methods.
fn without_effect(config: &Config, asked: &BTreeSet<String>) -> Result<Vec<String>, ConfigError> {
    let of_method = |line: &String| {
        let section = line.split_once('.').map_or("", |(section, _)| section);
        config.is_of_method(section) && !asked.contains(section)
    };
    let (ground, cluster) = (&config.ground.method, &config.cluster.method);
    let told = |line: String| format!("{line} has no effect: the methods are {ground} and {cluster}");
    Ok(config.differences()?.into_iter().filter(of_method).map(told).collect())
}

/// The ground filter that the configuration names.
fn ground_filter(config: &Config, registries: &Registries<'_>) -> Result<Box<dyn GroundFilter>, ConfigError> {
    let name = &config.ground.method;
    if name == NoGround::NAME {
        return Ok(Box::new(NoGround));
    }
    let entry = registries.ground.iter().find(|entry| entry.name == name).ok_or_else(|| {
        let mut known: Vec<String> = registries.ground.iter().map(|entry| entry.name.to_owned()).collect();
        known.push(NoGround::NAME.to_owned());
        ConfigError::UnknownMethod { kind: "ground filter", name: name.clone(), known }
    })?;
    (entry.build)(&config.method_table(name))
}

/// Adds every setting of a section to the values that a pass depends on.
pub(crate) fn with_section(mut inputs: Inputs, config: &Config, name: &str) -> Inputs {
    for (key, value) in config.method_table(name) {
        inputs = inputs.with(format!("{name}.{key}"), value);
    }
    inputs
}

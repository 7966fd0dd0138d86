//! The chain of methods of a run: noise, ground filter, clustering; what they reach, and what they depend on.

use crate::cluster::{self, ClusterEntry, Method};
use crate::config::{self, Config, ConfigError};
use crate::ground::{self, GroundEntry, GroundFilter, IsolatedNoise, NoGround, NoiseConfig};
use crate::model::{Lattice, Reach};
use crate::run::budget::TileNeed;
use crate::run::{cluster_pass, curve_pass, ground_pass, prepare, staged_pass};
use crate::store::Inputs;
use crate::tiling::{Plan, Tile};

/// Where methods are looked up; a test or a program of its own may add to it.
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

/// Share of points that plans take for points of objects, in percent: drives along streets have 27 to 64. What a tile really has
/// is known after the ground pass; in a forest fewer tiles are then worked on at once.
const OBJECT_SHARE_PERCENT: u64 = 55;

/// The methods of a run.
#[derive(Debug)]
pub(crate) struct Chain {
    pub(crate) noise: Option<IsolatedNoise>,
    pub(crate) filter: Box<dyn GroundFilter>,
    pub(crate) method: Method,
    /// Reach of noise and filter together, in lattice units.
    pub(crate) ground_reach: i64,
    /// Reach of the clustering, in lattice units.
    pub(crate) cluster_reach: i64,
}

impl Chain {
    /// Builds the methods that the configuration names.
    pub(crate) fn build(
        config: &Config,
        registries: &Registries<'_>,
        lattice: Lattice,
    ) -> Result<Self, ConfigError> {
        let noise_config: NoiseConfig = config::section("noise", &config.method_table("noise"))?;
        let noise = IsolatedNoise::new(&noise_config)?;
        let filter = ground_filter(config, registries)?;
        let name = &config.cluster.method;
        let entry = registries.cluster.iter().find(|entry| entry.name == name).ok_or_else(|| {
            let known = registries.cluster.iter().map(|entry| entry.name.to_owned()).collect();
            ConfigError::UnknownMethod { kind: "clustering method", name: name.clone(), known }
        })?;
        let method = (entry.build)(&config.method_table(name))?;
        // Upwards, so that a reach that is no multiple of the step is never cut short.
        #[expect(clippy::cast_possible_truncation, reason = "validated settings of at most kilometres")]
        let units = |metres: f64| (metres * f64::from(lattice.units_per_m())).ceil() as i64;
        let verdicts = noise.height_reach(lattice).metres().max(filter.reach(lattice).metres());
        let ground_reach = units(noise.reach(lattice).metres()) + units(verdicts);
        prepare::epsilon_settings(config)?;
        // What is estimated is not known yet: the halo that it is estimated with stands for it in the plan.
        let cluster_reach = units(method.reach(lattice).map_or(curve_pass::HALO_M, Reach::metres));
        Ok(Self { noise: noise_config.enabled.then_some(noise), filter, method, ground_reach, cluster_reach })
    }

    /// Bytes that a point in flight takes in the hungriest pass.
    pub(crate) fn bytes_per_point(&self) -> u64 {
        ground_pass::BYTES_PER_POINT.max(self.cluster_bytes_per_point())
    }

    fn cluster_bytes_per_point(&self) -> u64 {
        let of_objects = match &self.method {
            Method::Staged(_) => return staged_pass::BYTES_PER_POINT,
            Method::Local(_) => cluster_pass::bytes_per_point(0),
            Method::Prepared(method) => {
                let fields = method.needs().fields.len();
                curve_pass::bytes_per_point(fields.max(3)).max(cluster_pass::bytes_per_point(fields))
            }
        };
        of_objects * OBJECT_SHARE_PERCENT / 100
    }

    /// Bytes of a tile in the hungriest pass, halo included.
    pub(crate) fn tile_bytes(&self, plan: &Plan, tile: usize) -> u64 {
        let ground = plan.region_points(tile, self.ground_reach) * ground_pass::BYTES_PER_POINT;
        let cluster = plan.region_points(tile, self.cluster_reach) * self.cluster_bytes_per_point();
        ground.max(cluster)
    }

    /// What the tiles of `plan` need.
    pub(crate) fn needs(&self, plan: &Plan) -> Vec<TileNeed> {
        let core = |tile: &Tile| tile.points * self.bytes_per_point();
        (0..)
            .zip(&plan.tiles)
            .map(|(n, tile)| TileNeed { core: core(tile), all: self.tile_bytes(plan, n) })
            .collect()
    }

    /// Bytes of the largest tile of `plan`.
    pub(crate) fn largest_tile_bytes(&self, plan: &Plan) -> u64 {
        TileNeed::largest(&self.needs(plan))
    }
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

/// Adds every setting of a section to what a pass depends on.
pub(crate) fn with_section(mut inputs: Inputs, config: &Config, name: &str) -> Inputs {
    for (key, value) in config.method_table(name) {
        inputs = inputs.with(format!("{name}.{key}"), value);
    }
    inputs
}

//! What a method has to know of the whole drive before it can look at a tile: statistics of fields, and epsilon. Each is
//! a pass with its reduction.

use serde::Serialize;

use crate::cluster::dbscan::epsilon::{self, Attempt, Curve, Estimate};
use crate::cluster::{EpsilonConfig, Method, Needs, PreparedClusterer};
use crate::config::{self, Config, ConfigError};
use crate::error::Result;
use crate::model::AlgorithmError;
use crate::model::FieldSpace;
use crate::run::curve_pass::{AskingCost, CurvePass, HALO_M, Sample};
use crate::run::engine::{Engine, PassFigures};
use crate::run::fields_pass::{FieldsPass, StoredFields};
use crate::run::inputs;
use crate::run::scene::Scene;
use crate::run::tiles::Tiles;
use crate::store::Inputs;

/// An epsilon that was estimated over a drive, and what it came from.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DriveEpsilon {
    /// Unit of the distances: `m`, or `standard deviations` where fields are divided by theirs.
    pub unit: &'static str,
    /// The estimate with its curve, fit and tangent point.
    #[serde(flatten)]
    pub estimate: Estimate,
    /// The space that distances were taken in.
    pub space: FieldSpace,
    /// What exactness at the borders of tiles cost.
    pub cost: Cost,
}

/// What exactness at the borders of tiles cost: points whose neighbours may lie beyond what a tile reads ask for more.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cost {
    /// Metres around its core that a tile reads in the first place.
    pub halo_m: f64,
    /// Points that asked for more.
    pub asked_for_more: u64,
    /// Their share of all points that were asked for their neighbours.
    pub share: f64,
    /// Points that were read for them, per point read in the first place.
    pub read_share: f64,
}

impl Cost {
    fn of(cost: AskingCost, curve: &Curve) -> Self {
        Self {
            halo_m: HALO_M,
            asked_for_more: cost.asked,
            share: cost.asked as f64 / curve.queries.max(1) as f64,
            read_share: cost.read as f64 / cost.gathered.max(1) as f64,
        }
    }
}

/// Where a pass of this kind runs.
pub(crate) struct Setting<'a> {
    pub(crate) engine: &'a Engine<'a>,
    pub(crate) config: &'a Config,
    pub(crate) scene: &'a Scene,
    pub(crate) ground: &'a Inputs,
}

/// The space that distances are taken in, and the columns of those of its fields that are no coordinates.
pub(crate) fn field_space(
    setting: &Setting<'_>,
    passes: &mut Vec<PassFigures>,
    tiles: &Tiles<'_>,
    needs: &Needs,
) -> Result<(FieldSpace, Option<StoredFields>)> {
    if needs.fields.is_empty() {
        return Ok((FieldSpace::metres(tiles.drive.lattice()), None));
    }
    let drive = tiles.drive;
    let stored = StoredFields::open(drive, &needs.fields, setting.engine.run_dir)?;
    let pass = FieldsPass { drive, runs: drive.block_runs(), fields: &needs.fields, stored: &stored };
    let dir = setting.engine.run_dir.pass(inputs::FIELDS, inputs::fields(setting.scene, &needs.fields));
    passes.push(setting.engine.execute(&pass, &dir)?);
    let sums = pass.reduce(&dir)?;
    let space = FieldSpace::standardised(&sums, &needs.weights).map_err(|field| {
        let expected = "fields that have more than one value in the drive";
        ConfigError::value("dbscan.fields", field.name(), expected)
    })?;
    Ok((space, Some(stored)))
}

/// Estimates epsilon over the points that are neither ground nor noise.
pub(crate) fn estimate(
    setting: &Setting<'_>,
    passes: &mut Vec<PassFigures>,
    tiles: &Tiles<'_>,
    needs: &Needs,
    space: &FieldSpace,
    population: u64,
) -> Result<DriveEpsilon> {
    let settings = epsilon_settings(setting.config)?;
    let first = usize::try_from(settings.k).unwrap_or(usize::MAX);
    let most = usize::try_from(population).unwrap_or(usize::MAX);
    let mut k = first;
    loop {
        let pass = CurvePass {
            tiles,
            space,
            sample: Sample::new(settings.seed, settings.max_queries, population),
            k: k.min(most).max(1),
            population,
            diagonal: space.diagonal(setting.scene.survey.extent.unwrap_or_default()),
        };
        let (folder, depends) = inputs::epsilon(setting.ground, needs, &settings, k);
        let dir = setting.engine.run_dir.pass(&folder, depends);
        passes.push(setting.engine.execute(&pass, &dir)?);
        let (curve, cost) = pass.reduce(&dir)?;
        let cost = Cost::of(cost, &curve);
        match epsilon::estimate(curve, first, population)? {
            Attempt::Found(estimate) => {
                let unit = if space.is_metric() { "m" } else { "standard deviations" };
                return Ok(DriveEpsilon { unit, estimate: *estimate, space: space.clone(), cost });
            }
            // Once and for all, rather than a pass over the drive for every K: a longer curve holds every shorter one.
            Attempt::Longer(longer) => k = longer,
        }
    }
}

/// Settings of the estimation.
pub(crate) fn epsilon_settings(config: &Config) -> Result<EpsilonConfig, ConfigError> {
    let settings: EpsilonConfig = config::section("epsilon", &config.method_table("epsilon"))?;
    settings.validate()?;
    Ok(settings)
}

/// A method that is ready for tiles, and how far it reaches in lattice units.
pub(crate) fn ready(
    method: &dyn PreparedClusterer,
    tiles: &Tiles<'_>,
    space: &FieldSpace,
    epsilon: Option<&DriveEpsilon>,
) -> Result<(Method, i64)> {
    let local = method.prepare(space, epsilon.map(|found| found.estimate.epsilon))?;
    let lattice = tiles.drive.lattice();
    let reach = lattice.units(local.reach(lattice).metres());
    let edge_m = lattice.metres(tiles.drive.grid.edge());
    let longest_m = tiles.plan.tiles.iter().map(|tile| tile.to_m - tile.from_m + edge_m).fold(0.0, f64::max);
    if !space.is_metric() && tiles.plan.tiles.len() > 1 && lattice.metres(reach) > longest_m {
        let (method, reach_m) = (method.name(), lattice.metres(reach));
        return Err(AlgorithmError::ReachBeyondTile { method, reach_m, longest_m }.into());
    }
    Ok((Method::Local(local), reach))
}

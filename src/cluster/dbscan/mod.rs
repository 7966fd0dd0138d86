//! The clustering method `dbscan`: on x, y and z in metres (`metric`), in a space of standardised fields (`fields`), and on
//! tables (`rows`); with an epsilon that is given, or estimated from the drive (`epsilon`).
//!
//! Source: the paper on estimating epsilon, algorithm 1 (variant `size`), and Ester, Kriegel, Sander, Xu, "A density-based algorithm for
//! discovering clusters" (1996) (variant `core`). `size` is single link at epsilon, as `euclidean` is, with the same
//! kernel; `core` has its own, see `core_points`. Ours: border points go to the nearest core point, ties to the smaller
//! id, so that no order of points decides.
//!
//! Why `core` is exact over tiles: the region is the core of the tile and all within 2 epsilon. Whether a point within
//! epsilon of the tile's core is a core point is certain. Further out a neighbourhood may be cut off, and a point may
//! only *miss* being a core point: what is joined is always joined truly. Every link has an end in the core of some
//! tile, where both ends are certain. Border points pass nothing on, so they get a label in their own tile alone, where
//! every core point within epsilon of them is known.
//!
//! Known failures: those of single link for `size`; `core` cuts thin parts (wires, sparse crowns) off.

mod core_points;
pub mod epsilon;
mod fields;
mod metric;
pub mod rows;
mod settings;

use std::ops::RangeInclusive;

use self::epsilon::{CurveStep, DriveEpsilon, EpsilonConfig, HALO_M};
use self::fields::FieldDbscan;
pub use self::metric::Dbscan;
pub use self::settings::{Auto, DbscanConfig, DbscanVariant, Epsilon};
use self::settings::{NAME, check_radius, given};
use super::local::{self, Clusterer, OneStep};
use super::method::{
    BytesPer, ClusterEntry, DriveWindow, Figures, Mapped, Method, Reduced, Repeat, Sections, Step, TileWindow,
};
use crate::config::{self, ConfigError};
use crate::error::{Error, Result};
use crate::model::{AlgorithmError, Field, FieldSpace, Lattice, Reach};

pub(super) const ENTRY: ClusterEntry = ClusterEntry {
    name: NAME,
    summary: "connected points within epsilon, or core points with their border",
    reference: "the paper on estimating epsilon, algorithm 1; Ester et al. 1996",
    build,
};

/// Ready for tiles where epsilon is given in metres, else once something is known of the whole drive.
fn build(sections: Sections<'_>) -> Result<Box<dyn Method>, ConfigError> {
    let config: DbscanConfig = config::section(NAME, &sections(NAME))?;
    config.validate()?;
    Ok(match config.epsilon {
        Epsilon::Given(_) if config.is_metric() => {
            Box::new(OneStep::new(Dbscan::new(&config)?, &["dbscan.*"]))
        }
        _ => Box::new(OverDrive::new(&config, &config::section("epsilon", &sections("epsilon"))?)?),
    })
}

/// `dbscan` where something has to be known of the whole drive: statistics of fields, epsilon, or both.
#[derive(Debug, Clone)]
struct OverDrive {
    config: DbscanConfig,
    epsilon: EpsilonConfig,
    /// Fields that distances are taken in, standardised; empty for x, y and z in metres.
    fields: Vec<Field>,
    steps: Vec<Step>,
}

impl OverDrive {
    fn new(config: &DbscanConfig, epsilon: &EpsilonConfig) -> Result<Self, ConfigError> {
        epsilon.validate()?;
        let fields = if config.is_metric() { Vec::new() } else { config.fields.clone() };
        let mut steps = Vec::new();
        if config.epsilon == Epsilon::AUTO {
            steps.push(CurveStep::step(fields.len().max(3)));
        }
        // The places of the points and a tree come on top, estimated from their sizes.
        let bytes = BytesPer::ObjectPoint(local::BYTES_PER_POINT + 32 * fields.len() as u64);
        let settings: &[&str] = if steps.is_empty() { &["dbscan.*"] } else { &["dbscan.*", "epsilon.*"] };
        steps.push(Step { name: "cluster", settings, bytes, repeat: Repeat::Once });
        Ok(Self { config: config.clone(), epsilon: epsilon.clone(), fields, steps })
    }

    /// Whether a step estimates epsilon; else it labels points.
    fn estimates(&self, step: usize) -> bool {
        step + 1 < self.steps.len()
    }

    /// The space that distances are taken in.
    fn space(&self, drive: &dyn DriveWindow) -> Result<FieldSpace> {
        if self.fields.is_empty() {
            return Ok(FieldSpace::metres(drive.lattice()));
        }
        let space = FieldSpace::standardised(drive.field_sums(), &self.config.weights).map_err(|field| {
            let expected = "fields that have more than one value in the drive";
            ConfigError::value("dbscan.fields", field.name(), expected)
        })?;
        Ok(space)
    }

    fn curve(&self, drive: &dyn DriveWindow) -> Result<CurveStep> {
        CurveStep::new(&self.epsilon, self.space(drive)?, drive)
    }

    /// The method of one tile, now that this is known.
    fn clusterer(&self, drive: &dyn DriveWindow) -> Result<Box<dyn Clusterer>> {
        let mut config = self.config.clone();
        if self.steps.len() > 1 {
            let found = DriveEpsilon::decode(drive.global(0))?.estimate.epsilon;
            check_radius("dbscan.epsilon, estimated", found)?;
            config.epsilon = Epsilon::Given(found);
        }
        if config.is_metric() {
            return Ok(Box::new(Dbscan::new(&config)?));
        }
        Ok(Box::new(FieldDbscan::new(&config, given(&config)?, self.space(drive)?)))
    }
}

impl Method for OverDrive {
    fn name(&self) -> &'static str {
        NAME
    }

    fn object_size(&self) -> RangeInclusive<u64> {
        self.config.object_size()
    }

    fn steps(&self) -> &[Step] {
        &self.steps
    }

    fn fields(&self) -> &[Field] {
        &self.fields
    }

    /// That of the estimate: what is estimated is not known yet.
    fn planning_reach(&self, _lattice: Lattice) -> Reach {
        Reach::Exact { metres: HALO_M }
    }

    fn reach_is_provisional(&self) -> bool {
        true
    }

    fn reach(&self, step: usize, drive: &dyn DriveWindow) -> Result<i64> {
        let lattice = drive.lattice();
        if self.estimates(step) {
            self.space(drive)?;
            return Ok(lattice.units(HALO_M));
        }
        let reach = lattice.units(self.clusterer(drive)?.reach(lattice).metres());
        let (reach_m, longest_m) = (lattice.metres(reach), drive.longest_tile_m());
        if !self.config.is_metric() && drive.tiles() > 1 && reach_m > longest_m {
            return Err(AlgorithmError::ReachBeyondTile { method: NAME, reach_m, longest_m }.into());
        }
        Ok(reach)
    }

    fn map(&self, step: usize, tile: &dyn TileWindow) -> Result<Mapped> {
        if self.estimates(step) {
            return self.curve(tile)?.map(tile);
        }
        local::label(&*self.clusterer(tile)?, tile, self.reach(step, tile)?)
    }

    fn reduce(&self, step: usize, drive: &dyn DriveWindow) -> Result<Reduced> {
        if self.estimates(step) {
            return self.curve(drive)?.reduce(step, drive);
        }
        Ok(Reduced::SharedPoints)
    }

    fn figures(&self, drive: &dyn DriveWindow) -> Result<Figures> {
        let mut figures = Figures::new();
        if self.steps.len() > 1 {
            let found = DriveEpsilon::decode(drive.global(0))?;
            let value = serde_json::to_value(&found)
                .map_err(|error| Error::bug(format!("an estimate does not become JSON: {error}")))?;
            figures.insert("epsilon".to_owned(), value);
        }
        Ok(figures)
    }
}

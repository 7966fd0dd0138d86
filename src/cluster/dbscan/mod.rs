//! The clustering method `dbscan`: on x, y and z in metres (`metric`), in a space of standardised fields
//! (`fields`), and on tables (`rows`). Epsilon is a setting, or it is estimated from the drive (`epsilon`).
//!
//! The variant `size` is algorithm 1 of Wang, Ji, Wang, Wen, Li, Sun, "An Improved DBSCAN Method for LiDAR
//! Data Segmentation with Automatic Eps Estimation", Sensors 19(1), 172 (2019), doi:10.3390/s19010172. The
//! variant `core` is the algorithm of Ester, Kriegel, Sander, Xu, "A density-based algorithm for discovering
//! clusters in large spatial databases with noise" (1996). `size` is single link at epsilon, like
//! `euclidean`, with the same kernel. `core` has its own kernel, see `core_points`. A border point of several
//! clusters may belong to any of them in the paper of Ester et al.; their algorithm gives it to the first one
//! found. Ours: it goes to the cluster of its nearest core point, and of equally near ones to the first by x,
//! then y, then z (in a space of fields: by their values). So the order of the points does not matter.
//!
//! Why `core` is exact over tiles: a tile reads its core and everything within 2 epsilon. So for every point
//! within epsilon of the tile's core, the tile knows with certainty whether it is a core point. Further out,
//! neighbourhoods may be cut off, and a core point may be *missed*, but no other point becomes one. So every
//! link that a tile finds is a true link. Every link has an end in the core of some tile, and this tile knows
//! both ends with certainty. Border points do not pass connections on. Therefore only the tile that owns a
//! border point labels it, and this tile knows every core point within epsilon of it.
//!
//! Known failures: those of single link for `size`; `core` cuts off thin parts (wires, sparse crowns).

mod core_points;
pub mod epsilon;
mod fields;
mod metric;
pub mod rows;
mod settings;

use std::ops::RangeInclusive;

use self::epsilon::{CurveStep, DriveEpsilon, EpsilonConfig, HALO_M};
pub use self::settings::{Auto, DbscanConfig, DbscanVariant, Epsilon};
use self::settings::{NAME, check_radius, given};
use super::local::{self, Clusterer, OneStep};
use super::method::{
    BytesPer, ClusterEntry, DriveWindow, Figures, Mapped, Method, Reduced, Repeat, Sections, Step, TileWindow,
};
use crate::config::{self, ConfigError};
use crate::error::{Error, Result};
use crate::model::{AlgorithmError, Field, FieldSpace, Lattice, Reach, TileCloud};

pub(super) const ENTRY: ClusterEntry = ClusterEntry {
    name: NAME,
    summary: "connected points within epsilon, or core points with their border",
    reference: "Wang et al. 2019, algorithm 1, doi:10.3390/s19010172; Ester et al. 1996",
    build,
};

/// A method of one step if epsilon is given in metres, otherwise a method that first needs values of the
/// whole drive.
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

/// Raised when results of the variant `core` change and no setting does. Since 2, places decide where ids
/// decided before.
const CORE_EPOCH: u32 = 2;

fn epoch_of(config: &DbscanConfig) -> Vec<(&'static str, String)> {
    match config.variant {
        DbscanVariant::Core => vec![("algorithm epoch", CORE_EPOCH.to_string())],
        DbscanVariant::Size => Vec::new(),
    }
}

/// The method with a known epsilon.
#[derive(Debug, Clone)]
pub struct Dbscan {
    config: DbscanConfig,
    /// Radius in metres, or in standard deviations.
    epsilon: f64,
    /// The space of standardised fields. `None` for x, y and z in metres.
    space: Option<FieldSpace>,
}

impl Dbscan {
    /// The method with these settings, on x, y and z with a given epsilon.
    ///
    /// # Errors
    /// Those of [`DbscanConfig::validate`].
    pub fn new(config: &DbscanConfig) -> Result<Self, ConfigError> {
        config.validate()?;
        Ok(Self { config: config.clone(), epsilon: given(config)?, space: None })
    }
}

impl Clusterer for Dbscan {
    fn name(&self) -> &'static str {
        NAME
    }

    fn reach(&self, lattice: Lattice) -> Reach {
        let in_metres = || lattice.units(self.epsilon);
        let epsilon = self.space.as_ref().map_or_else(in_metres, |space| space.horizontal(self.epsilon));
        self.config.reach(epsilon, lattice)
    }

    fn object_size(&self) -> RangeInclusive<u64> {
        self.config.object_size()
    }

    fn depends_on(&self) -> Vec<(&'static str, String)> {
        epoch_of(&self.config)
    }

    fn cluster(&self, cloud: &TileCloud, labels: &mut [u32]) -> Result<u32, AlgorithmError> {
        self.cluster_tile(cloud, &vec![true; cloud.len()], labels)
    }

    fn cluster_tile(
        &self,
        cloud: &TileCloud,
        core: &[bool],
        labels: &mut [u32],
    ) -> Result<u32, AlgorithmError> {
        match &self.space {
            Some(space) => fields::label(&self.config, self.epsilon, space, cloud, core, labels),
            None => metric::label(&self.config, self.epsilon, cloud, core, labels),
        }
    }
}

/// `dbscan` with values of the whole drive: statistics of fields, epsilon, or both.
#[derive(Debug, Clone)]
struct OverDrive {
    config: DbscanConfig,
    epsilon: EpsilonConfig,
    /// Standardised fields in which distances are measured. Empty for x, y and z in metres.
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
        // The coordinates of the points and a tree come in addition. Their bytes are estimated from sizes.
        let bytes = BytesPer::ObjectPoint(local::BYTES_PER_POINT + 32 * fields.len() as u64);
        let settings: &[&str] = if steps.is_empty() { &["dbscan.*"] } else { &["dbscan.*", "epsilon.*"] };
        steps.push(Step { name: "cluster", settings, bytes, repeat: Repeat::Once });
        Ok(Self { config: config.clone(), epsilon: epsilon.clone(), fields, steps })
    }

    /// Whether a step estimates epsilon. Otherwise it labels points.
    fn estimates(&self, step: usize) -> bool {
        step + 1 < self.steps.len()
    }

    /// The space in which distances are measured.
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

    /// The method of one tile, with epsilon and space known.
    fn clusterer(&self, drive: &dyn DriveWindow) -> Result<Dbscan> {
        let mut config = self.config.clone();
        if self.steps.len() > 1 {
            let found = DriveEpsilon::decode(drive.global(0))?.estimate.epsilon;
            check_radius("dbscan.epsilon, estimated", found)?;
            config.epsilon = Epsilon::Given(found);
        }
        if config.is_metric() {
            return Ok(Dbscan::new(&config)?);
        }
        let epsilon = given(&config)?;
        Ok(Dbscan { config, epsilon, space: Some(self.space(drive)?) })
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

    fn depends_on(&self, step: usize) -> Vec<(&'static str, String)> {
        if self.estimates(step) {
            vec![("algorithm epoch", epsilon::EPOCH.to_string())]
        } else {
            epoch_of(&self.config)
        }
    }

    /// The reach of the estimate. The estimated epsilon is not known yet.
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
        let reach_m = lattice.metres(reach);
        let longest_m = drive.longest_tile_m();
        if !self.config.is_metric() && drive.tiles() > 1 && reach_m > longest_m {
            return Err(AlgorithmError::ReachBeyondTile { method: NAME, reach_m, longest_m }.into());
        }
        Ok(reach)
    }

    fn map(&self, step: usize, tile: &dyn TileWindow) -> Result<Mapped> {
        if self.estimates(step) {
            return self.curve(tile)?.map(tile);
        }
        local::label(&self.clusterer(tile)?, tile, self.reach(step, tile)?)
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
                .map_err(|error| Error::bug(format!("an estimate cannot be written as JSON: {error}")))?;
            figures.insert("epsilon".to_owned(), value);
        }
        Ok(figures)
    }
}

//! The clustering method `street`, our own: it classifies a voxel before it assigns the voxel to an object. A
//! classifier, trained on labelled drives, gives each voxel a probability for each class. Objects are then
//! separated class by class, from the ground up.
//!
//! Steps, by folder, in the order of the flow:
//!
//! - `voxels`: points to voxels of 0.15 m and a ground raster.
//! - `classes`: features of each voxel, from the voxels within 5.4 m (the corner of the largest window) and
//!   the ground within 12 m of these; then class probabilities, smoothed. Step `context`: corrected class
//!   probabilities, from those of the surrounding voxels.
//! - `chains`: upright chains near the ground. Each chain is classified as a whole: trunk or pole.
//! - `cores`: the parts of the drive that are certainly one object each, and the stems of trees.
//! - `growth`: step `edges` finds which voxels are neighbours, and everything else that growth needs to know
//!   about them. Step `growth`: every voxel takes the label of the core with the least path cost to it, in
//!   rounds.
//! - `objects`: step `leftovers` takes the pieces that no core reaches. It joins each to a nearby object, or
//!   makes it an object of its own. Step `objects`: islands and fixtures, the labels of points, and the class
//!   and confidence of each object. The third part of the model names an object as a whole. The fourth part
//!   recognises pieces of objects.
//!
//! `learning` makes samples for the models from labelled drives.
//!
//! Points are read by the first and the last step only. The other steps read voxels. Sums are integers, and
//! eigenvalues and costs follow a fixed sequence of IEEE operations. Ties are broken by the keys of voxels,
//! which do not depend on tiles. So tiled equals untiled to the bit.
//!
//! `benches/results/street.md` has the study of the thresholds and what was tried. Growth along least paths
//! follows the separation of trees of Tao et al., "Segmenting tree crowns from terrestrial and mobile LiDAR
//! data by exploring ecological theories", ISPRS Journal 110, 66-76 (2015),
//! doi:10.1016/j.isprsjprs.2015.10.007.

mod chains;
mod classes;
mod cores;
mod growth;
mod learning;
mod model;
mod objects;
mod settings;
mod shares;
mod spans;
mod voxels;
mod window;

use std::ops::RangeInclusive;
use std::sync::Arc;

use self::chains::stage_chains;
pub(crate) use self::classes::features::NAMES as FEATURES;
pub(crate) use self::classes::features::context::NAMES as CONTEXT_FEATURES;
use self::classes::{stage_classes, stage_context};
use self::cores::stage_cores;
use self::growth::{stage_edges, stage_growth};
pub(crate) use self::learning::doubts::doubtful;
pub(crate) use self::learning::training::{Counts, Purpose, Sample, SamplesOfObjects, Training};
pub(crate) use self::learning::truth::Known;
pub use self::model::StreetModel;
pub(crate) use self::model::{CLASS_NAMES, built_in};
pub(crate) use self::objects::figures::NAMES as OBJECT_FEATURES;
pub(crate) use self::objects::wholes::{CLASS_NAMES as WHOLE_CLASSES, NAMES as WHOLE_FEATURES};
use self::objects::{stage_leftovers, stage_objects};
use self::settings::{
    NAME, STEP_CHAINS, STEP_CLASSES, STEP_CONTEXT, STEP_CORES, STEP_EDGES, STEP_GROWTH, STEP_LEFTOVERS,
    STEP_OBJECTS, STEP_VOXELS,
};
pub use self::settings::{Scene, StreetConfig, WantedClass};
pub(crate) use self::shares::class;
use self::voxels::{stage_voxels, suits};
use super::method::{BytesPer, ClusterEntry, DriveWindow, Mapped, Method, Reduced, Repeat, Step, TileWindow};
use crate::config::{self, ConfigError};
use crate::error::{Error, Result};
use crate::model::{Kind, Lattice, Reach};

pub(super) const ENTRY: ClusterEntry = ClusterEntry {
    name: NAME,
    summary: "voxels get a class from a trained model; objects are separated class by class and named",
    reference: "ours, see benches/results/street.md",
    build: |sections| Ok(Box::new(Street::new(&config::section(NAME, &sections(NAME))?)?)),
};

/// Distance in metres beyond which points usually do not change an object. The voxels and the ground around
/// an object decide its class, and cores around it compete for its voxels during growth. Chosen: with it, all
/// 404 objects of four sections of synthetic streets (suburb and mixed, 400 m each) are those of the whole
/// drive.
const DECIDING_REACH_M: f64 = 30.0;

/// Peak memory of a tile in any step, in bytes per point.
const BYTES_PER_POINT: u64 = 60;

const fn step(name: &'static str, settings: &'static [&'static str], repeat: Repeat) -> Step {
    Step { name, settings, bytes: BytesPer::Point(BYTES_PER_POINT), repeat }
}

/// All steps, with `last` as the last one.
const fn steps(last: Step) -> [Step; 9] {
    [
        step("voxels", &[], Repeat::Once),
        step("classes", &["street.scene", "street.model"], Repeat::Once),
        step("context", &[], Repeat::Once),
        step("chains", &["street.scene"], Repeat::Once),
        step("cores", &[], Repeat::Once),
        step("edges", &[], Repeat::Once),
        step("growth", &["street.min_points"], Repeat::UntilSettled { most: stage_growth::MOST_ROUNDS }),
        step("leftovers", &["street.min_points"], Repeat::Once),
        last,
    ]
}

const STEPS: [Step; 9] = steps(step(
    "objects",
    &["street.scene", "street.model", "street.classes", "street.min_points"],
    Repeat::Once,
));

/// The method, see the module.
#[derive(Debug, Clone)]
pub struct Street {
    config: StreetConfig,
    /// The model that was read from a file. `None` means the built-in model of the scene.
    model: Option<Arc<StreetModel>>,
}

impl Street {
    /// The method with these settings.
    ///
    /// # Errors
    /// Those of [`StreetConfig::validate`].
    pub fn new(config: &StreetConfig) -> Result<Self, ConfigError> {
        config.validate()?;
        Ok(Self { config: config.clone(), model: None })
    }

    fn model(&self) -> Result<Arc<StreetModel>> {
        match &self.model {
            Some(model) => Ok(Arc::clone(model)),
            None => Ok(built_in(self.config.scene)?),
        }
    }
}

impl Method for Street {
    fn name(&self) -> &'static str {
        NAME
    }

    fn object_size(&self) -> RangeInclusive<u64> {
        self.config.min_points..=u64::MAX
    }

    fn steps(&self) -> &[Step] {
        &STEPS
    }

    fn kinds(&self) -> Vec<Kind> {
        self.config.kinds()
    }

    fn depends_on(&self, step: usize) -> Vec<(&'static str, String)> {
        let checksum = |of: fn(&StreetModel) -> u64| {
            let checksum = self.model().map(|model| format!("{:016x}", of(&model)));
            vec![("model", checksum.unwrap_or_else(|error| error.to_string()))]
        };
        match step {
            STEP_CLASSES => checksum(StreetModel::checksum_of_voxels),
            STEP_OBJECTS => checksum(StreetModel::checksum),
            _ => Vec::new(),
        }
    }

    fn model_file(&self) -> Option<&str> {
        Some(&*self.config.model).filter(|file| !file.is_empty())
    }

    fn use_model(&mut self, file: &str, content: &[u8]) -> Result<()> {
        self.model = Some(Arc::new(StreetModel::decode(file, content)?));
        Ok(())
    }

    /// Points are read for the columns of voxels and the cells of the ground raster that a tile owns.
    fn planning_reach(&self, lattice: Lattice) -> Reach {
        Reach::Exact { metres: lattice.metres(stage_voxels::points_reach(lattice)) }
    }

    fn microseconds_per_point(&self) -> f64 {
        13.0
    }

    fn stored_bytes_per_point(&self) -> u64 {
        22
    }

    fn deciding_reach_m(&self, _lattice: Lattice) -> f64 {
        DECIDING_REACH_M
    }

    fn border_reach(&self, _step: usize, lattice: Lattice) -> i64 {
        stage_growth::border_reach(lattice)
    }

    fn map(&self, step: usize, tile: &dyn TileWindow) -> Result<Mapped> {
        match step {
            STEP_VOXELS => stage_voxels::map(tile),
            STEP_CLASSES => {
                let model = self.model()?;
                stage_classes::map(tile, &|rows, shares| model::classify(&model.shapes, rows, shares))
            }
            STEP_CONTEXT => {
                let model = self.model()?;
                stage_context::map(tile, &|rows, shares| model::classify(&model.context, rows, shares))
            }
            STEP_CHAINS => stage_chains::map(tile, self.config.scene),
            STEP_CORES => stage_cores::map(tile),
            STEP_EDGES => stage_edges::map(tile),
            STEP_GROWTH => stage_growth::map(tile),
            STEP_LEFTOVERS => stage_leftovers::map(tile),
            STEP_OBJECTS => stage_objects::map(tile, &*self.model()?),
            other => Err(no_step(other)),
        }
    }

    fn warnings(&self, drive: &dyn DriveWindow) -> Result<Vec<String>> {
        suits::warnings(drive.global(STEP_VOXELS), self.model.is_none().then_some(self.config.scene))
    }

    fn reduce(&self, step: usize, drive: &dyn DriveWindow) -> Result<Reduced> {
        match step {
            STEP_VOXELS => suits::reduce(drive).map(Reduced::Global),
            STEP_CLASSES | STEP_CONTEXT | STEP_EDGES => Ok(Reduced::Global(Vec::new())),
            STEP_GROWTH => stage_growth::reduce(drive, self.config.min_uncertain()).map(Reduced::Global),
            STEP_CHAINS => stage_chains::reduce(drive).map(Reduced::Global),
            STEP_CORES => stage_cores::reduce(drive).map(Reduced::Global),
            STEP_LEFTOVERS => {
                let cores = stage_cores::count(drive.global(STEP_CORES))?;
                stage_leftovers::reduce(drive, cores, self.config.min_uncertain()).map(Reduced::Global)
            }
            STEP_OBJECTS => Ok(Reduced::Groups(stage_objects::reduce(drive, &self.config, &*self.model()?)?)),
            other => Err(no_step(other)),
        }
    }
}

fn no_step(step: usize) -> Error {
    Error::bug(format!("{NAME} has no step {step}"))
}

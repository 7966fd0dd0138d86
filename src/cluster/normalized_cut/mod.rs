//! The clustering method `normalized-cut`. It takes the objects of `euclidean`, and cuts those that are tall
//! and wide where they are weakly connected. A filter distinguishes trees, poles, facades and cars.
//!
//! Source: Guan, Cao, Yu, Li, Liu, Chen, Li, "Street-scene tree segmentation from mobile laser scanning
//! data", ISPRS Archives XLI-B3, 221-225 (2016), doi:10.5194/isprs-archives-XLI-B3-221-2016, section 3.2,
//! equations 1 to 3. "The paper" in this folder is Guan et al. 2016. It builds on Shi, Malik, "Normalized
//! cuts and image segmentation", IEEE Transactions on Pattern Analysis and Machine Intelligence 22(8),
//! 888-905 (2000), doi:10.1109/34.868688. Ours, because the paper does not say it: every value except the two
//! distances of section 4, the places where a cut is tried and the end of cutting (`cut`), the treatment of
//! large objects, and the whole tree filter (`tree_filter`), for which the paper only names "prior knowledge
//! (e.g. crown size)".
//!
//! Steps. `clusters`: the objects of `euclidean` and their voxels, tile by tile, joined over the drive.
//! `cut`: the tile that has the most points of an object gathers the whole object from all tiles, cuts it,
//! and classifies its parts. `objects`: the labels of points. Only the first and the last step read points.
//!
//! Why it is exact over tiles: voxels are sums of integers over the lattice, so an object has the same voxels
//! whatever the tiles. The cut is a function of these voxels, with a fixed order of operations on one thread,
//! and with an exponential function of our own. An object with more than `max_voxels` voxels is first cut on
//! voxels of twice the edge, or four times the edge, and so on. Its parts are cut again on finer voxels. This
//! limit is a setting, not the memory of the machine, so results do not depend on the machine. `report.json`
//! lists these objects.
//!
//! Cost: `euclidean`, and O(links) for each vector of a basis. A voxel of 0.3 m has a few hundred links of 4
//! bytes.
//!
//! Known failures: crowns that have grown together over most of their height are not cut, because there is no
//! narrow place; a facade with narrow places is cut there, and the pieces are joined again only if the filter
//! classifies them as facades.

mod clusters;
mod cut;
mod eigen;
mod graph;
mod objects;
mod pieces;
mod settings;
mod stage_cut;
mod tree_filter;

use std::ops::RangeInclusive;

pub use self::settings::NormalizedCutConfig;
use self::settings::{NAME, STEP_CLUSTERS, STEP_CUT};
use super::euclidean::{Euclidean, EuclideanConfig};
use super::local::{self, Clusterer};
use super::method::{BytesPer, ClusterEntry, DriveWindow, Mapped, Method, Reduced, Repeat, Step, TileWindow};
use crate::config::{self, ConfigError};
use crate::error::{Error, Result};
use crate::model::{Kind, Lattice, Reach};

pub(super) const ENTRY: ClusterEntry = ClusterEntry {
    name: NAME,
    summary: "clusters of euclidean; tall and wide ones are cut where they are weakly connected, and trees are named",
    reference: "Guan et al. 2016, section 3.2, doi:10.5194/isprs-archives-XLI-B3-221-2016",
    build: |sections| {
        let euclidean = config::section("euclidean", &sections("euclidean"))?;
        Ok(Box::new(NormalizedCut::new(&config::section(NAME, &sections(NAME))?, &euclidean)?))
    },
};

const STEPS: [Step; 3] = [
    Step {
        name: "clusters",
        settings: &["euclidean.*", "normalized-cut.voxel", "normalized-cut.tall", "normalized-cut.wide"],
        bytes: BytesPer::ObjectPoint(CLUSTERS_BYTES_PER_POINT),
        repeat: Repeat::Once,
    },
    Step {
        name: "cut",
        settings: &["normalized-cut.*"],
        bytes: BytesPer::ObjectPoint(CUT_BYTES_PER_POINT),
        repeat: Repeat::Once,
    },
    Step {
        name: "objects",
        settings: &[],
        bytes: BytesPer::ObjectPoint(OBJECTS_BYTES_PER_POINT),
        repeat: Repeat::Once,
    },
];

/// Bytes per point of objects that a tile needs for the clusters, and in addition for their labels and
/// voxels. Estimated from sizes.
const CLUSTERS_BYTES_PER_POINT: u64 = local::BYTES_PER_POINT + 16;
/// Bytes per point of objects that a tile needs for the graph, its halves and the basis of one object at a
/// time. Estimated from sizes: 4 to 5 KB per voxel of a dense crown, and about 12 points per voxel.
const CUT_BYTES_PER_POINT: u64 = 400;
/// Bytes per point of objects that a tile needs for labels. Estimated from sizes.
const OBJECTS_BYTES_PER_POINT: u64 = 40;

/// The method, see the module.
#[derive(Debug, Clone)]
pub struct NormalizedCut {
    config: NormalizedCutConfig,
    euclidean: Euclidean,
}

impl NormalizedCut {
    /// The method with these settings, on the objects of `euclidean` with those settings.
    ///
    /// # Errors
    /// Those of [`NormalizedCutConfig::validate`] and [`EuclideanConfig::validate`].
    pub fn new(config: &NormalizedCutConfig, euclidean: &EuclideanConfig) -> Result<Self, ConfigError> {
        config.validate()?;
        Ok(Self { config: config.clone(), euclidean: Euclidean::new(euclidean)? })
    }

    fn edge(&self, lattice: Lattice) -> u32 {
        u32::try_from(lattice.units(self.config.voxel)).unwrap_or(u32::MAX)
    }
}

impl Method for NormalizedCut {
    fn name(&self) -> &'static str {
        NAME
    }

    /// The sizes of `euclidean`: they apply to its clusters before the cut, and to the parts.
    fn object_size(&self) -> RangeInclusive<u64> {
        self.euclidean.object_size()
    }

    fn steps(&self) -> &[Step] {
        &STEPS
    }

    fn kinds(&self) -> Vec<Kind> {
        tree_filter::CLASSES.map(|class| Kind::new(class, 0)).into()
    }

    fn microseconds_per_point(&self) -> f64 {
        10.0
    }

    fn stored_bytes_per_point(&self) -> u64 {
        6
    }

    fn planning_reach(&self, lattice: Lattice) -> Reach {
        self.euclidean.reach(lattice)
    }

    /// Only the first step reads points around a tile.
    fn reach(&self, step: usize, drive: &dyn DriveWindow) -> Result<i64> {
        let lattice = drive.lattice();
        Ok(if step == STEP_CLUSTERS { lattice.units_up(self.euclidean.reach(lattice).metres()) } else { 0 })
    }

    fn map(&self, step: usize, tile: &dyn TileWindow) -> Result<Mapped> {
        let edge = self.edge(tile.lattice());
        match step {
            STEP_CLUSTERS => clusters::map(tile, &self.euclidean, edge),
            STEP_CUT => stage_cut::map(tile, &self.config, edge),
            _ => objects::map(tile),
        }
    }

    fn warnings(&self, drive: &dyn DriveWindow) -> Result<Vec<String>> {
        stage_cut::warnings(drive)
    }

    fn reduce(&self, step: usize, drive: &dyn DriveWindow) -> Result<Reduced> {
        match step {
            STEP_CLUSTERS => clusters::reduce(drive, &self.euclidean, &self.config).map(Reduced::Global),
            STEP_CUT => stage_cut::reduce(drive, self.edge(drive.lattice())).map(Reduced::Global),
            2 => objects::reduce(drive).map(Reduced::Groups),
            other => Err(Error::bug(format!("{NAME} has no step {other}"))),
        }
    }
}

//! The clustering method `density-peaks`. The voxels at the foot of tall, dense columns are centres. Every
//! other voxel follows its nearest denser voxel. Clusters with smooth borders are merged.
//!
//! Source: Li, Li, Li, Yang, Liu, "A Density-Based Clustering Method for Urban Scene Mobile Laser Scanning
//! Data Segmentation", Remote Sensing 9(4), 331 (2017), doi:10.3390/rs9040331, sections 3.2 and 3.3,
//! equations 3 to 13, Table 2. It builds on Rodriguez, Laio, "Clustering by fast search and find of density
//! peaks", Science 344(6191), 1492-1496 (2014), doi:10.1126/science.1242072. "The paper" in this folder is Li
//! et al. 2017. Ours, because the paper does not say it: every tie (larger density, then lower (k, j, i);
//! nearer, then denser; nearer, then lower x, y, z), the 10 m within which ground is searched, the
//! representatives of 0.1 m, the 20 points of a curvature, the threshold `merge_below`, and the 1.5 m of
//! re-assignment.
//!
//! There are three stages, each with a barrier. `voxels`: points to voxels, components over the drive, the
//! largest count. `peaks`: densities, parents, centres, chains across tiles. `borders`, again on points: sums
//! of pairs, nearest segments of halo voxels, labels. Points are read twice. In the last two stages, a tile
//! also reads the voxels of its neighbours. Every sum is an exact integer, and densities and curvatures are
//! computed by one fixed formula from exact integers. So tiled equals untiled to the bit. If fewer than 20
//! labelled points are within 1.5 m of a representative, the tile reads further around this representative
//! only, in the worst case over the whole drive.
//!
//! Cost: O(points) for voxels and labels. The search for a parent visits columns in the order of their
//! distance and stops at the first denser voxel, which for nearly all voxels is the one below. Pairs are
//! counted only where voxels of two clusters are near each other. Of the values for the drive, a tile decodes
//! its own slice and those of its neighbours. Memory in addition to the points: about 90 bytes per voxel
//! (`BYTES_PER_POINT` is measured). Reductions keep the ends of chains, 16 bytes per voxel along the borders
//! of tiles, and the pairs of clusters, but not the voxels.
//!
//! Known failures, from the objects that lose most points (`benches/results/density-peaks-worst.md`). The
//! density of voxels that begin high above ground (set-back storeys, balconies, wires) is divided by their
//! height: they have no centre, and belong to no object if no labelled point is within `reassign`. Trees that
//! touch a facade are merged with it, because the flat wall outweighs the crown in the mean curvature. A
//! crown that is wider than the distance to the next stem is cut into the prisms above each stem, hedge and
//! lamp pole below it. A pole inside a crown takes the part of the crown around it. Cars half a metre apart
//! are one object.

mod curvature;
mod decision;
mod figures;
mod labelled_points;
mod merge;
mod settings;
mod stage_borders;
mod stage_peaks;
mod stage_voxels;
mod surroundings;

use std::ops::RangeInclusive;

pub(super) use self::figures::CHARTS;
pub use self::settings::DensityPeaksConfig;
use self::settings::{NAME, STAGE_BORDERS, STAGE_PEAKS, STAGE_VOXELS};
use super::method::{BytesPer, ClusterEntry, DriveWindow, Mapped, Method, Reduced, Repeat, Step, TileWindow};
use crate::config::{self, ConfigError};
use crate::error::{Error, Result};
use crate::model::{Lattice, Reach};

pub(super) const ENTRY: ClusterEntry = ClusterEntry {
    name: NAME,
    summary: "voxels follow the nearest denser one to the foot of an object; smooth borders merge",
    reference: "Li et al. 2017, sections 3.2 and 3.3, doi:10.3390/rs9040331",
    build: |sections| Ok(Box::new(DensityPeaks::new(&config::section(NAME, &sections(NAME))?)?)),
};

/// Bytes per point that a tile of a stage needs at its peak. `scripts/tile_memory.py` measured 17 to 48 on
/// streets, where at least half of the points are ground, and 61 to 66 in forests, where nearly all points
/// are of objects and a voxel has few of them. The stage `borders` needs most.
const BYTES_PER_POINT: u64 = 68;

/// Raised when results change and no setting does. Since 2, places decide where ids decided before.
const ALGORITHM_EPOCH: u32 = 2;

const fn stage(name: &'static str, settings: &'static [&'static str]) -> Step {
    Step { name, settings, bytes: BytesPer::Point(BYTES_PER_POINT), repeat: Repeat::Once }
}

const STAGES: [Step; 3] = [
    stage("voxels", &["density-peaks.voxel"]),
    stage(
        "peaks",
        &[
            "density-peaks.min_density",
            "density-peaks.min_separation",
            "density-peaks.most_points",
            "density-peaks.scale_above",
            "density-peaks.search_radius",
        ],
    ),
    // Without `merge_below`: its decision uses sums that do not depend on it.
    stage("borders", &["density-peaks.pair_gap_m", "density-peaks.reassign"]),
];

/// The method, see the module.
#[derive(Debug, Clone)]
pub struct DensityPeaks {
    config: DensityPeaksConfig,
}

impl DensityPeaks {
    /// The method with these settings.
    ///
    /// # Errors
    /// Those of [`DensityPeaksConfig::validate`].
    pub fn new(config: &DensityPeaksConfig) -> Result<Self, ConfigError> {
        config.validate()?;
        Ok(Self { config: config.clone() })
    }

    fn edge(&self, lattice: Lattice) -> u32 {
        u32::try_from(lattice.units(self.config.voxel)).unwrap_or(u32::MAX)
    }
}

impl Method for DensityPeaks {
    fn name(&self) -> &'static str {
        NAME
    }

    fn microseconds_per_point(&self) -> f64 {
        2.9
    }

    fn stored_bytes_per_point(&self) -> u64 {
        3
    }

    fn depends_on(&self, stage: usize) -> Vec<(&'static str, String)> {
        if stage == STAGE_BORDERS {
            vec![("algorithm epoch", ALGORITHM_EPOCH.to_string())]
        } else {
            Vec::new()
        }
    }

    /// The reach of the points of the last stage. Voxels are read from further away, but they need less
    /// memory.
    fn planning_reach(&self, _lattice: Lattice) -> Reach {
        Reach::Exact { metres: stage_borders::reach_m(&self.config) }
    }

    /// The sum of the reaches of the stages: for ground, for a denser voxel, for the denser voxel of that
    /// one, and for the points of borders. Chains of parents and merged clusters depend on voxels further
    /// away.
    fn deciding_reach_m(&self, _lattice: Lattice) -> f64 {
        let config = &self.config;
        stage_peaks::GROUND_SEARCH_M
            + 2.0 * (config.search_radius.ceil() + 1.0) * config.voxel
            + stage_borders::reach_m(config)
    }

    fn of_a_section(&self) -> Option<String> {
        (self.config.most_points == 0).then(|| {
            "density-peaks compares voxels with the fullest processed voxel, so objects of a section can \
             differ from those of the whole drive: give density-peaks.most_points (most_points_in_a_voxel in \
             report.json of the whole drive) to avoid this"
                .to_owned()
        })
    }

    fn warnings(&self, drive: &dyn DriveWindow) -> Result<Vec<String>> {
        let (given, found) = (self.config.most_points, stage_voxels::most(drive.global(STAGE_VOXELS))?);
        Ok(if given == 0 || given >= found {
            Vec::new()
        } else {
            vec![format!(
                "density-peaks.most_points = {given}, and a voxel has {found} points: give the number of the \
                 fullest voxel, or 0"
            )]
        })
    }

    /// Objects of any size, because small sets of points have already been removed as noise.
    fn object_size(&self) -> RangeInclusive<u64> {
        1..=u64::MAX
    }

    fn steps(&self) -> &[Step] {
        &STAGES
    }

    fn charts(&self) -> &'static [&'static str] {
        &CHARTS
    }

    fn map(&self, stage: usize, tile: &dyn TileWindow) -> Result<Mapped> {
        let edge = self.edge(tile.lattice());
        match stage {
            STAGE_VOXELS => stage_voxels::map(tile, edge),
            STAGE_PEAKS => stage_peaks::map(tile, &self.config, edge),
            STAGE_BORDERS => stage_borders::map(tile, &self.config, edge),
            other => Err(no_stage(other)),
        }
    }

    fn reduce(&self, stage: usize, drive: &dyn DriveWindow) -> Result<Reduced> {
        match stage {
            STAGE_VOXELS => stage_voxels::reduce(drive).map(Reduced::Global),
            STAGE_PEAKS => stage_peaks::reduce(drive).map(Reduced::Global),
            STAGE_BORDERS => merge::group(drive, &self.config).map(Reduced::Groups),
            other => Err(no_stage(other)),
        }
    }
}

fn no_stage(stage: usize) -> Error {
    Error::bug(format!("{NAME} has no stage {stage}"))
}

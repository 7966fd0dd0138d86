//! The clustering method `density-peaks`: the voxels at the foot of tall, dense columns are centres, everything else
//! follows the nearest denser voxel, and clusters whose borders are smooth are merged.
//!
//! Source: Li, Li, Li, Yang, Liu, "A density-based clustering method for urban scene mobile laser scanning data
//! segmentation" (2017), sections 3.2 and 3.3, equations 3 to 13, Table 2. Ours, where the paper is silent: every tie
//! (larger density, then lower (k, j, i); nearer, then denser; nearer, then smaller id), the 10 m within which ground is
//! looked for, representatives of 0.1 m, the 20 points of a curvature, the threshold `c_t`, the 1.5 m of re-assignment.
//!
//! Stages, each with a barrier: `voxels` (points to voxels, components of the drive, the largest count), `peaks`
//! (densities, parents, centres, chains across tiles), `borders` (points again: pair sums, nearest segments of halo
//! voxels, labels). Points are read twice. Between, a tile reads the voxels of its neighbours. Every sum is an exact
//! integer; densities and curvatures are computed by one fixed formula from exact integers. So tiled equals untiled to
//! the bit. The neighbours of a curvature are searched as far as it takes: where 20 labelled points are not within
//! 1.5 m, the tile reads further around itself for those alone, at worst the whole drive.
//!
//! Cost: O(points) for voxels and labels; a search for a parent looks at columns in the order of their distance and
//! stops at the first denser voxel, for nearly all voxels the one below; pairs are only counted where voxels of two
//! clusters are near each other. A tile decodes its own slice of what holds for the drive and those of its neighbours.
//! Memory beside the points: about 90 bytes per voxel (`BYTES_PER_POINT` is measured); reductions hold
//! the ends of chains and 16 bytes per voxel along the borders of tiles, and the pairs of clusters, not the voxels.
//!
//! Known failures, from the objects that lose most points (`benches/results/density-peaks-worst.md`): what begins high
//! above ground (set-back storeys, balconies, wires) is divided by its height, has no centre, and stays without object
//! when nothing labelled is within `reassign`; trees that touch a facade are merged with it, since the flat wall
//! outweighs the crown in the mean curvature; a crown wider than the distance to the next stem is cut into the prisms
//! above each stem, hedge and lamp pole below it, and a pole inside a crown takes that part of the crown with it; cars half
//! a metre apart are one object.

mod columns;
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

pub use self::settings::DensityPeaksConfig;
use self::settings::{NAME, STAGE_BORDERS, STAGE_PEAKS, STAGE_VOXELS};
use super::method::{BytesPer, ClusterEntry, DriveWindow, Mapped, Method, Reduced, Repeat, Step, TileWindow};
use crate::config::{self, ConfigError};
use crate::error::{Error, Result};
use crate::model::{Lattice, Reach};

pub(super) const ENTRY: ClusterEntry = ClusterEntry {
    name: NAME,
    summary: "voxels follow the nearest denser one to the foot of an object; smooth borders merge",
    reference: "Li et al. 2017, sections 3.2 and 3.3",
    build: |sections| Ok(Box::new(DensityPeaks::new(&config::section(NAME, &sections(NAME))?)?)),
};

/// Bytes per point that a tile of a stage needs at its peak. `scripts/tile_memory.py` measured 17 to 48 on streets, where
/// half of the points or more are ground, and 61 to 66 in forests, where nearly all are of objects and few to a voxel; the
/// stage `borders` is the hungriest.
const BYTES_PER_POINT: u64 = 68;

const fn stage(name: &'static str, settings: &'static [&'static str]) -> Step {
    Step { name, settings, bytes: BytesPer::Point(BYTES_PER_POINT), repeat: Repeat::Once }
}

const STAGES: [Step; 3] = [
    stage("voxels", &["density-peaks.voxel"]),
    stage(
        "peaks",
        &["density-peaks.rho_t", "density-peaks.delta_t", "density-peaks.d_t", "density-peaks.d_neighbor"],
    ),
    // Not `c_t`: it decides over sums that do not depend on it.
    stage("borders", &["density-peaks.d_th", "density-peaks.reassign"]),
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

    /// That of the points of the last stage; voxels are read further around, and matter less.
    fn planning_reach(&self, _lattice: Lattice) -> Reach {
        Reach::Exact { metres: stage_borders::reach_m(&self.config) }
    }

    /// Every object: what is small was noise.
    fn object_size(&self) -> RangeInclusive<u64> {
        1..=u64::MAX
    }

    fn steps(&self) -> &[Step] {
        &STAGES
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

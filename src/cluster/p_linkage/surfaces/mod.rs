//! The clustering method `p-linkage`: surfaces. Each point is linked to the neighbour that is flatter and has
//! the most similar normal; trees of links are slices with a robust plane; adjacent slices with similar
//! normals are merged.
//!
//! Source: Lu, Yao, Tu, Li, Li, Liu, "Pairwise linkage for point cloud segmentation", ISPRS Annals III-3,
//! 201-208 (2016), doi:10.5194/isprs-annals-III-3-201-2016, section 3, equations 4 to 11. "The paper" in this
//! folder is Lu et al. 2016. Ours: neighbours are within `reach_m`; of equally flat points, the first in the
//! order of places (x, then y, then z) counts as flatter, so that a perfectly flat floor is one surface;
//! points in one place are linked to each other; a point without a link is the root of its tree, and a centre
//! if it is flatter than mean + standard deviation; if the median deviation is 0, all points are consistent;
//! random numbers follow from the size of a slice (`slice`). Merging is transitive, and compares the planes
//! of slices before any merging. Slices are merged only if their border is near both planes too, because
//! parallel planes at different heights became one surface across a kerb (`border`). The planes of slices are
//! fitted once more (`slice`). Then surfaces contest for points, `contest_rounds` times, because narrow
//! planes such as kerbs are in pieces before (`contest`). Surfaces that agree and lie on one plane are merged
//! (`merging`). `border_score = 0`, `refit_planes = false` and `contest_rounds = 0` give the printed rules.
//!
//! All points of a slice have its label, until a contest gives them another one. The plane of a surface is
//! fitted to the points that are consistent with its slices, or to those that are consistent with its local
//! planes and away from edges (`merging`).
//!
//! Ground points belong to no object and so to no surface. With `ground.method = "none"`, every point is
//! used.
//!
//! Steps. `links`: normals, links, trees, and the planes of trees that lie in one tile. Its reduction
//! computes the mean and the deviation of flatness, and joins the trees of several tiles. `planes`: the
//! planes of these trees, each fitted by one tile. `slices`: the adjacent slices that are similar. Its
//! reduction merges them. `contest-1`, `contest-2`, ...: for each point the surface whose local plane fits it
//! best, and then the surfaces that touch and agree. Their reduction merges these, and fits planes.
//! `surfaces`: the labels of points. All steps except `planes` and `slices` read points.
//!
//! Why it is exact over tiles: a tile reads points up to three times `reach_m` around it, so it knows all
//! neighbours of the neighbours of the points to which its own may be linked. A contest also decides points
//! of other tiles within 1.42 m (or `reach_m`, if that is more) of a tile. For this it reads the points
//! within twice this distance; the tiles that own them give their surfaces before the contest, by id.
//! Coordinates relative to a point or to the corner of a cube are integers, so normals, flatness and local
//! planes are the same to the last bit wherever they are computed. Trees and pairs that cross a seam are
//! named by ids of points, and joined in the reductions. Sums over the drive and over surfaces are integers.
//!
//! Cost: O(K) per point and 69 trials per slice. Neighbours, medians and trials are loops over columns of
//! numbers, which use AVX2 if the processor has it (`spatial::vectors`), with the same results to the bit.
//! For each point, a contest adds it to sums and computes its distance from the local planes in its cube. It
//! searches K neighbours only for the few points that another plane fits better or that may touch another
//! surface. In noise, where a cube has thousands of planes, it uses the planes of K neighbours instead.
//! Memory: about 4 K bytes per point of a tile for consistent sets, and in one tile about 130 bytes per point
//! of the largest slice that crosses a seam.
//!
//! Known failures: if the distance between scan lines is larger than the length of K / 2 points along a line,
//! the nearer half of the neighbours lies on one line, and normals are arbitrary. Raise `neighbours` or thin
//! the points. Noise of the size of a neighbourhood makes slices with arbitrary normals. If points are too
//! sparse for local planes (22 per square metre), small slices round off the edges between planes. A kerb of
//! 0.12 m stays in pieces below about 2000 points per square metre at 10 mm of noise, sometimes also above,
//! and the normal of such a narrow plane is exact to 2 degrees only.

mod around;
mod border;
mod contest;
mod contested;
mod cubes;
mod known;
mod merging;
mod normals;
mod payload;
mod planes;
mod seams;
mod settings;
mod slice;
mod smallest;
mod stage_contest;
mod stage_links;
mod stage_planes;
mod stage_slices;
mod stage_surfaces;
mod trees;

use std::ops::RangeInclusive;

pub use self::settings::SurfacesConfig;
use self::settings::{CONTEST_REACHES, CONTESTS, LINKS_REACHES, NAME, STEP_LINKS, STEP_PLANES, STEP_SLICES};
use crate::cluster::method::{
    BytesPer, ClusterEntry, DriveWindow, Mapped, Method, Reduced, Repeat, Step, TileWindow,
};
use crate::config::{self, ConfigError};
use crate::error::Result;
use crate::model::{Lattice, Reach};

pub(in crate::cluster) const ENTRY: ClusterEntry = ClusterEntry {
    name: NAME,
    summary: "surfaces: points linked by flatness and normals, slices with robust planes, merged where they agree",
    reference: "Lu et al. 2016, section 3, doi:10.5194/isprs-annals-III-3-201-2016",
    build: |sections| Ok(Box::new(Surfaces::new(&config::section(NAME, &sections(NAME))?)?)),
};

/// Raised when results or payloads change and no setting does. Since 2, places decide where ids decided
/// before. Since 3, `planes` has the planes that were in `slices`.
const ALGORITHM_EPOCH: u32 = 3;

const LINKS: Step = Step {
    name: "links",
    settings: &["p-linkage.flat_m2", "p-linkage.neighbours", "p-linkage.reach_m", "p-linkage.refit_planes"],
    bytes: BytesPer::ObjectPoint(LINKS_BYTES_PER_POINT),
    repeat: Repeat::Once,
};
const PLANES: Step = Step {
    name: "planes",
    settings: &[],
    bytes: BytesPer::ObjectPoint(SLICES_BYTES_PER_POINT),
    repeat: Repeat::Once,
};
const SLICES: Step = Step {
    name: "slices",
    settings: &["p-linkage.angle_deg", "p-linkage.border_score"],
    bytes: BytesPer::ObjectPoint(SLICES_BYTES_PER_POINT),
    repeat: Repeat::Once,
};
const SURFACES: Step = Step {
    name: "surfaces",
    settings: &["p-linkage.contest_rounds"],
    bytes: BytesPer::ObjectPoint(SURFACES_BYTES_PER_POINT),
    repeat: Repeat::Once,
};

/// A contest. It depends on the settings of earlier steps only.
const fn contest(name: &'static str) -> Step {
    let bytes = BytesPer::ObjectPoint(CONTEST_BYTES_PER_POINT);
    Step { name, settings: &[], bytes, repeat: Repeat::Once }
}

/// Bytes per point of objects that a tile needs for neighbours: consistent sets of 50 points (200), normals
/// and flatness (40), places, ids and zones (21), the index (23), and lists of sets, links and trees (56).
/// Estimated from sizes.
const LINKS_BYTES_PER_POINT: u64 = 340;
/// Bytes per point of objects that a tile needs for the payloads of itself and its neighbours. Estimated from
/// sizes.
const SLICES_BYTES_PER_POINT: u64 = 40;
/// Bytes per point of objects that a tile needs for a contest: places, ids and zones (21), cubes (20), an
/// index of all points (23), surfaces before and after (8), and lists of flags and of points by tiles (20).
/// Estimated from sizes.
const CONTEST_BYTES_PER_POINT: u64 = 92;
/// Bytes per point of objects that a tile needs for labels, and for the order of places (24). Estimated from
/// sizes.
const SURFACES_BYTES_PER_POINT: u64 = 64;

/// The method, see the module.
#[derive(Debug, Clone)]
pub struct Surfaces {
    config: SurfacesConfig,
    steps: Vec<Step>,
}

impl Surfaces {
    /// The method with these settings.
    ///
    /// # Errors
    /// Those of [`SurfacesConfig::validate`].
    pub fn new(config: &SurfacesConfig) -> Result<Self, ConfigError> {
        config.validate()?;
        let contests = CONTESTS.into_iter().take(config.contest_rounds as usize).map(contest);
        let steps = [LINKS, PLANES, SLICES].into_iter().chain(contests).chain([SURFACES]).collect();
        Ok(Self { config: config.clone(), steps })
    }

    /// Distances around a tile within which the step `links` and a contest read points, in lattice units.
    fn reaches(&self, lattice: Lattice) -> [i64; 2] {
        let contest = if self.config.contest_rounds == 0 { 0 } else { self.config.contest_zone(lattice) };
        [LINKS_REACHES * self.config.reach(lattice), CONTEST_REACHES * contest]
    }
}

impl Method for Surfaces {
    fn name(&self) -> &'static str {
        NAME
    }

    fn object_size(&self) -> RangeInclusive<u64> {
        self.config.sizes()
    }

    fn steps(&self) -> &[Step] {
        &self.steps
    }

    fn finds_surfaces(&self) -> bool {
        true
    }

    fn microseconds_per_point(&self) -> f64 {
        4.8
    }

    fn stored_bytes_per_point(&self) -> u64 {
        18
    }

    fn depends_on(&self, step: usize) -> Vec<(&'static str, String)> {
        if step == STEP_LINKS { vec![("algorithm epoch", ALGORITHM_EPOCH.to_string())] } else { Vec::new() }
    }

    fn planning_reach(&self, lattice: Lattice) -> Reach {
        let [links, contest] = self.reaches(lattice);
        Reach::Exact { metres: lattice.metres(links.max(contest)) }
    }

    /// The reach of the links of a point and of all contests after them. Slices and merged surfaces depend on
    /// points further away.
    fn deciding_reach_m(&self, lattice: Lattice) -> f64 {
        let [links, contest] = self.reaches(lattice);
        lattice.metres(links + i64::from(self.config.contest_rounds) * contest)
    }

    fn of_a_section(&self) -> Option<String> {
        (self.config.flat_m2 <= 0.0).then(|| {
            "p-linkage compares points with the mean flatness of all processed points, so surfaces of a \
             section can differ from those of the whole drive: give p-linkage.flat_m2 (\"slices grow from points \
             flatter than\" in report.json of the whole drive) to avoid this"
                .to_owned()
        })
    }

    fn reach(&self, step: usize, drive: &dyn DriveWindow) -> Result<i64> {
        let [links, contest] = self.reaches(drive.lattice());
        Ok(match step {
            STEP_LINKS => links,
            STEP_PLANES | STEP_SLICES => 0,
            _ if step + 1 == self.steps.len() => 0,
            _ => contest,
        })
    }

    fn map(&self, step: usize, tile: &dyn TileWindow) -> Result<Mapped> {
        match step {
            STEP_LINKS => stage_links::map(tile, &self.config),
            STEP_PLANES => stage_planes::map(tile, &self.config),
            STEP_SLICES => stage_slices::map(tile, &self.config),
            _ if step + 1 == self.steps.len() => stage_surfaces::map(tile, step),
            _ => stage_contest::map(tile, &self.config, step),
        }
    }

    fn reduce(&self, step: usize, drive: &dyn DriveWindow) -> Result<Reduced> {
        match step {
            STEP_LINKS => stage_links::reduce(drive, &self.config).map(Reduced::Global),
            STEP_PLANES => stage_planes::reduce(drive).map(Reduced::Global),
            STEP_SLICES => stage_slices::reduce(drive, &self.config).map(Reduced::Global),
            _ if step + 1 == self.steps.len() => stage_surfaces::reduce(drive, step).map(Reduced::Groups),
            _ => stage_contest::reduce(drive, &self.config, step).map(Reduced::Global),
        }
    }
}

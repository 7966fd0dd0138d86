//! The tiles that a run would process.

use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;

use crate::config::{Config, OutputFormat};
use crate::error::Result;
use crate::input::InputFile;
use crate::run::chain::{Chain, Registries};
use crate::run::cloud;
use crate::run::computed;
use crate::run::drive::{AxisFacts, Surveyed, Tiled};
use crate::run::engine::InMemory;
use crate::run::finish::names;
use crate::run::flow::{self, Planned};
use crate::run::open::Opened;
use crate::run::plan::{self, Budget, Work, over_budget, tile_bytes};
use crate::run::summary::SectionFacts;
use crate::tiling::Plan;

/// LAS files are at least this many times as large as LAZ files with the same points. Measured on the four
/// simulated scenes: 6.6 to 7.5.
const LAS_TO_LAZ: u64 = 6;

/// One tile of a plan.
#[derive(Debug, Clone, Serialize)]
pub struct TileFacts {
    /// Chainage of its first cell in metres.
    pub from_m: f64,
    /// Chainage of its last cell in metres.
    pub to_m: f64,
    /// Whether it is inside the section. The other tiles only complete the objects of the section.
    pub inside: bool,
    /// Points it owns.
    pub points: u64,
    /// Points it reads, halo included.
    pub points_read: u64,
    /// Estimated bytes in flight.
    pub bytes: u64,
}

/// The tiles that a run would process.
#[derive(Debug, Serialize)]
pub struct PlanFacts {
    /// Tiles in order of chainage.
    pub tiles: Vec<TileFacts>,
    /// Points of the drive, or of its section.
    pub points: u64,
    /// The section that would be processed. `None` if it is the whole drive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub section: Option<SectionFacts>,
    /// Threads.
    pub threads: usize,
    /// Memory budget in bytes.
    pub memory: u64,
    /// Estimated peak of the memory of tiles in flight, in bytes.
    pub memory_needed: u64,
    /// Reach of ground and noise in metres.
    pub ground_reach_m: f64,
    /// Reach of the clustering in metres.
    pub cluster_reach_m: f64,
    /// Records that the ground pass reads, per point of the drive or of its section.
    pub read_amplification: f64,
    /// Estimate of the most bytes of state on disk during the run.
    pub state_bytes: u64,
    /// Whether labelled copies are written.
    pub copies: bool,
    /// Bytes of the copy of the points from which the cloud-optimised file is made, and which is removed
    /// afterwards. `None` if there is no such file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cloud_scratch_bytes: Option<u64>,
    /// Smallest and largest number of seconds to expect, from the speed of the survey.
    pub seconds: (f64, f64),
    /// The axis.
    pub axis: AxisFacts,
    /// Problems and unusual facts.
    pub warnings: Vec<String>,
    /// The map: tiles and axis as SVG.
    #[serde(skip)]
    pub svg: String,
}

/// Plans the tiles that a run would process, in the folder `out` if it is known: files that earlier calls
/// wrote there are not input. Changes nothing.
///
/// # Errors
/// When a file or a setting cannot be used.
pub fn plan_of(
    inputs: &[PathBuf],
    out: Option<&Path>,
    config: &Config,
    registries: &Registries<'_>,
) -> Result<PlanFacts> {
    let open = Opened::to_look(inputs, out, config, registries)?;
    let Opened { drive, chain, budget: asked, .. } = &open;
    // A plan refuses the same labelled copies as a run.
    names::copies(&drive.catalog, config, chain.method.as_ref(), chain.finds())?;
    let mut driver = InMemory { limits: asked.limits() };
    let started = Instant::now();
    let surveyed = computed(flow::survey(&open, &mut driver, None)?)?;
    let survey_s = started.elapsed().as_secs_f64();
    let budget = asked.beside(surveyed.held_bytes());
    let Planned { surveyed, plan } = computed(flow::plan(&open, &mut driver, surveyed)?)?;
    let (tiles, read) = tiles(&Tiled::whole_blocks(drive, &surveyed, &plan), chain);
    let points = plan.points_inside();
    let mut needs: Vec<u64> = tiles.iter().map(|tile| tile.bytes).collect();
    needs.sort_unstable_by(|a, b| b.cmp(a));
    let largest = needs.first().copied().unwrap_or(0);
    let in_flight: u64 = needs.iter().take(budget.threads).sum();
    let ground_points = tiles.iter().map(|tile| tile.points_read).sum();
    let cloud_scratch_bytes = match config.output.writes("copc") {
        true => Some(points * (cloud::format(&open, &surveyed)?.record_len() as u64 + 4)),
        false => None,
    };
    let seconds = work(&open, &plan, &budget, survey_s, ground_points).seconds();
    let lattice = drive.lattice();
    let svg = plan::svg(&plan, &surveyed, lattice);
    Ok(PlanFacts {
        points,
        section: SectionFacts::of(&surveyed),
        threads: budget.threads,
        memory: asked.memory,
        memory_needed: in_flight.min(budget.memory.max(largest)),
        ground_reach_m: lattice.metres(chain.ground_reach),
        cluster_reach_m: lattice.metres(chain.cluster_reach),
        read_amplification: read as f64 / points.max(1) as f64,
        state_bytes: state_bytes(&open, points),
        copies: config.output.writes("points"),
        // A record with its number.
        cloud_scratch_bytes,
        seconds: (*seconds.start(), *seconds.end()),
        axis: AxisFacts::of(&surveyed.axis),
        tiles,
        warnings: warnings(&open, &surveyed, &budget, largest),
        svg,
    })
}

/// The tiles, and the number of records that the ground pass reads for them.
fn tiles(view: &Tiled<'_>, chain: &Chain) -> (Vec<TileFacts>, u64) {
    let plan = view.plan;
    let mut read = 0;
    let facts = (0..plan.tiles.len()).map(|number| {
        let tile = &plan.tiles[number];
        let region = plan.region(number, chain.ground_reach);
        read += view.records_read(&region);
        TileFacts {
            from_m: tile.from_m,
            to_m: tile.to_m,
            inside: tile.inside,
            points: tile.points,
            points_read: region.points,
            bytes: tile_bytes(chain, plan, number),
        }
    });
    (facts.collect(), read)
}

/// The warnings of a plan whose largest tile needs `largest` bytes.
fn warnings(open: &Opened<'_>, surveyed: &Surveyed, budget: &Budget, largest: u64) -> Vec<String> {
    let Opened { drive, chain, config, .. } = open;
    let mut warnings = config.warnings().to_vec();
    warnings.extend(drive.catalog.warnings().iter().cloned());
    warnings.extend(surveyed.warnings.iter().cloned());
    if largest > budget.memory {
        warnings.push(over_budget(largest, budget));
    }
    if chain.method.reach_is_provisional() {
        warnings.push(
            "the halo of the clustering is known only after epsilon is estimated: \
             this plan uses the halo of the estimation"
                .to_owned(),
        );
    }
    warnings
}

/// Estimate of the most bytes of state on disk during a run over `points` points.
fn state_bytes(open: &Opened<'_>, points: u64) -> u64 {
    let Opened { drive, chain, config, .. } = open;
    let of_files: u64 = drive
        .catalog
        .files()
        .iter()
        .map(|file| {
            // Positions of compressed files.
            let unpacked = if file.is_compressed() { file.point_count() * 12 } else { 0 };
            // Chunks of compressed copies stay in the state until the copy is complete.
            let chunks = match becomes_laz(file, config) && config.output.writes("points") {
                true if file.is_compressed() => file.source().len(),
                true => file.source().len() / LAS_TO_LAZ,
                false => 0,
            };
            unpacked + chunks
        })
        .sum();
    // Classes of ground and noise (1 byte), labels and classes of objects (5 bytes).
    of_files + points * (6 + chain.method.stored_bytes_per_point())
}

/// Whether the copy of a file is compressed.
fn becomes_laz(file: &InputFile, config: &Config) -> bool {
    match config.output.format {
        OutputFormat::Same => file.is_compressed(),
        format => format == OutputFormat::Laz,
    }
}

/// The work of a run with this plan, if its tiles read `ground_points` for the ground filter.
fn work(open: &Opened<'_>, plan: &Plan, budget: &Budget, survey_s: f64, ground_points: u64) -> Work {
    let Opened { drive, chain, config, .. } = open;
    let points_of = |wanted: &dyn Fn(&InputFile) -> bool| {
        drive.catalog.files().iter().filter(|file| wanted(file)).map(InputFile::point_count).sum::<u64>()
    };
    let records = drive.catalog.point_count();
    // A section is copied in proportion to its share of the drive.
    let copied = |records_of: u64| {
        let points = u128::from(records_of) * u128::from(plan.points_inside()) / u128::from(records.max(1));
        if config.output.writes("points") { u64::try_from(points).unwrap_or(u64::MAX) } else { 0 }
    };
    let tiles = 0..plan.tiles.len();
    let method_points = tiles.map(|tile| plan.region_points(tile, chain.cluster_reach)).sum();
    Work {
        records,
        compressed: points_of(&InputFile::is_compressed),
        survey_s,
        threads: budget.threads,
        ground: (ground_points, chain.filter.microseconds_per_point()),
        method: (method_points, chain.method.microseconds_per_point()),
        copied: copied(records),
        copied_compressed: copied(points_of(&|file| becomes_laz(file, config))),
    }
}

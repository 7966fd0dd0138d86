//! Looking without touching: what is in a drive, and which tiles a run would work on.

use std::path::PathBuf;

use rayon::prelude::*;
use serde::Serialize;

use crate::cluster::Method;
use crate::config::Config;
use crate::error::{Error, Result};
use crate::input::{Catalog, InputOptions};
use crate::run::budget::Budget;
use crate::run::drive::Drive;
use crate::run::methods::{Chain, Registries};
use crate::run::scene::{AxisFacts, Scene};
use crate::run::street::Street;
use crate::run::tiles::Tiles;
use crate::survey::{Collector, Survey, SurveyError};

/// Points per second and thread of the whole run on the machine of `benches/results`, for the estimate of `plan`.
const POINTS_PER_SECOND: f64 = 2e6;

/// What is known of one file.
#[derive(Debug, Clone, Serialize)]
pub struct FileFacts {
    /// File name.
    pub name: String,
    /// LAS version.
    pub version: String,
    /// Point format.
    pub point_format: u8,
    /// Whether it is LAZ.
    pub compressed: bool,
    /// Whether it is COPC.
    pub copc: bool,
    /// Points.
    pub points: u64,
    /// Bytes.
    pub bytes: u64,
    /// Extra-bytes dimensions.
    pub dimensions: Vec<String>,
}

/// What is known of a drive.
#[derive(Debug, Clone, Serialize)]
pub struct DriveFacts {
    /// Its files.
    pub files: Vec<FileFacts>,
    /// Points in all.
    pub points: u64,
    /// Bytes in all.
    pub bytes: u64,
    /// Coordinate reference system, as far as known.
    pub crs: String,
    /// EPSG code, if known.
    pub epsg: Option<u32>,
    /// Smallest coordinates in metres, from the points.
    pub min_m: [f64; 3],
    /// Largest coordinates in metres, from the points.
    pub max_m: [f64; 3],
    /// First and last GPS time in seconds, from the points.
    pub gps_time_s: Option<(f64, f64)>,
    /// Occupied area in square metres.
    pub area_m2: f64,
    /// Points per occupied square metre: mean.
    pub density_mean: f64,
    /// Points per square metre in the median occupied cell.
    pub density_median: f64,
    /// Points per square metre in the densest cell.
    pub density_max: f64,
    /// The axis.
    pub axis: AxisFacts,
    /// What is wrong or unusual.
    pub warnings: Vec<String>,
}

/// One tile of a plan.
#[derive(Debug, Clone, Serialize)]
pub struct TileFacts {
    /// Chainage of its first cell in metres.
    pub from_m: f64,
    /// Chainage of its last cell in metres.
    pub to_m: f64,
    /// Points it owns.
    pub points: u64,
    /// Points it reads, halo included.
    pub points_read: u64,
    /// Estimated bytes in flight.
    pub bytes: u64,
}

/// The tiles that a run would work on.
#[derive(Debug, Serialize)]
pub struct PlanFacts {
    /// Tiles in order of chainage.
    pub tiles: Vec<TileFacts>,
    /// Points of the drive.
    pub points: u64,
    /// Threads.
    pub threads: usize,
    /// Memory budget in bytes.
    pub memory: u64,
    /// Estimated peak of memory for tiles in flight, in bytes.
    pub memory_needed: u64,
    /// Reach of ground and noise in metres.
    pub ground_reach_m: f64,
    /// Reach of the clustering in metres.
    pub cluster_reach_m: f64,
    /// Records read per point of the drive by the ground pass.
    pub read_amplification: f64,
    /// Bytes of state on disk.
    pub state_bytes: u64,
    /// Estimated seconds.
    pub seconds: f64,
    /// The axis.
    pub axis: AxisFacts,
    /// What is wrong or unusual.
    pub warnings: Vec<String>,
    /// The map: tiles and axis as SVG.
    #[serde(skip)]
    pub svg: String,
}

/// Opens the files of a drive as the configuration says.
pub(crate) fn open_catalog(inputs: &[PathBuf], config: &Config) -> Result<Catalog> {
    Ok(Catalog::open(inputs, &InputOptions { mmap: config.input.mmap, unit: config.input.unit })?)
}

/// Surveys a drive in memory, on all threads of the budget.
fn survey(drive: &Drive, threads: usize) -> Result<Survey> {
    if drive.catalog.point_count() == 0 {
        return Err(SurveyError::Empty { files: drive.catalog.files().len() }.into());
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|error| Error::bug(format!("no threads: {error}")))?;
    let runs = drive.block_runs();
    let mut survey = Survey::default();
    // In groups, so that the parts waiting to be merged stay few.
    for group in runs.chunks(4 * threads) {
        let parts: Vec<Result<_>> = pool.install(|| {
            group
                .par_iter()
                .map(|run| {
                    let mut collector = Collector::new(drive.grid);
                    let mut buffer = Vec::new();
                    for block in run.blocks.clone() {
                        drive.survey_block((run.file, block), false, &mut buffer, &mut collector)?;
                    }
                    Ok(collector.finish())
                })
                .collect()
        });
        for (run, part) in group.iter().zip(parts) {
            survey.add(run.file, part?);
        }
    }
    Ok(survey)
}

/// What is in a drive, from every point of it; changes nothing.
///
/// # Errors
/// When a file cannot be used.
pub fn look_at(inputs: &[PathBuf], config: &Config) -> Result<DriveFacts> {
    let drive = Drive::without_columns(open_catalog(inputs, config)?, config);
    let budget = Budget::resolve(&config.run);
    let scene = Scene::new(&drive, survey(&drive, budget.threads)?, config)?;
    let files: Vec<FileFacts> = drive
        .catalog
        .files()
        .iter()
        .map(|file| FileFacts {
            name: file.name().to_owned(),
            version: format!("{}.{}", file.version().0, file.version().1),
            point_format: file.layout().point_format,
            compressed: file.is_compressed(),
            copc: file.is_copc(),
            points: file.point_count(),
            bytes: file.size_bytes(),
            dimensions: file.layout().dimensions.iter().map(|dimension| dimension.name.clone()).collect(),
        })
        .collect();
    let lattice = drive.lattice();
    let (lo, hi) = scene.survey.extent.unwrap_or_default();
    let cell_m2 = lattice.metres(drive.grid.edge()).powi(2);
    let mut counts: Vec<u32> = scene.cells.iter().map(|(_, points)| points).collect();
    counts.sort_unstable();
    let density = |count: u32| f64::from(count) / cell_m2;
    let area_m2 = counts.len() as f64 * cell_m2;
    let mut warnings = drive.catalog.warnings().to_vec();
    warnings.extend(scene.warnings.iter().cloned());
    Ok(DriveFacts {
        points: scene.survey.points(),
        bytes: files.iter().map(|file| file.bytes).sum(),
        files,
        crs: drive.catalog.crs().description.clone(),
        epsg: drive.catalog.crs().epsg,
        min_m: lo.map(|value| lattice.metres(value)),
        max_m: hi.map(|value| lattice.metres(value)),
        gps_time_s: scene.survey.time,
        area_m2,
        density_mean: scene.survey.points() as f64 / area_m2,
        density_median: density(counts[counts.len() / 2]),
        density_max: density(counts[counts.len() - 1]),
        axis: AxisFacts::of(&scene.axis),
        warnings,
    })
}

/// The tiles that a run would work on; changes nothing.
///
/// # Errors
/// When a file or a setting cannot be used.
pub fn plan_of(inputs: &[PathBuf], config: &Config, registries: &Registries<'_>) -> Result<PlanFacts> {
    let drive = Drive::without_columns(open_catalog(inputs, config)?, config);
    let chain = Chain::build(config, registries, drive.lattice())?;
    let asked = Budget::resolve(&config.run);
    let scene = Scene::new(&drive, survey(&drive, asked.threads)?, config)?;
    let budget = asked.beside(scene.held_bytes());
    let (_, plan) = Street::of(&scene, &drive).fit(config, &chain, &budget);
    let view = Tiles::of(&drive, &plan, &scene);
    let mut read = 0;
    let tiles: Vec<TileFacts> = (0..plan.tiles.len())
        .map(|number| {
            let tile = &plan.tiles[number];
            let region = plan.region(number, chain.ground_reach);
            read += view.records_read(&region);
            TileFacts {
                from_m: tile.from_m,
                to_m: tile.to_m,
                points: tile.points,
                points_read: region.points,
                bytes: chain.tile_bytes(&plan, number),
            }
        })
        .collect();
    let points = scene.survey.points();
    let mut needs: Vec<u64> = tiles.iter().map(|tile| tile.bytes).collect();
    needs.sort_unstable_by(|a, b| b.cmp(a));
    let largest = needs.first().copied().unwrap_or(0);
    let in_flight: u64 = needs.iter().take(budget.threads).sum();
    let unpacked: u64 = drive
        .catalog
        .files()
        .iter()
        .filter(|file| file.is_compressed())
        .map(|file| file.point_count() * 12)
        .sum();
    let mut warnings = drive.catalog.warnings().to_vec();
    warnings.extend(scene.warnings.iter().cloned());
    if largest > budget.memory {
        warnings.push(format!(
            "a tile needs about {} MiB, the budget is {} MiB: it will be processed alone",
            largest >> 20,
            budget.memory >> 20
        ));
    }
    if matches!(&chain.method, Method::Prepared(_)) {
        warnings.push(
            "the halo of the clusters is known once the drive is: that of the estimate stands for it"
                .to_owned(),
        );
    }
    let lattice = drive.lattice();
    let svg = crate::run::map::svg(&plan, &scene, lattice);
    Ok(PlanFacts {
        points,
        threads: budget.threads,
        memory: asked.memory,
        memory_needed: in_flight.min(budget.memory.max(largest)),
        ground_reach_m: lattice.metres(chain.ground_reach),
        cluster_reach_m: lattice.metres(chain.cluster_reach),
        read_amplification: read as f64 / points.max(1) as f64,
        // Classes and labels of every point, and positions of compressed files.
        state_bytes: points * 5 + unpacked,
        seconds: points as f64 / (POINTS_PER_SECOND * budget.threads as f64),
        axis: AxisFacts::of(&scene.axis),
        tiles,
        warnings,
        svg,
    })
}

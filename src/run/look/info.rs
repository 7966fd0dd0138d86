//! Facts of a drive, computed from every point.

use std::path::PathBuf;

use serde::Serialize;

use crate::config::Config;
use crate::error::Result;
use crate::run::chain::Registries;
use crate::run::drive::AxisFacts;
use crate::run::engine::InMemory;
use crate::run::open::Opened;
use crate::run::{computed, flow};

/// Facts of one file.
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

/// Facts of a drive.
#[derive(Debug, Clone, Serialize)]
pub struct DriveFacts {
    /// Its files.
    pub files: Vec<FileFacts>,
    /// Number of points.
    pub points: u64,
    /// How many of them are withheld. The extent includes them, density and times do not.
    pub withheld: u64,
    /// Number of bytes.
    pub bytes: u64,
    /// Coordinate reference system, if known.
    pub crs: String,
    /// EPSG code, if known.
    pub epsg: Option<u32>,
    /// Metres per unit of the coordinates of the files: x, y and z.
    pub units_m: [f64; 3],
    /// Smallest coordinates in metres, from the points.
    pub min_m: [f64; 3],
    /// Largest coordinates in metres, from the points.
    pub max_m: [f64; 3],
    /// First and last GPS time in seconds, from the points.
    pub gps_time_s: Option<(f64, f64)>,
    /// Occupied area in square metres.
    pub area_m2: f64,
    /// Mean number of points per occupied square metre.
    pub density_mean: f64,
    /// Points per square metre in the median occupied cell.
    pub density_median: f64,
    /// Points per square metre in the densest cell.
    pub density_max: f64,
    /// The axis.
    pub axis: AxisFacts,
    /// Problems and unusual facts.
    pub warnings: Vec<String>,
}

/// Computes the facts of a drive from every point. Changes nothing.
///
/// # Errors
/// When a file cannot be used.
pub fn look_at(inputs: &[PathBuf], config: &Config) -> Result<DriveFacts> {
    let open = Opened::to_look(inputs, None, config, &Registries::default())?;
    let mut driver = InMemory { limits: open.budget.limits() };
    let surveyed = computed(flow::survey(&open, &mut driver, None)?)?;
    let drive = &open.drive;
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
    let (lo, hi) = surveyed.survey.extent.unwrap_or_default();
    let cell_m2 = lattice.metres(drive.grid.edge()).powi(2);
    let mut counts: Vec<u32> = surveyed.used.iter().map(|(_, points)| points).collect();
    counts.sort_unstable();
    let density = |count: u32| f64::from(count) / cell_m2;
    let area_m2 = counts.len() as f64 * cell_m2;
    let mut warnings = config.warnings().to_vec();
    warnings.extend(drive.catalog.warnings().iter().cloned());
    warnings.extend(surveyed.warnings.iter().cloned());
    Ok(DriveFacts {
        points: surveyed.survey.points(),
        withheld: surveyed.survey.withheld(),
        bytes: files.iter().map(|file| file.bytes).sum(),
        files,
        crs: drive.catalog.crs().description.clone(),
        epsg: drive.catalog.crs().epsg,
        units_m: drive.catalog.units_m(),
        min_m: lo.map(|value| lattice.metres(value)),
        max_m: hi.map(|value| lattice.metres(value)),
        gps_time_s: surveyed.survey.time,
        area_m2,
        density_mean: (surveyed.survey.points() - surveyed.survey.withheld()) as f64 / area_m2,
        density_median: density(counts[counts.len() / 2]),
        density_max: density(counts[counts.len() - 1]),
        axis: AxisFacts::of(&surveyed.axis),
        warnings,
    })
}

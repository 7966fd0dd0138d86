//! What is known of a drive before it is cut into tiles: survey, axis, occupied cells. Shared by `info`, `plan` and `run`.

use std::sync::Arc;

use serde::Serialize;

use crate::config::{AxisChoice, Config};
use crate::error::{Error, Result};
use crate::run::drive::Drive;
use crate::run::rows::Rows;
use crate::spatial::{BlockZone, PackedCells};
use crate::survey::{Axis, AxisSource, Survey, SurveyError, read_trajectory};

/// Heights of a drive fit local coordinates up to this extent in lattice units.
const HEIGHT_LIMIT_UNITS: i64 = i32::MAX as i64;
/// The owners of cells take at most this part of what their points take: neighbours have the same one, which takes 1 or 2
/// bits, while a count of points takes 8 or 16.
const OWNERS_PART: u64 = 4;

/// Survey, axis and occupied cells of a drive.
#[derive(Debug)]
pub(crate) struct Scene {
    pub(crate) survey: Survey,
    pub(crate) axis: Axis,
    /// Points of the occupied cells.
    pub(crate) cells: Arc<PackedCells>,
    pub(crate) warnings: Vec<String>,
}

impl Scene {
    /// Derives axis and cells from the survey.
    pub(crate) fn new(drive: &Drive, mut survey: Survey, config: &Config) -> Result<Self> {
        let mut warnings = Vec::new();
        check_extent(drive, &survey)?;
        let cells = Arc::new(PackedCells::from(std::mem::take(&mut survey.occupancy)));
        let axis = find_axis(drive, &survey, &cells, config, &mut warnings)?;
        if survey.bad_times > 0 {
            warnings.push(format!("{} points have no finite GPS time", survey.bad_times));
        }
        survey.time_bins.clear();
        warn_of_strays(&survey, &cells, drive.lattice().metres(drive.grid.edge()), &mut warnings);
        warn_of_header_boxes(drive, &survey, &mut warnings);
        Ok(Self { survey, axis, cells, warnings })
    }

    /// Bytes that are held for as long as the run lasts and grow with the street: what is known of its cells, with the plan,
    /// of its axis, and of its blocks.
    pub(crate) fn held_bytes(&self) -> u64 {
        let zones = self.survey.zones.iter().flatten().map(BlockZone::bytes).sum::<u64>();
        self.cells.bytes() + self.cells.bytes() / OWNERS_PART + self.axis.bytes() + zones
    }

    /// One number for the content of all files.
    pub(crate) fn content_digest(&self) -> u64 {
        let mut hasher = xxhash_rust::xxh3::Xxh3::new();
        for file in &self.survey.content {
            hasher.update(&(file.len() as u64).to_le_bytes());
            file.iter().for_each(|part| hasher.update(&part.to_le_bytes()));
        }
        hasher.digest()
    }

    /// Smallest lattice z of the drive.
    pub(crate) fn lowest(&self) -> i64 {
        self.survey.extent.map_or(0, |(lo, _)| lo[2])
    }
}

/// How far points may lie outside the boxes of the headers, in metres: less is rounding.
const BOX_TOLERANCE_M: f64 = 0.01;

/// LAZ has no checksums: damage that still decodes shows at points outside the box of the header.
fn warn_of_header_boxes(drive: &Drive, survey: &Survey, warnings: &mut Vec<String>) {
    let Some((lo, hi)) = survey.extent else { return };
    let files = drive.catalog.files().iter().filter(|file| file.point_count() > 0);
    let boxes: Vec<_> = files.map(|file| (file.header_extent(), file.units_m())).collect();
    let outermost = |end: usize, axis: usize, pick: fn(f64, f64) -> f64| {
        boxes
            .iter()
            .map(|(extent, units_m)| extent[end][axis] * units_m[axis])
            .reduce(pick)
            .unwrap_or(f64::NAN)
    };
    let beyond = (0..3)
        .map(|axis| {
            let below = outermost(0, axis, f64::min) - drive.lattice().metres(lo[axis]);
            let above = drive.lattice().metres(hi[axis]) - outermost(1, axis, f64::max);
            below.max(above)
        })
        .fold(0.0, f64::max);
    if beyond > BOX_TOLERANCE_M {
        warnings.push(format!(
            "points lie up to {beyond:.2} m outside the boxes that the headers give: a header was not kept up to \
             date, or records are damaged"
        ));
    }
}

/// Where the axis came from and how long it is, for reports.
#[derive(Debug, Clone, Serialize)]
pub struct AxisFacts {
    /// Where it came from.
    pub source: AxisSource,
    /// Its length in metres.
    pub length_m: f64,
    /// Stretches it consists of; more than one where the drive came back to a street it knew.
    pub stretches: usize,
}

impl AxisFacts {
    pub(crate) fn of(axis: &Axis) -> Self {
        Self { source: axis.source, length_m: axis.length_m(), stretches: axis.stretches().count() }
    }
}

fn check_extent(drive: &Drive, survey: &Survey) -> Result<()> {
    if let Some((lo, hi)) = survey.extent
        && hi[2] - lo[2] > HEIGHT_LIMIT_UNITS
    {
        let metres = |units| drive.lattice().metres(units);
        return Err(Error::from(SurveyError::Heights {
            lowest_m: metres(lo[2]),
            highest_m: metres(hi[2]),
            limit_m: metres(HEIGHT_LIMIT_UNITS),
        }));
    }
    Ok(())
}

fn find_axis(
    drive: &Drive,
    survey: &Survey,
    cells: &PackedCells,
    config: &Config,
    warnings: &mut Vec<String>,
) -> Result<Axis> {
    let path = &config.axis.trajectory;
    if !path.as_os_str().is_empty() {
        let units_m = drive.catalog.crs().horizontal_unit_m;
        let track = read_trajectory(path)?;
        let track: Vec<[f64; 2]> =
            track.into_iter().map(|place| place.map(|value| value * units_m)).collect();
        if let Some(axis) = Axis::from_positions(AxisSource::Trajectory, &track) {
            return Ok(axis);
        }
        warnings.push(format!("the trajectory {} does not get anywhere, not used", path.display()));
    }
    if config.axis.source != AxisChoice::Principal {
        if let Some(axis) = Axis::from_time_bins(&survey.time_bins, drive.lattice()) {
            return Ok(axis);
        }
        if config.axis.source == AxisChoice::GpsTime {
            warnings.push("GPS time gives no track, the axis is the principal axis of the points".to_owned());
        }
    }
    Ok(Axis::principal(cells, drive.grid, drive.lattice()))
}

/// Points far from all others are usually errors of the scanner or of a merge; they are processed like any other.
fn warn_of_strays(survey: &Survey, cells: &PackedCells, edge_m: f64, warnings: &mut Vec<String>) {
    let Some((lo, hi)) = survey.extent else { return };
    let mut far = 0;
    let reach = [0, 1].map(|k| {
        let rows = Rows::of(cells, k);
        let [low, high] = [0.01, 0.99].map(|share| f64::from(rows.quantile(share)) * edge_m);
        let margin = (high - low).max(100.0) * 5.0;
        (low - margin, high + margin)
    });
    for (cell, points) in cells.iter() {
        let out = (0..2).any(|k| {
            let at = f64::from(cell[k]) * edge_m;
            at < reach[k].0 || at > reach[k].1
        });
        far += if out { u64::from(points) } else { 0 };
    }
    if far > 0 {
        let extent = [0, 1].map(|k| (hi[k] - lo[k]) as f64 / 1e6);
        warnings.push(format!(
            "{far} points lie far from all others (the drive spans {:.1} x {:.1} million lattice units with them); \
             they are processed like any other",
            extent[0], extent[1]
        ));
    }
}

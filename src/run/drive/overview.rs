//! The survey, the axis and the occupied cells of a drive: what is known before the drive is divided into
//! tiles. `info`, `plan` and `run` use it.

use std::sync::Arc;

use crate::config::Config;
use crate::error::{Error, Result};
use crate::run::drive::Drive;
use crate::run::drive::Section;
use crate::run::drive::axis::find_axis;
use crate::run::drive::strays::Usual;
use crate::run::drive::warnings::{warn_of_files_apart, warn_of_header_boxes};
use crate::spatial::{BlockZone, CellMap, PackedCells};
use crate::survey::{Axis, ClockDoubt, Moment, Survey, SurveyError};
use crate::words::counted;

/// Largest extent of heights in lattice units that fits local coordinates.
const HEIGHT_LIMIT_UNITS: i64 = i32::MAX as i64;
/// The owners of cells take at most one part in this many of the memory of the points per cell. Neighbouring
/// cells mostly have the same owner, so an owner takes 1 or 2 bits. A count of points takes 8 or 16.
const OWNERS_PART: u64 = 4;

/// Survey, axis and occupied cells of a drive.
#[derive(Debug)]
pub(crate) struct Surveyed {
    pub(crate) survey: Survey,
    pub(crate) axis: Axis,
    /// Number of points of each occupied cell, withheld ones included: tiles own these as well.
    pub(crate) cells: Arc<PackedCells>,
    /// The same without withheld points.
    pub(crate) used: Arc<PackedCells>,
    /// When the recording begins and ends, and its gaps.
    pub(crate) moments: Vec<Moment>,
    /// The section that is processed; `None` if it is the whole drive.
    pub(crate) section: Option<Section>,
    pub(crate) warnings: Vec<String>,
}

impl Surveyed {
    /// Derives axis and cells from the survey. Points within `deciding` lattice units decide on an object.
    pub(crate) fn new(drive: &Drive, mut survey: Survey, config: &Config, deciding: i64) -> Result<Self> {
        let mut warnings = Vec::new();
        check_extent(drive, &survey)?;
        let withheld = survey.withheld();
        if withheld > 0 && withheld == survey.points() {
            return Err(SurveyError::Withheld { points: withheld }.into());
        }
        let cells = Arc::new(PackedCells::from(std::mem::take(&mut survey.occupancy)));
        let used = used_cells(&cells, std::mem::take(&mut survey.withheld_by_cell));
        let usual = Usual::of(drive, &used);
        let axis = find_axis(drive, &survey, (&used, &usual), config, &mut warnings)?;
        if withheld > 0 {
            let (points, verb) = (counted(withheld, "point"), if withheld == 1 { "is" } else { "are" });
            warnings.push(format!(
                "{points} {verb} withheld (the flag of LAS for points that are not to be processed) and left out: neither \
                 ground nor part of an object"
            ));
        }
        if survey.bad_times > 0 {
            let times = counted(survey.bad_times, "point");
            let verb = if survey.bad_times == 1 { "has" } else { "have" };
            warnings.push(format!("{times} {verb} no usable GPS time: it is not finite, or beyond 1e15 s"));
        }
        // Times that are not seconds say nothing about profiles.
        let moments = match ClockDoubt::of(&survey, drive.lattice()) {
            None => Moment::of(&survey.time_bins, drive.lattice()),
            Some(_) => Vec::new(),
        };
        survey.time_bins.clear();
        usual.warn(drive, &survey, &used, &axis, &mut warnings);
        warn_of_header_boxes(drive, &survey, &mut warnings);
        warn_of_files_apart(drive, &mut warnings);
        let (grid, lattice) = (drive.grid, drive.lattice());
        let section = Section::chosen(&config.tiling, &axis, &cells, grid, lattice, deciding)?;
        Ok(Self { survey, axis, cells, used, moments, section, warnings })
    }

    /// Number of points of each processed cell.
    pub(crate) fn processed(&self) -> &Arc<PackedCells> {
        self.section.as_ref().map_or(&self.cells, |section| &section.cells)
    }

    /// Where the processed section begins and ends, as metres of chainage; `None` for the whole drive.
    pub(crate) fn section_m(&self) -> Option<(f64, f64)> {
        self.section.as_ref().map(|section| (section.from_m, section.to_m))
    }

    /// Whether the cells at each vertex of the axis are inside the section; `None` for the whole drive.
    pub(crate) fn inside(&self) -> Option<&[bool]> {
        self.section.as_ref().map(|section| &section.inside[..])
    }

    /// Bytes that are in use during the whole run and grow with the length of the drive: its cells with the
    /// plan, its axis, and its blocks.
    pub(crate) fn held_bytes(&self) -> u64 {
        let zones = self.survey.zones.iter().flatten().map(BlockZone::bytes).sum::<u64>();
        let used = if Arc::ptr_eq(&self.cells, &self.used) { 0 } else { self.used.bytes() };
        self.cells.bytes() + used + self.cells.bytes() / OWNERS_PART + self.axis.bytes() + zones
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

    /// Smallest and largest lattice coordinates of the drive.
    pub(crate) fn extent(&self) -> ([i64; 3], [i64; 3]) {
        self.survey.extent.unwrap_or_default()
    }

    /// Smallest lattice z of the drive.
    pub(crate) fn lowest(&self) -> i64 {
        self.extent().0[2]
    }
}

/// The occupied cells without withheld points, which are given by cell.
fn used_cells(cells: &Arc<PackedCells>, withheld: CellMap<u32>) -> Arc<PackedCells> {
    let withheld = PackedCells::from(withheld);
    if withheld.is_empty() {
        return Arc::clone(cells);
    }
    let mut without = withheld.cursor();
    let mut used = CellMap::default();
    for (cell, points) in cells.iter() {
        let points = points.saturating_sub(without.get(cell));
        if points > 0 {
            *used.entry(cell) = points;
        }
    }
    Arc::new(PackedCells::from(used))
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

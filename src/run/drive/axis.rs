//! Selects the axis: from a trajectory, from GPS time, or from the points.

use std::path::Path;

use serde::Serialize;

use crate::config::{AxisChoice, Config};
use crate::error::Result;
use crate::run::drive::Drive;
use crate::run::drive::strays::Usual;
use crate::spatial::PackedCells;
use crate::survey::{Axis, AxisSource, ClockDoubt, Survey, SurveyError, read_trajectory};

/// The source and the length of the axis, for reports.
#[derive(Debug, Clone, Serialize)]
pub struct AxisFacts {
    /// Its source.
    pub source: AxisSource,
    /// Its length in metres.
    pub length_m: f64,
    /// Number of its stretches. More than one if the drive returned to a street.
    pub stretches: usize,
}

impl AxisFacts {
    pub(crate) fn of(axis: &Axis) -> Self {
        Self { source: axis.source, length_m: axis.length_m(), stretches: axis.stretches().count() }
    }
}

/// Distance between the box around a trajectory and the box around the points, in metres, above which the two
/// do not belong together. Scanners reach some hundred metres.
const ELSEWHERE_M: f64 = 1_000.0;

/// Refuses a trajectory that is in another coordinate system, or of another drive.
fn check_near(path: &Path, track: &[[f64; 2]], drive: &Drive, survey: &Survey) -> Result<()> {
    let Some((low, high)) = survey.extent else { return Ok(()) };
    let apart = |axis: usize| {
        let values = || track.iter().map(|place| place[axis]);
        let (least, most) =
            (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        let metres = |units: i64| drive.lattice().metres(units);
        (least - metres(high[axis])).max(metres(low[axis]) - most).max(0.0)
    };
    let metres = apart(0).hypot(apart(1));
    if metres > ELSEWHERE_M {
        return Err(SurveyError::Elsewhere { path: path.to_owned(), kilometres: metres / 1_000.0 }.into());
    }
    Ok(())
}

/// The axis of a drive according to the settings.
pub(super) fn find_axis(
    drive: &Drive,
    survey: &Survey,
    (cells, usual): (&PackedCells, &Usual),
    config: &Config,
    warnings: &mut Vec<String>,
) -> Result<Axis> {
    let path = &config.axis.trajectory;
    if !path.as_os_str().is_empty() {
        let [unit_m, ..] = drive.catalog.units_m();
        let runs = read_trajectory(path, unit_m)?;
        check_near(path, &runs.concat(), drive, survey)?;
        if let Some(axis) = Axis::from_runs(AxisSource::Trajectory, runs) {
            return Ok(axis);
        }
        warnings.push(format!("the trajectory {} has no length: it is not used", path.display()));
    }
    if config.axis.source != AxisChoice::Principal {
        if let Some(doubt) = ClockDoubt::of(survey, drive.lattice()) {
            warnings.push(format!(
                "{doubt}; the axis is the principal axis of the points (--trajectory gives the driven one)"
            ));
            return Ok(principal(drive, cells, usual));
        }
        if let Some(axis) = Axis::from_time_bins(&survey.time_bins, drive.lattice()) {
            return Ok(axis);
        }
        if config.axis.source == AxisChoice::GpsTime {
            warnings.push("GPS time gives no track: the axis is the principal axis of the points".to_owned());
        }
    }
    Ok(principal(drive, cells, usual))
}

/// The principal axis of the cells. Those far from all others would turn it.
fn principal(drive: &Drive, cells: &PackedCells, usual: &Usual) -> Axis {
    let near = usual.without_far(cells);
    Axis::principal(near.as_ref().unwrap_or(cells), drive.grid, drive.lattice())
}

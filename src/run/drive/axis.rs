//! Which axis is taken: that of a trajectory, of GPS time, or of the points.

use serde::Serialize;

use crate::config::{AxisChoice, Config};
use crate::error::Result;
use crate::run::drive::Drive;
use crate::spatial::PackedCells;
use crate::survey::{Axis, AxisSource, Survey, read_trajectory};

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

/// The axis of a drive, as the settings ask for it.
pub(super) fn find_axis(
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

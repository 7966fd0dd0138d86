//! The origin and the units of the coordinates of the page.

use crate::input::unit_symbol;
use crate::output::report::{PageCloud, PageFrame};
use crate::run::drive::{Drive, Surveyed};
use crate::run::finish::names::CLOUD;

/// Origin of the coordinates of the page, on the lattice: the start of the axis and the height of the lowest
/// point. Not a corner of the points, because stray points can be far from everything.
pub(super) fn origin(drive: &Drive, surveyed: &Surveyed) -> [i64; 3] {
    let start = surveyed.axis.vertices().first().copied().unwrap_or_default();
    let [x, y] = start.map(|metres| drive.lattice().units(metres.round()));
    [x, y, surveyed.lowest()]
}

/// The frame of the page.
pub(super) fn frame(drive: &Drive, surveyed: &Surveyed) -> PageFrame {
    let origin = origin(drive, surveyed);
    let [unit_m, ..] = drive.catalog.units_m();
    PageFrame {
        origin_m: [origin[0], origin[1]].map(|units| drive.lattice().metres(units)),
        units_m: [unit_m; 2],
    }
}

/// The cloud-optimised file in the frame of the page.
pub(super) fn cloud(drive: &Drive, surveyed: &Surveyed) -> PageCloud {
    let origin_m = origin(drive, surveyed).map(|units| drive.lattice().metres(units));
    PageCloud { file: CLOUD, origin_m, units_m: drive.catalog.units_m() }
}

/// The units of the coordinates of the input in the plane, and of its heights, as a person reads them.
pub(super) fn unit_names(drive: &Drive) -> [String; 2] {
    let [plan_m, _, height_m] = drive.catalog.units_m();
    [plan_m, height_m].map(unit_symbol)
}

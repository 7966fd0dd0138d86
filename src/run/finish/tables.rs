//! The tables of objects, and charts for the choice of thresholds.

use std::io::{self, Write};
use std::path::Path;

use crate::config::Config;
use crate::error::{Error, Result};
use crate::inventory::{self, SurfaceRow};
use crate::model::{Chart, in_u32};
use crate::output::objects::{self, DriveShape, ObjectFormatEntry, ObjectRow, ObjectTable, TileShape};
use crate::output::report::PageTable;
use crate::output::{OutputError, chart_svg};
use crate::run::drive::{Drive, Surveyed};
use crate::run::finish::frame::frame;
use crate::run::finish::names::{self, PAGE, page_limit_bytes};
use crate::run::passes::inventory::Inventory;
use crate::run::passes::stitch::Objects;
use crate::store::{RunDir, StoreError};
use crate::tiling::Plan;
use crate::whole_file::write_from;

/// Writes the table of objects in the formats of the settings, and the table of surfaces if the method finds
/// surfaces. Returns the table of objects for the page, if the page is written.
pub(crate) fn write_tables(
    run_dir: &RunDir,
    drive: &Drive,
    surveyed: &Surveyed,
    plan: &Plan,
    whole: &Objects,
    rows: &Inventory,
    config: &Config,
) -> Result<Option<PageTable>> {
    let row = |index: usize| {
        let row = rows.row(index).map_err(io::Error::other)?;
        Ok(ObjectRow { outline: row.outline, heights: Vec::new(), base: row.base, values: row.values })
    };
    let columns = inventory::columns();
    let shape = shape(drive, surveyed, plan);
    let table = ObjectTable { columns: &columns, drive: &shape, len: rows.len(), row: &row };
    write_formats(run_dir, objects::REGISTRY, &table, config)?;
    if whole.surfaces {
        let row = |index: usize| {
            let SurfaceRow { outline, centre, values } = rows.surface(index).map_err(io::Error::other)?;
            let heights = outline.iter().map(|place| place[2]).collect();
            let outline = outline.into_iter().map(|[x, y, _]| [x, y]).collect();
            Ok(ObjectRow { outline, heights, base: centre, values })
        };
        let columns = inventory::SURFACE_COLUMNS;
        let table = ObjectTable { columns, drive: &shape, len: rows.surfaces(), row: &row };
        write_formats(run_dir, objects::SURFACES, &table, config)?;
    }
    let points = |index: usize| whole.objects[index].points;
    let frame = frame(drive, surveyed);
    let spill = || rows.spill().map_err(io::Error::other);
    let for_page = page_limit_bytes(config)
        .map(|limit| PageTable::of(&table, &points, frame, limit, &spill))
        .transpose();
    let path = run_dir.out().join(PAGE);
    for_page.map_err(|source| OutputError::Write { path, source }.into())
}

/// Writes a table in the formats of the settings.
fn write_formats(
    run_dir: &RunDir,
    formats: &[ObjectFormatEntry],
    table: &ObjectTable<'_>,
    config: &Config,
) -> Result<()> {
    for entry in formats.iter().filter(|entry| config.output.writes(entry.name())) {
        write_output(run_dir, entry.file_name, |part| entry.format.write(table, part))?;
    }
    Ok(())
}

/// Vertices of the axis that are nearer to an end of a section, in metres of chainage, are this end: chainage
/// is a sum of steps. Files have coordinates to a millimetre.
const SAME_M: f64 = 1e-3;

/// A vertex of the axis in metres, and its chainage.
type Placed = ([f64; 2], f64);

/// The axis and the tiles in the units of the input.
fn shape<'a>(drive: &'a Drive, surveyed: &Surveyed, plan: &Plan) -> DriveShape<'a> {
    let crs = drive.catalog.crs();
    let units_m = drive.catalog.units_m();
    let [unit_m, ..] = units_m;
    let in_units = |(place, chainage_m): Placed| [place[0] / unit_m, place[1] / unit_m, chainage_m];
    let axis = processed_stretches(surveyed)
        .into_iter()
        .map(|stretch| stretch.into_iter().map(in_units).collect())
        .collect();
    let edge = drive.grid.edge();
    let corner = |corner: [i64; 2]| corner.map(|index| drive.lattice().metres(index * edge) / unit_m);
    let tiles = plan
        .tiles
        .iter()
        .enumerate()
        .filter(|(_, tile)| tile.inside)
        .map(|(number, tile)| TileShape {
            number: in_u32(number, "tiles"),
            chainage_m: [tile.from_m, tile.to_m],
            points: tile.points,
            outline: inventory::around_cells(&plan.core(number)).into_iter().map(corner).collect(),
        })
        .collect();
    DriveShape { epsg: crs.epsg, wkt: crs.text(), wkt_epsg: crs.text_epsg(), units_m, axis, tiles }
}

/// The stretches of the axis that are processed, from end to end of a section.
pub(super) fn processed_stretches(surveyed: &Surveyed) -> Vec<Vec<Placed>> {
    let mut chainage = surveyed.axis.chainage_m().iter().copied();
    let stretches = surveyed.axis.stretches().map(|stretch| {
        let placed: Vec<Placed> = stretch.iter().copied().zip(chainage.by_ref()).collect();
        match surveyed.section_m() {
            Some(section_m) => within(&placed, section_m),
            None => placed,
        }
    });
    stretches.filter(|stretch| !stretch.is_empty()).collect()
}

/// The part of a stretch between two chainages; empty if it has no length.
fn within(stretch: &[Placed], (from_m, to_m): (f64, f64)) -> Vec<Placed> {
    let (Some(first), Some(last)) = (stretch.first(), stretch.last()) else { return Vec::new() };
    let (from_m, to_m) = (from_m.max(first.1), to_m.min(last.1));
    if to_m - from_m < SAME_M {
        return Vec::new();
    }
    let between =
        stretch.iter().filter(|vertex| vertex.1 - from_m >= SAME_M && to_m - vertex.1 >= SAME_M).copied();
    std::iter::once(at(stretch, from_m)).chain(between).chain([at(stretch, to_m)]).collect()
}

/// The place at a chainage of the stretch.
fn at(stretch: &[Placed], chainage_m: f64) -> Placed {
    let next = stretch.partition_point(|vertex| vertex.1 < chainage_m).clamp(1, stretch.len() - 1);
    let (a, b) = (stretch[next - 1], stretch[next]);
    let [before, after] = [chainage_m - a.1, b.1 - chainage_m];
    if before.min(after) < SAME_M {
        return if before < after { a } else { b };
    }
    let share = before / (before + after);
    ([0, 1].map(|axis| a.0[axis] + share * (b.0[axis] - a.0[axis])), chainage_m)
}

/// Writes every chart as `NAME.svg` if the settings ask for charts, and returns the names of the files.
pub(crate) fn write_charts(run_dir: &RunDir, charts: &[Chart], config: &Config) -> Result<Vec<String>> {
    let charts = if config.output.writes("charts") { charts } else { &[] };
    let names: Vec<String> = charts.iter().map(|chart| names::chart(&chart.name)).collect();
    let ours = run_dir.own_outputs()?;
    for name in names.iter().filter(|name| !ours.contains(name)) {
        let path = run_dir.out().join(name);
        if path.exists() {
            return Err(StoreError::InTheWay { path }.into());
        }
    }
    run_dir.claim_outputs(&names)?;
    for (chart, name) in charts.iter().zip(&names) {
        let svg = chart_svg(chart).map_err(|error| Error::bug(error.to_string()))?;
        write_whole(run_dir, name, |out| out.write_all(svg.as_bytes()))?;
    }
    Ok(names)
}

/// Writes an output file. It gets its final name when it is complete.
pub(super) fn write_whole(
    run_dir: &RunDir,
    name: &str,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), OutputError> {
    write_output(run_dir, name, |part| {
        let mut out = io::BufWriter::new(fs_err::File::create(part)?);
        write(&mut out)?;
        out.flush()
    })
}

/// Lets `write` create an output file in the state directory, and gives it its final name when it is
/// complete.
fn write_output(
    run_dir: &RunDir,
    name: &str,
    write: impl FnOnce(&Path) -> io::Result<()>,
) -> Result<(), OutputError> {
    let path = run_dir.out().join(name);
    let part = run_dir.path(&format!("{name}.part"));
    write_from(&part, &path, write).map_err(|source| OutputError::Write { path, source })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// To the east from chainage 100 to 103, and then to the north, to 103.5.
    const STRETCH: [Placed; 5] = [
        ([10.0, 5.0], 100.0),
        ([11.0, 5.0], 101.0),
        ([12.0, 5.0], 102.0),
        ([13.0, 5.0], 103.0),
        ([13.0, 5.5], 103.5),
    ];

    fn assert_is(section_m: (f64, f64), expected: &[Placed]) {
        let found = within(&STRETCH, section_m);
        let far = |(a, b): (&Placed, &Placed)| {
            (a.1 - b.1).abs() > 1e-9 || (0..2).any(|axis| (a.0[axis] - b.0[axis]).abs() > 1e-9)
        };
        let differ = found.len() != expected.len() || found.iter().zip(expected).any(far);
        assert!(!differ, "{section_m:?}: {found:?}, not {expected:?}");
    }

    #[test]
    fn the_axis_of_a_section_ends_where_the_section_ends() {
        let [_, _, third, fourth, _] = STRETCH;
        assert_is((101.25, 103.25), &[([11.25, 5.0], 101.25), third, fourth, ([13.0, 5.25], 103.25)]);
        // Between two vertices.
        assert_is((101.2, 101.8), &[([11.2, 5.0], 101.2), ([11.8, 5.0], 101.8)]);
        // It ends where the stretch ends, and not beyond.
        assert_is((102.5, f64::INFINITY), &[([12.5, 5.0], 102.5), fourth, STRETCH[4]]);
        assert_is((0.0, 1e4), &STRETCH);
        // A section that only touches the stretch, or is beside it, has nothing of it.
        for section_m in [(0.0, 100.0), (103.5, 110.0), (0.0, 50.0), (200.0, 300.0)] {
            assert_is(section_m, &[]);
        }
        assert!(within(&STRETCH[..1], (0.0, 1e4)).is_empty() && within(&[], (0.0, 1e4)).is_empty());
    }

    #[test]
    fn a_vertex_at_an_end_of_a_section_is_this_end() {
        for tiny in [-1e-9, 0.0, 1e-9] {
            assert_eq!(within(&STRETCH, (101.0 + tiny, 103.0 - tiny)), STRETCH[1..4], "{tiny}");
        }
    }
}

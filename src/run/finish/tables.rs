//! The tables of objects, and charts for the choice of thresholds.

use std::io::Write;
use std::path::Path;

use crate::config::Config;
use crate::error::{Error, Result};
use crate::inventory::{self, Object, Site, Station, Terrain};
use crate::model::{Chart, in_u32};
use crate::output::objects::{self, ObjectRow, ObjectTable};
use crate::output::report::PageTable;
use crate::output::{OutputError, chart_svg};
use crate::run::drive::{Drive, Surveyed};
use crate::run::finish::frame::frame;
use crate::run::finish::names::page_limit_bytes;
use crate::run::passes::stitch::Objects;
use crate::store::{RunDir, StoreError};
use crate::whole_file::publish;

/// Writes the table of objects in the formats of the settings. Returns it for the page, if that is written.
pub(crate) fn write_tables(
    run_dir: &RunDir,
    drive: &Drive,
    surveyed: &Surveyed,
    whole: &Objects,
    terrain: &Terrain,
    config: &Config,
) -> Result<Option<PageTable>> {
    let crs = drive.catalog.crs();
    let file_names: Vec<&str> = drive.catalog.files().iter().map(|file| file.name()).collect();
    let locate = |place| {
        let (chainage_m, offset_m) = surveyed.axis.locate(place);
        Station { chainage_m, offset_m }
    };
    let site = Site {
        lattice: drive.lattice(),
        units_m: [crs.horizontal_unit_m, crs.horizontal_unit_m, crs.vertical_unit_m],
        terrain,
        locate: &locate,
        file_names: &file_names,
    };
    let row = |index: usize| {
        let id = in_u32(index + 1, "objects");
        let kind = whole.kinds.get(index).copied().unwrap_or_default();
        let object = Object::new(id, &whole.objects[index], &site).of_kind(kind);
        ObjectRow { outline: inventory::outline(&object), values: inventory::values(&object) }
    };
    let columns = inventory::columns();
    let len = whole.objects.len();
    let table = ObjectTable { columns: &columns, epsg: crs.epsg, len, row: &row };
    for entry in objects::REGISTRY.iter().filter(|entry| config.output.writes(entry.name())) {
        let name = entry.file_name;
        write_whole(run_dir, name, |out| {
            let failed = |source| OutputError::Write { path: name.into(), source };
            entry.format.write(&table, out).map_err(failed)
        })?;
    }
    let points = |index: usize| whole.objects[index].points;
    let frame = frame(drive, surveyed);
    let for_page =
        page_limit_bytes(config).map(|limit| PageTable::of(&table, &points, frame, limit)).transpose();
    for_page.map_err(|error| Error::bug(error.to_string()))
}

/// Writes every chart as `NAME.svg`, and removes the charts of an earlier call with another method.
pub(crate) fn write_charts(run_dir: &RunDir, charts: &[Chart]) -> Result<()> {
    let names: Vec<String> = charts.iter().map(|chart| format!("{}.svg", chart.name)).collect();
    for name in run_dir.own_outputs()?.iter().filter(|name| name.ends_with(".svg") && !names.contains(name)) {
        let path = run_dir.out().join(name);
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(OutputError::Write { path, source: error }.into());
            }
            _ => {}
        }
    }
    let ours = run_dir.own_outputs()?;
    for name in names.iter().filter(|name| !ours.contains(name)) {
        let path = run_dir.out().join(name);
        if path.exists() {
            return Err(StoreError::InTheWay { path }.into());
        }
    }
    run_dir.claim_outputs(&names)?;
    for chart in charts {
        let svg = chart_svg(chart).map_err(|error| Error::bug(error.to_string()))?;
        let name = format!("{}.svg", chart.name);
        write_whole(run_dir, &name, |out| {
            let path = run_dir.out().join(&name);
            out.write_all(svg.as_bytes()).map_err(|source| OutputError::Write { path, source })
        })?;
    }
    Ok(())
}

/// Writes an output file. It gets its final name when it is complete.
pub(super) fn write_whole(
    run_dir: &RunDir,
    name: &str,
    write: impl FnOnce(&mut dyn Write) -> Result<(), OutputError>,
) -> Result<(), OutputError> {
    let path = run_dir.out().join(name);
    let part = run_dir.path(&format!("{name}.part"));
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |source| OutputError::Write { path, source }
    };
    let mut out = std::io::BufWriter::new(std::fs::File::create(&part).map_err(failed(&part))?);
    write(&mut out)?;
    let file = out.into_inner().map_err(|error| failed(&part)(error.into_error()))?;
    file.sync_all().map_err(failed(&part))?;
    publish(&part, &path).map_err(failed(&path))
}

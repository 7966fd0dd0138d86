//! The end of a run: object table, report, and the mark that says that everything is there.

use std::io::Write;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::config::{ClassificationChoice, Config, ConfigError};
use crate::error::{Error, Result};
use crate::input::Catalog;
use crate::inventory::{self, Object, Site, Station, Terrain, TerrainSums};
use crate::model::{Chart, Lattice};
use crate::output::objects::{self, ObjectRow, ObjectTable};
use crate::output::{LabelOptions, LabelledFile, OutputError, OutputFormat, chart_svg, check_names};
use crate::run::RunSummary;
use crate::run::drive::Drive;
use crate::run::ground_pass::GroundPayload;
use crate::run::scene::{AxisFacts, Scene};
use crate::spatial::CellGrid;
use crate::stitch::Stitched;
use crate::store::{PassDir, RunDir, StoreError};
use crate::whole_file::publish;

/// Points of a drive by class.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Neither ground nor noise.
    pub object: u64,
    /// Ground.
    pub ground: u64,
    /// Isolated noise near or below the ground.
    pub low_noise: u64,
    /// Isolated noise high above.
    pub high_noise: u64,
}

/// The labelled copies to be written: names do not collide, and nothing foreign is in the place of any output.
pub(crate) fn plan_files(
    catalog: &Catalog,
    config: &Config,
    run_dir: &RunDir,
) -> Result<(Vec<LabelledFile>, Vec<String>)> {
    let name = &config.output.format;
    let format: OutputFormat = toml::Value::String(name.clone())
        .try_into()
        .map_err(|_| ConfigError::value("output.format", name, "same, las or laz"))?;
    let options = LabelOptions {
        format,
        dimension: config.output.dimension.clone(),
        set_classification: config.output.classification == ClassificationChoice::Set,
        keep_original: config.output.original_classification,
    };
    let ours = run_dir.own_outputs()?;
    let mut files: Vec<LabelledFile> = Vec::new();
    let mut warnings = Vec::new();
    for file in catalog.files() {
        let labelled = LabelledFile::plan(file, &options)?;
        warnings.extend(labelled.warnings().iter().cloned());
        files.push(labelled);
    }
    check_names(&files)?;
    let names: Vec<String> = files.iter().map(LabelledFile::name).chain(BESIDE).map(str::to_owned).collect();
    for name in names.iter().filter(|name| !ours.contains(name)) {
        let path = run_dir.out().join(name);
        if path.exists() {
            return Err(StoreError::InTheWay { path }.into());
        }
    }
    run_dir.claim_outputs(&names)?;
    Ok((files, warnings))
}

/// Points by class and the terrain, from the payloads of the ground pass; `lowest` is the smallest lattice z of the drive.
pub(crate) fn counts_and_terrain(
    payloads: impl Iterator<Item = Result<GroundPayload>>,
    grid: CellGrid,
    lattice: Lattice,
    lowest: i64,
) -> Result<(Counts, Terrain)> {
    let mut counts = [0; 4];
    let mut terrain = TerrainSums::new(grid, lattice, lowest);
    for payload in payloads {
        let payload = payload?;
        for (total, count) in counts.iter_mut().zip(payload.counts) {
            *total += count;
        }
        for (cell, points, sum) in payload.heights {
            terrain.add(cell, points, sum);
        }
    }
    let [object, ground, low_noise, high_noise] = counts;
    Ok((Counts { object, ground, low_noise, high_noise }, terrain.into_terrain()))
}

/// Writes the table of objects in every format.
pub(crate) fn write_tables(
    run_dir: &RunDir,
    drive: &Drive,
    scene: &Scene,
    stitched: &Stitched,
    terrain: &Terrain,
) -> Result<()> {
    let crs = drive.catalog.crs();
    let file_names: Vec<&str> = drive.catalog.files().iter().map(|file| file.name()).collect();
    let locate = |place| {
        let (chainage_m, offset_m) = scene.axis.locate(place);
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
        // There are no more objects than ids.
        let id = u32::try_from(index + 1).unwrap_or(u32::MAX);
        let object = Object::new(id, &stitched.objects[index], &site);
        ObjectRow { outline: inventory::outline(&object), values: inventory::values(&object) }
    };
    let (columns, len) = (inventory::columns(), stitched.objects.len());
    let table = ObjectTable { columns: &columns, epsg: crs.epsg, len, row: &row };
    for entry in objects::REGISTRY {
        let name = entry.file_name;
        write_whole(run_dir, name, |out| {
            let failed = |source| OutputError::Write { path: name.into(), source };
            entry.format.write(&table, out).map_err(failed)
        })?;
    }
    Ok(())
}

/// Writes every chart as `NAME.svg`, and removes those that an earlier call with another method left.
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

/// Writes a file of the output under its final name when it is complete.
fn write_whole(
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

const FINISHED: &str = "finished.json";

/// What a finished run left.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Finished {
    pub(crate) objects: usize,
    /// Names of the labelled copies.
    pub(crate) files: Vec<String>,
}

#[derive(Debug, Serialize, Deserialize)]
struct Mark {
    fingerprint: String,
    objects: usize,
    files: Vec<String>,
    /// Bytes of each file, so that one that was cut or replaced is noticed.
    bytes: Vec<u64>,
}

/// What an earlier call finished under the same fingerprint, if all of it is still there.
pub(crate) fn already_finished(run_dir: &RunDir, export: &PassDir) -> Result<Option<Finished>> {
    let Some(mark) = run_dir.read_json::<Mark>(FINISHED)? else { return Ok(None) };
    let names = mark.files.iter().map(String::as_str).chain(BESIDE);
    let size = |name: &str| fs_err::metadata(run_dir.out().join(name)).map(|facts| facts.len()).ok();
    let whole = names.zip(&mark.bytes).all(|(name, &bytes)| size(name) == Some(bytes));
    let same = mark.fingerprint == export.fingerprint().to_string();
    Ok((same && whole).then_some(Finished { objects: mark.objects, files: mark.files }))
}

const REPORT: &str = "report.json";
/// What a finished run leaves beside the labelled copies.
const BESIDE: [&str; objects::REGISTRY.len() + 1] = {
    let mut names = [REPORT; objects::REGISTRY.len() + 1];
    let mut index = 0;
    while index < objects::REGISTRY.len() {
        names[index] = objects::REGISTRY[index].file_name;
        index += 1;
    }
    names
};

/// Takes the mark back before outputs are written anew. Units of the export whose files have already been named
/// have nothing left to resume from, so they go too.
pub(crate) fn withdraw(run_dir: &RunDir, export: &PassDir) -> Result<()> {
    if run_dir.read_json::<Mark>(FINISHED)?.is_some() {
        export.clear()?;
        let path = run_dir.path(FINISHED);
        fs_err::remove_file(&path).map_err(StoreError::io("remove", &path))?;
    }
    Ok(())
}

/// Marks the run, whose last output has been written, as finished and removes what only an unfinished export needs.
pub(crate) fn mark_finished(run_dir: &RunDir, export: &PassDir, finished: &Finished) -> Result<()> {
    let mut bytes = Vec::new();
    for name in finished.files.iter().map(String::as_str).chain(BESIDE) {
        let path = run_dir.out().join(name);
        bytes.push(fs_err::metadata(&path).map_err(StoreError::io("read", &path))?.len());
    }
    let fingerprint = export.fingerprint().to_string();
    let (objects, files) = (finished.objects, finished.files.clone());
    run_dir.write_json(FINISHED, &Mark { fingerprint, objects, files, bytes })?;
    export.clear()?;
    let folder = run_dir.path("export");
    fs_err::remove_dir_all(&folder).map_err(StoreError::io("remove", &folder))?;
    Ok(())
}

/// Writes `report.json`: configuration, figures, times, warnings.
pub(crate) fn write_report(
    run_dir: &RunDir,
    drive: &Drive,
    config: &Config,
    scene: &Scene,
    summary: &RunSummary,
) -> Result<()> {
    let files: Vec<_> = drive
        .catalog
        .files()
        .iter()
        .map(|file| json!({ "name": file.name(), "points": file.point_count(), "bytes": file.size_bytes() }))
        .collect();
    let report = json!({
        "program": format!("chainage {}", env!("CARGO_PKG_VERSION")),
        "input": files,
        "crs": { "description": drive.catalog.crs().description, "epsg": drive.catalog.crs().epsg },
        "lattice_step_m": drive.lattice().step_m(),
        "axis": AxisFacts::of(&scene.axis),
        "result": summary,
        "configuration": config.to_json(),
    });
    write_whole(run_dir, REPORT, |out| {
        serde_json::to_writer_pretty(&mut *out, &report)
            .map_err(std::io::Error::from)
            .and_then(|()| out.write_all(b"\n"))
            .map_err(|source| OutputError::Write { path: run_dir.out().join(REPORT), source })
    })?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_summed_and_cells_of_all_tiles_are_the_terrain() {
        let tiles = [
            GroundPayload { counts: [5, 2, 1, 0], heights: vec![([0, 0], 2, -4_001)] },
            GroundPayload { counts: [7, 1, 0, 3], heights: vec![([6, 0], 1, 3_000)] },
        ];
        let (grid, lattice) = (CellGrid::new(1_000), Lattice::MILLIMETRE);
        let payloads = tiles.into_iter().map(Ok);
        let (counts, terrain) = counts_and_terrain(payloads, grid, lattice, -2_500).unwrap();
        assert_eq!(counts, Counts { object: 12, ground: 3, low_noise: 1, high_noise: 3 });
        let heights = [[500, 500], [6_500, 500]].map(|place| terrain.height_m(place));
        assert_eq!(heights, [Some(-2.001), Some(3.0)]);
    }

    #[test]
    fn every_format_is_among_the_outputs() {
        assert_eq!(BESIDE, ["objects.csv", "objects.geojson", "report.json"]);
    }
}

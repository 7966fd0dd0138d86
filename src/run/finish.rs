//! The end of a run: object table, report, and the mark that says that everything is there.

use std::io::Write;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::config::{ClassificationChoice, Config};
use crate::error::{Error, Result};
use crate::input::Catalog;
use crate::model::{Chart, ObjectPart};
use crate::output::{
    LabelOptions, LabelledFile, ObjectRow, OutputError, chart_svg, check_names, write_csv, write_geojson,
};
use crate::run::RunSummary;
use crate::run::drive::Drive;
use crate::run::scene::{AxisFacts, Scene};
use crate::run::terrain::Terrain;
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
    let options = LabelOptions {
        format: config.output.format,
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

/// Writes `objects.csv` and `objects.geojson`.
pub(crate) fn write_tables(
    run_dir: &RunDir,
    drive: &Drive,
    scene: &Scene,
    stitched: &Stitched,
    terrain: &Terrain,
) -> Result<()> {
    let row = |(id, object): (u32, &ObjectPart)| row(id, object, drive, scene, terrain);
    let rows = || (1_u32..).zip(&stitched.objects).map(row);
    let epsg = drive.catalog.crs().epsg;
    write_whole(run_dir, "objects.csv", |out| write_csv(rows(), out))?;
    write_whole(run_dir, "objects.geojson", |out| write_geojson(rows(), epsg, out))?;
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

/// The row of an object; positions in the units of the input.
fn row(id: u32, object: &ObjectPart, drive: &Drive, scene: &Scene, terrain: &Terrain) -> ObjectRow {
    let lattice = drive.lattice();
    let crs = drive.catalog.crs();
    let units_m = [crs.horizontal_unit_m, crs.horizontal_unit_m, crs.vertical_unit_m];
    let world = |point: [i64; 3]| [0, 1, 2].map(|k| lattice.metres(point[k]) / units_m[k]);
    // Sums are exact integers; the mean is rounded to the lattice, which is finer than what is written.
    #[expect(clippy::cast_possible_truncation, reason = "a mean of lattice coordinates is one")]
    let centre = object.sum.map(|sum| (sum / i128::from(object.points.max(1))) as i64);
    let place = [lattice.metres(centre[0]), lattice.metres(centre[1])];
    let (chainage_m, offset_m) = scene.axis.locate(place);
    let ground_m = terrain.height_m([centre[0], centre[1]]);
    let above = |z: i64| ground_m.map(|ground| lattice.metres(z) - ground);
    let hull: Vec<[f64; 2]> =
        object.hull.iter().map(|place| [0, 1].map(|k| lattice.metres(place[k]) / units_m[k])).collect();
    ObjectRow {
        id,
        points: object.points,
        min: world(object.lo),
        max: world(object.hi),
        centroid: world(centre),
        ground_z: ground_m.map(|ground| ground / units_m[2]),
        height_above_ground: above(object.hi[2]),
        base_above_ground: above(object.lo[2]),
        footprint: hull,
        area_m2: object.hull_area_units2() * lattice.step_m().powi(2),
        chainage_m,
        offset_m,
        files: object.files.iter().map(|&file| drive.file(file as usize).name().to_owned()).collect(),
    }
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
const BESIDE: [&str; 3] = ["objects.csv", "objects.geojson", REPORT];

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

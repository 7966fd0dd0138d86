//! The tables of objects, and charts for people who choose thresholds.

use std::io::Write;
use std::path::Path;

use crate::error::{Error, Result};
use crate::model::{Chart, ObjectPart};
use crate::output::{ObjectRow, OutputError, chart_svg, write_csv, write_geojson};
use crate::run::drive::{Drive, Surveyed};
use crate::run::terrain::Terrain;
use crate::store::{RunDir, StoreError};
use crate::whole_file::publish;

/// Writes `objects.csv` and `objects.geojson`.
pub(crate) fn write_tables(
    run_dir: &RunDir,
    drive: &Drive,
    surveyed: &Surveyed,
    objects: &[ObjectPart],
    terrain: &Terrain,
) -> Result<()> {
    let row = |(id, object): (u32, &ObjectPart)| row(id, object, drive, surveyed, terrain);
    let rows = || (1_u32..).zip(objects).map(row);
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

/// The row of an object; positions in the units of the input.
fn row(id: u32, object: &ObjectPart, drive: &Drive, surveyed: &Surveyed, terrain: &Terrain) -> ObjectRow {
    let lattice = drive.lattice();
    let crs = drive.catalog.crs();
    let units_m = [crs.horizontal_unit_m, crs.horizontal_unit_m, crs.vertical_unit_m];
    let world = |point: [i64; 3]| [0, 1, 2].map(|k| lattice.metres(point[k]) / units_m[k]);
    // Sums are exact integers; the mean is rounded to the lattice, which is finer than what is written.
    #[expect(clippy::cast_possible_truncation, reason = "a mean of lattice coordinates is one")]
    let centre = object.sum.map(|sum| (sum / i128::from(object.points.max(1))) as i64);
    let place = [lattice.metres(centre[0]), lattice.metres(centre[1])];
    let (chainage_m, offset_m) = surveyed.axis.locate(place);
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

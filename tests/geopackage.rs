//! `objects.gpkg` as GDAL reads it, against `objects.csv` and the labelled points: values, geometries,
//! coordinate system, and that every point is within 0.1 m of the outline of its object.

use std::path::Path;
use std::process::{Command, Output};

use crate::util::drive::scratch;
use crate::util::method_run::MethodRun;
use crate::util::{shipped, skipped};

fn oracle(arguments: &[&Path]) -> Output {
    let script = shipped("tests/oracle/geopackage_oracle.py");
    Command::new("python3").arg(script).args(arguments).output().expect("python3")
}

#[test]
fn gdal_reads_what_the_table_has() {
    let can = Command::new("python3").arg(shipped("tests/oracle/geopackage_oracle.py")).arg("--can").output();
    if !can.is_ok_and(|can| can.status.success()) {
        return skipped("objects.gpkg read by GDAL (geopandas, pyogrio or laspy is not installed)");
    }
    let folder = scratch();
    for method in ["street", "euclidean"] {
        let out = folder.path().join(method);
        let run = MethodRun { method, results: &["objects.gpkg"] };
        let objects = run.run_in(&out, &["tiling.tile_length=20"]).objects;
        let read = oracle(&[&out, &out.join("tree_road_sweep.laz")]);
        let told = String::from_utf8_lossy(&read.stdout);
        assert_eq!(told, format!("{objects} objects agree\n"), "{}", String::from_utf8_lossy(&read.stderr));
        // The same tiles give the same bytes, whatever the threads.
        let again = folder.path().join(format!("{method} again"));
        run.run_in(&again, &["tiling.tile_length=20", "run.threads=1"]);
        run.assert_same(&again, &run.results(&out), "once more");
    }
}

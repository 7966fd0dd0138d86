//! `density-peaks` in the engine, on the shipped scan: the same bytes for any tiles and threads, after an
//! interruption in every pass, and after a change of a threshold.

use std::path::{Path, PathBuf};

use chainage::config::Config;
use chainage::run::RunError;

use crate::util::drive::scratch;
use crate::util::method_run::{MethodRun, resumed};

const PEAKS: MethodRun = MethodRun {
    method: "density-peaks",
    results: &[
        "tree_road_sweep.laz",
        "objects.csv",
        "objects.geojson",
        "density-peaks-decision.svg",
        "density-peaks-curvature.svg",
    ],
};
const PASSES: [&str; 10] =
    ["survey", "scatter", "ground", "voxels", "peaks", "borders", "stitch", "relabel", "inventory", "export"];

fn order(pass: &str) -> usize {
    PASSES.iter().position(|name| *name == pass).unwrap()
}

#[test]
fn tiles_and_threads_do_not_show() {
    PEAKS.assert_tiles_do_not_show(scratch().path());
}

#[test]
#[ignore = "long; scripts/check.sh runs it"]
fn a_run_stopped_in_any_pass_ends_in_the_same_bytes() {
    let folder = scratch();
    let settings = ["tiling.tile_length=20", "run.threads=2"];
    let straight: PathBuf = folder.path().join("straight");
    PEAKS.run_in(&straight, &settings);
    let expected = PEAKS.results(&straight);
    // Before the first unit of a pass, or after it.
    for (number, pass) in PASSES.into_iter().enumerate() {
        let after = number % 2;
        let out = folder.path().join(format!("{pass}-{after}"));
        match PEAKS.interrupted_in(pass, after, &out, &settings) {
            // Units in progress are finished. A pass of one unit is complete then, and the next one
            // stops.
            Err(error) => {
                let Some(RunError::Interrupted { pass: stopped, .. }) = error.cause() else {
                    panic!("{error}")
                };
                assert!(order(stopped) - order(pass) <= 1);
            }
            Ok(_) => assert_eq!(pass, "export"),
        }
        let summary = PEAKS.run_in(&out, &settings);
        assert!(
            resumed(&summary).iter().take(order(pass)).all(|pass| pass.1),
            "{pass}: {:?}",
            resumed(&summary)
        );
        PEAKS.assert_same(&out, &expected, &format!("stopped in {pass} after {after}"));
    }
}

/// The last unit file of a pass: the result of its reduction.
fn global_of(out: &Path, pass: &str) -> PathBuf {
    let folder = std::fs::read_dir(out.join(".chainage")).unwrap().map(|entry| entry.unwrap().path());
    let folder = folder.filter(|path| path.to_str().unwrap().ends_with(&format!("-{pass}"))).max().unwrap();
    let units = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    units.filter(|path| path.extension().is_some_and(|extension| extension == "bin")).max().unwrap()
}

#[test]
fn a_run_that_died_in_a_reduction_does_it_again() {
    let folder = scratch();
    let settings = ["tiling.tile_length=20", "run.threads=2"];
    let straight: PathBuf = folder.path().join("straight");
    PEAKS.run_in(&straight, &settings);
    let expected = PEAKS.results(&straight);
    for (pass, next) in [("voxels", "peaks"), ("peaks", "borders")] {
        for cut in [true, false] {
            let out = folder.path().join(format!("{pass}-{cut}"));
            assert!(PEAKS.interrupted_in(next, 0, &out, &settings).is_err());
            let global = global_of(&out, pass);
            let bytes = std::fs::read(&global).unwrap();
            if cut {
                std::fs::write(&global, &bytes[..bytes.len() / 2]).unwrap();
            } else {
                std::fs::remove_file(&global).unwrap();
            }
            let summary = PEAKS.run_in(&out, &settings);
            assert!(resumed(&summary)[..order(next)].iter().all(|pass| pass.1), "{:?}", resumed(&summary));
            assert_eq!(std::fs::read(&global).unwrap(), bytes, "{pass}");
            PEAKS.assert_same(&out, &expected, &format!("reduction of {pass} lost, cut {cut}"));
        }
    }
}

#[test]
#[ignore = "long; scripts/check.sh runs it"]
fn a_changed_setting_does_again_what_follows_it_and_nothing_else() {
    let folder = scratch();
    let base = ["tiling.tile_length=20"];
    let out = folder.path().join("changed");
    let fresh = folder.path().join("fresh");
    PEAKS.run_in(&out, &base);
    for (setting, kept) in [
        ("density-peaks.merge_below=0.02", 6),
        ("density-peaks.pair_gap_m=0.4", 5),
        ("density-peaks.search_radius=9", 4),
        ("density-peaks.voxel=0.4", 3),
    ] {
        let settings = [base[0], setting];
        let summary = PEAKS.run_in(&out, &settings);
        let expected: Vec<(&str, bool)> =
            PASSES.iter().enumerate().map(|(at, pass)| (*pass, at < kept)).collect();
        assert_eq!(resumed(&summary), expected, "{setting}");
        let _ = std::fs::remove_dir_all(&fresh);
        PEAKS.run_in(&fresh, &settings);
        PEAKS.assert_same(&out, &PEAKS.results(&fresh), setting);
        // Restored, so that the next case again differs from the defaults by one change.
        PEAKS.run_in(&out, &base);
    }
    assert!(PEAKS.run_in(&out, &base).nothing_to_do);
}

#[test]
fn every_configuration_that_ships_is_accepted_and_says_what_the_defaults_are() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("config");
    let mut seen = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        // Names of classes, for `eval`.
        if name == "classes.toml" {
            continue;
        }
        let config = Config::resolve(Some(&path), &[]).unwrap_or_else(|error| panic!("{name}: {error}"));
        for entry in chainage::cluster::REGISTRY {
            (entry.build)(&|name| config.method_table(name))
                .unwrap_or_else(|error| panic!("{name}: {error}"));
        }
        if name == "density-peaks.toml" {
            // The noise filter has the values of the paper, and the defaults differ.
            let of_the_paper =
                ["noise.voxel=0.3", "noise.min_component_points=10", "noise.keep_sparse=false"];
            let methods = ["cluster.method=density-peaks", "ground.method=voxel-column"];
            let chosen = [&methods[..], &of_the_paper].concat().into_iter().map(str::to_owned);
            let default = Config::resolve(None, &chosen.collect::<Vec<_>>()).unwrap();
            assert_eq!(config.to_json(), default.to_json());
        }
        seen.push(name);
    }
    seen.sort_unstable();
    assert_eq!(seen, ["default.toml", "dense-trees.toml", "density-peaks.toml", "forest.toml"]);
}

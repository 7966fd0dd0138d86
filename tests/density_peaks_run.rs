//! `density-peaks` in the engine, on the shipped scan: the same bytes for any tiles and threads, after an
//! interruption in every pass, and after a change of a threshold.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use chainage::Result;
use chainage::config::Config;
use chainage::run::{
    CancelToken, Event, Observer, Registries, RunError, RunRequest, RunSummary, Silent, run,
};

use crate::util::drive::scratch;

/// Outputs of a run that must not depend on how it ran.
const RESULTS: [&str; 5] = [
    "tree_road_sweep.laz",
    "objects.csv",
    "objects.geojson",
    "density-peaks-decision.svg",
    "density-peaks-curvature.svg",
];
const PASSES: [&str; 9] =
    ["survey", "scatter", "ground", "voxels", "peaks", "borders", "stitch", "relabel", "export"];

fn request(out: &Path, settings: &[&str]) -> RunRequest<'static> {
    let mut settings: Vec<String> = settings.iter().map(ToString::to_string).collect();
    settings.push("cluster.method=density-peaks".to_owned());
    let input = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/tree_road_sweep.laz");
    RunRequest {
        inputs: vec![input],
        out: out.to_owned(),
        config: Config::resolve(None, &settings).unwrap(),
        fresh: false,
        registries: Registries::default(),
    }
}

fn run_in(out: &Path, settings: &[&str]) -> RunSummary {
    run(&request(out, settings), &Silent, &CancelToken::default()).unwrap()
}

fn results(out: &Path) -> Vec<Vec<u8>> {
    RESULTS.iter().map(|name| std::fs::read(out.join(name)).unwrap()).collect()
}

fn assert_same(out: &Path, expected: &[Vec<u8>], what: &str) {
    for ((name, bytes), expected) in RESULTS.iter().zip(results(out)).zip(expected) {
        assert!(bytes == *expected, "{name}, {what}");
    }
}

/// Stops a run after a number of units of a pass.
struct StopIn<'a> {
    pass: &'static str,
    after: usize,
    seen: AtomicUsize,
    cancel: &'a CancelToken,
}

impl Observer for StopIn<'_> {
    fn event(&self, event: &Event<'_>) {
        let here = match event {
            Event::PassStarted { pass, .. } => *pass == self.pass && self.after == 0,
            Event::UnitFinished { pass, .. } => {
                *pass == self.pass && self.seen.fetch_add(1, Ordering::Relaxed) + 1 == self.after
            }
            _ => false,
        };
        if here {
            self.cancel.cancel();
        }
    }
}

fn interrupted_in(pass: &'static str, after: usize, out: &Path, settings: &[&str]) -> Result<RunSummary> {
    let cancel = CancelToken::default();
    let stop = StopIn { pass, after, seen: AtomicUsize::new(0), cancel: &cancel };
    run(&request(out, settings), &stop, &cancel)
}

/// Number of units that a run resumed from an earlier one, by pass.
fn resumed(summary: &RunSummary) -> Vec<(&'static str, bool)> {
    let whole = |figures: &chainage::run::PassFigures| (figures.pass, figures.resumed == figures.units);
    summary.passes.iter().map(whole).collect()
}

fn order(pass: &str) -> usize {
    PASSES.iter().position(|name| *name == pass).unwrap()
}

#[test]
fn tiles_and_threads_do_not_show() {
    let folder = scratch();
    let whole = folder.path().join("whole");
    let summary = run_in(&whole, &["tiling.tile_length=1000", "run.threads=1"]);
    assert_eq!(summary.tiles, 1);
    assert!(summary.objects > 10, "{}", summary.objects);
    let expected = results(&whole);
    for (length, threads) in [("5", "2"), ("20", "1"), ("20", "3"), ("60", "2")] {
        let out = folder.path().join(format!("{length}-{threads}"));
        let settings = [format!("tiling.tile_length={length}"), format!("run.threads={threads}")];
        let tiles = run_in(&out, &[&settings[0], &settings[1]]).tiles;
        assert!(tiles > 1);
        assert_same(&out, &expected, &format!("tiles of {length} m, {threads} threads"));
    }
}

#[test]
fn a_run_stopped_in_any_pass_ends_in_the_same_bytes() {
    let folder = scratch();
    let settings = ["tiling.tile_length=20", "run.threads=2"];
    let straight: PathBuf = folder.path().join("straight");
    run_in(&straight, &settings);
    let expected = results(&straight);
    for pass in PASSES {
        for after in [0, 1] {
            let out = folder.path().join(format!("{pass}-{after}"));
            match interrupted_in(pass, after, &out, &settings) {
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
            let summary = run_in(&out, &settings);
            assert!(
                resumed(&summary).iter().take(order(pass)).all(|pass| pass.1),
                "{pass}: {:?}",
                resumed(&summary)
            );
            assert_same(&out, &expected, &format!("stopped in {pass} after {after}"));
        }
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
    run_in(&straight, &settings);
    let expected = results(&straight);
    for (pass, next) in [("voxels", "peaks"), ("peaks", "borders")] {
        for cut in [true, false] {
            let out = folder.path().join(format!("{pass}-{cut}"));
            assert!(interrupted_in(next, 0, &out, &settings).is_err());
            let global = global_of(&out, pass);
            let bytes = std::fs::read(&global).unwrap();
            if cut {
                std::fs::write(&global, &bytes[..bytes.len() / 2]).unwrap();
            } else {
                std::fs::remove_file(&global).unwrap();
            }
            let summary = run_in(&out, &settings);
            assert!(resumed(&summary)[..order(next)].iter().all(|pass| pass.1), "{:?}", resumed(&summary));
            assert_eq!(std::fs::read(&global).unwrap(), bytes, "{pass}");
            assert_same(&out, &expected, &format!("reduction of {pass} lost, cut {cut}"));
        }
    }
}

#[test]
fn a_changed_setting_does_again_what_follows_it_and_nothing_else() {
    let folder = scratch();
    let base = ["tiling.tile_length=20"];
    let out = folder.path().join("changed");
    let fresh = folder.path().join("fresh");
    run_in(&out, &base);
    for (setting, kept) in [
        ("density-peaks.c_t=0.02", 6),
        ("density-peaks.d_th=0.4", 5),
        ("density-peaks.d_neighbor=9", 4),
        ("density-peaks.voxel=0.4", 3),
    ] {
        let settings = [base[0], setting];
        let summary = run_in(&out, &settings);
        let expected: Vec<(&str, bool)> =
            PASSES.iter().enumerate().map(|(at, pass)| (*pass, at < kept)).collect();
        assert_eq!(resumed(&summary), expected, "{setting}");
        let _ = std::fs::remove_dir_all(&fresh);
        run_in(&fresh, &settings);
        assert_same(&out, &results(&fresh), setting);
        // Restored, so that the next change is one from the defaults.
        run_in(&out, &base);
    }
    assert!(run_in(&out, &base).nothing_to_do);
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
            let default = Config::resolve(None, &["cluster.method=density-peaks".to_owned()]).unwrap();
            assert_eq!(config.to_json(), default.to_json());
        }
        seen.push(name);
    }
    seen.sort_unstable();
    assert_eq!(seen, ["default.toml", "dense-trees.toml", "density-peaks.toml"]);
}

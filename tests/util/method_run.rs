//! Runs of a method on the shipped scan, including runs that are stopped in a pass.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use chainage::Result;
use chainage::config::Config;
use chainage::run::{CancelToken, Event, Observer, Registries, RunRequest, RunSummary, Silent, run};

/// A method, and the settings and outputs to test that its result does not depend on how it ran.
pub(crate) struct MethodRun {
    pub(crate) method: &'static str,
    pub(crate) results: &'static [&'static str],
}

impl MethodRun {
    fn request(&self, out: &Path, settings: &[&str]) -> RunRequest<'static> {
        // The fastest ground filter, and no report, because the report is not compared here.
        let mut settings: Vec<String> = ["ground.method=voxel-column", "output.report=false"]
            .iter()
            .chain(settings)
            .map(ToString::to_string)
            .collect();
        settings.push(format!("cluster.method={}", self.method));
        let input = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/tree_road_sweep.laz");
        RunRequest {
            inputs: vec![input],
            out: out.to_owned(),
            config: Config::resolve(None, &settings).unwrap(),
            fresh: false,
            registries: Registries::default(),
        }
    }

    pub(crate) fn run_in(&self, out: &Path, settings: &[&str]) -> RunSummary {
        run(&self.request(out, settings), &Silent, &CancelToken::default()).unwrap()
    }

    pub(crate) fn results(&self, out: &Path) -> Vec<Vec<u8>> {
        self.results.iter().map(|name| std::fs::read(out.join(name)).unwrap()).collect()
    }

    pub(crate) fn assert_same(&self, out: &Path, expected: &[Vec<u8>], what: &str) {
        for ((name, bytes), expected) in self.results.iter().zip(self.results(out)).zip(expected) {
            assert!(bytes == *expected, "{name}, {what}");
        }
    }

    /// Runs until a number of units of a pass are finished.
    pub(crate) fn interrupted_in(
        &self,
        pass: &'static str,
        after: usize,
        out: &Path,
        settings: &[&str],
    ) -> Result<RunSummary> {
        let cancel = CancelToken::default();
        let stop = StopIn { pass, after, seen: AtomicUsize::new(0), cancel: &cancel };
        run(&self.request(out, settings), &stop, &cancel)
    }

    /// Asserts that any tiles and threads give the same bytes as one tile.
    pub(crate) fn assert_tiles_do_not_show(&self, folder: &Path) {
        let whole: PathBuf = folder.join("whole");
        let summary = self.run_in(&whole, &["tiling.tile_length=1000", "run.threads=1"]);
        assert_eq!(summary.tiles, 1);
        assert!(summary.objects > 10, "{}", summary.objects);
        let expected = self.results(&whole);
        for (length, threads) in [("5", "2"), ("20", "3")] {
            let out = folder.join(format!("{length}-{threads}"));
            let settings = [format!("tiling.tile_length={length}"), format!("run.threads={threads}")];
            let tiles = self.run_in(&out, &[&settings[0], &settings[1]]).tiles;
            assert!(tiles > 1);
            self.assert_same(&out, &expected, &format!("tiles of {length} m, {threads} threads"));
        }
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

/// Whether all units of a pass were resumed from an earlier run, by pass.
pub(crate) fn resumed(summary: &RunSummary) -> Vec<(&'static str, bool)> {
    let whole = |figures: &chainage::run::PassFigures| (figures.pass, figures.resumed == figures.units);
    summary.passes.iter().map(whole).collect()
}

//! Switching between settings in one directory, with interruptions: after a call has overwritten a result, no
//! older result may count in its place.

use std::path::{Path, PathBuf};

use chainage::ErrorKind;
use chainage::run::{CancelToken, Event, Observer, Registries, RunRequest, run};

use crate::util::drive::{assert_same_outputs, config, drive, scratch, settings};
use crate::util::shipped;

/// Cancels the run after this many units of a pass.
struct StopAfter<'a> {
    cancel: &'a CancelToken,
    pass: &'static str,
    units: std::sync::atomic::AtomicUsize,
}

impl Observer for StopAfter<'_> {
    fn event(&self, event: &Event<'_>) {
        if let Event::UnitFinished { pass, .. } = event
            && *pass == self.pass
            && self.units.fetch_sub(1, std::sync::atomic::Ordering::Relaxed) == 1
        {
            self.cancel.cancel();
        }
    }
}

fn interrupted(inputs: &[PathBuf], out: &Path, assignments: &[&str], pass: &'static str, units: usize) {
    let cancel = CancelToken::default();
    let observer = StopAfter { cancel: &cancel, pass, units: units.into() };
    let request = RunRequest {
        inputs: inputs.to_vec(),
        out: out.to_owned(),
        config: config(&settings(assignments)),
        fresh: false,
        registries: Registries::default(),
    };
    let error = run(&request, &observer, &cancel).expect_err("cancelled");
    assert_eq!(error.kind(), ErrorKind::Interrupted, "{error}");
}

const SHORT: [&str; 2] = ["tiling.tile_length=15.0", "run.threads=1"];
const LONG: [&str; 2] = ["tiling.tile_length=40.0", "run.threads=1"];

#[test]
fn other_tiles_in_between_leave_no_trace() {
    let inputs = [shipped("tests/data/tree_road_sweep.laz")];
    let folder = scratch();
    let fresh = folder.path().join("fresh");
    let out = folder.path().join("out");
    drive(&inputs, &fresh, &settings(&SHORT)).unwrap();

    // All ten short tiles are clustered, and nothing is exported.
    interrupted(&inputs, &out, &SHORT, "cluster", 10);
    // Labels of the long tiles have now replaced labels of the short tiles.
    interrupted(&inputs, &out, &LONG, "cluster", 2);
    drive(&inputs, &out, &settings(&SHORT)).unwrap();
    assert_same_outputs(&fresh, &out, "after other tiles had begun");
}

#[test]
fn another_method_in_between_leaves_no_trace() {
    let inputs = [shipped("tests/data/tree_road_sweep.laz")];
    let folder = scratch();
    let fresh = folder.path().join("fresh");
    let out = folder.path().join("out");
    drive(&inputs, &fresh, &settings(&SHORT)).unwrap();

    // All ten short tiles are clustered, and nothing is exported.
    interrupted(&inputs, &out, &SHORT, "cluster", 10);
    let mut peaks = SHORT.to_vec();
    peaks.push("cluster.method=density-peaks");
    drive(&inputs, &out, &settings(&peaks)).unwrap();
    drive(&inputs, &out, &settings(&SHORT)).unwrap();
    assert_same_outputs(&fresh, &out, "after another method");
}

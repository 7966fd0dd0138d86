//! A run that several processes share: the bytes of one process for every method, with units computed twice,
//! workers killed, files that appear late, and workers that do not belong to the run.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use chainage::run::{CancelToken, Event, Observer, SharedRun, Units};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::util::drive::{assert_same_outputs, scratch};
use crate::util::las::Shape;
use crate::util::program::{ended, program, run_command, run_to_the_end, wait_until};
use crate::util::shipped;
use crate::util::street::{Course, Street};

/// A folder with a small street.
struct Inputs {
    folder: tempfile::TempDir,
    name: &'static str,
}

/// The due pass and units, as `next --json` prints them.
#[derive(Debug, Clone)]
struct Due {
    pass: Option<String>,
    units: Vec<usize>,
}

impl Due {
    fn read(text: &[u8]) -> Self {
        let value: serde_json::Value = serde_json::from_slice(text).expect("JSON");
        let units = value["units"].as_array().expect("units").iter();
        Self {
            pass: value["pass"].as_str().map(ToOwned::to_owned),
            units: units.map(|unit| serde_json::from_value(unit.clone()).expect("a number")).collect(),
        }
    }

    fn pass(&self) -> &str {
        self.pass.as_deref().expect("a pass is due")
    }
}

/// Numbers as `--units` takes them.
fn list(units: &[usize]) -> String {
    units.iter().map(ToString::to_string).collect::<Vec<_>>().join(",")
}

impl Inputs {
    /// A street of about 5,000 points.
    fn new(name: &'static str) -> Self {
        let folder = scratch();
        let points = Street { things: 120, patches: 600, ..Street::middling(8, Course::Straight) }.points();
        let path = folder.path().join(name);
        if name.ends_with("laz") {
            Shape::default().write_in_chunks(&path, &points, 500);
        } else {
            Shape::default().write(&path, &points);
        }
        Self { folder, name }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn list(&self) -> Vec<PathBuf> {
        vec![self.path(self.name)]
    }

    /// The output directory of a run by one process.
    fn alone(&self, options: &[&str]) -> PathBuf {
        let out = self.path("alone");
        run_to_the_end(&self.list(), &out, options);
        out
    }

    /// Opens the run for workers.
    fn open(&self, out: &Path, options: &[&str]) -> Due {
        let run = run_command(&self.list(), out, options);
        // The same arguments with another command.
        let arguments: Vec<_> =
            run.get_args().skip(1).filter(|word| *word != "--progress" && *word != "none").collect();
        let output =
            program().arg("plan").args(["--units", "--json"]).args(arguments).output().expect("starts");
        assert!(output.status.success(), "{}", ended(&output).1);
        Due::read(&output.stdout)
    }
}

/// A command on a shared run.
fn command(name: &str, out: &Path, arguments: &[&str]) -> Command {
    let mut command = program();
    command
        .arg(name)
        .arg(out)
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}

/// A worker for these units.
fn worker(out: &Path, pass: &str, units: &[usize]) -> Child {
    let arguments = ["--pass", pass, "--units", &list(units), "--wait", "0", "--threads", "1"];
    command("work", out, &arguments).spawn().expect("starts")
}

/// A command that succeeds and prints what is due.
fn due_after(name: &str, out: &Path, arguments: &[&str]) -> Due {
    let output = command(name, out, arguments).arg("--json").output().expect("starts");
    assert!(output.status.success(), "{name} {arguments:?}: {}", ended(&output).1);
    Due::read(&output.stdout)
}

/// A command that fails with a code and texts.
fn refused(name: &str, out: &Path, arguments: &[&str], code: i32, texts: &[&str]) {
    let (found, errors) = ended(&command(name, out, arguments).output().expect("starts"));
    assert_eq!(found, code, "{name} {arguments:?}: {errors}");
    for text in texts {
        assert!(errors.contains(text), "{text:?} is not in:\n{errors}");
    }
}

/// Walks from pass to pass until nothing is due. `share` computes the units of a pass.
fn to_the_end(out: &Path, mut due: Due, mut share: impl FnMut(&str, &[usize])) -> Vec<String> {
    let mut passes = Vec::new();
    while let Some(pass) = due.pass.clone() {
        if !due.units.is_empty() {
            share(&pass, &due.units);
        }
        due = due_after("reduce", out, &["--after", &pass, "--wait", "0"]);
        passes.push(pass);
    }
    passes
}

/// Every unit goes to one of `processes` workers at random, and every fifth to a second one at the same time.
fn shuffled(random: &mut ChaCha8Rng, units: &[usize], processes: usize) -> Vec<Vec<usize>> {
    let mut shares = vec![Vec::new(); processes];
    let mut units = units.to_vec();
    units.shuffle(random);
    for unit in units {
        shares[random.random_range(0..processes)].push(unit);
        if random.random_range(0..5) == 0 {
            shares[random.random_range(0..processes)].push(unit);
        }
    }
    shares.retain(|share| !share.is_empty());
    shares
}

/// The warnings in the report of a run.
fn warnings(out: &Path) -> Vec<String> {
    let report = std::fs::read(out.join("report.json")).expect("a report");
    let report: serde_json::Value = serde_json::from_slice(&report).expect("JSON");
    serde_json::from_value(report["result"]["warnings"].clone()).expect("texts")
}

#[test]
fn every_method_gives_the_bytes_of_one_process_for_any_split_of_its_units() {
    let inputs = Inputs::new("street.laz");
    let methods: Vec<&str> = chainage::cluster::REGISTRY.iter().map(|entry| entry.name).collect();
    let auto = ["--method", "dbscan", "--set", "dbscan.epsilon=\"auto\""];
    let all = methods.iter().map(|name| vec!["--method", *name]).chain([auto.to_vec()]);
    for (number, method) in all.enumerate() {
        let mut random = ChaCha8Rng::seed_from_u64(number as u64);
        let options =
            [&["--tile-length", "12", "--memory", "256M", "--set", "output.copc=true"], &*method].concat();
        let alone = inputs.alone(&options);
        let out = inputs.path("shared");
        let due = inputs.open(&out, &[&options[..], &["--leave-survey"]].concat());
        assert_eq!(due.pass(), "survey");
        let processes = 2 + number % 7;
        let passes = to_the_end(&out, due, |pass, units| {
            let shares = shuffled(&mut random, units, processes);
            let workers: Vec<Child> = shares.iter().map(|share| worker(&out, pass, share)).collect();
            for worker in workers {
                let (code, errors) = ended(&worker.wait_with_output().expect("ended"));
                assert_eq!(code, 0, "{method:?}, pass {pass}: {errors}");
            }
        });
        assert!(passes.len() >= 7, "{passes:?}");
        // A late worker finds that there is nothing to do.
        assert!(worker(&out, "copc nodes", &[0]).wait().expect("ended").success());
        assert!(due_after("next", &out, &[]).pass.is_none());
        assert_same_outputs(&alone, &out, &format!("{method:?} by {processes} processes"));
        let told = [&alone, &out].map(|folder| warnings(folder));
        assert_eq!(told[0], told[1], "{method:?}");
        assert!(told[0].iter().any(|text| text.contains("no coordinate system is known")), "{:?}", told[0]);
        for folder in [alone, out] {
            std::fs::remove_dir_all(folder).expect("removed");
        }
    }
}

#[test]
fn killed_workers_and_reductions_change_no_byte() {
    for (name, seed) in [("street.las", 1), ("street.laz", 2)] {
        let inputs = Inputs::new(name);
        let options = ["--tile-length", "8", "--memory", "256M", "--set", "output.copc=true"];
        let alone = inputs.alone(&options);
        let out = inputs.path("shared");
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut due = inputs.open(&out, &options);
        let mut killed = 0;
        let pause = |random: &mut ChaCha8Rng| {
            std::thread::sleep(Duration::from_millis(random.random_range(2..24)));
        };
        while let Some(pass) = due.pass.clone() {
            if killed < 12 {
                // Two workers with all units, and at the same time a process to complete the pass, all killed
                // without notice.
                let mut children: Vec<Child> = (0..2).map(|_| worker(&out, &pass, &due.units)).collect();
                let reduce = ["--after", &pass, "--wait", "1"];
                children.push(command("reduce", &out, &reduce).spawn().expect("starts"));
                for child in &mut children {
                    pause(&mut random);
                    child.kill().expect("killed");
                    killed += u32::from(!child.wait().expect("ended").success());
                }
            } else if !due.units.is_empty() {
                assert!(worker(&out, &pass, &due.units).wait().expect("ended").success());
            } else {
                due_after("reduce", &out, &["--after", &pass]);
            }
            due = due_after("next", &out, &[]);
        }
        assert!(killed >= 3, "{killed} were killed in time");
        assert_same_outputs(&alone, &out, name);
        let left = std::fs::read_dir(out.join(".chainage"))
            .expect("the state")
            .filter(|entry| entry.as_ref().is_ok_and(|entry| entry.file_name() == "export"));
        assert_eq!(left.count(), 0, "files of the export are left");
    }
}

#[test]
fn one_process_and_workers_go_on_where_the_other_was() {
    let inputs = Inputs::new("street.laz");
    let options = ["--tile-length", "8", "--memory", "256M"];
    let alone = inputs.alone(&options);
    // Workers start the run, and a single process ends it.
    let out = inputs.path("shared");
    let due = inputs.open(&out, &options);
    let pass = due.pass().to_owned();
    assert!(due.units.len() > 1 || pass == "scatter", "{due:?}");
    assert!(worker(&out, &pass, &due.units).wait().expect("ended").success());
    let due = due_after("reduce", &out, &["--after", &pass]);
    let half = &due.units[..due.units.len().div_ceil(2)];
    assert!(worker(&out, due.pass(), half).wait().expect("ended").success());
    assert_eq!(due_after("next", &out, &[]).units, due.units[half.len()..]);
    run_to_the_end(&inputs.list(), &out, &options);
    assert_same_outputs(&alone, &out, "workers, then one process");
    let log = crate::util::program::events(&out);
    let again = crate::util::program::finished(&log, due.pass());
    assert_eq!(again, due.units.len() - half.len(), "the process computed what the workers had done");
    // A single process starts the run and is killed in the clusters, and workers end it.
    let out = inputs.path("taken-over");
    let mut child = run_command(&inputs.list(), &out, &options).spawn().expect("starts");
    wait_until("the pass ground", || {
        crate::util::program::finished(&crate::util::program::events(&out), "ground") > 0
    });
    child.kill().expect("killed");
    child.wait().expect("ended");
    let due = due_after("next", &out, &[]);
    to_the_end(&out, due, |pass, units| {
        assert!(worker(&out, pass, units).wait().expect("ended").success(), "{pass}");
    });
    assert_same_outputs(&alone, &out, "one process, then workers");
}

/// A host with less memory reduces the passes of others. It keeps their plan.
#[test]
fn a_reduction_keeps_the_plan_however_little_memory_its_host_has() {
    let folder = scratch();
    let inputs = Inputs { folder, name: "sweep.laz" };
    std::fs::copy(shipped("tests/data/tree_road_sweep.laz"), inputs.path(inputs.name)).expect("copied");
    let options = ["--memory", "2G", "--threads", "1"];
    let alone = inputs.alone(&options);
    let out = inputs.path("shared");
    let due = inputs.open(&out, &options);
    let configuration = out.join(".chainage/run.toml");
    let text = std::fs::read_to_string(&configuration).expect("settings");
    assert!(text.contains("memory_mib = 2048"), "{text}");
    let little = text.replace("memory_mib = 2048", "memory_mib = 16");
    std::fs::write(&configuration, &little).expect("written");
    let request = out.join(".chainage/request.json");
    let digest = |text: &str| format!("{:016x}", xxhash_rust::xxh3::xxh3_64(text.as_bytes()));
    let recorded = std::fs::read_to_string(&request).expect("a request");
    assert!(recorded.contains(&digest(&text)), "{recorded}");
    std::fs::write(&request, recorded.replace(&digest(&text), &digest(&little))).expect("written");
    let plan = std::fs::read(out.join(".chainage/plan.json")).expect("a plan");
    let passes = to_the_end(&out, due, |pass, units| {
        let (code, errors) = ended(&worker(&out, pass, units).wait_with_output().expect("ends"));
        assert_eq!(code, 0, "{pass}: {errors}");
    });
    assert!(!passes.contains(&"scatter".to_owned()), "{passes:?}");
    assert!(std::fs::read(out.join(".chainage/plan.json")).expect("a plan") == plan, "another plan");
    assert_same_outputs(&alone, &out, "with little memory");
}

/// A worker must not store results from other points, because they would be used once the right file is back.
#[test]
fn a_worker_refuses_a_file_with_other_points_and_accepts_a_copy() {
    let inputs = Inputs::new("street.las");
    let out = inputs.path("out");
    let due = inputs.open(&out, &["--tile-length", "8"]);
    let input = inputs.path("street.las");
    let whole = std::fs::read(&input).expect("read");
    // The lowest byte of one z near the end: size, count and header stay.
    let mut other = whole.clone();
    let at = other.len() - 50;
    other[at] ^= 1;
    let put = |bytes: &[u8]| {
        std::fs::remove_file(&input).expect("removed");
        std::fs::write(&input, bytes).expect("written");
    };
    put(&other);
    let (code, errors) = ended(&worker(&out, due.pass(), &due.units).wait_with_output().expect("ends"));
    assert_eq!(code, 6, "{errors}");
    assert!(errors.contains("the points of street.las have changed"), "{errors}");
    assert!(!unit_file(&out, due.pass(), 0).exists(), "a unit of other points");
    put(&whole);
    let (code, errors) = ended(&worker(&out, due.pass(), &due.units).wait_with_output().expect("ends"));
    assert_eq!(code, 0, "{errors}");
}

#[test]
fn settings_of_a_run_that_are_damaged_are_refused() {
    let inputs = Inputs::new("street.las");
    let out = inputs.path("out");
    let due = inputs.open(&out, &["--method", "euclidean"]);
    let settings = out.join(".chainage/run.toml");
    let text = std::fs::read_to_string(&settings).expect("settings");
    for damaged in ["", &text[..text.len() / 2], &text.replace("euclidean\"", "street\"")] {
        std::fs::write(&settings, damaged).expect("written");
        let pass = due.pass();
        refused("reduce", &out, &["--after", pass, "--wait", "0"], 6, &["run.toml is damaged"]);
        refused("work", &out, &["--pass", pass, "--wait", "0"], 6, &["run.toml is damaged"]);
        refused("next", &out, &[], 6, &["run.toml is damaged"]);
    }
    // The same command as before writes these files again.
    inputs.open(&out, &["--method", "euclidean"]);
    assert_eq!(due_after("next", &out, &[]).pass.as_deref(), due.pass.as_deref());
}

#[test]
fn workers_repair_a_copy_that_was_removed() {
    let inputs = Inputs::new("street.las");
    let out = inputs.alone(&["--method", "euclidean"]);
    let copy = out.join("street.las");
    let before = std::fs::read(&copy).expect("a copy");
    std::fs::remove_file(&copy).expect("removed");
    let due = inputs.open(&out, &["--method", "euclidean"]);
    assert_eq!(due.pass.as_deref(), Some("export"));
    to_the_end(&out, due, |pass, units| {
        let (code, errors) = ended(&worker(&out, pass, units).wait_with_output().expect("ends"));
        assert_eq!(code, 0, "{pass}: {errors}");
    });
    assert!(std::fs::read(&copy).expect("a copy") == before);
}

#[test]
fn a_preset_is_no_setting_of_a_worker() {
    let inputs = Inputs::new("street.las");
    let out = inputs.path("out");
    let due = inputs.open(&out, &[]);
    let arguments = ["--pass", due.pass(), "--preset", "forest"];
    refused("work", &out, &arguments, 2, &["unexpected argument '--preset'"]);
}

#[test]
fn workers_that_do_not_belong_to_the_run_are_refused() {
    let inputs = Inputs::new("street.las");
    let out = inputs.path("out");
    refused("next", &out, &[], 6, &["contains no run", "start one with chainage run"]);
    refused("reduce", &out, &["--after", "ground"], 6, &["contains no run"]);
    assert!(!out.exists(), "a command that refuses made a directory");
    let due = inputs.open(&out, &["--tile-length", "8", "--memory", "256M"]);
    fn with<'a>(pass: &'a str, more: &[&'a str]) -> Vec<&'a str> {
        [&["--pass", pass, "--wait", "0"], more].concat()
    }
    let pass = due.pass();
    // With other settings, the error names both values. How the machine is used may differ.
    let other = with(pass, &["--set", "euclidean.max_gap_m=0.7"]);
    refused(
        "work",
        &out,
        &other,
        6,
        &["the run has euclidean.max_gap_m = 0.3, this worker euclidean.max_gap_m = 0.7"],
    );
    let machine = with(pass, &["--threads", "2", "--memory", "300M", "--no-mmap", "--units", "0"]);
    assert!(command("work", &out, &machine).output().expect("starts").status.success());
    // Units and passes that do not exist, and a pass that is not due yet.
    refused(
        "work",
        &out,
        &with(pass, &["--units", "0..9999"]),
        3,
        &["none has the number", "chainage next OUT"],
    );
    refused("work", &out, &with(pass, &["--units", "3..3"]), 2, &["is not a list of units like 3..7,12"]);
    refused("work", &out, &["--pass", "grond"], 3, &["grond is not a pass of this run", "ground, "]);
    refused("reduce", &out, &["--after", "grond"], 3, &["grond is not a pass of this run", "ground, "]);
    let early = ["--pass", "relabel", "--wait", "0"];
    refused("work", &out, &early, 6, &["before relabel, is not complete", "chainage reduce OUT --after"]);
    refused("reduce", &out, &["--after", "export", "--wait", "0"], 6, &["before export, is not complete"]);
    // With another version, the error names both.
    let version = out.join(".chainage/version.json");
    let right = std::fs::read_to_string(&version).expect("read");
    std::fs::write(&version, right.replace(env!("CARGO_PKG_VERSION"), "0.0.7")).expect("written");
    let both = ["was started by chainage 0.0.7", concat!("this is ", env!("CARGO_PKG_VERSION"))];
    refused("work", &out, &with(pass, &[]), 6, &both);
    std::fs::write(&version, right).expect("written");
    // The input has grown.
    let mut longer = std::fs::read(&inputs.list()[0]).expect("read");
    let bytes = longer.clone();
    longer.extend([0; 64]);
    std::fs::write(&inputs.list()[0], longer).expect("written");
    refused("work", &out, &with(pass, &[]), 6, &["was started with other input", "bytes"]);
    std::fs::write(&inputs.list()[0], bytes).expect("written");
    assert!(command("work", &out, &with(pass, &[])).output().expect("starts").status.success());
}

/// The file of a unit of the first pass whose folder ends in a name.
fn unit_file(out: &Path, pass: &str, unit: usize) -> PathBuf {
    let state = std::fs::read_dir(out.join(".chainage")).expect("the state");
    let folders = state.map(|entry| entry.expect("an entry").path());
    let folder = folders.into_iter().find(|path| path.to_string_lossy().ends_with(&format!("-{pass}")));
    folder.expect("the folder of the pass").join(format!("unit-{unit:06}.bin"))
}

#[test]
fn units_that_are_missing_damaged_or_foreign_are_named() {
    let inputs = Inputs::new("street.las");
    let out = inputs.path("out");
    let options = ["--tile-length", "8", "--memory", "256M", "--leave-survey"];
    let mut due = inputs.open(&out, &options);
    while due.pass() != "ground" {
        assert!(worker(&out, due.pass(), &due.units).wait().expect("ended").success());
        due = due_after("reduce", &out, &["--after", &due.pass.expect("a pass")]);
    }
    assert!(due.units.len() > 5, "{} tiles", due.units.len());
    assert!(worker(&out, "ground", &due.units[2..]).wait().expect("ended").success());
    let reduce = ["--after", "ground", "--wait", "0"];
    refused("reduce", &out, &reduce, 6, &["2 of", "are missing: 0..2", "--pass ground --units 0..2"]);
    assert!(worker(&out, "ground", &[0, 1]).wait().expect("ended").success());
    let path = unit_file(&out, "ground", 3);
    let right = std::fs::read(&path).expect("read");
    let neighbour = std::fs::read(unit_file(&out, "ground", 4)).expect("read");
    let mut flipped = right.clone();
    flipped[right.len() / 2] ^= 4;
    for (bytes, why) in [
        (flipped, "checksum or trailer do not match"),
        (right[..right.len() - 9].to_vec(), "checksum or trailer do not match"),
        (neighbour, "number of the unit do not match"),
        (b"something else".to_vec(), "shorter than a header"),
        (vec![7; 400], "not a file of chainage"),
    ] {
        std::fs::write(&path, bytes).expect("written");
        refused(
            "reduce",
            &out,
            &reduce,
            6,
            &["unit 3 of pass ground cannot be used", "unit-000003.bin", why],
        );
        assert_eq!(due_after("next", &out, &[]).units, [3], "{why}");
    }
    assert!(worker(&out, "ground", &[3]).wait().expect("ended").success());
    assert!(std::fs::read(&path).expect("read") == right, "computed again with the same bytes");
    due_after("reduce", &out, &reduce);
}

#[test]
fn units_that_appear_late_are_waited_for() {
    let inputs = Inputs::new("street.las");
    let out = inputs.path("out");
    let due = inputs.open(&out, &["--tile-length", "15", "--memory", "256M"]);
    assert!(worker(&out, due.pass(), &due.units).wait().expect("ended").success());
    // As on a host that sees file names of another host late.
    let hidden_during = |path: &Path, run: &dyn Fn()| {
        let aside = inputs.path("aside");
        std::fs::rename(path, &aside).expect("moved");
        std::thread::scope(|scope| {
            scope.spawn(|| {
                std::thread::sleep(Duration::from_millis(400));
                std::fs::rename(&aside, path).expect("moved back");
            });
            run();
        });
    };
    let reduce = ["--after", due.pass(), "--wait"];
    let path = unit_file(&out, due.pass(), 0);
    hidden_during(&path, &|| {
        refused("reduce", &out, &[&reduce[..], &["0"]].concat(), 6, &["are missing: 0"]);
        due_after("reduce", &out, &[&reduce[..], &["30"]].concat());
    });
    let next = due_after("next", &out, &[]);
    let work = ["--pass", next.pass(), "--units", "0", "--wait"];
    // The mark of the previous pass, and one of its units.
    for late in [path.with_file_name("complete.json"), path] {
        hidden_during(&late, &|| {
            let output = command("work", &out, &work).arg("0").output().expect("starts");
            assert!(!output.status.success(), "{} is not needed", late.display());
            let output = command("work", &out, &work).arg("30").output().expect("starts");
            assert!(output.status.success(), "{}: {}", late.display(), ended(&output).1);
        });
        std::fs::remove_file(unit_file(&out, next.pass(), 0)).expect("removed");
    }
}

#[test]
fn a_worker_on_a_full_disk_fails_alone() {
    let inputs = Inputs::new("street.las");
    let options = ["--tile-length", "8", "--memory", "256M"];
    let alone = inputs.alone(&options);
    let out = inputs.path("out");
    let due = inputs.open(&out, &options);
    to_the_end(&out, due, |pass, units| {
        // A limit of file sizes simulates a full disk. The signal that comes with it is ignored.
        let text = "trap '' XFSZ; ulimit -f 1; exec \"$@\"";
        let units = list(units);
        let mut full = Command::new("sh");
        full.args(["-c", text, "sh"]).arg(env!("CARGO_BIN_EXE_chainage")).arg("work").arg(&out);
        let full = full.args(["--pass", pass, "--units", &units, "--wait", "0"]).output().expect("starts");
        let (code, errors) = ended(&full);
        assert!(code == 0 || (code == 5 && errors.contains("cannot write")), "{pass}: {code} {errors}");
        if pass == "ground" {
            assert_eq!(code, 5, "the limit is not noticed");
        }
        let rest = due_after("next", &out, &[]).units;
        assert!(rest.is_empty() || worker(&out, pass, &rest).wait().expect("ended").success());
    });
    assert_same_outputs(&alone, &out, "after a worker without room");
}

/// Ends the run as soon as a pass starts.
struct EndsTheRun<'a> {
    out: &'a Path,
    pass: &'static str,
}

impl Observer for EndsTheRun<'_> {
    fn event(&self, event: &Event<'_>) {
        if matches!(event, Event::PassStarted { pass, .. } if *pass == self.pass) {
            let due = due_after("next", self.out, &[]);
            to_the_end(self.out, due, |pass, units| {
                assert!(worker(self.out, pass, units).wait().expect("ended").success(), "{pass}");
            });
        }
    }
}

#[test]
fn a_worker_that_is_late_ends_well_when_others_have_ended_the_run() {
    let inputs = Inputs::new("street.laz");
    let options = ["--tile-length", "8", "--memory", "256M", "--set", "output.copc=true"];
    let alone = inputs.alone(&options);
    for pass in ["relabel", "copc nodes", "export"] {
        let out = inputs.path(pass);
        let mut due = inputs.open(&out, &options);
        while due.pass() != pass {
            let before = due.pass().to_owned();
            assert!(
                due.units.is_empty() || worker(&out, &before, &due.units).wait().expect("ended").success()
            );
            due = due_after("reduce", &out, &["--after", &before]);
        }
        let shared = SharedRun {
            out: out.clone(),
            wait: Duration::ZERO,
            registries: chainage::run::Registries::default(),
        };
        let resolve = |path: &Path| Ok(chainage::config::Config::resolve(Some(path), &[])?);
        let observer = EndsTheRun { out: &out, pass };
        let late =
            chainage::run::work(&shared, (pass, &Units::All), resolve, &observer, &CancelToken::default());
        late.unwrap_or_else(|error| panic!("{pass}: {error}"));
        assert_same_outputs(&alone, &out, pass);
        assert_eq!(due_after("next", &out, &[]).pass, None, "{pass}");
    }
}

/// Opens the run with other settings as soon as a pass starts, so that earlier passes are cleared.
struct OpensAnew<'a> {
    inputs: &'a Inputs,
    out: &'a Path,
}

impl Observer for OpensAnew<'_> {
    fn event(&self, event: &Event<'_>) {
        if matches!(event, Event::PassStarted { .. }) {
            let mut due = self.inputs.open(self.out, &["--tile-length", "11", "--memory", "256M"]);
            while due.pass() != "relabel" {
                let pass = due.pass().to_owned();
                let units = &due.units;
                assert!(units.is_empty() || worker(self.out, &pass, units).wait().expect("ended").success());
                due = due_after("reduce", self.out, &["--after", &pass]);
            }
        }
    }
}

#[test]
fn a_late_worker_of_earlier_settings_says_that_the_state_has_changed() {
    let inputs = Inputs::new("street.las");
    for pass in ["cluster", "relabel"] {
        let out = inputs.path(pass);
        let mut due = inputs.open(&out, &["--tile-length", "8", "--memory", "256M"]);
        while due.pass() != pass {
            let before = due.pass().to_owned();
            let units = &due.units;
            assert!(units.is_empty() || worker(&out, &before, units).wait().expect("ended").success());
            due = due_after("reduce", &out, &["--after", &before]);
        }
        let shared = SharedRun {
            out: out.clone(),
            wait: Duration::ZERO,
            registries: chainage::run::Registries::default(),
        };
        let resolve = |path: &Path| Ok(chainage::config::Config::resolve(Some(path), &[])?);
        let observer = OpensAnew { inputs: &inputs, out: &out };
        let late =
            chainage::run::work(&shared, (pass, &Units::All), resolve, &observer, &CancelToken::default());
        let error = late.expect_err("the units are not those of the run");
        assert_eq!(error.kind(), chainage::ErrorKind::State, "{pass}: {error}");
        let text = format!("pass {pass} has not been opened for workers with these settings");
        assert_eq!(error.to_string(), text);
        std::fs::remove_dir_all(out).expect("removed");
    }
}

#[test]
fn a_reduction_waits_for_nobody_who_drives_the_run() {
    let inputs = Inputs::new("street.las");
    let out = inputs.path("out");
    let due = inputs.open(&out, &["--tile-length", "15", "--memory", "256M"]);
    let lock =
        std::fs::File::options().read(true).write(true).open(out.join(".chainage/lock")).expect("there");
    lock.lock().expect("free");
    let reduce = ["--after", due.pass(), "--wait", "0"];
    refused("reduce", &out, &reduce, 7, &["is in use by process", "on this host", "it has ended"]);
    // Workers need no lock.
    assert!(worker(&out, due.pass(), &due.units).wait().expect("ended").success());
    lock.unlock().expect("held");
    due_after("reduce", &out, &reduce);
}

/// Runs every job at once, the tasks of an array one after the other. Options are `--name=value` or switches.
const SBATCH: &str = r#"#!/bin/bash
last="" words=()
for word in "$@"; do
    case $word in
    --array=0-*) last=${word#--array=0-} ;;
    --*) ;;
    *) words+=("$word") ;;
    esac
done
for task in $(seq 0 "${last:-0}"); do SLURM_ARRAY_TASK_ID=$task bash "${words[@]}" >&2; done
echo 1
"#;

/// With tables alone, the pass `export` has no units: its reduction is submitted without an array.
#[test]
fn the_script_for_slurm_ends_with_and_without_labelled_copies() {
    use std::os::unix::fs::PermissionsExt;
    let inputs = Inputs::new("street.las");
    let bin = inputs.path("bin");
    std::fs::create_dir(&bin).expect("a folder");
    std::fs::write(bin.join("sbatch"), SBATCH).expect("written");
    std::fs::set_permissions(bin.join("sbatch"), PermissionsExt::from_mode(0o755)).expect("executable");
    let search = format!("{}:{}", bin.display(), std::env::var("PATH").expect("a path"));
    for (files, names) in
        [("[\"csv\"]", &["objects.csv"][..]), ("[\"points\",\"csv\"]", &["objects.csv", "street.las"])]
    {
        let files = format!("output.files={files}");
        let options = ["--method", "euclidean", "--ground", "voxel-column", "--set", &files];
        let alone = inputs.alone(&options);
        let out = inputs.path("by-slurm");
        let printed = program()
            .arg("slurm")
            .args(inputs.list())
            .arg("-o")
            .arg(&out)
            .args(options)
            .output()
            .expect("starts");
        let script = inputs.path("job.sh");
        std::fs::write(&script, printed.stdout).expect("written");
        let ran = Command::new("bash").arg(&script).env("PATH", &search).output().expect("starts");
        assert!(ran.status.success(), "{files}: {}", ended(&ran).1);
        for name in names {
            let read = |folder: &Path| std::fs::read(folder.join(name)).expect(name);
            assert!(read(&alone) == read(&out), "{name} with {files}");
        }
        for folder in [alone, out] {
            std::fs::remove_dir_all(folder).expect("removed");
        }
    }
}

#[test]
fn the_sample_is_shared_in_its_own_folder() {
    // Paths are recorded as they are on disk, so workers may start anywhere.
    let folder = scratch();
    let input = shipped("tests/data/mls_profiles.las");
    let mut plan = program();
    plan.args(["plan", "--units", "--json", "--tile-length", "40", "-o", "out"])
        .arg(&input)
        .current_dir(folder.path());
    let output = plan.output().expect("starts");
    assert!(output.status.success(), "{}", ended(&output).1);
    let due = Due::read(&output.stdout);
    let worker =
        command("work", &folder.path().join("out"), &["--pass", due.pass(), "--units", "0"]).output();
    assert!(worker.expect("starts").status.success());
}

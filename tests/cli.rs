//! The command line: every exit code, the error messages with their hints, tables and pages, and the choice
//! between standard output and standard error.
//!
//! Texts are part of the interface. To change one, change its snapshot (`INSTA_UPDATE=always cargo test
//! cli`).

use std::path::Path;
use std::process::{Command, Output};

use chainage::store::FORMAT_VERSION;

use crate::util::drive::scratch;
use crate::util::las::{Point, Shape, geographic};
use crate::util::program::program;
use crate::util::shipped;

/// Calls the program in a folder.
fn call(folder: &Path, arguments: &[&str]) -> Output {
    program().current_dir(folder).args(arguments).output().expect("the program starts")
}

/// Exit code, standard output, standard error.
fn told(output: &Output) -> String {
    let code = output.status.code().expect("an exit code");
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).expect("text");
    format!("exit code {code}\n--- stdout\n{}--- stderr\n{}", text(&output.stdout), text(&output.stderr))
}

fn stdout(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(0), "{}", told(output));
    assert!(output.stderr.is_empty(), "{}", told(output));
    String::from_utf8(output.stdout.clone()).expect("text")
}

/// A folder with the shipped samples.
fn samples() -> tempfile::TempDir {
    let folder = scratch();
    for name in ["tree_road_sweep.laz", "mls_profiles.las"] {
        std::fs::copy(shipped("tests/data").join(name), folder.path().join(name)).expect("copied");
    }
    folder
}

/// Arguments that make the output independent of the machine.
const FIXED: [&str; 4] = ["--threads", "2", "--memory", "256M"];

fn with_fixed<'a>(arguments: &[&'a str]) -> Vec<&'a str> {
    arguments.iter().copied().chain(FIXED).collect()
}

#[test]
fn help_of_the_program_and_of_every_command() {
    let folder = scratch();
    let help = stdout(&call(folder.path(), &["--help"]));
    let commands: Vec<&str> = help
        .lines()
        .skip_while(|line| *line != "Work with a drive:")
        .take_while(|line| *line != "Options:")
        .filter_map(|line| line.strip_prefix("  ")?.split(' ').next().filter(|name| !name.is_empty()))
        .collect();
    assert!(commands.len() >= 14, "{commands:?}");
    insta::assert_snapshot!("help", &help);
    for command in commands.iter().filter(|name| **name != "help") {
        let text = stdout(&call(folder.path(), &[command, "--help"]));
        assert!(text.contains("Usage: chainage"), "{text}");
        insta::assert_snapshot!(format!("help_{command}"), text);
    }
}

#[test]
fn info_of_the_samples() {
    let folder = samples();
    insta::assert_snapshot!("info_sweep", stdout(&call(folder.path(), &["info", "tree_road_sweep.laz"])));
    insta::assert_snapshot!("info_profiles", stdout(&call(folder.path(), &["info", "mls_profiles.las"])));
}

#[test]
fn plan_of_the_sample() {
    let folder = samples();
    let arguments = with_fixed(&["plan", "tree_road_sweep.laz", "--tile-length", "20"]);
    // The time follows from the speed of the machine.
    let page = stdout(&call(folder.path(), &arguments));
    let (before, time) = page.split_once("  time      ").expect("a time");
    insta::assert_snapshot!("plan_sweep", format!("{before}  time\n"));
    assert!(time.contains(" s\n"), "{time}");
    let before: Vec<_> = std::fs::read_dir(folder.path()).expect("readable").collect();
    assert_eq!(before.len(), 2, "looking leaves nothing behind");
}

#[test]
fn json_of_info_plan_run_and_status_is_json_with_the_same_figures() {
    let folder = samples();
    let json = |arguments: &[&str]| -> serde_json::Value {
        let output = call(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(0), "{}", told(&output));
        serde_json::from_slice(&output.stdout).expect("JSON and nothing else")
    };
    let info = json(&["info", "--json", "tree_road_sweep.laz"]);
    assert_eq!(info["points"], 71_841);
    // In every notation. A file leaves standard output for the page.
    assert_eq!(json(&["info", "--json", "-", "tree_road_sweep.laz"]), info);
    assert_eq!(json(&["info", "tree_road_sweep.laz", "--json=-"]), info);
    assert_eq!(json(&["info", "tree_road_sweep.laz", "--json"]), info);
    let page = stdout(&call(folder.path(), &["info", "--json=info.json", "tree_road_sweep.laz"]));
    assert!(page.contains("71,841 in 1 file"), "{page}");
    let written = std::fs::read(folder.path().join("info.json")).expect("written");
    assert_eq!(serde_json::from_slice::<serde_json::Value>(&written).expect("JSON"), info);
    let drawn = stdout(&call(folder.path(), &["plan", "tree_road_sweep.laz", "--svg", "-"]));
    assert!(drawn.starts_with("<svg") && drawn.ends_with("</svg>\n"), "{drawn}");
    let plan = json(&with_fixed(&["plan", "--json", "tree_road_sweep.laz", "--tile-length", "20"]));
    let tiles = plan["tiles"].as_array().expect("tiles");
    assert_eq!(tiles.iter().map(|tile| tile["points"].as_u64().expect("a count")).sum::<u64>(), 71_841);
    let run =
        json(&with_fixed(&["run", "--json", "tree_road_sweep.laz", "--tile-length", "20", "-o", "out"]));
    assert_eq!(run["points"], 71_841);
    assert_eq!(run["tiles"], tiles.len());
    assert_eq!(run["nothing_to_do"], false);
    let counts = &run["counts"];
    let sum: u64 =
        ["object", "ground", "low_noise", "high_noise"].iter().filter_map(|name| counts[name].as_u64()).sum();
    assert_eq!(sum, 71_841);
    let status = json(&["status", "--json", "out"]);
    assert_eq!(status["finished"], true);
    assert_eq!(
        json(&with_fixed(&["run", "--json", "tree_road_sweep.laz", "--tile-length", "20", "-o", "out"]))["nothing_to_do"],
        true
    );
}

#[test]
fn status_says_what_is_stale_and_why() {
    let folder = samples();
    let run =
        with_fixed(&["run", "tree_road_sweep.laz", "--tile-length", "20", "-o", "out", "--progress", "none"]);
    assert_eq!(call(folder.path(), &run).status.code(), Some(0));
    insta::assert_snapshot!("status_done", stdout(&call(folder.path(), &["status", "out"])));
    let why = ["status", "out", "--why", "--set", "euclidean.max_gap_m=0.5"];
    insta::assert_snapshot!("status_why", stdout(&call(folder.path(), &why)));
}

#[test]
fn the_drawing_of_a_plan_is_well_formed() {
    let folder = samples();
    let arguments = with_fixed(&["plan", "tree_road_sweep.laz", "--tile-length", "20", "--svg", "plan.svg"]);
    stdout(&call(folder.path(), &arguments));
    let svg = std::fs::read_to_string(folder.path().join("plan.svg")).expect("drawn");
    let open = well_formed(&svg);
    assert!(open.contains(&"path".to_owned()) && open.contains(&"polyline".to_owned()), "{open:?}");
}

/// The names of all elements of an XML text without entities, comments or CDATA. Panics if tags are not
/// nested.
fn well_formed(text: &str) -> Vec<String> {
    let mut open = Vec::new();
    let mut seen = Vec::new();
    let mut rest = text;
    while let Some(start) = rest.find('<') {
        assert!(!rest[..start].contains(['>', '&']), "loose text: {}", &rest[..start]);
        let end = start + rest[start..].find('>').expect("every < has its >");
        let tag = &rest[start + 1..end];
        assert!(!tag.contains('<') && tag.matches('"').count().is_multiple_of(2), "<{tag}>");
        let name: String =
            tag.trim_start_matches('/').chars().take_while(|c| c.is_ascii_alphanumeric()).collect();
        assert!(!name.is_empty(), "<{tag}>");
        if tag.starts_with('/') {
            assert_eq!(open.pop().as_ref(), Some(&name), "</{name}>");
        } else {
            seen.push(name.clone());
            if !tag.ends_with('/') {
                open.push(name);
            }
        }
        rest = &rest[end + 1..];
    }
    assert!(open.is_empty() && rest.trim().is_empty(), "not closed: {open:?}");
    seen
}

#[test]
fn pages_are_there_and_the_printed_configuration_is_accepted() {
    let folder = samples();
    let config = stdout(&call(folder.path(), &["config"]));
    assert_eq!(config, chainage::config::DEFAULT_TOML);
    std::fs::write(folder.path().join("all.toml"), config).expect("written");
    let plan = |arguments: &[&str]| stdout(&call(folder.path(), &with_fixed(arguments)));
    assert_eq!(plan(&["plan", "mls_profiles.las"]), plan(&["plan", "mls_profiles.las", "-c", "all.toml"]));
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        assert!(stdout(&call(folder.path(), &["completions", shell])).contains("chainage"), "{shell}");
    }
    let man = stdout(&call(folder.path(), &["man"]));
    assert!(man.contains(".TH chainage") && man.contains("chainage\\-run"), "{}", &man[..200]);
    insta::assert_snapshot!("methods", stdout(&call(folder.path(), &["methods"])));
}

#[test]
fn results_go_to_stdout_and_everything_else_to_stderr() {
    let folder = samples();
    let arguments =
        |progress| with_fixed(&["run", "mls_profiles.las", "-o", progress, "--progress", progress]);
    for progress in ["plain", "json", "none", "bar", "auto"] {
        let output = call(folder.path(), &arguments(progress));
        let (out, errors) =
            (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert_eq!(output.status.code(), Some(0), "{errors}");
        assert!(out.contains("10,310 points") && out.lines().count() == 4, "{out}");
        for line in errors.lines().filter(|_| progress == "json") {
            let event: serde_json::Value = serde_json::from_str(line).expect("a JSON object per line");
            assert!(event["event"].is_string(), "{line}");
        }
        assert_eq!(
            errors.contains("ground: "),
            ["plain", "auto"].contains(&progress),
            "{progress}: {errors}"
        );
    }
}

#[test]
fn a_reader_that_goes_away_is_no_failure() {
    let script =
        format!("{} config | head -1; echo \"code ${{PIPESTATUS[0]}}\"", env!("CARGO_BIN_EXE_chainage"));
    // Repeated, because the reader must have closed the pipe before the last write.
    let slow = format!("({} man; echo \"code $?\" >&2) | true", env!("CARGO_BIN_EXE_chainage"));
    let output = Command::new("bash").args(["-c", &script]).output().expect("a shell");
    assert!(String::from_utf8_lossy(&output.stdout).ends_with("code 0\n"), "{}", told(&output));
    for _ in 0..5 {
        let output = Command::new("bash").args(["-c", &slow]).output().expect("a shell");
        assert_eq!(String::from_utf8_lossy(&output.stderr), "code 0\n");
    }
}

/// The output of a call in a folder with samples, as a snapshot.
fn assert_told(name: &str, arguments: &[&str]) {
    let folder = samples();
    let put = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).expect("written");
    let points = [Point::at([0; 3]), Point::at([1_000; 3])];
    put("degrees.las", &Shape { records: geographic(), ..Shape::default() }.bytes(&points));
    put("empty.las", &Shape::default().bytes(&[]));
    let whole = Shape::default().bytes(&points);
    put("cut.las", &whole[..whole.len() - 30]);
    put("text.las", b"id,points\n1,50\n");
    put("two.las", &whole);
    put("moved.las", &Shape::default().bytes(&[points[0], Point::at([1_001; 3])]));
    put("three.las", &Shape::default().bytes(&[points[0], points[1], Point::at([2_000; 3])]));
    put("bad.toml", b"[euclidean\nd_t = 1\n");
    put("track.csv", b"time,x,y\n1,2,3\n");
    std::fs::create_dir_all(folder.path().join("again")).expect("a folder");
    put("again/mls_profiles.las", &whole);
    put("file", b"");
    let output = call(folder.path(), arguments);
    let text = told(&output).replace(&folder.path().display().to_string(), "[folder]");
    insta::assert_snapshot!(name, text);
}

#[test]
fn wrong_usage_ends_with_2() {
    assert_told("usage_no_output", &["run", "mls_profiles.las"]);
    assert_told("usage_unknown_command", &["go"]);
    assert_told("usage_memory", &["run", "mls_profiles.las", "-o", "out", "--memory", "lots"]);
    assert_told("usage_shell", &["completions", "sh"]);
}

#[test]
fn wrong_settings_end_with_3() {
    let run = |more: &'static str| ["run", "mls_profiles.las", "-o", "out", "--set", more];
    assert_told("config_unknown_key", &run("euclidean.dt=1"));
    assert_told("config_range", &run("street.min_points=0"));
    assert_told("config_type", &run("run.fail_fast=3"));
    assert_told("config_assignment", &run("euclidean"));
    assert_told("config_method", &["run", "mls_profiles.las", "-o", "out", "--method", "magic"]);
    assert_told("config_filter", &["plan", "mls_profiles.las", "--ground", "magic"]);
    assert_told("config_no_file", &["plan", "mls_profiles.las", "-c", "none.toml"]);
    assert_told("config_syntax", &["plan", "mls_profiles.las", "-c", "bad.toml"]);
    assert_told("config_tile_length", &["plan", "mls_profiles.las", "--tile-length", "0.1"]);
    assert_told("config_plan_outputs", &["plan", "mls_profiles.las", "--svg", "-", "--json"]);
    assert_told("config_format", &["run", "mls_profiles.las", "-o", "out", "--output-format", "shp"]);
}

#[test]
fn unusable_input_ends_with_4() {
    assert_told("input_missing", &["info", "none.las"]);
    assert_told("input_pattern", &["info", "none-*.las"]);
    assert_told("input_degrees", &["run", "degrees.las", "-o", "out"]);
    assert_told("input_empty", &["run", "empty.las", "-o", "out"]);
    assert_told("input_cut", &["run", "cut.las", "-o", "out"]);
    assert_told("input_text", &["info", "text.las"]);
    assert_told("input_twice", &["plan", "mls_profiles.las", "mls_profiles.las"]);
    assert_told("input_two_names", &["run", "mls_profiles.las", "again/mls_profiles.las", "-o", "out"]);
    assert_told("input_trajectory", &["plan", "mls_profiles.las", "--trajectory", "track.csv"]);
}

#[test]
fn what_cannot_be_written_ends_with_5() {
    assert_told("output_is_a_file", &["run", "mls_profiles.las", "-o", "file"]);
    assert_told("output_holds_input", &["run", "mls_profiles.las", "-o", "."]);
}

#[test]
fn a_state_that_does_not_match_ends_with_6() {
    assert_told("state_none", &["status", "out"]);
    let folder = samples();
    let run = |input: &str| call(folder.path(), &["run", input, "-o", "out", "--progress", "none"]);
    assert_eq!(run("mls_profiles.las").status.code(), Some(0));
    insta::assert_snapshot!("state_other_input", told(&run("tree_road_sweep.laz")));
    let version = folder.path().join("out/.chainage/version.json");
    std::fs::write(&version, r#"{ "program": "0.0.9", "state_version": 999 }"#).expect("written");
    let this = format!("this is {} (state version {FORMAT_VERSION})", env!("CARGO_PKG_VERSION"));
    insta::assert_snapshot!("state_version", told(&run("mls_profiles.las")).replace(&this, "[this program]"));
    std::fs::write(&version, "{").expect("written");
    insta::assert_snapshot!("state_damaged", told(&run("mls_profiles.las")));
}

#[test]
fn a_directory_in_use_ends_with_7() {
    let folder = samples();
    let run = ["run", "mls_profiles.las", "-o", "out", "--progress", "none"];
    assert_eq!(call(folder.path(), &run).status.code(), Some(0));
    let lock = std::fs::File::options()
        .write(true)
        .open(folder.path().join("out/.chainage/lock"))
        .expect("the lock of the finished run");
    lock.lock().expect("nobody holds it");
    let text = told(&call(folder.path(), &run));
    assert!(text.starts_with("exit code 7\n"), "{text}");
    assert!(text.contains("out is in use by process"), "{text}");
}

#[test]
fn damage_ends_with_4_or_a_warning() {
    let folder = samples();
    let path = folder.path().join("tree_road_sweep.laz");
    let whole = std::fs::read(&path).expect("the sample");
    let points_at = u32::from_le_bytes(whole[96..100].try_into().expect("four bytes")) as usize;
    // The first layer of the first chunk claims to be longer than the chunk. Its size follows 8 bytes for the
    // chunk table, the first record (30 bytes) and the number of points.
    let mut bytes = whole;
    bytes[points_at + 42..points_at + 46].copy_from_slice(&[0xff, 0xff, 0xff, 0x7f]);
    std::fs::write(&path, &bytes).expect("written");
    let run = ["run", "tree_road_sweep.laz", "-o", "out", "--progress", "none"];
    insta::assert_snapshot!("input_damaged_chunk", told(&call(folder.path(), &run)));
    // LAZ has no checksums. Damage that can still be decoded shows as points outside the box of the header.
    let path = folder.path().join("mls_profiles.las");
    let mut bytes = std::fs::read(&path).expect("the sample");
    let points_at = u32::from_le_bytes(bytes[96..100].try_into().expect("four bytes")) as usize;
    bytes[points_at + 2] ^= 0x08;
    std::fs::write(&path, &bytes).expect("written");
    let text = told(&call(folder.path(), &["run", "mls_profiles.las", "-o", "other", "--progress", "none"]));
    assert!(text.contains("outside the boxes that the headers give"), "{text}");
}

#[test]
fn points_that_differ_end_with_9() {
    let score = |name: &str, prediction: &str| {
        let labels = [
            "--prediction-dim",
            "user_data",
            "--reference-dim",
            "user_data",
            "--class-dim",
            "none",
            "--scratch",
            ".",
        ];
        assert_told(name, &[&["eval", prediction, "--reference", "two.las"], &labels[..]].concat());
    };
    score("eval_moved", "moved.las");
    score("eval_longer", "three.las");
}

#[test]
fn the_demo_runs() {
    let folder = scratch();
    let output = call(folder.path(), &["demo"]);
    assert_eq!(output.status.code(), Some(0), "{}", told(&output));
    let out = folder.path().join("chainage-demo/output");
    for name in ["tree_road_sweep.laz", "objects.csv", "objects.geojson", "report.json", "report.html"] {
        assert!(out.join(name).exists(), "{name}");
    }
    let report: serde_json::Value =
        serde_json::from_slice(&std::fs::read(out.join("report.json")).expect("read")).expect("JSON");
    assert!(report["result"]["objects"].as_u64().expect("a count") > 20);
}

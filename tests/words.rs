//! The texts that a user types and reads: did-you-mean, presets, dry runs, silence, pages, and warnings that
//! ask. One test for each expectation.

use std::path::Path;
use std::process::Output;

use crate::util::drive::scratch;
use crate::util::las::{Point, Shape};
use crate::util::program::program;
use crate::util::{shipped, skipped};

const SAMPLE: &str = "mls_profiles.las";
const SWEEP: &str = "tree_road_sweep.laz";

fn call(folder: &Path, arguments: &[&str]) -> Output {
    program().current_dir(folder).args(arguments).output().expect("the program starts")
}

fn code(output: &Output) -> i32 {
    output.status.code().expect("an exit code")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("text")
}

/// Standard output of a call that succeeds.
fn told(folder: &Path, arguments: &[&str]) -> String {
    let output = call(folder, arguments);
    assert_eq!(code(&output), 0, "{arguments:?}: {}", text(&output.stderr));
    text(&output.stdout)
}

/// Standard error of a call that fails with `expected`.
fn refused(folder: &Path, arguments: &[&str], expected: i32) -> String {
    let output = call(folder, arguments);
    let errors = text(&output.stderr);
    assert_eq!(code(&output), expected, "{arguments:?}: {errors}");
    errors
}

/// A folder with both shipped samples.
fn samples() -> tempfile::TempDir {
    let folder = scratch();
    for name in [SWEEP, SAMPLE] {
        std::fs::copy(shipped("tests/data").join(name), folder.path().join(name)).expect("copied");
    }
    folder
}

#[test]
fn a_mistyped_setting_is_followed_by_the_one_that_was_meant() {
    let folder = samples();
    let set = |text: &str| refused(folder.path(), &["plan", SAMPLE, "--set", text], 3);
    let mistyped = set("euclidian.d_t=0.4");
    assert!(
        mistyped.starts_with("error: there is no setting euclidian.d_t: did you mean euclidean.max_gap_m?\n")
    );
    let bare = set("d_t=1");
    assert!(
        bare.contains(
            "d_t is euclidean.max_gap_m and density-peaks.scale_above now: write euclidean.max_gap_m=1"
        ),
        "{bare}"
    );
    let typed = set("noise.voxel=wide");
    assert!(typed.contains("noise.voxel = \"wide\": must be a number"), "{typed}");
}

#[test]
fn a_wrong_method_points_to_the_list_and_help_names_all() {
    let folder = samples();
    let wrong = refused(folder.path(), &["plan", SAMPLE, "--method", "euclidian"], 3);
    assert!(wrong.contains("there is no clustering method euclidian: did you mean euclidean?"), "{wrong}");
    assert!(wrong.contains("hint: chainage methods"), "{wrong}");
    let help = told(folder.path(), &["run", "--help"]);
    for entry in chainage::cluster::REGISTRY {
        assert!(help.contains(entry.name), "{}", entry.name);
    }
    for entry in chainage::ground::REGISTRY {
        assert!(help.contains(entry.name), "{}", entry.name);
    }
}

#[test]
fn presets_are_built_in_listed_and_used() {
    let folder = samples();
    let list = told(folder.path(), &["config", "--presets"]);
    assert!(list.contains("dense-trees") && list.contains("crowns"), "{list}");
    let effective = told(folder.path(), &["config", "--effective", "--preset", "dense-trees"]);
    assert!(
        effective.contains("method = \"density-peaks\"") && effective.contains("min_separation = 5.0"),
        "{effective}"
    );
    // A flag overrides a preset.
    let over = ["config", "--effective", "--preset", "dense-trees", "--method", "euclidean"];
    assert!(told(folder.path(), &over).contains("method = \"euclidean\""));
    let wrong = refused(folder.path(), &["plan", SAMPLE, "--preset", "dense-tree"], 3);
    assert!(wrong.contains("there is no preset dense-tree: did you mean dense-trees?"), "{wrong}");
    assert!(wrong.contains("hint: chainage config --presets"), "{wrong}");
}

#[test]
fn a_configuration_file_is_checked_without_a_drive() {
    let folder = samples();
    let write = |text: &str| std::fs::write(folder.path().join("my.toml"), text).expect("written");
    let check = ["config", "--check", "my.toml"];
    write("[euclidean]\nmax_gap_m = 0.4\n[noise]\nenabled = true\n");
    let page = told(folder.path(), &check);
    assert_eq!(page, "my.toml: valid, 1 setting differs from the defaults\n  euclidean.max_gap_m = 0.4\n");
    // The settings of a method that is not chosen are checked as well.
    write("[density-peaks]\nmerge_below = 7.0\n");
    assert!(refused(folder.path(), &check, 3).contains("density-peaks.merge_below = 7: must be"));
    write("[euclidean]\ndt = 0.4\n");
    assert!(refused(folder.path(), &check, 3).contains("did you mean euclidean.max_gap_m?"));
}

#[test]
fn settings_have_speaking_names_and_the_old_ones_are_read_with_a_warning() {
    let folder = samples();
    let all = told(folder.path(), &["config"]);
    for (name, symbol) in
        [("max_gap_m = 0.3", "d_t:"), ("min_density = 4.0", "rho_t:"), ("merge_below = 0.04", "c_t:")]
    {
        let line = all.lines().find(|line| line.starts_with(name)).unwrap_or_else(|| panic!("{name}: {all}"));
        assert!(line.contains(symbol), "the symbol of the paper: {line}");
    }
    let warning = "euclidean.d_t is called euclidean.max_gap_m now: the old name is read until version 0.2";
    let old = ["--set", "euclidean.d_t=0.4", "--method", "euclidean"];
    let plan = told(folder.path(), &[&["plan", SAMPLE], &old[..]].concat());
    assert!(plan.contains(&format!("  warning: {warning}\n")), "{plan}");
    let run = call(folder.path(), &[&["run", SAMPLE, "-o", "out", "-q"], &old[..]].concat());
    assert!(text(&run.stderr).contains(warning), "{}", text(&run.stderr));
    // The setting is recorded under its new name, so nothing has to be computed again.
    let status = told(folder.path(), &["status", "out", "--why", "--set", "euclidean.max_gap_m=0.4"]);
    assert!(!status.contains("must be redone"), "{status}");
    std::fs::write(folder.path().join("my.toml"), "[density-peaks]\nc_t = 0.1\n").expect("written");
    let check = told(folder.path(), &["config", "--check", "my.toml"]);
    assert!(
        check.contains("density-peaks.merge_below = 0.1\n  warning: density-peaks.c_t is called"),
        "{check}"
    );
}

#[test]
fn a_dry_run_shows_the_plan_and_writes_nothing() {
    let folder = samples();
    let fixed = ["--threads", "2", "--memory", "256M", "--tile-length", "20"];
    // The time is measured again by each call, so it is left out.
    let told = |folder: &Path, arguments: &[&str]| {
        let page = told(folder, arguments);
        page.lines().filter(|line| !line.starts_with("  time ")).map(str::to_owned).collect::<Vec<_>>()
    };
    let dry = told(folder.path(), &[&["run", SAMPLE, "-o", "out", "--dry-run"], &fixed[..]].concat());
    assert_eq!(dry, told(folder.path(), &[&["plan", SAMPLE], &fixed[..]].concat()));
    // It writes nothing, so it needs no folder.
    assert_eq!(dry, told(folder.path(), &[&["run", SAMPLE, "--dry-run"], &fixed[..]].concat()));
    assert!(!folder.path().join("out").exists());
}

/// The warning of a run of a sample without a coordinate system.
const NO_SYSTEM: &str = "warning: no coordinate system is known: coordinates are taken as metres (if they are feet, \
                         set input.unit), and other programs may take objects.geojson for degrees\n";

#[test]
fn quiet_is_silent_and_verbose_shows_settings_and_tiles() {
    let folder = samples();
    let run = |out: &str, flag: &str| {
        let output = call(
            folder.path(),
            &[
                "run",
                SAMPLE,
                "-o",
                out,
                flag,
                "--tile-length",
                "40",
                "--method",
                "euclidean",
                "--set",
                "euclidean.max_gap_m=0.4",
            ],
        );
        assert_eq!(code(&output), 0, "{}", text(&output.stderr));
        text(&output.stderr)
    };
    assert_eq!(run("quiet", "-q"), NO_SYSTEM);
    let verbose = run("verbose", "-v");
    assert!(verbose.contains("setting euclidean.max_gap_m = 0.4\n"), "{verbose}");
    assert!(verbose.contains("ground: unit 1 of ") && verbose.contains("ground 2 of 7"), "{verbose}");
}

#[test]
fn a_second_call_says_that_there_is_nothing_to_do() {
    let folder = samples();
    let run = ["run", SAMPLE, "-o", "out", "--progress", "plain"];
    assert_eq!(code(&call(folder.path(), &run)), 0);
    let again = call(folder.path(), &run);
    let (page, lines) = (text(&again.stdout), text(&again.stderr));
    assert!(page.ends_with("  nothing to do: out is up to date\n") && page.contains("1 tile\n"), "{page}");
    assert!(lines.contains("survey: already done\n") && !lines.contains("points/s"), "{lines}");
}

#[test]
fn status_names_the_setting_its_values_and_their_unit() {
    let folder = samples();
    assert_eq!(code(&call(folder.path(), &["run", SAMPLE, "-o", "out", "-q"])), 0);
    let why = told(folder.path(), &["status", "out", "--why", "--set", "noise.voxel=0.6"]);
    assert!(why.contains("  ground must be redone: noise.voxel changed from 0.5 to 0.6 m\n"), "{why}");
    assert!(!why.contains("lattice units"), "{why}");
    // The help has only options that count here, without those of the machine.
    let help = told(folder.path(), &["status", "--help"]);
    for flag in ["--threads", "--memory", "--no-mmap"] {
        assert!(!help.contains(flag), "{help}");
    }
}

#[test]
fn commands_offer_only_settings_that_have_an_effect_on_them() {
    let folder = samples();
    let passes = ["--preset", "--method", "--ground", "--model", "--tile-length"];
    let of_run = [&passes[..], &["--config", "--trajectory"]].concat();
    for (command, without, with) in [
        ("info", &passes[..], &["--config", "--set", "--trajectory", "--memory", "--no-mmap"][..]),
        (
            "train",
            &["--method"],
            &["--preset", "--config", "--ground", "--model", "--tile-length", "--threads"],
        ),
        ("work", &of_run, &["--set", "--threads", "--memory", "--no-mmap"]),
    ] {
        let help = told(folder.path(), &[command, "--help"]);
        let offers = |flag: &&&str| help.split_whitespace().any(|word| word == **flag);
        assert_eq!(without.iter().find(offers), None, "{help}");
        assert!(with.iter().all(|flag| offers(&flag)), "{help}");
    }
}

#[test]
fn a_fresh_run_removes_and_names_what_the_earlier_one_wrote() {
    let folder = samples();
    assert_eq!(code(&call(folder.path(), &["run", SAMPLE, "-o", "out", "-q"])), 0);
    std::fs::write(folder.path().join("out/notes.txt"), "mine").expect("written");
    let fresh = call(folder.path(), &["run", SWEEP, "-o", "out", "--fresh", "-q"]);
    assert_eq!(code(&fresh), 0, "{}", text(&fresh.stderr));
    let removed = "removed mls_profiles.las: an earlier call wrote it, and this one does not";
    assert!(text(&fresh.stderr).contains(removed), "{}", text(&fresh.stderr));
    let there = |name: &str| folder.path().join("out").join(name).exists();
    assert!(!there(SAMPLE) && there(SWEEP) && there("objects.csv"));
    assert!(there("notes.txt"), "a file of the user stays");
    assert!(folder.path().join(SAMPLE).exists(), "the input stays");
}

#[test]
fn results_never_replace_scans() {
    let folder = samples();
    let scan = || std::fs::read(folder.path().join(SAMPLE)).expect("the scan");
    let before = scan();
    let json = format!("--json={SAMPLE}");
    for arguments in [
        &["plan", "--svg", SAMPLE, SWEEP][..],
        &["info", SWEEP, &json],
        &["eval", SWEEP, &json],
        &["run", SWEEP, "-o", "out", &json],
        &["train", SWEEP, "-o", SAMPLE],
        &["train", SWEEP, "-o", "no-folder/a.model"],
    ] {
        let refused = call(folder.path(), arguments);
        assert_eq!(code(&refused), 2, "{arguments:?}: {}", text(&refused.stderr));
        let errors = text(&refused.stderr);
        let told = errors.contains("contains points (LAS or LAZ) and is not replaced")
            || errors.contains("cannot write no-folder/a.model");
        assert!(told, "{arguments:?}: {errors}");
    }
    assert!(scan() == before && !folder.path().join("out").exists());
}

#[test]
fn errors_are_lines_of_json_where_progress_is() {
    let folder = samples();
    let failed = call(folder.path(), &["run", "none.las", "-o", "out", "--progress", "json"]);
    assert_eq!(code(&failed), 4);
    let errors = text(&failed.stderr);
    let lines: Vec<serde_json::Value> =
        errors.lines().map(|line| serde_json::from_str(line).expect(line)).collect();
    let last = lines.last().expect("a line");
    assert_eq!((&last["event"], &last["exit_code"]), (&"error".into(), &4.into()), "{errors}");
    assert!(last["error"].as_str().is_some_and(|error| error.contains("none.las")), "{errors}");
    assert!(last["hint"].is_string() && last["causes"].is_array(), "{errors}");
}

#[test]
fn a_section_that_is_scored_is_told_apart() {
    let folder = samples();
    assert_eq!(
        code(&call(
            folder.path(),
            &["synth", "lane", "-o", "drive", "--length", "40m", "--pulse-rate", "20kHz"]
        )),
        0
    );
    let section = ["run", "drive", "-o", "part", "--from", "10", "--to", "20", "--outputs", "points", "-q"];
    assert_eq!(code(&call(folder.path(), &section)), 0);
    let scored = call(folder.path(), &["eval", "part"]);
    assert_eq!(code(&scored), 0, "{}", text(&scored.stderr));
    let warned = text(&scored.stderr);
    assert!(warned.contains("part is the result of chainage 10 to 20 m of"), "{warned}");
}

#[test]
fn files_far_apart_are_asked_about() {
    let folder = scratch();
    for (name, x) in [("near.las", 0), ("far.las", 20_000_000)] {
        let points: Vec<Point> = (0..20).map(|step| Point::at([x + step * 100, 0, 0])).collect();
        std::fs::write(folder.path().join(name), Shape::default().bytes(&points)).expect("written");
    }
    let plan = told(folder.path(), &["plan", "near.las", "far.las"]);
    assert!(
        plan.contains(
            "warning: the files lie 20 km apart (the largest gap between neighbours): is this one drive?"
        ),
        "{plan}"
    );
    assert!(!told(folder.path(), &["plan", "near.las"]).contains("apart"));
}

#[test]
fn a_tile_beyond_the_budget_is_mentioned_once() {
    let folder = scratch();
    // Half a million points within a square metre cannot be divided into tiles.
    let points: Vec<Point> =
        (0..500_000).map(|step| Point::at([step % 997, step / 997, step % 13])).collect();
    std::fs::write(folder.path().join("dense.las"), Shape::default().bytes(&points)).expect("written");
    let plan = told(folder.path(), &["plan", "dense.las", "--memory", "16M"]);
    let words = "more than the memory budget of 16 MiB (--memory)";
    assert_eq!(plan.matches(words).count(), 1, "{plan}");
    assert!(plan.contains("warning: a tile needs ") && plan.contains("it runs by itself"), "{plan}");
}

#[test]
fn numbers_that_are_none_are_explained_by_an_example() {
    let folder = samples();
    let plan = |flag: &str, value: &str| refused(folder.path(), &["plan", SAMPLE, flag, value], 2);
    for value in ["two", "-3", "0"] {
        assert!(
            plan("--threads", value).contains("--threads takes a number from 1 to 1024, for example 2"),
            "{value}"
        );
        assert!(plan("--tile-length", value).contains("must be a number above 0 m"), "{value}");
    }
    assert!(plan("--memory", "-3G").contains("-3G is"));
}

#[test]
fn folders_below_are_searched_on_request() {
    let folder = samples();
    let below = folder.path().join("drives/monday");
    std::fs::create_dir_all(&below).expect("a folder");
    std::fs::rename(folder.path().join(SAMPLE), below.join(SAMPLE)).expect("moved");
    assert!(refused(folder.path(), &["info", "drives"], 4).contains("no LAS or LAZ file"));
    assert!(told(folder.path(), &["info", "drives", "--recursive"]).contains("10,310 in 1 file"));
    assert!(
        refused(folder.path(), &["info", "drives/monday/..", "-r", "none"], 4).contains("cannot read none")
    );
}

#[test]
fn the_manual_has_a_page_for_every_command() {
    let folder = scratch();
    let page = told(folder.path(), &["man", "run"]);
    assert!(page.contains(".TH chainage-run") && page.contains("chainage run"), "{page}");
    assert!(page.contains("tile\\-length"), "{page}");
    assert!(refused(folder.path(), &["man", "walk"], 3).contains("one of info, plan, run"));
    assert_eq!(told(folder.path(), &["man", "--all", "pages"]), "");
    let mut names: Vec<String> = std::fs::read_dir(folder.path().join("pages"))
        .expect("the folder")
        .map(|entry| entry.expect("an entry").file_name().into_string().expect("a name"))
        .collect();
    names.sort();
    assert!(
        names.contains(&"chainage.1".to_owned()) && names.contains(&"chainage-eval.1".to_owned()),
        "{names:?}"
    );
    // Every page to which the first one refers exists.
    let first = std::fs::read_to_string(folder.path().join("pages/chainage.1")).expect("written");
    for reference in first.split("chainage\\-").skip(1) {
        let name: String =
            reference.chars().take_while(|c| c.is_ascii_alphabetic() || *c == '\\' || *c == '-').collect();
        let name = format!("chainage-{}.1", name.replace('\\', ""));
        assert!(name == "chainage-help.1" || names.contains(&name), "{name}");
    }
}

#[test]
fn commands_are_listed_in_groups() {
    let folder = scratch();
    let help = told(folder.path(), &["--help"]);
    let titles = ["Work with a drive:", "Check and measure:", "Settings and pages:"];
    let places: Vec<usize> = titles.iter().map(|title| help.find(title).expect("a title")).collect();
    assert!(places.is_sorted(), "{help}");
}

#[test]
fn the_demo_says_where_its_result_is_and_has_json() {
    let folder = scratch();
    let page = told(folder.path(), &["demo"]);
    let last = page.lines().last().expect("a line");
    assert!(
        last.contains("chainage-demo/output/tree_road_sweep.laz") && last.contains("cluster_id"),
        "{page}"
    );
    let json: serde_json::Value =
        serde_json::from_str(&told(folder.path(), &["demo", "--json"])).expect("JSON");
    assert_eq!(json["points"], 71_841);
    let ignored = std::fs::read_to_string(shipped(".gitignore")).expect("the list");
    assert!(ignored.lines().any(|line| line == "/chainage-demo"));
}

#[test]
fn a_missing_coordinate_system_is_named_as_missing() {
    let folder = samples();
    let info = told(folder.path(), &["info", SAMPLE]);
    assert!(
        info.contains("  CRS       not given in the files (coordinates are taken as metres)\n"),
        "{info}"
    );
    assert!(info.contains("points/m²"), "{info}");
}

#[test]
fn colours_are_for_terminals_only() {
    let folder = samples();
    for arguments in [&["plan", "none.las"][..], &["run", SAMPLE, "-o", "."], &["run", SAMPLE, "-o", "out"]] {
        let output = call(folder.path(), arguments);
        assert!(!text(&output.stderr).contains('\u{1b}') && !text(&output.stdout).contains('\u{1b}'));
    }
    // `script` provides a terminal. If it is missing, this part cannot be tested.
    let shown = |colour: &str| {
        let line = format!("{colour} {} plan none.las", env!("CARGO_BIN_EXE_chainage"));
        let script = std::process::Command::new("script").args(["-qec", &line, "/dev/null"]).output();
        script.ok().map(|output| text(&output.stdout))
    };
    let Some(coloured) = shown("TERM=xterm NO_COLOR=") else {
        return skipped("colours at a terminal (the program script is not installed)");
    };
    assert!(coloured.contains("\u{1b}[1;31merror:\u{1b}[0m"), "{coloured:?}");
    assert!(!shown("TERM=xterm NO_COLOR=1").expect("it was there").contains('\u{1b}'));
}

#[test]
fn a_section_of_the_drive_is_planned_and_processed() {
    let folder = samples();
    let plan = told(folder.path(), &["plan", SAMPLE, "--from", "60", "--to", "90", "--tile-length", "50"]);
    assert!(plan.contains("  section   chainage 60 to 90 m of "), "{plan}");
    // Tiles beside the section only complete its objects. They are marked, and not counted.
    let rows: Vec<&str> = plan.lines().skip(1).take_while(|line| !line.is_empty()).collect();
    let beside = rows.iter().filter(|row| row.ends_with("beside the section")).count();
    assert!(beside > 0 && beside < rows.len(), "{plan}");
    assert!(plan.contains(&format!(" in {} tile", rows.len() - beside)), "{plan}");
    let page = told(folder.path(), &["run", SAMPLE, "-o", "out", "--from", "60", "--to", "90", "-q"]);
    assert!(page.contains("  chainage 60 to 90 m of ") && page.contains("1 tile\n"), "{page}");
    // To the end of the drive, and from its beginning.
    assert!(told(folder.path(), &["plan", SAMPLE, "--from", "60"]).contains("  section   chainage 60 to "));
    assert!(
        told(folder.path(), &["plan", SAMPLE, "--to", "90"]).contains("  section   chainage 0 to 90 m of ")
    );
    let refused =
        |arguments: &[&str], code| refused(folder.path(), &[&["plan", SAMPLE], arguments].concat(), code);
    let beyond = refused(&["--from", "5000"], 3);
    assert!(
        beyond.contains("there are no points from 5000 m on: the chainage of this drive is 0 to "),
        "{beyond}"
    );
    assert!(beyond.contains("hint: chainage info FILES"), "{beyond}");
    let turned = refused(&["--from", "90", "--to", "60"], 3);
    assert!(turned.contains("--to = 60: must be above --from, which is 90 m"), "{turned}");
    let typed = refused(&["--from", "-3"], 2);
    assert!(typed.contains("must be a chainage in metres, 0 or more, for example 250"), "{typed}");
    let over = refused(&["--to", "40", "--method", "dbscan", "--set", "dbscan.epsilon=auto"], 3);
    assert!(over.contains("hint: estimate it first with chainage estimate-epsilon FILES"), "{over}");
}

#[test]
fn a_plan_says_how_long_a_run_takes_as_a_range() {
    let folder = samples();
    // The quantities behind the time have unit tests; here the speed of the survey differs from call to call.
    let page = told(folder.path(), &["plan", SAMPLE, "--tile-length", "50", "--json=plan.json"]);
    let line = page.lines().find_map(|line| line.strip_prefix("  time      ")).expect("a line");
    assert!(line == "about 1 s" || (line.contains(" to ") && line.ends_with('s')), "{line}");
    let json = std::fs::read(folder.path().join("plan.json")).expect("written");
    let plan: serde_json::Value = serde_json::from_slice(&json).expect("JSON");
    let [least, most] = [0, 1].map(|at| plan["seconds"][at].as_f64().expect("a number"));
    assert!(0.0 < least && 2.0 * least < most, "{least} {most}");
}

#[test]
fn every_method_names_its_paper_by_author_year_and_doi() {
    let folder = scratch();
    let page = told(folder.path(), &["methods"]);
    let references: Vec<&str> = chainage::cluster::REGISTRY
        .iter()
        .map(|entry| entry.reference)
        .chain(chainage::ground::REGISTRY.iter().map(|entry| entry.reference))
        .collect();
    for reference in references {
        assert!(page.contains(reference), "{reference}");
        // A method that is not from a paper says so, and where it is described.
        let ours = reference.starts_with("ours, see benches/results/");
        assert!(ours || (reference.contains("doi:10.") && reference.contains(" et al. 20")), "{reference}");
    }
}

#[test]
fn a_drive_whose_ground_is_not_found_is_told_of_another_filter() {
    let folder = scratch();
    // Trunks beside each other from the ground up: no column is low, so the filter finds no ground.
    let mut points = Vec::new();
    for trunk in 0..400 {
        let (x, y) = (trunk % 20 * 300, trunk / 20 * 300);
        points.extend((0..60).map(|z| Point::at([x + 100, y + 100, z * 100])));
    }
    std::fs::write(folder.path().join("forest.las"), Shape::default().bytes(&points)).expect("written");
    let run = |filter: &str| {
        let list = ["run", "forest.las", "-o", filter, "-q", "--method", "euclidean", "--ground", filter];
        text(&call(folder.path(), &list).stderr)
    };
    let warned = run("voxel-column");
    assert!(warned.contains("warning: ") && warned.contains("--ground "), "{warned}");
    assert!(!run("none").contains("--ground "), "nothing is looked for");
}

#[test]
fn a_drive_most_of_which_is_too_steep_for_a_filter_is_told_of_another_one() {
    let folder = scratch();
    // 6 m level, then 12 m with a slope of one half.
    let place = |i: i64, j: i64| Point::at([i * 100, j * 100, (i - 60).max(0) * 50]);
    let points: Vec<Point> = (0..180).flat_map(|i| (0..60).map(move |j| place(i, j))).collect();
    std::fs::write(folder.path().join("hill.las"), Shape::default().bytes(&points)).expect("written");
    let run = |filter: &str| {
        let list = ["run", "hill.las", "-o", filter, "-q", "--method", "euclidean", "--ground", filter];
        text(&call(folder.path(), &list).stderr)
    };
    let warned = run("voxel-column");
    assert!(warned.contains("little ground") && warned.contains("--ground opening"), "{warned}");
    assert_eq!(run("opening"), NO_SYSTEM);
}

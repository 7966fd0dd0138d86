//! The messages of the program about unsuitable inputs, folders and settings, and that they are true. One
//! test for each message.

use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::OsStringExt;
use std::path::Path;

use crate::util::drive::{scratch, touch};
use crate::util::las::Shape;
use crate::util::program::{ended, program};
use crate::util::shipped;

const SAMPLE: &str = "mls_profiles.las";
const CHEAP: [&str; 4] = ["--method", "euclidean", "--ground", "voxel-column"];

/// Exit code, standard output and standard error of a call in a folder.
fn call(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let output = program().current_dir(folder).args(arguments).output().expect("the program starts");
    let (code, errors) = ended(&output);
    (code, String::from_utf8_lossy(&output.stdout).into_owned(), errors)
}

/// Standard output of a call that succeeds.
fn told(folder: &Path, arguments: &[&str]) -> String {
    let (code, text, errors) = call(folder, arguments);
    assert_eq!(code, 0, "{arguments:?}: {errors}");
    text
}

/// Standard error of a call that fails with `expected`.
fn refused(folder: &Path, arguments: &[&str], expected: i32) -> String {
    let (code, _, errors) = call(folder, arguments);
    assert_eq!(code, expected, "{arguments:?}: {errors}");
    errors
}

/// A folder with the sample in `drive`.
fn with_drive() -> tempfile::TempDir {
    let folder = scratch();
    let drive = folder.path().join("drive/first");
    std::fs::create_dir_all(&drive).expect("a folder");
    std::fs::copy(shipped("tests/data").join(SAMPLE), drive.join(SAMPLE)).expect("copied");
    folder
}

#[test]
fn outputs_inside_the_searched_folders_are_no_input() {
    let folder = with_drive();
    for search in [&["drive", "-r"][..], &["drive/*/*.las"]] {
        let run = [&["run"], search, &["-o", "drive/out", "-q"], &CHEAP].concat();
        told(folder.path(), &run);
        assert!(told(folder.path(), &run).contains("nothing to do"), "{search:?}");
        let plan = told(folder.path(), &[&run[..], &["--dry-run"]].concat());
        assert!(plan.contains("10,310 points in"), "{plan}");
        let status = told(folder.path(), &["status", "drive/out"]);
        assert!(status.contains("finished: every output is complete"), "{status}");
    }
    let info = told(folder.path(), &["info", "drive", "-r"]);
    assert!(info.contains("10,310 in 1 file,"), "{info}");
    // A folder with input is refused as output folder, and the message names an input file.
    let both = refused(folder.path(), &["run", "drive/first", "-o", "drive/first"], 5);
    assert!(both.contains("drive/first/mls_profiles.las would be overwritten"), "{both}");
    assert!(!folder.path().join("drive/first/.chainage").exists());
}

#[test]
fn the_folder_of_a_run_gives_each_point_once() {
    let folder = with_drive();
    told(folder.path(), &[&["run", "drive/first", "-o", "out", "-q", "--copc"][..], &CHEAP].concat());
    for input in ["out", "out/*.la[sz]"] {
        let info = told(folder.path(), &["info", input]);
        assert!(info.contains("10,310 in 1 file,") && !info.contains("drive.copc.laz"), "{info}");
    }
    let alone = told(folder.path(), &["info", "out/drive.copc.laz"]);
    assert!(alone.contains("COPC"), "{alone}");
}

#[test]
fn a_name_that_is_not_utf_8_is_refused_before_anything_is_written() {
    let folder = with_drive();
    let name = OsString::from_vec(b"gr\xfc\xdf.las".to_vec());
    let path = folder.path().join(&name);
    std::fs::copy(shipped("tests/data").join(SAMPLE), &path).expect("copied");
    for command in [&["info"][..], &["plan"], &["run", "-o", "out"]] {
        let mut call = program();
        let output = call.current_dir(folder.path()).args(command).arg(&name).output().expect("starts");
        let (code, errors) = ended(&output);
        assert_eq!(code, 4, "{errors}");
        assert!(
            errors.contains("gr\\xFC\\xDF.las\" is not UTF-8") && errors.contains("hint: rename"),
            "{errors}"
        );
    }
    assert!(!folder.path().join("out").exists());
}

#[test]
fn only_named_outputs_are_written_and_charts_are_listed() {
    let folder = with_drive();
    let run = |outputs: &str| {
        let to = ["run", "drive/first", "-o", "out", "-q", "--method", "density-peaks", "--outputs", outputs];
        let page = told(folder.path(), &to);
        let charts = std::fs::read_dir(folder.path().join("out")).expect("a folder").filter(|entry| {
            entry.as_ref().is_ok_and(|entry| entry.path().extension() == Some(OsStr::new("svg")))
        });
        (page, charts.count())
    };
    let (page, charts) = run("csv");
    assert!(page.contains("out: objects.csv, report.json\n") && charts == 0, "{page}");
    let (page, charts) = run("csv,charts");
    let listed = "out: objects.csv, density-peaks-decision.svg, density-peaks-curvature.svg, report.json\n";
    assert!(page.contains(listed) && charts == 2, "{page}");
    // A chart that is gone is written again.
    std::fs::remove_file(folder.path().join("out/density-peaks-decision.svg")).expect("removed");
    let (page, charts) = run("csv,charts");
    assert!(page.contains(listed) && charts == 2, "{page}");
    let (page, _) = run("csv,charts");
    assert!(page.contains("nothing to do"), "{page}");
    let empty = refused(folder.path(), &["run", "drive/first", "-o", "other", "--outputs", ""], 3);
    assert!(empty.contains("output.files = \"\": must be a list of these: points, "), "{empty}");
}

#[test]
fn las_codes_that_the_points_cannot_store_are_refused_and_those_without_objects_told() {
    let folder = with_drive();
    let run = |codes: &'static str| {
        [&["run", "drive/first", "-o", "out", "--outputs", "points", "--set", codes], &CHEAP[..]].concat()
    };
    // Point format 1 has five bits for the class.
    let text = refused(folder.path(), &run("output.classification=pole=64,tree=31"), 3);
    let told = "mls_profiles.las has point format 1 and LAS classes up to 31: pole cannot be 64";
    assert!(text.contains(told) && text.contains("choose codes up to 31"), "{text}");
    assert!(!folder.path().join("out").exists(), "a folder for a run that was refused");
    let text = refused(folder.path(), &run("output.classification=lamp=64"), 3);
    assert!(text.contains("as in pole=64,vehicle=65 (classes: tree, pole, vehicle, building,"), "{text}");
    let (code, _, text) = call(folder.path(), &run("output.classification=pole=20"));
    let told = "the LAS codes of output.classification have no effect: euclidean names no objects";
    assert!(code == 0 && text.contains(told), "{code} {text}");
}

#[test]
fn numbers_that_cannot_be_read_are_answered_with_an_example() {
    let folder = with_drive();
    for value in ["abc", "-3", "99999"] {
        let text = refused(folder.path(), &["view", "out", "--port", value], 2);
        assert!(text.contains("must be a whole number, from 0 to 65535, for example 8080"), "{text}");
    }
    for value in ["abc", "-3", "-3m"] {
        let text = refused(folder.path(), &["synth", "mixed", "-o", "x", "--length", value], 2);
        assert!(text.contains("must be a length, 0 or more, for example 500m"), "{text}");
    }
    let text = refused(folder.path(), &["synth", "mixed", "-o", "x", "--speed", "60-30"], 2);
    assert!(text.contains("must ascend from the lowest to the highest speed: write 30-60"), "{text}");
    let text = refused(folder.path(), &["train", "drive", "-o", "x.model", "--seed", "-1"], 2);
    assert!(text.contains("must be a whole number, 0 or more, for example 7"), "{text}");
}

#[test]
fn errors_have_the_form_of_the_progress() {
    let folder = with_drive();
    let json = ["run", "drive/first", "-o", "out", "--progress", "json", "--set", "a.b=1"];
    let text = refused(folder.path(), &json, 3);
    let event: serde_json::Value =
        serde_json::from_str(text.lines().last().expect("a line")).expect("a line of JSON");
    assert_eq!((&event["event"], &event["exit_code"]), (&"error".into(), &3.into()), "{text}");
    // The demo has the same options.
    let (code, _, errors) = call(folder.path(), &["demo", "-q"]);
    assert!(code == 0 && !errors.contains("survey"), "{errors}");
}

#[test]
fn status_tells_another_method_and_what_is_finished() {
    let folder = with_drive();
    told(folder.path(), &[&["run", "drive/first", "-o", "out", "-q"][..], &CHEAP].concat());
    let page = told(folder.path(), &["status", "out", "--why", "--method", "density-peaks"]);
    assert!(
        page.contains("  other passes are needed: cluster.method changed from euclidean to density-peaks\n"),
        "{page}"
    );
    assert!(
        page.contains("  finished with the settings of the last call; chainage run with these"),
        "{page}"
    );
    assert!(told(folder.path(), &["status", "out"]).ends_with("  finished: every output is complete\n"));
    std::fs::remove_file(folder.path().join("out/objects.csv")).expect("removed");
    assert!(told(folder.path(), &["status", "out"]).ends_with("  not finished: the same command resumes\n"));
    let page = told(folder.path(), &["status", "out", "--method", "dbscan"]);
    assert!(page.ends_with("  not finished: chainage run with these settings resumes\n"), "{page}");
}

#[test]
fn a_foreign_file_in_the_state_is_named_and_stays() {
    let folder = with_drive();
    let run = [&["run", "drive/first", "-o", "out", "-q"][..], &CHEAP].concat();
    let (code, _, errors) = call(folder.path(), &run);
    assert!(code == 0 && !errors.contains("did not write"), "{errors}");
    let note = folder.path().join("out/.chainage/note.txt");
    std::fs::write(&note, "mine").expect("written");
    let (code, _, errors) = call(folder.path(), &run);
    let warning =
        "warning: chainage did not write out/.chainage/note.txt: it stays until --fresh removes it\n";
    assert!(code == 0 && errors.contains(warning), "{errors}");
    assert!(note.is_file());
}

#[test]
fn a_drive_is_learned_from_once() {
    let folder = with_drive();
    let twice = refused(folder.path(), &["train", "drive", "drive/../drive", "-o", "x.model"], 3);
    assert!(twice.contains("train = drive/../drive: must be a drive that is given once"), "{twice}");
    let missing = refused(folder.path(), &["train", "--model", "x.model"], 2);
    assert!(missing.contains("--test <DRIVES>..."), "{missing}");
    assert!(missing.contains("train [OPTIONS] --model <MODEL> --test <DRIVES>...\n"), "{missing}");
}

#[test]
fn a_plan_counts_the_disk_of_every_output() {
    let folder = with_drive();
    let plan = told(folder.path(), &["run", "drive/first", "-o", "out", "--dry-run", "--copc"]);
    let disk = plan.lines().find(|line| line.starts_with("  disk ")).expect("a line");
    // 10,310 records of 40 bytes, and their numbers.
    assert!(disk.ends_with("of state, and the labelled copies, and drive.copc.laz, which needs 0.4 MiB more while it is written"), "{disk}");
    let csv = told(folder.path(), &["run", "drive/first", "-o", "out", "--dry-run", "--outputs", "csv"]);
    assert!(!csv.contains("labelled copies"), "{csv}");
}

#[test]
fn what_a_run_refuses_is_refused_by_a_plan_and_by_config() {
    let folder = with_drive();
    let run = ["run", "drive/first", "-o", "out", "--outputs", "nonsense"];
    let by_run = refused(folder.path(), &run, 3);
    assert!(by_run.contains("output.files = \"nonsense\": must be a list of these: points, csv"), "{by_run}");
    assert_eq!(refused(folder.path(), &[&run[..], &["--dry-run"]].concat(), 3), by_run);
    for value in ["output.files=['nonsense']", "output.dimension=Point_Source_ID", "output.dimension=GpsTime"]
    {
        let by_plan = refused(folder.path(), &["plan", "drive/first", "--set", value], 3);
        assert_eq!(refused(folder.path(), &["config", "--set", value], 3), by_plan);
        assert!(by_plan.contains(": must be a "), "{by_plan}");
    }
    // A setting of a method that this run does not use.
    let unused = ["drive/first", "--set", "euclidean.max_gap_m=-1"];
    let by_plan = refused(folder.path(), &[&["plan"], &unused[..]].concat(), 3);
    assert!(by_plan.contains("euclidean.max_gap_m = -1: must be 0.001 to 10 metres"), "{by_plan}");
    assert_eq!(refused(folder.path(), &[&["run", "-o", "out"], &unused[..]].concat(), 3), by_plan);
    // A whole number of 301 digits is still a number.
    for length in ["--tile-length", "--to"] {
        let text = refused(folder.path(), &["plan", "drive/first", length, "1e300"], 3);
        assert!(!text.contains("must be a number"), "{text}");
    }
}

#[test]
fn options_of_a_drive_are_refused_for_a_table() {
    let folder = with_drive();
    std::fs::write(folder.path().join("t.csv"), "x,y\n0,1\n2,3\n4,9\n").expect("written");
    for options in
        [&["--method", "dbscan"][..], &["--threads", "2"], &["-r"], &["--scratch", "s"], &["--set", "a.b=1"]]
    {
        let text = refused(folder.path(), &[&["estimate-epsilon", "t.csv"], options].concat(), 3);
        assert!(text.contains("t.csv: must be left out for a table"), "{text}");
    }
    let twice = ["cluster", "t.csv", "-o", "c.csv", "--method", "dbscan", "--columns", "x,y,x"];
    let text = refused(folder.path(), &twice, 3);
    assert!(text.contains("--columns = x: must be named once"), "{text}");
    std::fs::write(folder.path().join("t.csv"), "x,y\n0,1\n-1e308,3\n1e308,9\n").expect("written");
    let text = refused(folder.path(), &["cluster", "t.csv", "-o", "c.csv", "--method", "dbscan"], 4);
    assert!(text.contains("point 2 has the value -1e308; numbers above 1e150 cannot be clustered"), "{text}");
}

#[test]
fn a_model_that_is_not_there_is_no_scan() {
    let folder = with_drive();
    let text = refused(folder.path(), &["run", "drive/first", "-o", "out", "--model", "nothere"], 4);
    assert!(
        text.contains("cannot read the model ") && text.contains("hint: chainage train writes a model"),
        "{text}"
    );
    assert_eq!(text.matches("nothere").count(), 1, "the cause repeats the path: {text}");
}

#[test]
fn temporary_folders_are_new_and_are_removed() {
    let folder = with_drive();
    let estimate = ["estimate-epsilon", "drive/first", "--scratch", "for a time", "--progress", "none"];
    // The sample is too small for an estimate. The temporary folder is removed nevertheless.
    refused(folder.path(), &estimate, 4);
    assert_eq!(std::fs::read_dir(folder.path().join("for a time")).expect("a folder").count(), 0);
}

#[test]
fn a_refused_run_claims_no_name_and_records_no_settings() {
    let folder = with_drive();
    let path = |name: &str| folder.path().join(name);
    let run = |input: &'static str, more: &[&'static str]| {
        [&["run", input, "-o", "out"], more, &CHEAP[..]].concat()
    };
    told(folder.path(), &run("drive/first", &[]));
    let first = path("drive/first").join(SAMPLE);
    std::fs::copy(&first, path("precious.las")).expect("copied");
    let other = refused(folder.path(), &run("precious.las", &[]), 6);
    assert!(other.contains("file mls_profiles.las before, precious.las now"), "{other}");
    // A file of the user with the name that the refused run would have written.
    std::fs::copy(&first, path("out/precious.las")).expect("copied");
    told(folder.path(), &run("drive/first", &["--set", "euclidean.max_gap_m=0.5"]));
    assert!(path("out/precious.las").exists(), "a file of the user was removed");
    // Other content under the same name, with other settings.
    let mut bytes = std::fs::read(&first).expect("readable");
    let at = u32::from_le_bytes(bytes[96..100].try_into().expect("four bytes")) as usize;
    bytes[at] ^= 1;
    std::fs::write(&first, &bytes).expect("written");
    let changed = refused(folder.path(), &run("drive/first", &["--outputs", "csv,report"]), 6);
    assert!(changed.contains("the points of mls_profiles.las have changed"), "{changed}");
    bytes[at] ^= 1;
    std::fs::write(&first, &bytes).expect("written");
    let status = told(folder.path(), &["status", "out"]);
    assert!(status.contains("finished: every output is complete"), "{status}");
}

#[test]
fn results_without_the_record_of_their_input_are_refused() {
    let folder = with_drive();
    let run = |more: &[&'static str]| [&["run", "drive/first", "-o", "out", "-q"], more, &CHEAP].concat();
    told(folder.path(), &run(&[]));
    let record = folder.path().join("out/.chainage/input.json");
    std::fs::remove_file(&record).expect("removed");
    for call in [&run(&[])[..], &["status", "out"], &["next", "out"]] {
        let text = refused(folder.path(), call, 6);
        assert!(
            text.contains("input.json is missing, so the input of the results beside it is unknown"),
            "{text}"
        );
        assert!(text.contains("hint: start over here with chainage run --fresh"), "{text}");
    }
    assert!(!record.exists());
    told(folder.path(), &run(&["--fresh"]));
    assert!(record.exists());
}

#[test]
fn a_labelled_copy_with_the_name_of_another_output_is_refused() {
    let folder = with_drive();
    let cases: [(&str, &[&str], &str); 5] = [
        ("report.json", &[], "report.json"),
        ("Objects.csv", &[], "objects.csv"),
        ("report.html", &[], "report.html"),
        ("drive.copc.las", &["--copc", "--output-format", "laz"], "drive.copc.laz"),
        ("density-peaks-decision.svg", &["--method", "density-peaks"], "density-peaks-decision.svg"),
    ];
    for (input, more, output) in cases {
        std::fs::copy(shipped("tests/data").join(SAMPLE), folder.path().join(input)).expect("copied");
        for dry in [&[][..], &["--dry-run"]] {
            let text = refused(folder.path(), &[&["run", input, "-o", "out"], more, dry].concat(), 4);
            let told = format!(
                "the labelled copy of {input} would have the name of another output of the run, {output}"
            );
            assert!(text.contains(&told) && text.contains("hint: rename the input file"), "{text}");
            assert!(!folder.path().join("out").exists(), "a folder for a run that was refused");
        }
    }
    // Without labelled copies there is nothing to lose.
    told(folder.path(), &[&["run", "report.json", "-o", "out", "--outputs", "csv"], &CHEAP[..]].concat());
}

#[test]
fn a_dimension_with_a_control_character_is_refused() {
    let folder = with_drive();
    for name in ["\"a\\u0000b\"", "\"a\\nb\"", "\"a\\u007Fb\""] {
        let setting = format!("output.dimension={name}");
        let text = refused(folder.path(), &["run", "drive/first", "-o", "out", "--set", &setting], 3);
        assert!(text.contains("must be 1 to 31 printable ASCII characters"), "{text}");
    }
}

#[test]
fn a_drive_without_points_is_named_and_leaves_no_folder() {
    let folder = with_drive();
    Shape::default().write(&folder.path().join("empty.las"), &[]);
    let text = refused(folder.path(), &["run", "empty.las", "-o", "out"], 4);
    assert!(text.contains("there are no points in empty.las"), "{text}");
    assert!(!folder.path().join("out").exists());
    told(folder.path(), &[&["run", "drive/first", "-o", "out", "-q"][..], &CHEAP].concat());
}

#[test]
fn outputs_and_settings_of_outputs_without_effect_are_told() {
    let folder = with_drive();
    let cases: [(&[&str], &str); 8] = [
        (&["--outputs", "csv,charts"], "the output charts has no effect: euclidean draws none"),
        (
            &["--outputs", "csv", "--output-format", "laz"],
            "output.format = \"laz\" has no effect: no labelled copies are written",
        ),
        (
            &["--outputs", "copc", "--output-format", "las"],
            "output.format = \"las\" has no effect: no labelled copies are written",
        ),
        (
            &["--outputs", "copc", "--keep-original"],
            "output.original_classification = true has no effect: no labelled copies are written",
        ),
        (
            &["--outputs", "csv", "--keep-classification"],
            "output.classification = \"keep\" has no effect: no points are written",
        ),
        (
            &["--no-report", "--set", "output.report_mb=1"],
            "output.report_mb = 1.0 has no effect: report.html is not written",
        ),
        (
            &["--no-report", "--outputs", "csv,report"],
            "the output report has no effect: output.report is false (--no-report)",
        ),
        (
            &["--keep-classification", "--set", "output.classification=pole=20"],
            "output.classification=pole=20 has no effect: another option sets it to \"keep\"",
        ),
    ];
    for (more, told) in cases {
        let (code, _, text) =
            call(folder.path(), &[&["run", "drive/first", "-o", "out"], more, &CHEAP[..]].concat());
        assert_eq!(code, 0, "{more:?}: {text}");
        assert_eq!(text.matches("has no effect").count(), 1, "{more:?}: {text}");
        assert!(text.contains(told), "{more:?}: {text}");
    }
    // Settings that have an effect are not reported.
    let (_, _, text) = call(
        folder.path(),
        &[&["run", "drive/first", "-o", "out", "--copc", "--keep-original"], &CHEAP[..]].concat(),
    );
    assert!(!text.contains("has no effect"), "{text}");
}

#[test]
fn status_tells_a_touched_input_and_counts_no_more_stale_units_than_there_are() {
    let folder = with_drive();
    let run = ["run", "drive/first", "-o", "out", "-q", "--method", "density-peaks"];
    told(folder.path(), &run);
    assert!(!told(folder.path(), &["status", "out", "--why"]).contains("touched"));
    touch(&folder.path().join("drive/first").join(SAMPLE));
    let why = told(folder.path(), &["status", "out", "--why"]);
    let line = "mls_profiles.las was changed or touched since the run was started: the next run compares its content";
    assert!(why.contains(line) && why.contains("finished: every output is complete"), "{why}");
    told(folder.path(), &run);
    let why = told(folder.path(), &["status", "out", "--why"]);
    assert!(!why.contains("touched"), "{why}");
    let other = told(folder.path(), &["status", "out", "--set", "noise.voxel=0.6"]);
    let mut stale_ones = 0;
    for line in other.lines() {
        let [.., units, _, stale] = line.split_whitespace().collect::<Vec<_>>()[..] else { continue };
        let (Ok(units), Ok(stale)) = (units.parse::<u32>(), stale.parse::<u32>()) else { continue };
        assert!(stale <= units, "{other}");
        stale_ones += stale;
    }
    assert!(stale_ones > 0, "{other}");
    let text = refused(folder.path(), &["work", "out", "--pass", "ground", "--units", "99"], 3);
    assert!(text.contains("pass ground has 1 unit, and none has the number 99"), "{text}");
}

#[test]
fn a_finished_run_is_finished_when_its_input_is_gone() {
    let folder = with_drive();
    let run = [&["run", "drive/first", "-o", "out", "-q"][..], &CHEAP].concat();
    told(folder.path(), &run);
    std::fs::rename(folder.path().join("drive"), folder.path().join("moved")).expect("renamed");
    let status = told(folder.path(), &["status", "out"]);
    assert!(
        status.contains("the passes are not compared with the input: ") && status.contains("drive/first"),
        "{status}"
    );
    assert!(status.contains("finished: every output is complete"), "{status}");
    let next = told(folder.path(), &["next", "out", "--json"]);
    assert!(next.contains("\"pass\": null"), "{next}");
    let other = told(folder.path(), &["status", "out", "--set", "euclidean.max_gap_m=0.5"]);
    assert!(other.contains("finished with the settings of the last call"), "{other}");
    // A further output is gone as well.
    std::fs::remove_file(folder.path().join("out/objects.csv")).expect("removed");
    let text = refused(folder.path(), &["status", "out"], 4);
    assert!(text.contains("drive/first"), "{text}");
    refused(folder.path(), &["next", "out"], 4);
}

#[test]
fn a_finished_run_is_finished_when_its_model_is_gone() {
    let folder = with_drive();
    let model = folder.path().join("model.bin");
    std::fs::copy(shipped("src/cluster/street/model.bin"), &model).expect("copied");
    told(folder.path(), &["run", "drive/first", "-o", "out", "-q", "--model", "model.bin"]);
    std::fs::remove_file(&model).expect("removed");
    let status = told(folder.path(), &["status", "out"]);
    assert!(
        status.contains("cannot read the model") && status.contains("finished: every output"),
        "{status}"
    );
}

#[test]
fn points_beyond_the_count_are_named_by_every_command() {
    let folder = with_drive();
    let path = folder.path().join("drive/first").join(SAMPLE);
    let mut bytes = std::fs::read(&path).expect("the sample");
    bytes[107..111].copy_from_slice(&10_000_u32.to_le_bytes());
    std::fs::write(&path, &bytes).expect("written");
    let run = [&["run", "drive/first", "-o", "out", "--json"][..], &CHEAP].concat();
    let expected = format!(
        "{SAMPLE}: the header promises 10000 points, but 310 more records follow them (10310 in all)"
    );
    for arguments in [&run[..], &["info", "drive/first", "--json"], &["plan", "drive/first", "--json"]] {
        let text = told(folder.path(), arguments);
        assert!(text.contains(&expected), "{text}");
    }
    bytes[107..111].copy_from_slice(&[0; 4]);
    std::fs::write(&path, &bytes).expect("written");
    let text = refused(folder.path(), &run, 4);
    assert!(
        text.contains("the header promises no points, but the file has 10310 whole records")
            && text.contains("-set_number_of_point_records"),
        "{text}"
    );
}

#[test]
fn a_run_without_a_coordinate_system_says_so_in_one_line() {
    let folder = with_drive();
    for (outputs, unit, expected) in [
        (
            "csv,geojson",
            "auto",
            Some(
                "no coordinate system is known: coordinates are taken as metres (if they are feet, set input.unit), \
                 and other programs may take objects.geojson for degrees",
            ),
        ),
        (
            "csv",
            "auto",
            Some(
                "no coordinate system is known: coordinates are taken as metres (if they are feet, set input.unit)",
            ),
        ),
        (
            "geojson",
            "metre",
            Some("no coordinate system is known: other programs may take objects.geojson for degrees"),
        ),
        ("csv", "metre", None),
    ] {
        let unit = format!("input.unit={unit}");
        let run =
            ["run", "drive/first", "-o", "out", "--fresh", "--json", "--outputs", outputs, "--set", &unit];
        let json: serde_json::Value =
            serde_json::from_str(&told(folder.path(), &[&run[..], &CHEAP].concat())).expect("JSON");
        let warnings = json["warnings"].as_array().expect("a list");
        let found: Vec<&str> = warnings.iter().filter_map(serde_json::Value::as_str).collect();
        let about: Vec<&&str> = found.iter().filter(|text| text.contains("coordinate system")).collect();
        assert_eq!(about, expected.iter().collect::<Vec<_>>(), "{outputs} {unit}");
    }
}

#[test]
fn huge_numbers_have_an_exponent() {
    let folder = with_drive();
    let plan = [&["plan", "drive/first", "--set", "euclidean.max_gap_m=1e300"][..], &CHEAP].concat();
    let text = refused(folder.path(), &plan, 3);
    assert!(text.contains("euclidean.max_gap_m = 1e300: must be"), "{text}");
    let path = folder.path().join("drive/first").join(SAMPLE);
    let mut bytes = std::fs::read(&path).expect("the sample");
    // The largest x in the header, and then the smallest.
    bytes[179..187].copy_from_slice(&(-1e300_f64).to_le_bytes());
    std::fs::write(&path, &bytes).expect("written");
    let text = told(folder.path(), &["info", "drive/first"]);
    assert!(text.contains("points lie up to 1e300 m outside the boxes"), "{text}");
}

/// `--json` is the same everywhere: alone it prints JSON, and with an equals sign it names a file.
#[test]
fn json_means_the_same_in_every_command() {
    let folder = with_drive();
    let rows: String = (0..900).map(|i| format!("{} {}\n", i % 30, i / 30)).collect();
    std::fs::write(folder.path().join("grid.txt"), rows).expect("written");
    told(folder.path(), &[&["run", "drive", "-r", "-o", "out", "-q"][..], &CHEAP].concat());
    let eval = ["eval", "out", "--reference-dim", "cluster_id", "--class-dim", "none"];
    let cluster = ["cluster", "grid.txt", "--no-header", "--method", "p-linkage", "-o", "labelled.txt"];
    let epsilon = ["estimate-epsilon", "grid.txt", "--no-header"];
    for command in [&eval[..], &cluster, &epsilon] {
        for json in [&["--json"][..], &["--json", "-"], &["--json=-"]] {
            let text = told(folder.path(), &[command, json].concat());
            assert!(serde_json::from_str::<serde_json::Value>(&text).is_ok(), "{command:?} {json:?}: {text}");
        }
        let page = told(folder.path(), &[command, &["--json=facts.json"]].concat());
        assert!(!page.is_empty() && !page.starts_with('{'), "{page}");
        let facts = std::fs::read_to_string(folder.path().join("facts.json")).expect("written");
        assert!(serde_json::from_str::<serde_json::Value>(&facts).is_ok(), "{facts}");
        std::fs::remove_file(folder.path().join("facts.json")).expect("removed");
        let blank = refused(folder.path(), &[command, &["--json", "facts.json"]].concat(), 2);
        assert!(blank.contains("write '--json=facts.json' to write one"), "{blank}");
        assert!(!folder.path().join("facts.json").exists());
    }
    // The option comes before the input, and the input is not mistaken for its file.
    assert!(
        told(
            folder.path(),
            &["eval", "--json", "out", "--reference-dim", "cluster_id", "--class-dim", "none"]
        )
        .starts_with('{')
    );
}

#[test]
fn outputs_of_a_run_are_not_replaced_by_json() {
    let folder = with_drive();
    let run = [&["run", "drive", "-r", "-o", "out", "-q"][..], &CHEAP].concat();
    told(folder.path(), &run);
    let table = || std::fs::read(folder.path().join("out/objects.csv")).expect("the table");
    let before = table();
    for name in ["objects.csv", "report.json", "report.html", "drive.copc.laz", "density-peaks-curvature.svg"]
    {
        let json = format!("--json=out/{name}");
        let errors = refused(folder.path(), &[&run[..], &[&json]].concat(), 3);
        assert!(errors.contains(&format!("another file: {name} in out is an output of the run")), "{errors}");
    }
    let there = folder.path().join("out").display().to_string();
    refused(folder.path(), &[&run[..], &[&format!("--json={there}/../out/objects.csv")]].concat(), 3);
    assert!(table() == before);
    told(folder.path(), &[&run[..], &["--json=out/facts.json"]].concat());
    assert!(folder.path().join("out/facts.json").is_file());
}

#[test]
fn a_folder_is_not_standard_output() {
    let folder = with_drive();
    for command in
        [&["run", "drive", "-r", "-o", "-"][..], &["synth", "suburb", "-o", "-"], &["demo", "-o", "-"]]
    {
        let errors = refused(folder.path(), command, 2);
        assert!(errors.contains("a folder cannot be standard output"), "{errors}");
    }
    assert!(!folder.path().join("-").exists());
}

#[test]
fn a_list_of_outputs_may_have_blanks_and_surfaces_are_named() {
    let folder = with_drive();
    let run = ["run", "drive", "-r", "-o", "out", "-q", "--method", "p-linkage", "--outputs", "csv, report"];
    let page = told(folder.path(), &run);
    assert!(page.contains(" surfaces, ") && !page.contains(" objects, "), "{page}");
    assert!(folder.path().join("out/report.html").is_file());
    let none = [&["run", "drive", "-r", "-o", "other", "-q", "--outputs", "csv"][..], &CHEAP].concat();
    told(folder.path(), &none);
    let view = refused(folder.path(), &["view", "other", "--no-open"], 4);
    assert!(view.contains("unless --no-report or --outputs leaves it out"), "{view}");
}

/// A failure inside a measured run is no failure to write.
#[test]
fn bench_passes_on_what_a_run_says() {
    let folder = with_drive();
    let file = format!("drive/first/{SAMPLE}");
    let missing = [&file, "-q", "--trajectory", "no.csv"];
    let run = refused(folder.path(), &[&["run", "-o", "out"], &missing[..]].concat(), 4);
    assert!(run.contains("no.csv") && run.starts_with("error: "), "{run}");
    let bench = refused(folder.path(), &[&["bench", "--rounds", "1"], &missing[..]].concat(), 4);
    assert_eq!(bench, run);
}

/// `-q` is there where something is shown, and shows warnings only.
#[test]
fn quiet_is_the_same_in_every_command_that_shows_progress() {
    let folder = with_drive();
    for command in ["run", "demo", "work", "estimate-epsilon", "train", "synth", "bench"] {
        let help = told(folder.path(), &[command, "--help"]);
        assert!(help.contains("-q, --quiet"), "{command}: {help}");
    }
    let (code, _, errors) = call(folder.path(), &["bench", "-q", "--rounds", "1", "--method", "euclidean"]);
    assert_eq!((code, errors.as_str()), (0, ""));
    let epsilon = ["estimate-epsilon", "drive", "-r", "--ground", "none"];
    let (_, _, shown) = call(folder.path(), &epsilon);
    let (_, _, quiet) = call(folder.path(), &[&epsilon[..], &["-q"]].concat());
    assert!(shown.contains("survey: done in") && !quiet.contains("survey"), "{shown}{quiet}");
    let both = refused(folder.path(), &["work", "out", "--pass", "ground", "-q", "--progress", "plain"], 2);
    assert!(both.contains("cannot be used with"), "{both}");
}

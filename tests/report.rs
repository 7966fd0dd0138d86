//! The page `report.html`: what it shows about a drive, that tiles and threads do not change it, and when it
//! is written.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use base64::Engine;
use serde_json::Value;

use crate::util::drive::{assert_same_outputs, drive, scratch, settings};
use crate::util::las::Shape;
use crate::util::program::{ended, run_command, run_to_the_end};
use crate::util::shipped;
use crate::util::street::{Course, Street};

fn sweep() -> Vec<PathBuf> {
    vec![shipped("tests/data/tree_road_sweep.laz")]
}

fn page(out: &Path) -> String {
    std::fs::read_to_string(out.join("report.html")).expect("the page")
}

/// The content of a data element.
fn part<'a>(page: &'a str, name: &str) -> &'a str {
    let (_, rest) = page.split_once(&format!("id=\"data-{name}\">")).expect("the part");
    rest.split_once("</script>").expect("its end").0
}

fn json(page: &str, name: &str) -> Value {
    serde_json::from_str(part(page, name)).expect("JSON")
}

fn inflated(page: &str, name: &str) -> Vec<u8> {
    let bytes = base64::engine::general_purpose::STANDARD.decode(part(page, name)).expect("base64");
    miniz_oxide::inflate::decompress_to_vec(&bytes).expect("deflate")
}

/// The keys of the shown points.
fn keys(page: &str) -> Vec<u32> {
    let bytes = inflated(page, "points");
    let count = bytes.len() / 17;
    assert_eq!(json(page, "page")["sample"]["points"], count);
    let mut key = 0;
    let mut next = |at: usize| {
        key += u32::from_le_bytes([0, 1, 2, 3].map(|byte| bytes[byte * count + at]));
        key
    };
    (0..count).map(&mut next).collect()
}

#[test]
fn every_object_is_shown_and_the_table_is_that_of_the_csv() {
    let folder = scratch();
    let out = folder.path().join("out");
    let summary = drive(
        &sweep(),
        &out,
        &settings(&["cluster.method=euclidean", "ground.method=voxel-column", "euclidean.min_points=30"]),
    )
    .expect("runs");
    let page = page(&out);
    let keys = keys(&page);
    let shown: BTreeSet<u32> = keys.iter().copied().collect();
    for object in 1..=summary.objects {
        assert!(shown.contains(&(u32::try_from(object).expect("few") + 1)), "object {object}");
    }
    // Nearly all points fit. Points within one centimetre are merged.
    let (without_noise, len) = (summary.counts.object + summary.counts.ground, keys.len() as u64);
    assert!(
        len <= without_noise + summary.objects as u64 && len * 10 > without_noise * 9,
        "{len} of {without_noise}"
    );

    let table: Value = serde_json::from_slice(&inflated(&page, "table")).expect("JSON");
    let csv = std::fs::read_to_string(out.join("objects.csv")).expect("the table");
    let names: Vec<&str> = csv.lines().next().expect("a header").split(',').collect();
    let columns = table["columns"].as_array().expect("columns");
    assert_eq!(
        columns.iter().map(|column| column["name"].as_str().expect("a name")).collect::<Vec<_>>(),
        names
    );
    let fifth: Vec<&str> = csv.lines().nth(5).expect("an object").split(',').collect();
    for (number, (column, text)) in columns.iter().zip(fifth).enumerate() {
        match &table["values"][number][4] {
            Value::Null => assert_eq!(text, "", "{}", column["name"]),
            Value::Number(value) => {
                let same =
                    (value.as_f64().expect("finite") - text.parse::<f64>().expect("a number")).abs() < 1e-9;
                assert!(same, "{}: {value} and {text}", column["name"]);
            }
            Value::Array(values) => {
                let words =
                    values.iter().map(|value| value.as_str().map_or(value.to_string(), str::to_owned));
                assert_eq!(words.collect::<Vec<_>>().join(";"), text, "{}", column["name"]);
            }
            Value::Bool(flag) => assert_eq!(flag.to_string(), text, "{}", column["name"]),
            other => assert_eq!(other, text),
        }
    }
    assert_eq!(table["outlines"].as_array().map(Vec::len), Some(summary.objects));

    // Its coordinates are in metres.
    assert_eq!(json(&page, "page")["units"], serde_json::json!(["m", "m"]));

    // The same numbers as in report.json.
    let mut run = json(&page, "run");
    run.as_object_mut().expect("an object").remove("tiles").expect("tiles");
    let report: Value =
        serde_json::from_slice(&std::fs::read(out.join("report.json")).expect("the report")).expect("JSON");
    assert_eq!(run, report);
}

#[test]
fn tiles_threads_and_memory_leave_no_trace_in_it() {
    let folder = scratch();
    let outs = [["--tile-length", "15", "--threads", "1"], ["--tile-length", "500", "--threads", "2"]].map(
        |options| {
            let out = folder.path().join(options[1]);
            run_to_the_end(&sweep(), &out, &options);
            out
        },
    );
    // Outputs include the page without the part that says what the run did.
    assert_same_outputs(&outs[0], &outs[1], "other tiles");
    assert_ne!(json(&page(&outs[0]), "run")["tiles"], json(&page(&outs[1]), "run")["tiles"]);
}

#[test]
fn a_small_limit_is_kept_and_every_object_stays() {
    let folder = scratch();
    let out = folder.path().join("out");
    let points = Street { things: 9_000, patches: 60_000, ..Street::middling(5, Course::Straight) }.points();
    let file = folder.path().join("street.las");
    Shape::default().write(&file, &points);
    let summary = drive(
        &[file],
        &out,
        &settings(&["cluster.method=euclidean", "ground.method=voxel-column", "output.report_mb=1"]),
    )
    .expect("runs");
    let page = page(&out);
    assert!(page.len() <= 1_000_000, "{} bytes", page.len());
    let shown: BTreeSet<u32> = keys(&page).into_iter().filter(|&key| key > 1).collect();
    assert_eq!(shown.len(), summary.objects);
    let sentence = json(&page, "page")["sample"]["sentence"].as_str().expect("a text").to_owned();
    assert!(sentence.contains(" points: at most one of a voxel"), "{sentence}");
}

#[test]
fn names_are_never_markup() {
    let folder = scratch();
    let name = "a<script>alert(1)<!-- \"b\".las";
    let file = folder.path().join(name);
    std::fs::copy(shipped("tests/data/mls_profiles.las"), &file).expect("copied");
    let out = folder.path().join("out");
    drive(&[file], &out, &[]).expect("runs");
    let page = page(&out);
    assert_eq!(json(&page, "page")["title"], name);
    assert!(!page.contains("<script>alert") && !page.contains("<!-- \\\"b"));
    // The heading has its text before the script runs.
    assert!(page.contains("<h1 id=\"title\">a&lt;script>alert(1)&lt;!-- \"b\".las</h1>"));
}

#[test]
fn outputs_that_are_not_chosen_are_left_out() {
    let folder = scratch();
    let out = folder.path().join("out");
    let names = |out: &Path| -> Vec<String> {
        let entries =
            std::fs::read_dir(out).expect("a folder").map(|entry| entry.expect("an entry").file_name());
        let mut names: Vec<String> = entries.map(|name| name.to_string_lossy().into_owned()).collect();
        names.sort();
        names
    };
    let call = |list: &str| {
        run_to_the_end(&sweep(), &out, &["--outputs", list]);
        names(&out)
    };
    let all = "points,csv,geojson,report";
    let whole = call(all);
    let complete = page(&out);
    // The outputs of an earlier call are removed.
    assert_eq!(call("report"), [".chainage", "report.html", "report.json"]);
    // The same points are sampled without labelled copies as with them.
    assert_eq!(part(&page(&out), "points"), part(&complete, "points"));
    // The page names the table only beside the table.
    let named = [&complete, &page(&out)].map(|page| {
        ["figures are in report.json and objects.csv.", "objects.csv has them."]
            .map(|text| page.contains(text))
    });
    assert_eq!(named, [[true; 2], [false; 2]]);
    assert_eq!(call("csv"), [".chainage", "objects.csv", "report.json"]);
    assert_eq!(call("points"), [".chainage", "report.json", "tree_road_sweep.laz"]);
    assert_eq!(call(all), whole);
    let refused = run_command(&sweep(), &out, &["--outputs", "csv,shp"]).output().expect("starts");
    let (code, errors) = ended(&refused);
    assert_eq!(code, 3, "{errors}");
    assert!(
        errors.contains("output.files = \"shp\": must be a list of these: points, csv, geojson, "),
        "{errors}"
    );
}

#[test]
fn without_a_report_the_page_of_an_earlier_call_goes() {
    let folder = scratch();
    let out = folder.path().join("out");
    run_to_the_end(&sweep(), &out, &["--no-report"]);
    assert!(!out.join("report.html").exists() && out.join("report.json").is_file());
    // An OUT without a page, as older versions left it, gets one.
    run_to_the_end(&sweep(), &out, &[]);
    let first = page(&out);
    // There is nothing to do, and nothing is written.
    let output = run_command(&sweep(), &out, &[]).output().expect("starts");
    assert_eq!(ended(&output).0, 0);
    assert!(page(&out) == first);
    run_to_the_end(&sweep(), &out, &["--no-report"]);
    assert!(!out.join("report.html").exists());
}

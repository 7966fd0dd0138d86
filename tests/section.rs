//! A section of a drive, chosen by `--from` and `--to`: its objects are the same as in the whole drive for
//! any tiles, even if they straddle an end of the section. Files without points in it are not copied.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use chainage::run::RunSummary;

use crate::util::drive::{Labelled, assert_same_outputs, drive, scratch, settings};
use crate::util::las::{Point, Shape};
use crate::util::program::program;

/// Ground of 0.25 m spacing and 16 m width from `from` to `to` metres along x, a post every 3 m, and a wall
/// of 22 m every 25 m. The size of a thing depends on its place, so that no two are alike.
fn street(from: i64, to: i64) -> Vec<Point> {
    let mut points = Vec::new();
    for x in (from * 1_000..to * 1_000).step_by(250) {
        points.extend((0..16_000).step_by(250).map(|y| Point::at([x, y, x / 50])));
    }
    for x in (0..=to + 100).filter(|x| x % 3 == 1) {
        for z in (400..2_000 + 10 * (x % 50)).step_by(100) {
            let wide = 100 + 20 * (x % 7);
            let corner = |k: i64| [x * 1_000 + wide * (k % 3), 4_000 + 10 * x + wide * (k / 3), x * 20 + z];
            points.extend((0..9).map(|k| Point::at(corner(k))));
        }
    }
    for x in (0..=to + 100).filter(|x| x % 25 == 12) {
        for step in 0..110 {
            let along = x * 1_000 + 200 * step;
            let wall = (4..12 + x % 4).map(|z| Point::at([along, 13_000, along / 50 + z * 150]));
            points.extend(wall);
        }
    }
    points.retain(|point| (from * 1_000..to * 1_000).contains(&point.mm[0]));
    points
}

/// Writes the street in three files.
fn files(folder: &Path) -> Vec<PathBuf> {
    let of = [("a.las", 0, 70), ("b.laz", 70, 170), ("c.las", 170, 210)];
    let write = |(name, from, to): (&str, i64, i64)| {
        let path = folder.join(name);
        Shape::default().write(&path, &street(from, to));
        path
    };
    of.map(write).to_vec()
}

fn rows(out: &Path) -> BTreeMap<String, BTreeMap<String, String>> {
    let text = std::fs::read_to_string(out.join("objects.csv")).expect("a table");
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let row = |line: &str| -> BTreeMap<String, String> {
        names
            .iter()
            .zip(line.split(','))
            .map(|(name, value)| ((*name).to_owned(), value.to_owned()))
            .collect()
    };
    lines.map(row).map(|row| (row["uid"].clone(), row)).collect()
}

fn number(row: &BTreeMap<String, String>, name: &str) -> f64 {
    row[name].parse().expect("a number")
}

/// The values of an object, without numbers that only have a meaning within a run.
fn described(row: &BTreeMap<String, String>) -> Vec<(&str, &str)> {
    row.iter()
        .filter(|(name, _)| !["id", "touches"].contains(&name.as_str()))
        .map(|(name, value)| (name.as_str(), value.as_str()))
        .collect()
}

const SECTION: [&str; 3] = ["tiling.from=80", "tiling.to=120", "tiling.beyond=20"];

#[test]
fn objects_of_a_section_are_those_of_the_whole_drive() {
    let folder = scratch();
    let files = files(folder.path());
    for method in ["euclidean", "density-peaks", "street"] {
        let run = |name: &str, list: &[&str]| {
            let out = folder.path().join(format!("{method}-{name}"));
            let method = format!("cluster.method={method}");
            let list = settings(&[list, &[method.as_str(), "euclidean.min_points=20"]].concat());
            let summary = drive(&files, &out, &list).expect("a run");
            (out, summary)
        };
        let (whole_out, _) = run("whole", &["tiling.tile_length=50"]);
        let (out, summary) = run("section", &SECTION);
        let section = summary.section.expect("a section");
        assert!((section.from_m, section.to_m) == (80.0, 120.0) && section.length_m > 190.0, "{section:?}");
        let (whole, found) = (rows(&whole_out), rows(&out));
        assert!(found.len() > 12 && found.len() < whole.len() / 2, "{method}: {}", found.len());
        for (uid, row) in &found {
            assert_eq!(row["cut"], "false", "{uid}");
            let expected =
                whole.get(uid).unwrap_or_else(|| panic!("{method}: {uid} is not in the whole drive"));
            assert_eq!(described(row), described(expected), "{method}");
        }
        for (uid, row) in &whole {
            if (80.0..=120.0).contains(&number(row, "chainage_m")) {
                assert!(found.contains_key(uid), "{method}: {uid} is missing");
            }
        }
        // Points outside the section have the class of the input; only points of the objects of the section
        // have an object.
        let part = [&files[0..1], &files[1..2]].concat();
        let (one, all) = (Labelled::read(&part, &out), Labelled::read(&part, &whole_out));
        let mut pairs = BTreeMap::new();
        for point in 0..one.at.len() {
            let x = one.at[point][0];
            if (81_000..119_000).contains(&x) {
                assert_eq!(one.class[point], all.class[point]);
                let other = *pairs.entry(all.label[point]).or_insert(one.label[point]);
                assert_eq!(other, one.label[point], "{method}: an object is divided or joined");
            } else if !(77_000..123_000).contains(&x) {
                // An object also has its class where it reaches beyond the section.
                assert!(one.class[point] == 1 || one.label[point] != 0, "{method}: {x}");
                assert!(
                    one.label[point] == 0
                        || pairs.values().any(|label| *label == one.label[point])
                        || x < 81_000
                );
            }
        }
    }
}

#[test]
fn an_object_across_the_end_is_whole_or_marked_as_cut() {
    let folder = scratch();
    let files = files(folder.path());
    // A wall lies from 112 to 134 m.
    let wall = |name: &str, beyond: &str| {
        let out = folder.path().join(name);
        let list = ["tiling.from=60", "tiling.to=114", beyond, "euclidean.min_points=20"];
        drive(&files, &out, &settings(&list)).expect("a run");
        let walls = rows(&out).into_values().filter(|row| {
            (110.0..135.0).contains(&number(row, "chainage_m")) && number(row, "length_m") > 1.5
        });
        walls.collect::<Vec<_>>()
    };
    let [followed] = &wall("followed", "tiling.beyond=30")[..] else { panic!("one wall") };
    assert!(number(followed, "length_m") > 21.5 && followed["cut"] == "false", "{followed:?}");
    let [cut] = &wall("cut", "tiling.beyond=0")[..] else { panic!("one wall") };
    assert_eq!(cut["cut"], "true", "{cut:?}");
}

#[test]
fn tiles_do_not_show_in_a_section_and_other_files_are_not_copied() {
    let folder = scratch();
    let files = files(folder.path());
    let run = |name: &str, list: &[&str]| {
        let out = folder.path().join(name);
        drive(&files, &out, &settings(&[&SECTION, list].concat())).expect("a run");
        out
    };
    let one = run("one", &["tiling.tile_length=1000", "run.threads=1"]);
    for length in ["7", "33"] {
        let length = format!("tiling.tile_length={length}");
        assert_same_outputs(&one, &run(&length, &[&length, "run.threads=2"]), &length);
    }
    assert!(one.join("a.las").exists() && one.join("b.laz").exists() && !one.join("c.las").exists());
    // The copies of an earlier run of the whole drive do not stay beside the copies of the section.
    let again = folder.path().join("again");
    drive(&files, &again, &[]).expect("a run");
    assert!(again.join("c.las").exists());
    run("again", &[]);
    assert!(!again.join("c.las").exists());
    assert_same_outputs(&one, &again, "after the whole drive");
}

/// The vertices of the axis are about 1 m apart, so the ends of a section are mostly between two of them.
#[test]
fn the_axis_of_a_section_ends_where_the_section_ends() {
    let folder = scratch();
    let files = files(folder.path());
    for (name, [from, to]) in [("long", [80.4, 119.7]), ("short", [80.2, 80.8]), ("within", [100.1, 100.3])] {
        let out = folder.path().join(name);
        let section = [format!("tiling.from={from:?}"), format!("tiling.to={to:?}")];
        let list = [&section[..], &settings(&["output.files=[\"report\"]"])].concat();
        drive(&files, &out, &list).expect("a run");
        let page = std::fs::read_to_string(out.join("report.html")).expect("the page");
        let (_, rest) = page.split_once("id=\"data-page\">").expect("the part");
        let part = rest.split_once("</script>").expect("its end").0;
        let facts: serde_json::Value = serde_json::from_str(part).expect("JSON");
        let stations = facts["axis"][0]["s"].as_array().expect("an axis");
        let ends = [stations.first(), stations.last()].map(|end| end.and_then(serde_json::Value::as_f64));
        assert_eq!(ends, [Some(from), Some(to)], "{stations:?}");
    }
}

/// A method, the setting for a value that is estimated over all points, and the value in a run.
type OverAll = (&'static str, &'static str, fn(&RunSummary) -> f64);

const OVER_ALL: [OverAll; 2] = [
    ("density-peaks", "density-peaks.most_points", |run| number_at(run, "stages", "most_points_in_a_voxel")),
    ("p-linkage", "p-linkage.flat_m2", |run| {
        number_at(run, "p-linkage", "slices grow from points flatter than, in m2")
    }),
];

fn number_at(run: &RunSummary, part: &str, name: &str) -> f64 {
    run.figures[part][name].as_f64().unwrap_or_else(|| panic!("no {name} in {:?}", run.figures))
}

/// A value over all points affects every object. So a section has the objects of the whole drive only with
/// the value of the whole drive.
#[test]
fn with_the_value_of_the_whole_drive_a_section_has_its_objects_and_without_it_the_user_is_told() {
    let folder = scratch();
    let synth = folder.path().join("mixed");
    let options = ["--length", "300m", "--pulse-rate", "40kHz", "--seed", "7", "--las"];
    let made =
        program().args(["synth", "mixed", "-o"]).arg(&synth).args(options).output().expect("a program");
    assert!(made.status.success(), "{made:?}");
    let files = vec![synth.join("mixed_0001.las")];
    for (method, setting, value) in OVER_ALL {
        let run = |name: String, list: &[String]| {
            let out = folder.path().join(name);
            let list =
                [list, &[format!("cluster.method={method}"), "output.files=[\"csv\"]".to_owned()]].concat();
            let summary = drive(&files, &out, &list).expect("a run");
            (rows(&out), summary)
        };
        let (whole, of_whole) = run(format!("{method}-whole"), &[]);
        let is_told = |summary: &RunSummary| summary.warnings.iter().any(|text| text.contains(setting));
        assert!(!is_told(&of_whole), "{:?}", of_whole.warnings);
        let given = format!("{setting}={}", value(&of_whole));
        for (from, to) in [(60.0, 100.0), (140.0, 170.0), (200.0, 240.0)] {
            let mut list = vec![
                format!("tiling.from={from:?}"),
                format!("tiling.to={to:?}"),
                "tiling.beyond=30".to_owned(),
            ];
            if from > 60.0 {
                list.push(given.clone());
            }
            let (found, summary) = run(format!("{method}-{from}"), &list);
            assert_eq!(is_told(&summary), from <= 60.0, "{:?}", summary.warnings);
            if is_told(&summary) {
                continue;
            }
            assert!(found.len() > 8, "{method}: {} objects", found.len());
            for (uid, row) in found.iter().filter(|(_, row)| row["cut"] == "false") {
                let expected = whole.get(uid);
                let expected =
                    expected.unwrap_or_else(|| panic!("{method}, {from}: {uid} is not in the whole"));
                assert_eq!(described(row), described(expected), "{method}, {from}");
            }
            for (uid, row) in &whole {
                if (from..=to).contains(&number(row, "chainage_m")) {
                    assert!(found.contains_key(uid), "{method}, {from}: {uid} is missing");
                }
            }
        }
    }
}

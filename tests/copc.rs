//! The cloud-optimised file of a drive: the same points with the same objects as the labelled copies, the
//! same bytes for any tiles, threads and memory, and a tree that other programs read.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::util::drive::{Labelled, drive, scratch, settings};
use crate::util::las::{Point, Shape};
use crate::util::method_run::MethodRun;
use crate::util::program::program;
use crate::util::{shipped, skipped};

const NAME: &str = "drive.copc.laz";
const SWEEP: &str = "tree_road_sweep.laz";

/// The number of points with the same coordinates, class and object.
fn multiset(points: &Labelled) -> BTreeMap<([i64; 3], u8, u32), usize> {
    let mut all = BTreeMap::new();
    for point in 0..points.at.len() {
        *all.entry((points.at[point], points.class[point], points.label[point])).or_insert(0) += 1;
    }
    all
}

fn run(inputs: &[PathBuf], out: &Path, list: &[&str]) {
    let list = settings(&[&["output.files=[\"points\",\"csv\",\"geojson\",\"copc\"]"], list].concat());
    drive(inputs, out, &list).expect("a run");
}

/// A number of the header or of a record.
fn word<const N: usize>(bytes: &[u8], at: u64) -> [u8; N] {
    let at = usize::try_from(at).expect("a position");
    bytes[at..at + N].try_into().expect("inside")
}

/// The nodes of a file: level and position, and number of points. Checks that their chunks follow each other.
fn nodes(bytes: &[u8]) -> BTreeMap<[i32; 4], i32> {
    assert_eq!(&bytes[377..381], b"copc", "its record follows the header");
    assert_eq!(u16::from_le_bytes(word(bytes, 375 + 18)), 1);
    let info = 375 + 54;
    let page = u64::from_le_bytes(word(bytes, info + 40));
    let length = u64::from_le_bytes(word(bytes, info + 48));
    let mut end = u64::from(u32::from_le_bytes(word(bytes, 96))) + 8;
    let mut found = BTreeMap::new();
    for entry in (page..page + length).step_by(32) {
        let key = [0, 4, 8, 12].map(|at| i32::from_le_bytes(word(bytes, entry + at)));
        let at = u64::from_le_bytes(word(bytes, entry + 16));
        let count = i32::from_le_bytes(word(bytes, entry + 28));
        if count > 0 {
            assert_eq!(at, end, "{key:?}");
            end += u64::from(u32::from_le_bytes(word(bytes, entry + 24)));
        }
        assert!(found.insert(key, count).is_none(), "{key:?} twice");
    }
    for key in found.keys().filter(|key| key[0] > 0) {
        let parent = [key[0] - 1, key[1] >> 1, key[2] >> 1, key[3] >> 1];
        assert!(found.contains_key(&parent), "{key:?} has no parent");
    }
    found
}

#[test]
fn the_file_has_the_points_of_the_copies_and_the_same_bytes_however_it_is_made() {
    let folder = scratch();
    let inputs = [shipped("tests/data").join(SWEEP)];
    let mut first: Option<Vec<u8>> = None;
    for (name, list) in [
        ("one", &["tiling.tile_length=1000", "run.threads=1"][..]),
        ("many", &["tiling.tile_length=9", "run.threads=3", "run.memory_mib=16"][..]),
    ] {
        let out = folder.path().join(name);
        run(&inputs, &out, list);
        let bytes = std::fs::read(out.join(NAME)).expect("the file");
        assert_eq!(*first.get_or_insert_with(|| bytes.clone()), bytes, "{name}");
        let state = std::fs::read_dir(out.join(".chainage")).expect("the state");
        let folders = state.map(|entry| entry.expect("an entry").file_name());
        let left: Vec<_> = folders.filter(|name| name.to_string_lossy().contains("copc")).collect();
        assert!(left.is_empty(), "its points are not kept twice: {left:?}");
    }
    let out = folder.path().join("one");
    let (cloud, copy) = (Labelled::of(&[out.join(NAME)]), Labelled::read(&inputs, &out));
    assert!(multiset(&cloud) == multiset(&copy), "points differ");
    let nodes = nodes(&first.expect("made"));
    let all: usize = nodes.values().map(|count| usize::try_from(*count).expect("a count")).sum();
    assert_eq!(all, cloud.at.len());
    // Every level shows more; the tree ends where a column has few points.
    let of_level =
        |level: i32| nodes.iter().filter(|(key, _)| key[0] == level).map(|(_, count)| count).sum::<i32>();
    assert!(nodes.len() > 4 && of_level(0) > 1_000 && of_level(0) < of_level(1), "{nodes:?}");
}

#[test]
fn a_run_that_goes_on_with_other_memory_makes_the_same_file() {
    let folder = scratch();
    let euclidean = MethodRun { method: "euclidean", results: &[NAME] };
    let settings = |memory| ["output.files=[\"points\",\"copc\"]", "tiling.tile_length=9", memory];
    let whole = folder.path().join("whole");
    euclidean.run_in(&whole, &settings("run.memory_mib=2048"));
    let expected = euclidean.results(&whole);
    for (pass, after) in [("copc points", 1), ("copc nodes", 1)] {
        let out = folder.path().join(pass);
        let stopped = euclidean.interrupted_in(pass, after, &out, &settings("run.memory_mib=16"));
        assert!(stopped.is_err(), "stopped in {pass}");
        euclidean.run_in(&out, &settings("run.memory_mib=2048"));
        euclidean.assert_same(&out, &expected, pass);
    }
}

#[test]
fn files_of_other_formats_scales_and_offsets_become_one() {
    let folder = scratch();
    let post =
        |x: i64| (0..60).map(move |z| Point { time: 5.0, mark: 9, ..Point::at([x, 3_000, 300 + z * 50]) });
    let street = |from: i64| -> Vec<Point> {
        let ground = (0..400).map(|n| Point::at([from + n % 20 * 250, n / 20 * 250, 0]));
        ground.chain(post(from + 2_000)).collect()
    };
    let shapes = [
        ("a.las", Shape { format: 0, ..Shape::default() }),
        ("b.laz", Shape { format: 1, scale_tenths: 500, ..Shape::default() }),
        ("c.las", Shape { offset_mm: [7_000, -3_000, 50], ..Shape::default() }),
    ];
    let mut inputs = Vec::new();
    for (number, (name, shape)) in (0..).zip(&shapes) {
        let path = folder.path().join(name);
        shape.write(&path, &street(number * 5_000));
        inputs.push(path);
    }
    let out = folder.path().join("out");
    run(&inputs, &out, &["euclidean.min_points=20"]);
    let (cloud, copies) = (Labelled::of(&[out.join(NAME)]), Labelled::read(&inputs, &out));
    assert!(multiset(&cloud) == multiset(&copies), "points differ");
    assert!(copies.label.iter().max() == Some(&3), "three posts");
    assert_eq!(cloud.mark.iter().filter(|mark| **mark == 9).count(), 180, "intensities");
    nodes(&std::fs::read(out.join(NAME)).expect("the file"));
}

#[test]
fn a_section_has_its_own_points_only_and_the_file_goes_with_the_next_run_without_it() {
    let folder = scratch();
    let inputs = [shipped("tests/data").join(SWEEP)];
    let out = folder.path().join("out");
    run(&inputs, &out, &["tiling.from=20", "tiling.to=40", "tiling.beyond=5"]);
    let cloud = Labelled::of(&[out.join(NAME)]);
    let summary = drive(&inputs, &out, &settings(&["tiling.from=20", "tiling.to=40", "tiling.beyond=5"]));
    assert_eq!(summary.expect("a run").points, cloud.at.len() as u64);
    assert!(!out.join(NAME).exists());
}

/// laspy reads the tree itself: it requests the nodes of a box and of a level.
#[test]
fn laspy_reads_the_file() {
    let folder = scratch();
    let out = folder.path().join("out");
    let run = program()
        .args(["run", &shipped("tests/data").join(SWEEP).to_string_lossy(), "-o", &out.to_string_lossy()])
        .args(["--copc", "--outputs", "points", "--ground", "voxel-column", "-q"])
        .output()
        .expect("the program starts");
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let oracle = shipped("tests/oracle/copc_oracle.py");
    let output =
        std::process::Command::new("python3").arg(oracle).arg(out.join(NAME)).arg(out.join(SWEEP)).output();
    let Ok(output) = output else {
        return skipped("COPC read by laspy (python3 is not installed)");
    };
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    if output.status.code() == Some(77) {
        return skipped(&format!("COPC read by laspy ({})", text.trim()));
    }
    assert!(output.status.success(), "{text}{}", String::from_utf8_lossy(&output.stderr));
    assert!(text.contains("71,841 points"), "{text}");
}

/// x and y in US survey feet, z in metres: a node is a cube in the numbers of the file.
#[test]
fn heights_may_have_another_unit_than_x_and_y() {
    let folder = scratch();
    let tower = |x: i64| (0..9_000).map(move |n| Point::at([x + n % 7 * 100, n % 11 * 100, 20_000 + n * 13]));
    let ground = (0..40_000).map(|n| Point::at([n % 200 * 900, n / 200 * 900, 20_000]));
    let points: Vec<Point> = ground.chain(tower(40_000)).chain(tower(90_000)).collect();
    let (metre, foot) = ("UNIT[\"metre\",1]", "UNIT[\"US survey foot\",0.3048006096012192]");
    for (name, horizontal, vertical) in [("feet", foot, metre), ("metres", metre, foot)] {
        let input = folder.path().join(format!("{name}.las"));
        let system = format!("COMPD_CS[\"c\",PROJCS[\"p\",{horizontal}],VERT_CS[\"v\",{vertical}]]\0");
        let records = vec![("LASF_Projection", 2_112, system.into_bytes())];
        Shape { records, ..Shape::default() }.write(&input, &points);
        let out = folder.path().join(name);
        let inputs = [input];
        run(&inputs, &out, &["tiling.tile_length=12"]);
        let bytes = std::fs::read(out.join(NAME)).expect("the file");
        let (cloud, copy) = (Labelled::of(&[out.join(NAME)]), Labelled::read(&inputs, &out));
        assert!(multiset(&cloud) == multiset(&copy), "points differ");
        let nodes = nodes(&bytes);
        assert!(nodes.len() > 4, "{}", nodes.len());
        // Every point is in the cube of the root, and the cube is not larger than it needs to be.
        let number = |at: u64| f64::from_le_bytes(word(&bytes, at));
        let info = 375 + 54;
        let halfsize = number(info + 24);
        for (axis, (largest, smallest)) in [(0, (179, 187)), (1, (195, 203)), (2, (211, 219))] {
            let (low, high) = (number(info + 8 * axis) - halfsize, number(info + 8 * axis) + halfsize);
            assert!(low <= number(smallest) && number(largest) <= high, "{name}: {axis}");
        }
        assert!(2.0 * halfsize < 180.0 * 4.0, "{name}: {halfsize}");
    }
}

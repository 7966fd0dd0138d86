//! The cloud-optimised file of a drive: the same points with the same objects as the labelled copies, the
//! same bytes for any tiles, threads and memory, and a tree that other programs read.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use chainage::input::{Catalog, Fields, InputOptions, LengthUnit};

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

/// Class 12 of formats 0 to 5 means overlap points. Formats 6 to 10 reserve it, and have a flag for them.
#[test]
fn overlap_points_of_old_formats_get_the_flag_of_the_new_ones() {
    let folder = scratch();
    let points: Vec<Point> = (0..400).map(|n| Point::at([n % 20 * 250, n / 20 * 250, 0])).collect();
    let mut bytes = Shape { format: 1, ..Shape::default() }.bytes(&points);
    let first = u32::from_le_bytes(word(&bytes, 96)) as usize;
    // Class with flags: overlap, overlap and key point, the largest class, key point.
    let old = [12, 12 | 1 << 6, 31, 1 | 1 << 6];
    for (at, record) in bytes[first..].chunks_exact_mut(28).enumerate() {
        record[15] = old[at % 4];
    }
    let path = folder.path().join("old.las");
    std::fs::write(&path, bytes).expect("written");
    let out = folder.path().join("out");
    let kept = ["cluster.method=euclidean", "ground.method=none", "noise.enabled=false"];
    run(std::slice::from_ref(&path), &out, &kept);
    // The number of points with each pair of the byte at 15 and the byte after it.
    let pairs = |name: &str| {
        let catalog = Catalog::open(&[out.join(name)], &InputOptions::default()).expect("opens");
        let file = &catalog.files()[0];
        let (mut found, mut buffer) = (BTreeMap::new(), Vec::new());
        for block in 0..file.blocks().len() {
            let records = file.records(block, Fields::All, &mut buffer).expect("records");
            for record in records.chunks_exact(file.layout().record_len) {
                *found.entry([record[15], record[16]]).or_insert(0) += 1;
            }
        }
        found
    };
    // Flags and class of format 6.
    let expected = [([0, 31], 100), ([1 << 1, 1], 100), ([1 << 3, 1], 100), ([1 << 1 | 1 << 3, 1], 100)];
    assert_eq!(pairs(NAME), BTreeMap::from(expected));
    // Class with flags, and scan angle of format 1: the copy keeps them.
    assert_eq!(pairs("old.las"), old.map(|class| ([class, 0], 100)).into());
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

/// Files with these points, whose offsets are this many tenths of a millimetre beside a whole millimetre.
fn beside_whole_steps(folder: &Path, files: &[(&str, &[Point], [f64; 3])]) -> Vec<PathBuf> {
    let write = |(name, points, tenths): &(&str, &[Point], [f64; 3])| {
        let path = folder.join(name);
        let mut bytes = Shape::default().bytes(points);
        for (axis, tenths) in tenths.iter().enumerate() {
            let at = 155 + 8 * axis;
            bytes[at..at + 8].copy_from_slice(&(tenths / 10_000.0).to_le_bytes());
        }
        std::fs::write(&path, bytes).expect("a writable folder");
        path
    };
    files.iter().map(write).collect()
}

/// Checks that every point is in the cube of its node, and returns the number of points.
fn check_cubes(path: &Path) -> usize {
    let bytes = std::fs::read(path).expect("the file");
    let number = |at: usize| f64::from_le_bytes(word(&bytes, at as u64));
    let info = 375 + 54;
    let (centre, halfsize) = ([0, 1, 2].map(|axis| number(info + 8 * axis)), number(info + 24));
    let options = InputOptions { mmap: true, unit: LengthUnit::Auto };
    let catalog = Catalog::open(&[path.to_owned()], &options).expect("opens");
    let file = &catalog.files()[0];
    let nodes: Vec<_> = nodes(&bytes).into_iter().filter(|(_, count)| *count > 0).collect();
    assert_eq!(nodes.len(), file.blocks().len());
    let mut all = 0;
    for (block, (key, count)) in nodes.iter().enumerate() {
        let mut buffer = Vec::new();
        let records = file.records(block, Fields::All, &mut buffer).expect("readable");
        let records = records.chunks_exact(file.layout().record_len);
        assert_eq!(records.len(), usize::try_from(*count).expect("a count"));
        all += records.len();
        let side = 2.0 * halfsize / f64::from(1 << key[0]);
        for record in records {
            for axis in 0..3 {
                let steps = i32::from_le_bytes(word(record, 4 * axis as u64));
                let at = f64::from(steps) * number(131 + 8 * axis) + number(155 + 8 * axis);
                let low = centre[axis] - halfsize + f64::from(key[axis + 1]) * side;
                assert!(low - 1e-9 <= at && at <= low + side + 1e-9, "{key:?}: {at} in {low} + {side}");
            }
        }
    }
    all
}

/// Offsets are 0.4 and 0.6 mm beside the lattice. The coordinates that are written then are on the other side
/// of the border of a cell, for some points.
#[test]
fn files_with_offsets_beside_the_lattice_become_one_readable_file() {
    let folder = scratch();
    let cloud = |seed: i64| -> Vec<Point> {
        let ground = (0..70_000).map(|k| {
            let k = k * 2 + seed;
            // A tenth of the points are at the borders of cells.
            let x = if k % 10 < 2 { k * 7_919 % 20 * 1_000 + 999 } else { k * 7_919 % 20_000 };
            Point::at([x, k * 104_729 % 6_000, k % 40])
        });
        let post = (0..80).map(|z| Point::at([4_999 + z % 3, 3_000 + seed, 300 + z * 50]));
        ground.chain(post).collect()
    };
    let points = [cloud(0), cloud(1)];
    let files = [("a.las", &points[0][..], [4.0; 3]), ("b.las", &points[1][..], [6.0; 3])];
    let inputs = beside_whole_steps(folder.path(), &files);
    let mut first: Option<Vec<u8>> = None;
    for length in [1_000, 5] {
        let out = folder.path().join(length.to_string());
        run(&inputs, &out, &[&format!("tiling.tile_length={length}"), "euclidean.min_points=20"]);
        let bytes = std::fs::read(out.join(NAME)).expect("the file");
        assert!(*first.get_or_insert_with(|| bytes.clone()) == bytes, "tiles of {length} m differ");
        assert_eq!(check_cubes(&out.join(NAME)), 140_160);
        // Written coordinates have the offset of the first file. Those of the second are rounded to it.
        let mut copies = Labelled::read(&inputs, &out);
        copies.at = points.iter().flatten().map(|point| point.mm).collect();
        assert!(multiset(&Labelled::of(&[out.join(NAME)])) == multiset(&copies), "points differ");
        assert!(copies.label.iter().any(|label| *label > 0), "a post");
    }
}

/// Two places 3 km apart in steps of a thousandth of a millimetre: 32 bits of the first offset do not reach
/// the second.
#[test]
fn files_far_apart_get_an_offset_between_them_and_steps_that_reach() {
    let folder = scratch();
    let place =
        |_: i64| -> Vec<Point> { (0..400).map(|n| Point::at([n % 20 * 250, n / 20 * 250, 0])).collect() };
    let write = |name: &str, east_m: f64, scale: f64| {
        let path = folder.path().join(name);
        let mut bytes = Shape::default().bytes(&place(0));
        for axis in 0..3 {
            bytes[131 + 8 * axis..139 + 8 * axis].copy_from_slice(&scale.to_le_bytes());
        }
        bytes[155..163].copy_from_slice(&east_m.to_le_bytes());
        std::fs::write(&path, bytes).expect("a writable folder");
        path
    };
    // Records of 0 to 5,000 steps; the boxes of the headers are not believed.
    let header = |out: &Path| {
        let bytes = std::fs::read(out.join(NAME)).expect("the file");
        [131, 155, 179, 187].map(|at| f64::from_le_bytes(word(&bytes, at)))
    };
    for (name, apart_m, scale, offset) in [
        ("the same", 2_000.0, 1e-6, 500_000.0),
        ("an offset in the middle", 3_000.0, 1e-6, 501_500.002_375),
        ("steps of the lattice", 9_000.0, 1e-4, 504_500.002_4),
    ] {
        let folder = folder.path().join(name);
        let inputs = [write("a.las", 500_000.0, 1e-6), write("b.las", 500_000.0 + apart_m, 1e-6)];
        run(&inputs, &folder, &[]);
        assert_eq!(check_cubes(&folder.join(NAME)), 800, "{name}");
        let [found_scale, found_offset, highest, lowest] = header(&folder);
        assert!((found_scale - scale).abs() < 1e-12, "{name}: {found_scale}");
        assert!((found_offset - offset).abs() < 1e-3, "{name}: {found_offset}");
        assert!((highest - 500_000.0 - apart_m - 0.004_75).abs() <= scale, "{name}: {highest}");
        assert!((lowest - 500_000.0).abs() <= scale, "{name}: {lowest}");
    }
    // 500 km in steps of 0.1 mm are more than 32 bits.
    let inputs = [write("a.las", 0.0, 1e-6), write("b.las", 500_000.0, 1e-6)];
    let planned = chainage::run::plan_of(
        &inputs,
        None,
        &crate::util::drive::config(&settings(&["output.files=[\"copc\"]"])),
        &chainage::run::Registries::default(),
    );
    let ran = drive(&inputs, &folder.path().join("refused"), &settings(&["output.files=[\"copc\"]"]));
    let texts = [planned.expect_err("refused").to_string(), ran.expect_err("refused").to_string()];
    for text in texts {
        assert!(
            text.contains("up to 500000 m apart in x") && text.contains("0.0001 m reach 429497 m"),
            "{text}"
        );
    }
    assert!(!folder.path().join("refused/objects.csv").exists());
}

#[test]
fn files_with_two_kinds_of_gps_times_are_refused_before_anything_is_computed() {
    let folder = scratch();
    let points: Vec<Point> = (0..400).map(|n| Point::at([n % 20 * 250, n / 20 * 250, 0])).collect();
    let write = |name: &str, format: u8, standard: u8| {
        let path = folder.path().join(name);
        let mut bytes = Shape { format, ..Shape::default() }.bytes(&points);
        bytes[6] = standard;
        std::fs::write(&path, bytes).expect("a writable folder");
        path
    };
    let (week, standard) = (write("week.las", 6, 0), write("standard.las", 1, 1));
    // Format 0 has no times.
    let (timeless, out) = (write("timeless.las", 0, 0), folder.path().join("out"));
    let error = drive(&[week, standard.clone()], &out, &settings(&["output.files=[\"copc\"]"]));
    let text = error.expect_err("refused").to_string();
    let expected = "week.las has GPS times of the week, and standard.las adjusted standard times";
    assert!(text.contains(expected), "{text}");
    assert!(!out.join(".chainage").exists(), "nothing was computed");
    run(&[timeless, standard], &out, &[]);
    let bytes = std::fs::read(out.join(NAME)).expect("the file");
    assert_eq!(bytes[6] & 1, 1, "the times of the file that has some");
}

/// laspy reads the tree by itself: it asks for the nodes of a box and of a level.
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

/// GeoTIFF keys: UTM in metres (26918), heights in US survey feet (6360).
#[test]
fn heights_keep_the_unit_that_only_keys_give() {
    let folder = scratch();
    let input = folder.path().join("keys.las");
    let keys: [u16; 16] = [1, 1, 0, 3, 1_024, 0, 1, 1, 3_072, 0, 1, 26_918, 4_096, 0, 1, 6_360];
    let keys = keys.iter().flat_map(|word| word.to_le_bytes()).collect();
    let records = vec![("LASF_Projection", 34_735, keys)];
    let tower = (0..9_000).map(|n| Point::at([40_000 + n % 7 * 100, n % 11 * 100, 20_000 + n * 13]));
    let ground = (0..40_000).map(|n| Point::at([n % 200 * 900, n / 200 * 900, 20_000]));
    let points: Vec<Point> = ground.chain(tower).collect();
    Shape { records, ..Shape::default() }.write(&input, &points);
    let out = folder.path().join("out");
    let inputs = [input];
    run(&inputs, &out, &["tiling.tile_length=12"]);
    let units_m = |file: PathBuf| Catalog::open(&[file], &InputOptions::default()).expect("opens").units_m();
    let [read, written] = [inputs[0].clone(), out.join(NAME)].map(units_m);
    let same = read.iter().zip(written).all(|(read, written)| (read / written - 1.0).abs() < 1e-9);
    assert!(same && read[2] < 0.31, "{read:?} {written:?}");
}

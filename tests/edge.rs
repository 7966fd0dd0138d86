//! Unusual drives: no points, few points, all points in one place, points far away. Also methods from outside
//! the project, good and bad ones.

use std::path::{Path, PathBuf};

use chainage::cluster::{ClusterEntry, Clusterer, OneStep};
use chainage::ground::{GroundEntry, GroundFilter};
use chainage::input::{Catalog, InputError, InputOptions, LengthUnit};
use chainage::model::{AlgorithmError, Lattice, PointClass, Reach, TileCloud};
use chainage::output::OutputError;
use chainage::run::{CancelToken, Event, Observer, Registries, RunError, RunRequest, RunSummary, run};
use chainage::spatial::TileView;
use chainage::survey::SurveyError;
use chainage::{Error, ErrorKind, cluster, ground};

use crate::util::drive::{Labelled, assert_same_outputs, config, drive, run_with, scratch, settings};
use crate::util::las::{Point, Shape, geographic};
use crate::util::shipped;
use crate::util::street::{Course, Street, number};

/// A drive in a folder of its own.
struct Scratch(tempfile::TempDir);

impl Scratch {
    fn new() -> Self {
        Self(scratch())
    }

    fn out(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn file(&self, name: &str, shape: &Shape, points: &[Point]) -> PathBuf {
        let path = self.0.path().join(name);
        shape.write(&path, points);
        path
    }
}

fn list(tile_m: f64, more: &[&str]) -> Vec<String> {
    let mut list = settings(&["run.threads=2", "run.memory_mib=256"]);
    list.push(format!("tiling.tile_length={tile_m}"));
    list.extend(settings(more));
    list
}

/// Runs one file and returns the result.
fn label(points: &[Point], tile_m: f64, more: &[&str]) -> (RunSummary, Labelled) {
    let scratch = Scratch::new();
    let files = vec![scratch.file("a.las", &Shape::default(), points)];
    let summary = drive(&files, &scratch.out("out"), &list(tile_m, more)).unwrap();
    let labelled = Labelled::read(&files, &scratch.out("out"));
    assert_eq!(labelled.label.len(), points.len());
    (summary, labelled)
}

#[test]
fn a_drive_without_points_is_refused_and_an_empty_file_among_others_is_not() {
    let scratch = Scratch::new();
    let empty = scratch.file("empty.las", &Shape::default(), &[]);
    let error = drive(std::slice::from_ref(&empty), &scratch.out("out"), &list(5.0, &[])).unwrap_err();
    assert!(matches!(error.cause(), Some(SurveyError::Empty { files: 1, file: Some(_) })), "{error}");
    assert_eq!(error.kind(), ErrorKind::Input);
    let points = Street::middling(1, Course::Straight).points();
    let files = vec![
        empty,
        scratch.file("a.las", &Shape::default(), &points),
        scratch.file("z.laz", &Shape::default(), &[]),
    ];
    let summary = drive(&files, &scratch.out("three"), &list(5.0, &[])).unwrap();
    assert_eq!(summary.points, points.len() as u64);
    let (_, alone) = label(&points, 5.0, &[]);
    assert_eq!(Labelled::read(&files, &scratch.out("three")), alone);
}

#[test]
fn one_point_is_noise_and_one_point_that_need_not_have_company_is_ground() {
    let (summary, labelled) = label(&[Point::at([5, -5, 5])], 5.0, &[]);
    assert_eq!((summary.objects, summary.tiles, &labelled.class[..]), (0, 1, &[7][..]));
    let (_, labelled) = label(&[Point::at([5, -5, 5])], 5.0, &["noise.min_component_points=1"]);
    assert_eq!(labelled.class, [2]);
}

#[test]
fn ten_thousand_equal_points_are_one_place() {
    let (summary, labelled) = label(&vec![Point::at([700, 800, 900]); 10_000], 1.0, &[]);
    assert_eq!((summary.tiles, summary.counts.ground), (1, 10_000));
    assert!(labelled.class.iter().all(|class| *class == 2));
    // Above something low, they are an object.
    let mut points = vec![Point::at([700, 800, 5_900]); 10_000];
    points.extend([Point::at([700, 800, 0]); 20]);
    let (summary, labelled) = label(&points, 1.0, &[]);
    assert_eq!((summary.objects, summary.counts.object), (1, 10_000));
    assert!(labelled.label[..10_000].iter().all(|label| *label == 1));
}

#[test]
fn points_kilometres_away_are_processed_like_any_other_and_change_nothing_here() {
    let mut points = Street::middling(2, Course::Hairpin).points();
    let (_, before) = label(&points, 5.0, &[]);
    let count = points.len();
    for away in [
        [2_000_000_000, 0, 0],
        [-900_000_000, 1_900_000_000, 0],
        [5_000, 5_000, 1_500_000],
        [5_000, 0, -400_000],
    ] {
        points.push(Point { time: points[count - 1].time, ..Point::at(away) });
    }
    number(&mut points);
    for tile_m in [5.0, 1e6] {
        let (summary, after) = label(&points, tile_m, &[]);
        assert_eq!(after.class[..count], before.class[..]);
        assert_eq!(after.label[..count], before.label[..]);
        assert!(
            after.class[count..].iter().all(|class| [7, 18].contains(class)),
            "{:?}",
            &after.class[count..]
        );
        assert!(
            summary.warnings.iter().any(|text| {
                text.contains("lie far from all others") && text.contains("the axis does not follow them")
            }),
            "{:?}",
            summary.warnings
        );
    }
}

/// Two clusters so far apart that the extent of a tile with both would not fit 31 bits.
#[test]
fn a_drive_as_wide_as_records_allow_keeps_its_objects() {
    let shape = Shape { scale_tenths: 1, ..Shape::default() };
    let block = |x: i64| {
        (0..60_i64)
            .flat_map(move |step| [[x + step * 10, 0, 5_000], [x + step % 5 * 100, 0, 0]].map(Point::at))
    };
    let points: Vec<Point> = block(-200_000_000).chain(block(0)).chain(block(200_000_000)).collect();
    let run = |cell: &str| {
        let scratch = Scratch::new();
        let files = vec![scratch.file("wide.las", &shape, &points)];
        let out = scratch.out("out");
        let summary = drive(&files, &out, &list(0.0, &[cell])).unwrap();
        let table = std::fs::read_to_string(out.join("objects.csv")).unwrap();
        let names: Vec<&str> = table.lines().next().unwrap().split(',').collect();
        let columns = ["min_x", "max_x"].map(|name| names.iter().position(|other| *other == name).unwrap());
        let ends: Vec<[f64; 2]> = table
            .lines()
            .skip(1)
            .map(|row| columns.map(|column| row.split(',').nth(column).unwrap().parse().unwrap()))
            .collect();
        (summary.objects, ends, Labelled::read(&files, &out))
    };
    let fine = run("tiling.cell=1.0");
    assert_eq!(fine.0, 3);
    // Smallest and largest x of each object.
    assert_eq!(fine.1, [-200_000.0, 0.0, 200_000.0].map(|x| [x, x + 0.59]));
    assert_eq!(run("tiling.cell=10.0"), fine);
}

/// With a scale of 1 m, a damaged record has a coordinate that no place on earth has.
#[test]
fn a_coordinate_that_is_nowhere_on_earth_is_refused_with_its_record() {
    let scratch = Scratch::new();
    let shape = Shape { scale_tenths: 10_000, ..Shape::default() };
    let mut points: Vec<Point> =
        (0..70_000).map(|k| Point::at([k % 300 * 1_000, k / 300 * 1_000, 0])).collect();
    points[69_000].mm[1] = -1_000_000_000_000;
    for name in ["damaged.las", "damaged.laz"] {
        let files = [scratch.file(name, &shape, &points)];
        for method in ["cluster.method=euclidean", "cluster.method=density-peaks"] {
            let out = scratch.out(&format!("{name} {method}"));
            let error = drive(&files, &out, &list(0.0, &[method])).unwrap_err();
            let Some(SurveyError::Position { record, xyz, .. }) = error.cause() else { panic!("{error}") };
            assert_eq!((*record, xyz[1]), (69_000, -1_000_000_000), "{name}");
            assert!(error.to_string().contains(name) && error.hint().is_some(), "{error}");
        }
    }
}

#[test]
fn heights_beyond_any_landscape_are_refused_with_both_ends() {
    let scratch = Scratch::new();
    let points = [Point::at([0; 3]), Point::at([0, 0, 2_000_000_000]), Point::at([0, 0, -2_000_000_000])];
    let files = [scratch.file("high.las", &Shape::default(), &points)];
    let error = drive(&files, &scratch.out("out"), &list(5.0, &[])).unwrap_err();
    assert!(matches!(error.cause(), Some(SurveyError::Heights { .. })), "{error}");
    assert!(error.to_string().contains("-2000000 m to 2000000 m"), "{error}");
}

#[test]
fn times_that_are_no_numbers_are_counted_and_do_no_harm() {
    let mut points = Street::middling(3, Course::Straight).points();
    let (_, before) = label(&points, 5.0, &[]);
    for (index, point) in points.iter_mut().enumerate().filter(|(index, _)| index % 3 == 0) {
        point.time = [f64::NAN, f64::INFINITY, -1e300, f64::NEG_INFINITY][index % 4];
    }
    let (summary, after) = label(&points, 5.0, &[]);
    assert_eq!((&after.class, &after.label), (&before.class, &before.label));
    let bad = points.iter().filter(|point| !point.time.is_finite() || point.time.abs() >= 1e15).count();
    assert!(
        summary
            .warnings
            .contains(&format!("{bad} points have no usable GPS time: it is not finite, or beyond 1e15 s")),
        "{:?}",
        summary.warnings
    );
    points.iter_mut().for_each(|point| point.time = f64::NAN);
    let (_, after) = label(&points, 5.0, &[]);
    assert_eq!((&after.class, &after.label), (&before.class, &before.label));
}

#[test]
fn a_cut_file_degrees_and_equal_names_are_refused() {
    let scratch = Scratch::new();
    let points = Street::middling(4, Course::Loop).points();
    let whole = scratch.file("a.las", &Shape::default(), &points);
    let run = |files: &[PathBuf]| drive(files, &scratch.out("out"), &list(5.0, &[])).unwrap_err();

    let bytes = std::fs::read(&whole).unwrap();
    let cut = scratch.out("cut.las");
    std::fs::write(&cut, &bytes[..bytes.len() - 100]).unwrap();
    let error = run(&[cut]);
    assert!(matches!(error.cause(), Some(InputError::Truncated { .. })), "{error}");

    let degrees =
        scratch.file("degrees.las", &Shape { records: geographic(), ..Shape::default() }, &points[..9]);
    let error = run(&[degrees]);
    assert!(matches!(error.cause(), Some(InputError::Geographic { .. })), "{error}");

    std::fs::create_dir(scratch.out("b")).unwrap();
    let same = scratch.out("b/A.LAS");
    std::fs::copy(&whole, &same).unwrap();
    let error = run(&[whole, same]);
    assert!(matches!(error.cause(), Some(OutputError::NameClash { .. })), "{error}");
}

#[test]
fn files_with_one_name_are_told_apart_where_no_copies_are_written() {
    let scratch = Scratch::new();
    let post = |x: i64| (0..60).map(move |n| Point::at([x, 0, 300 + n * 50]));
    let mut files = Vec::new();
    for (folder, x) in [("north", 0), ("south", 40_000)] {
        std::fs::create_dir(scratch.out(folder)).unwrap();
        let ground = (0..400).map(|n| Point::at([x + n % 20 * 250, n / 20 * 250, 0]));
        let points: Vec<Point> = ground.chain(post(x + 2_000)).collect();
        files.push(scratch.file(&format!("{folder}/x.las"), &Shape::default(), &points));
    }
    let out = scratch.out("out");
    drive(&files, &out, &list(5.0, &["output.files=[\"csv\"]", "euclidean.min_points=20"])).unwrap();
    let table = std::fs::read_to_string(out.join("objects.csv")).unwrap();
    let lines: Vec<&str> = table.lines().skip(1).collect();
    assert_eq!(lines.len(), 2, "{table}");
    assert!(lines[0].contains("north/x.las") && lines[1].contains("south/x.las"), "{table}");
}

/// A drive of 80 m. The last profiles meet a post that is 12 m before the end of the ground. A post that is
/// 30 m before it has a point of the same time, as those that a spinning head sees until the end.
#[test]
fn an_object_is_cut_if_the_last_profiles_can_meet_it_and_do() {
    let time = |x: i64| x as f64 / 80_000.0 * 30.0;
    let ground = (0..320 * 48).map(|n| {
        let (x, y) = (n / 48 * 250, n % 48 * 250 - 6_000);
        Point { mm: [x, y, 0], time: time(x), mark: 0 }
    });
    // The lowest point of a post is seen last.
    let post = |x: i64, last: i64| {
        let seen = move |n: i64| time(if n == 0 { last } else { x });
        (0..60).map(move |n| Point { mm: [x, 3_000, 300 + n * 50], time: seen(n), mark: 0 })
    };
    let posts = [(30_000, 30_000), (50_000, 79_750), (68_000, 79_750)];
    let posts = posts.iter().flat_map(|(x, last)| post(*x, *last));
    let points: Vec<Point> = ground.chain(posts).collect();
    for (format, expected) in [(6, ["false", "false", "true"]), (0, ["false"; 3])] {
        let scratch = Scratch::new();
        let file = scratch.file("x.las", &Shape { format, ..Shape::default() }, &points);
        let out = scratch.out("out");
        drive(&[file], &out, &list(5.0, &["output.files=[\"csv\"]", "euclidean.min_points=20"])).unwrap();
        let table = std::fs::read_to_string(out.join("objects.csv")).unwrap();
        let rows: Vec<Vec<&str>> = table.lines().map(|line| line.split(',').collect()).collect();
        let column = rows[0].iter().position(|name| *name == "cut").unwrap();
        let cut: Vec<&str> = rows[1..].iter().map(|row| row[column]).collect();
        assert_eq!(cut, expected, "point format {format}: {table}");
    }
}

/// The settings say feet. Points, tables, page and cloud-optimised file agree on it, and a file that does not
/// name its system has the units of those that do.
#[test]
fn every_output_has_the_units_of_the_points() {
    let scratch = Scratch::new();
    let sample = vec![shipped("tests/data/mls_profiles.las")];
    let out = scratch.out("feet");
    let asked = ["input.unit=foot", "output.files=[\"points\",\"csv\",\"copc\"]", "euclidean.min_points=5"];
    let summary = drive(&sample, &out, &list(5.0, &asked)).unwrap();
    assert!(summary.objects > 0);
    let catalog = Catalog::open(&sample, &InputOptions { mmap: true, unit: LengthUnit::Foot }).unwrap();
    let extent = catalog.files()[0].header_extent();
    let range = |axis: usize| extent[0][axis] - 0.01..extent[1][axis] + 0.01;
    let table = std::fs::read_to_string(out.join("objects.csv")).unwrap();
    let mut lines = table.lines().filter(|line| !line.starts_with('#'));
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    for line in lines {
        for (name, value) in names.iter().zip(line.split(',')) {
            for (axis, of) in ["base_x", "base_y", "base_z"].iter().enumerate() {
                let inside = || range(axis).contains(&value.parse::<f64>().unwrap());
                assert!(name != of || inside(), "{name} {value} is not in {:?}", range(axis));
            }
        }
    }
    assert!(["base_x", "base_y", "base_z"].iter().all(|name| names.contains(name)), "{names:?}");
    // The record of COPC follows the header: centre and half of the edge of the octree (COPC 1.0).
    let cloud = std::fs::read(out.join("drive.copc.laz")).unwrap();
    let number = |at: usize| f64::from_le_bytes(*cloud[375 + 54 + at..].first_chunk().unwrap());
    for axis in 0..3 {
        let (centre, half) = (number(8 * axis), number(24));
        let range = range(axis);
        assert!(centre - half <= range.start + 0.02 && centre + half >= range.end - 0.02, "{centre} {half}");
    }
}

/// A file that does not name its system has the system of the others, and therefore its unit.
#[test]
fn files_without_a_system_have_the_unit_of_those_with_one() {
    let scratch = Scratch::new();
    // New York Long Island (EPSG:2263) in US survey feet (9003), as keys of GeoTIFF.
    let keys = [[1_u16, 1, 0, 3], [1_024, 0, 1, 1], [3_072, 0, 1, 2_263], [3_076, 0, 1, 9_003]].concat();
    let keys: Vec<u8> = keys.into_iter().flat_map(u16::to_le_bytes).collect();
    let with = Shape { format: 1, records: vec![("LASF_Projection", 34_735, keys)], ..Shape::default() };
    let files = vec![
        scratch.file("with.las", &with, &row()),
        scratch.file("without.las", &Shape { format: 1, ..Shape::default() }, &row()),
    ];
    let catalog = Catalog::open(&files, &InputOptions { mmap: true, unit: LengthUnit::Auto }).unwrap();
    let units: Vec<f64> = catalog.files().iter().map(|file| file.units_m()[0]).collect();
    assert!(units.iter().all(|unit| (unit - 1_200.0 / 3_937.0).abs() < 1e-9), "{units:?}");
    assert!((catalog.units_m()[0] - units[0]).abs() < 1e-12);
}

/// A file in New York Long Island (EPSG:2263), US survey feet, with more keys of GeoTIFF.
fn in_feet(scratch: &Scratch, name: &str, more: &[[u16; 4]]) -> PathBuf {
    let mut keys = vec![[1_024, 0, 1, 1], [3_072, 0, 1, 2_263]];
    keys.extend(more);
    let directory = [[1, 1, 0, u16::try_from(keys.len()).unwrap()]].into_iter().chain(keys);
    let bytes: Vec<u8> = directory.flatten().flat_map(u16::to_le_bytes).collect();
    let records = vec![("LASF_Projection", 34_735, bytes)];
    scratch.file(name, &Shape { format: 1, records, ..Shape::default() }, &row())
}

#[test]
fn a_vertical_system_has_its_own_unit_and_a_contradiction_names_both() {
    let scratch = Scratch::new();
    let open = |files: &[PathBuf]| Catalog::open(files, &InputOptions { mmap: true, unit: LengthUnit::Auto });
    let feet = 1_200.0 / 3_937.0;
    // NAVD88 in metres (5703); its unit as a code (4099).
    let [code, unit, survey_feet] = [
        ("code.las", [4_096, 0, 1, 5_703]),
        ("unit.las", [4_099, 0, 1, 9_001]),
        ("feet.las", [4_099, 0, 1, 9_003]),
    ]
    .map(|(name, key)| in_feet(&scratch, name, &[key]));
    let together = open(&[code.clone(), unit.clone()]).unwrap();
    let [plan_m, _, height_m] = together.units_m();
    assert!((plan_m - feet).abs() < 1e-9 && (height_m - 1.0).abs() < 1e-9, "{plan_m} {height_m}");
    let warnings = together.warnings().join("\n");
    assert!(warnings.contains("coordinates are in US survey feet, heights in metres"), "{warnings}");
    let error = open(&[code, survey_feet]).unwrap_err().to_string();
    assert!(
        error.contains("feet.las is in EPSG:2263 in US survey feet with heights in US survey feet, but"),
        "{error}"
    );
    assert!(error.ends_with("code.las is in EPSG:2263 in US survey feet with heights in metres"), "{error}");
    let unknown = open(&[in_feet(&scratch, "datum.las", &[[4_096, 0, 1, 5_103]])]).unwrap();
    let warnings = unknown.warnings().join("\n");
    assert!(warnings.contains("the unit of the vertical system 5103 is not known"), "{warnings}");
}

/// The tables of a run do not name a system that the stated unit contradicts.
#[test]
fn a_stated_unit_takes_a_contradicted_system_out_of_the_tables() {
    let scratch = Scratch::new();
    let files = vec![in_feet(&scratch, "feet.las", &[])];
    for (unit, is_named) in [("us-survey-foot", true), ("metre", false)] {
        let out = scratch.out(unit);
        let asked = [&format!("input.unit={unit}")[..], "euclidean.min_points=5"];
        let summary = drive(&files, &out, &list(5.0, &asked)).unwrap();
        let warnings = summary.warnings.join("\n");
        let contradiction =
            "input.unit says that coordinates are in metres, but those of EPSG:2263 are in US survey feet";
        assert_eq!(warnings.contains(contradiction), !is_named, "{warnings}");
        for name in ["objects.geojson", "report.json"] {
            let text = std::fs::read_to_string(out.join(name)).unwrap();
            let code = if name == "report.json" { "\"epsg\": 2263" } else { "EPSG::2263" };
            assert_eq!(text.contains(code), is_named, "{name} with {unit}");
        }
    }
}

#[test]
fn different_clocks_are_named() {
    let scratch = Scratch::new();
    let with_clock = |name: &str, standard: u8| {
        let path = scratch.file(name, &Shape::default(), &row());
        let mut bytes = std::fs::read(&path).unwrap();
        // Bit 0 of the global encoding (LAS 1.4, table 4).
        bytes[6] = bytes[6] & !1 | standard;
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let files = [with_clock("week.las", 0), with_clock("standard.las", 1), with_clock("other.las", 0)];
    let warnings = |files: &[PathBuf]| {
        let options = InputOptions { mmap: true, unit: LengthUnit::Auto };
        Catalog::open(files, &options).unwrap().warnings().join("\n")
    };
    let found = warnings(&files);
    assert!(
        found.contains("standard times in standard.las, and seconds of the week in week.las and 1 more"),
        "{found}"
    );
    assert!(!warnings(&[files[0].clone(), files[2].clone()]).contains("clock"));
}

#[test]
fn degrees_without_a_system_are_refused_unless_the_unit_is_stated() {
    let scratch = Scratch::new();
    let path = scratch.file("degrees.las", &Shape { scale_tenths: 1, ..Shape::default() }, &row());
    let mut bytes = std::fs::read(&path).unwrap();
    // Scales of x and y: 1e-7 degrees.
    for at in [131, 139] {
        bytes[at..at + 8].copy_from_slice(&1e-7_f64.to_le_bytes());
    }
    std::fs::write(&path, bytes).unwrap();
    let open = |unit| Catalog::open(std::slice::from_ref(&path), &InputOptions { mmap: true, unit });
    let error = open(LengthUnit::Auto).unwrap_err();
    assert!(matches!(&error, InputError::Geographic { .. }), "{error}");
    assert!(error.to_string().contains("look like degrees"), "{error}");
    let stated = open(LengthUnit::Metre).unwrap();
    assert_eq!(stated.crs().description, "not given in the files (input.unit is metre)");
}

#[test]
fn a_trajectory_of_elsewhere_is_refused() {
    let scratch = Scratch::new();
    let files = vec![scratch.file("a.las", &Shape::default(), &row())];
    let track = scratch.out("track.csv");
    for (place, refusal) in [("500000,5400000", Some("km away from the points")), ("900,0", None)] {
        let moved = place.replacen("00,", "01,", 1);
        std::fs::write(&track, format!("gps_time,x,y,z\n0,{place},0\n1,{moved},0\n")).unwrap();
        let assignment = format!("axis.trajectory={}", track.display());
        let found = drive(&files, &scratch.out("out"), &list(5.0, &[&assignment]));
        match refusal {
            Some(text) => {
                let error = found.unwrap_err();
                assert!(error.to_string().contains(text), "{error}");
            }
            None => assert!(found.is_ok(), "{found:?}"),
        }
    }
}

#[test]
fn two_hundred_tiny_files_are_one_drive() {
    let scratch = Scratch::new();
    let mut points = Street::middling(5, Course::Carriageways).points();
    points.truncate(points.len() / 200 * 200);
    let name = |part: usize| format!("part-{part:03}.{}", if part.is_multiple_of(2) { "las" } else { "laz" });
    let parts = points.chunks(points.len() / 200).enumerate();
    let files: Vec<PathBuf> =
        parts.map(|(part, points)| scratch.file(&name(part), &Shape::default(), points)).collect();
    assert_eq!(files.len(), 200);
    drive(&files, &scratch.out("out"), &list(10.0, &[])).unwrap();
    let (_, alone) = label(&points, 10.0, &[]);
    assert_eq!(Labelled::read(&files, &scratch.out("out")), alone);
}

#[test]
fn a_labelled_copy_fed_in_again_comes_out_as_it_is() {
    let scratch = Scratch::new();
    for name in ["a.las", "b.laz"] {
        let points = Street::middling(6, Course::Straight).points();
        let files = vec![scratch.file(name, &Shape::default(), &points)];
        let [first, second] = ["first", "second"].map(|run| scratch.out(&format!("{run}-{name}")));
        drive(&files, &first, &list(10.0, &[])).unwrap();
        drive(&[first.join(name)], &second, &list(4.0, &[])).unwrap();
        assert_same_outputs(&first, &second, name);
    }
}

/// A ground filter as a new contributor would write it: everything below a height is ground.
#[derive(Debug)]
struct Below(i64);

impl GroundFilter for Below {
    fn name(&self) -> &'static str {
        "below"
    }
    fn reach(&self, _: Lattice) -> Reach {
        Reach::Exact { metres: 0.0 }
    }
    fn classify(&self, view: &mut TileView<'_>, classes: &mut [PointClass]) -> Result<(), AlgorithmError> {
        let cloud = view.cloud();
        for (index, class) in classes.iter_mut().enumerate().filter(|(_, class)| !class.is_noise()) {
            if cloud.lattice_point(index)[2] < self.0 {
                *class = PointClass::Ground;
            }
        }
        Ok(())
    }
}

/// A clustering method as a new contributor would write it: the points in a cube of one metre are one object.
#[derive(Debug)]
struct Cubes;

impl Clusterer for Cubes {
    fn name(&self) -> &'static str {
        "cubes"
    }
    fn reach(&self, _: Lattice) -> Reach {
        Reach::Exact { metres: 1.5 }
    }
    fn object_size(&self) -> std::ops::RangeInclusive<u64> {
        2..=u64::MAX
    }
    fn cluster(&self, cloud: &TileCloud, labels: &mut [u32]) -> Result<u32, AlgorithmError> {
        let cube = |index: usize| cloud.lattice_point(index).map(|value| value.div_euclid(1_000));
        let mut cubes: Vec<[i64; 3]> = (0..cloud.len()).map(cube).collect();
        cubes.sort_unstable();
        cubes.dedup();
        for (index, label) in labels.iter_mut().enumerate() {
            *label = 1 + u32::try_from(cubes.binary_search(&cube(index)).unwrap()).unwrap();
        }
        Ok(u32::try_from(cubes.len()).unwrap())
    }
}

const BELOW: GroundEntry = GroundEntry {
    name: "below",
    summary: "below 1 m",
    reference: "none",
    build: |_| Ok(Box::new(Below(1_000))),
};
const CUBES: ClusterEntry = ClusterEntry {
    name: "cubes",
    summary: "cubes of a metre",
    reference: "none",
    build: |_| Ok(Box::new(OneStep::new(Cubes, &[]))),
};

#[test]
fn a_method_is_one_type_and_one_line() {
    let scratch = Scratch::new();
    let points = Street::middling(7, Course::Hairpin).points();
    let files = vec![scratch.file("a.las", &Shape::default(), &points)];
    let mut filters = ground::REGISTRY.to_vec();
    let mut methods = cluster::REGISTRY.to_vec();
    filters.push(BELOW);
    methods.push(CUBES);
    let registries = Registries { ground: &filters, cluster: &methods };
    for tile_m in [3.0, 1e6] {
        let out = scratch.out(&format!("{tile_m}"));
        let list = list(tile_m, &["ground.method=below", "cluster.method=cubes", "noise.enabled=false"]);
        run_with(&files, &out, &list, registries).unwrap();
        let found = Labelled::read(&files, &out);
        let cube = |index: usize| found.at[index].map(|value| value.div_euclid(1_000));
        let partition = found.partition();
        for (index, point) in points.iter().enumerate() {
            assert_eq!(found.class[index] == 2, point.mm[2] < 1_000);
            let first =
                (0..points.len()).find(|&other| points[other].mm[2] >= 1_000 && cube(other) == cube(index));
            let alone = (0..points.len()).filter(|&other| cube(other) == cube(index)).count() < 2;
            assert_eq!(partition[index], first.filter(|_| point.mm[2] >= 1_000 && !alone), "point {index}");
        }
    }
    assert_same_outputs(&scratch.out("3"), &scratch.out("1000000"), "cubes");
}

/// A method that fails at one place, by an error or by a panic, and does nothing elsewhere.
#[derive(Debug)]
struct Failing {
    panics: bool,
}

/// The place, in lattice units: chainage 20 to 25 m of the street below.
const BAD: std::ops::Range<i64> = 21_000..24_000;

impl Clusterer for Failing {
    fn name(&self) -> &'static str {
        "failing"
    }
    fn reach(&self, _: Lattice) -> Reach {
        Reach::Exact { metres: 0.0 }
    }
    fn object_size(&self) -> std::ops::RangeInclusive<u64> {
        1..=u64::MAX
    }
    fn cluster(&self, cloud: &TileCloud, labels: &mut [u32]) -> Result<u32, AlgorithmError> {
        // As slow as a real tile, so that the engine has time to stop.
        std::thread::sleep(std::time::Duration::from_millis(5));
        if (0..cloud.len()).any(|index| BAD.contains(&cloud.lattice_point(index)[0])) {
            assert!(!self.panics, "this method cannot count to three");
            return Err(AlgorithmError::TooManyPoints { method: "failing", points: 5_000_000_000 });
        }
        labels.fill(0);
        Ok(0)
    }
}

const FAILING: ClusterEntry = ClusterEntry {
    name: "failing",
    summary: "fails at one place",
    reference: "none",
    build: |_| Ok(Box::new(OneStep::new(Failing { panics: false }, &["failing.*"]))),
};
const PANICKING: ClusterEntry = ClusterEntry {
    build: |_| Ok(Box::new(OneStep::new(Failing { panics: true }, &["failing.*"]))),
    ..FAILING
};

/// Objects on ground every metre, over 40 m.
fn row() -> Vec<Point> {
    let mut points = Vec::new();
    for x in 0..40_i64 {
        points.extend((0..20).map(|step| Point::at([x * 1_000 + 500, step % 5 * 100, 0])));
        points.extend((0..20).map(|step| Point::at([x * 1_000 + 500, 200, 2_000 + step * 100])));
    }
    points
}

#[derive(Default)]
struct Failures(std::sync::Mutex<Vec<String>>);

impl Observer for Failures {
    fn event(&self, event: &Event<'_>) {
        if let Event::UnitFailed { pass, unit, reason } = event {
            self.0.lock().unwrap().push(format!("{pass} {unit}: {reason}"));
        }
    }
}

fn run_failing(files: &[PathBuf], out: &Path, entry: ClusterEntry, more: &[&str]) -> (Error, Vec<String>) {
    let mut list = list(5.0, &["cluster.method=failing", "tiling.cell=0.5"]);
    list.extend(settings(more));
    let failures = Failures::default();
    let registries = Registries { ground: ground::REGISTRY, cluster: &[entry] };
    let request = RunRequest {
        inputs: files.to_vec(),
        out: out.to_owned(),
        config: config(&list),
        fresh: false,
        registries,
    };
    let error = run(&request, &failures, &CancelToken::default()).unwrap_err();
    (error, failures.0.into_inner().unwrap())
}

/// Numbers of failed and finished tiles of a pass, from their files.
fn units(out: &Path, pass: &str) -> (Vec<String>, usize) {
    let names: Vec<String> = std::fs::read_dir(out.join(".chainage").join(pass))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    let mut failed: Vec<String> = names.iter().filter(|name| name.ends_with(".err.json")).cloned().collect();
    failed.sort();
    (failed, names.iter().filter(|name| name.ends_with(".bin")).count())
}

#[test]
fn a_tile_that_fails_or_panics_is_recorded_and_the_others_go_on() {
    let scratch = Scratch::new();
    let files = vec![scratch.file("a.las", &Shape { format: 0, ..Shape::default() }, &row())];
    for (entry, kind, text) in [
        (FAILING, "Input", "failing: a tile has 5000000000 points, the limit is 4294967295"),
        (PANICKING, "Bug", "internal error: pass cluster, unit 4: this method cannot count to three"),
    ] {
        let out = scratch.out(kind);
        let (error, told) = run_failing(&files, &out, entry, &[]);
        let Some(RunError::UnitsFailed { pass, failed, total, first }) = error.cause() else {
            panic!("{error}")
        };
        assert_eq!((pass.as_str(), *failed, *total), ("cluster", 1, 8), "{error}");
        assert!(first.contains(text), "{first}");
        assert_eq!(error.kind(), ErrorKind::UnitsFailed);
        assert_eq!(told, [format!("cluster 4: {text}")]);
        let (failed, done) = units(&out, "pass-03-1-cluster");
        assert_eq!((failed, done), (vec!["unit-000004.err.json".to_owned()], 7));
        let record: serde_json::Value = serde_json::from_slice(
            &std::fs::read(out.join(".chainage/pass-03-1-cluster/unit-000004.err.json")).unwrap(),
        )
        .unwrap();
        assert_eq!(
            (&record["pass"], &record["unit"], &record["kind"]),
            (&"cluster".into(), &4.into(), &kind.into())
        );
        assert_eq!(record["error"], text);
        assert!(!out.join("a.las").exists(), "a copy that is not complete has its name");
        // With a method that does not fail there, the run resumes: the failed tile is computed, and the
        // record of the failure disappears.
        let mut list = list(5.0, &["cluster.method=failing", "tiling.cell=0.5"]);
        list.push("run.threads=1".to_owned());
        let good = ClusterEntry { build: |_| Ok(Box::new(OneStep::new(Cubes, &[]))), ..FAILING };
        let registries = Registries { ground: ground::REGISTRY, cluster: &[good] };
        let summary = run_with(&files, &out, &list, registries).unwrap();
        let figures = summary.passes.iter().find(|figures| figures.pass == "cluster").unwrap();
        assert_eq!((figures.units, figures.resumed), (8, 7));
        assert_eq!(units(&out, "pass-03-1-cluster"), (Vec::new(), 8));
    }
}

#[test]
fn fail_fast_stops_at_the_first_failure() {
    let scratch = Scratch::new();
    let files = vec![scratch.file("a.las", &Shape { format: 0, ..Shape::default() }, &row())];
    let out = scratch.out("out");
    let more = ["run.fail_fast=true", "run.threads=1", "tiling.tile_length=1"];
    let (error, _) = run_failing(&files, &out, FAILING, &more);
    // The bad place is three tiles wide, and tiles in progress are finished.
    assert!(matches!(error.cause(), Some(RunError::UnitsFailed { failed: 1..=3, total: 40, .. })), "{error}");
    let (_, done) = units(&out, "pass-03-1-cluster");
    assert!((20..27).contains(&done), "{done} tiles were done all the same");
}

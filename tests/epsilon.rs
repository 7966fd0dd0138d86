//! Estimated epsilon on drives: the curve against brute force over the whole cloud, with any cut; runs with
//! `auto` and with fields other than coordinates; which results a change invalidates; and the program itself.

use std::path::{Path, PathBuf};

use chainage::cluster::dbscan::epsilon::DriveEpsilon;
use chainage::cluster::dbscan::epsilon::{Curve, EpsilonError};
use chainage::cluster::dbscan::rows as space;
use chainage::cluster::{DbscanVariant, Epsilon};
use chainage::run::{CancelToken, EstimateRequest, Registries, Silent, estimate_epsilon};
use chainage::spatial::Points;
use proptest::prelude::*;
use proptest::test_runner::TestRunner;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::util::drive::{Labelled, assert_same_outputs, config, drive, scratch, settings};
use crate::util::las::{Point, Shape};
use crate::util::oracle;
use crate::util::program::{ended, events, finished, program, run_command, run_to_the_end};
use crate::util::shipped;
use crate::util::street::{COURSES, Course, Street, permutation};

/// Estimates epsilon over files, with these settings added to those of an estimation.
fn estimated(inputs: &[PathBuf], out: &Path, more: &[String]) -> Result<DriveEpsilon, chainage::Error> {
    let mut list = settings(&["cluster.method=dbscan", "dbscan.epsilon=auto", "run.memory_mib=256"]);
    list.extend_from_slice(more);
    let request = EstimateRequest {
        inputs: inputs.to_vec(),
        out: out.to_owned(),
        config: config(&list),
        registries: Registries::default(),
    };
    estimate_epsilon(&request, &Silent, &CancelToken::default()).map(|(found, _)| found)
}

/// The curve, even if it gives no epsilon; `None` if there are too few points.
fn curve_of(result: Result<DriveEpsilon, chainage::Error>) -> Option<Curve> {
    match result {
        Ok(found) => Some(found.estimate.curve),
        Err(error) => match error.cause() {
            Some(EpsilonError::NoTangent { curve, .. }) => Some(curve.clone()),
            Some(EpsilonError::TooFewPoints { .. }) => None,
            _ => panic!("{error}"),
        },
    }
}

/// Mean distance in metres to the 2nd to k-th nearest neighbour over all points, from all pairs.
fn brute_force(points: &[[i64; 3]], k: usize) -> Vec<f64> {
    let mut sums = vec![0.0; k - 1];
    for p in points {
        let squared = |q: &[i64; 3]| (0..3).map(|axis| (p[axis] - q[axis]).pow(2)).sum::<i64>();
        let mut all: Vec<i64> = points.iter().map(squared).collect();
        all.sort_unstable();
        all[1..].iter().zip(&mut sums).for_each(|(&squared, sum)| *sum += (squared as f64).sqrt() / 1_000.0);
    }
    sums.iter().map(|sum| sum / points.len() as f64).collect()
}

/// One random case.
#[derive(Debug, Clone)]
struct Case {
    street: Street,
    tile_m: f64,
    threads: usize,
    k: usize,
    ground: bool,
    shuffled: bool,
    chunk: Option<u32>,
}

fn cases() -> impl Strategy<Value = Case> {
    let street = (any::<u64>(), prop::sample::select(COURSES.to_vec()), 1..12_usize, 0..30_usize, 0..6_usize)
        .prop_map(|(seed, course, things, patches, strays)| Street {
            seed,
            course,
            things,
            thing_points: 20,
            patches,
            strays,
            base_mm: [651_000_120, 5_423_000_990, 98_300],
        });
    let tile_m = prop_oneof![3 => 1.0..6.0, 1 => 6.0..60.0];
    let flags = (any::<bool>(), any::<bool>(), prop_oneof![Just(None), (5..20_u32).prop_map(Some)]);
    (street, tile_m, 1..4_usize, 8..30_usize, flags).prop_map(
        |(street, tile_m, threads, k, (ground, shuffled, chunk))| Case {
            street,
            tile_m,
            threads,
            k,
            ground,
            shuffled,
            chunk,
        },
    )
}

/// The used points, by brute force: all points, or those that are neither noise nor ground.
fn kept(points: &[Point], ground: bool) -> Vec<[i64; 3]> {
    let at: Vec<[i64; 3]> = points.iter().map(|point| point.mm).collect();
    if !ground {
        return at;
    }
    let hidden: Vec<bool> = oracle::noise(&at, [300, 900], 4, true).iter().map(|&code| code != 0).collect();
    let ground = oracle::voxel_column(&at, &hidden, [300, 1_000, 500, 1_500], 2);
    (0..at.len()).filter(|&p| !hidden[p] && !ground[p]).map(|p| at[p]).collect()
}

/// Most of these streets are so sparse, and their tiles so short, that hardly any point finds its neighbours
/// in core and halo. If tiles did not read beyond the halo, the first cases would fail.
#[test]
fn the_curve_is_that_of_the_whole_cloud_however_it_is_cut() {
    let mut asked = 0;
    let test = |case: Case| {
        let folder = scratch();
        let mut points = case.street.points();
        if case.shuffled {
            points =
                permutation(points.len(), case.street.seed).into_iter().map(|index| points[index]).collect();
        }
        let path = folder.path().join(if case.chunk.is_some() { "street.laz" } else { "street.las" });
        Shape { offset_mm: case.street.base_mm, ..Shape::default() }.write_in_chunks(
            &path,
            &points,
            case.chunk.unwrap_or(0),
        );
        let kept = kept(&points, case.ground);
        let estimate = |name: &str, tile_m: f64, threads: usize| {
            let mut list = settings(&["noise.voxel=0.3", "noise.min_component_points=4", "noise.high=0.9"]);
            if !case.ground {
                list.extend(settings(&["ground.method=none", "noise.enabled=false"]));
            }
            list.push(format!("epsilon.k={}", case.k));
            list.push(format!("tiling.tile_length={tile_m}"));
            list.push(format!("run.threads={threads}"));
            estimated(std::slice::from_ref(&path), &folder.path().join(name), &list)
        };
        let tiled = estimate("tiled", case.tile_m, case.threads);
        asked += tiled.as_ref().map_or(0, |found| found.cost.asked_for_more);
        let tiled = curve_of(tiled);
        let whole = curve_of(estimate("whole", 1e6, 1));
        prop_assert_eq!(&tiled, &whole, "bits of the means");
        let Some(curve) = tiled else {
            prop_assert!(kept.len() < case.k);
            return Ok(());
        };
        prop_assert_eq!((curve.queries, curve.population), (kept.len() as u64, kept.len() as u64));
        let expected = brute_force(&kept, curve.k());
        for (k, (mean, expected)) in (2..).zip(curve.mean.iter().zip(&expected)) {
            prop_assert!(
                (mean - expected).abs() <= 1e-9 * expected.max(1e-3),
                "k = {}: {} {}",
                k,
                mean,
                expected
            );
        }
        Ok(())
    };
    let test = std::cell::RefCell::new(test);
    let config = ProptestConfig { cases: 48, ..ProptestConfig::default() };
    TestRunner::new(config).run(&cases(), |case| (test.borrow_mut())(case)).unwrap();
    assert!(asked > 0, "no point asked for more: the test does not see it");
}

/// A heap of points, and one more point 900 m away: its neighbours are at the other end of the drive.
#[test]
fn a_point_far_from_all_others_finds_its_neighbours() {
    let folder = scratch();
    let mut points: Vec<Point> = (0..60).map(|i| Point::at([i * 700, i % 7 * 210, i % 5 * 330])).collect();
    points.push(Point::at([900_000, 40_000, 0]));
    let path = folder.path().join("far.las");
    Shape::default().write(&path, &points);
    let kept: Vec<[i64; 3]> = points.iter().map(|point| point.mm).collect();
    for tile_m in ["5", "1000000"] {
        let more = settings(&["ground.method=none", "noise.enabled=false", "epsilon.k=10"]);
        let more = [more, vec![format!("tiling.tile_length={tile_m}")]].concat();
        let found =
            curve_of(estimated(std::slice::from_ref(&path), &folder.path().join(tile_m), &more)).unwrap();
        for (mean, expected) in found.mean.iter().zip(brute_force(&kept, found.k())) {
            assert!((mean - expected).abs() < 1e-9 * expected, "{mean} {expected}");
        }
    }
}

#[test]
fn a_sample_of_the_points_is_the_same_in_any_tiles_and_near_the_whole() {
    let folder = scratch();
    let sweep = [shipped("tests/data/tree_road_sweep.laz")];
    let estimate = |name: &str, more: &[&str]| {
        estimated(&sweep, &folder.path().join(name), &settings(more)).expect("an estimate").estimate
    };
    let whole = estimate("whole", &["epsilon.max_queries=0"]);
    let part = estimate("part", &["epsilon.max_queries=5000", "tiling.tile_length=1000"]);
    let tiled = estimate("tiled", &["epsilon.max_queries=5000", "tiling.tile_length=7"]);
    assert_eq!(part, tiled);
    assert!((4_700..5_300).contains(&part.curve.queries) && whole.standard_error == 0.0, "{part:?}");
    assert!(part.standard_error > 0.0);
    let off = (part.curve.mean[9] - whole.curve.mean[9]).abs();
    assert!(off > 0.0 && off < 5.0 * part.curve.standard_error[9], "{off} {}", part.curve.standard_error[9]);
    let other = estimate("other", &["epsilon.max_queries=5000", "epsilon.seed=2"]);
    assert_ne!(other.curve.mean, part.curve.mean);
}

/// Some points are in one place, so a sample of records would differ from a sample of places.
#[test]
fn a_sample_of_the_points_depends_on_neither_the_order_of_records_nor_the_files() {
    let folder = scratch();
    for course in COURSES {
        let mut points = Street::middling(17, course).points();
        points.extend_from_within(points.len() / 3..points.len() / 2);
        let reversed = points.iter().rev().copied().collect();
        let shuffled = permutation(points.len(), 4).into_iter().map(|index| points[index]).collect();
        let estimate = |name: &str, points: &[Point], files: usize| {
            let name = format!("{course:?} {name}");
            let write = |(part, points): (usize, &[Point])| {
                let path = folder.path().join(format!("{name} {part}.las"));
                Shape::default().write(&path, points);
                path
            };
            let inputs: Vec<PathBuf> =
                points.chunks(points.len().div_ceil(files)).enumerate().map(write).collect();
            let more = settings(&[
                "ground.method=none",
                "noise.enabled=false",
                "epsilon.k=12",
                "epsilon.max_queries=400",
                "tiling.tile_length=9",
            ]);
            curve_of(estimated(&inputs, &folder.path().join(name), &more)).expect("a curve")
        };
        let expected = estimate("as driven", &points, 1);
        assert!((200..800).contains(&expected.queries) && points.len() > 1_000, "{}", expected.queries);
        let orders: [(&str, Vec<Point>); 2] = [("driven backwards", reversed), ("shuffled", shuffled)];
        for (name, points) in &orders {
            assert_eq!(estimate(name, points, 1), expected, "{course:?}, {name}");
        }
        assert_eq!(estimate("in five files", &points, 5), expected, "{course:?}");
        assert_eq!(estimate("shuffled in two files", &orders[1].1, 2), expected, "{course:?}");
    }
}

/// A run with an estimated epsilon gives the same bytes as with one tile, and the same labels as with this
/// epsilon in the settings.
#[test]
#[ignore = "long; scripts/check.sh runs it"]
fn nobody_can_tell_the_tiles_of_a_run_with_an_estimate() {
    let folder = scratch();
    let sweep = [shipped("tests/data/tree_road_sweep.laz")];
    for variant in ["size", "core"] {
        let base = settings(&["cluster.method=dbscan", "dbscan.min_points=8", "run.memory_mib=256"]);
        let set =
            |more: &[String]| [&base[..], &settings(&[&format!("dbscan.variant={variant}")]), more].concat();
        let mut outs = Vec::new();
        for (tile, threads) in [("1000", 1), ("5", 2), ("23", 1)] {
            let out = folder.path().join(format!("{variant}-{tile}"));
            let more = settings(&["dbscan.epsilon=auto", &format!("tiling.tile_length={tile}")]);
            let summary =
                drive(&sweep, &out, &set(&[more, settings(&[&format!("run.threads={threads}")])].concat()))
                    .expect("a run");
            outs.push((out, summary.epsilon().expect("an estimate").estimate));
        }
        for (out, estimate) in &outs[1..] {
            assert_eq!(estimate, &outs[0].1, "{variant}");
            assert_same_outputs(&outs[0].0, out, variant);
        }
        let report: serde_json::Value =
            serde_json::from_slice(&std::fs::read(outs[0].0.join("report.json")).expect("read"))
                .expect("JSON");
        let epsilon = report["result"]["epsilon"]["epsilon"].as_f64().expect("a number");
        assert!(
            report["result"]["epsilon"]["curve"]["mean"].as_array().is_some_and(|curve| curve.len() == 39)
        );
        let given = folder.path().join(format!("{variant}-given"));
        drive(&sweep, &given, &set(&settings(&[&format!("dbscan.epsilon={epsilon}")]))).expect("a run");
        assert_same_outputs(&outs[0].0, &given, "given");
    }
}

const FIELDS: &str = r#"dbscan.fields=["x","y","z","intensity"]"#;

/// Objects in a space of fields equal those that the same method for tables finds over all points at once.
#[test]
#[ignore = "long; scripts/check.sh runs it"]
fn fields_beyond_coordinates_are_standardised_over_the_drive_and_exact_over_tiles() {
    let folder = scratch();
    let sweep = [shipped("tests/data/tree_road_sweep.laz")];
    for (variant, kind) in [("size", DbscanVariant::Size), ("core", DbscanVariant::Core)] {
        let set = settings(&[
            "cluster.method=dbscan",
            "dbscan.epsilon=0.08",
            "dbscan.min_points=6",
            &format!("dbscan.variant={variant}"),
            FIELDS,
            "dbscan.weights=[2,2,2,0.5]",
            "run.memory_mib=256",
        ]);
        let run = |name: &str, tile: &str, threads: &str| {
            let out = folder.path().join(format!("{variant}-{name}"));
            let more = settings(&[&format!("tiling.tile_length={tile}"), &format!("run.threads={threads}")]);
            drive(&sweep, &out, &[&set[..], &more].concat()).expect("a run");
            out
        };
        let whole = run("whole", "1000", "1");
        let tiled = run("tiled", "9", "2");
        assert_same_outputs(&whole, &tiled, variant);
        let found = Labelled::read(&sweep, &whole);
        let values: Vec<f64> = (0..found.at.len())
            .flat_map(|p| [0, 1, 2].map(|k| found.at[p][k] as f64).into_iter().chain([found.mark[p].into()]))
            .collect();
        let mut all = Points::new(4, values).unwrap();
        all.standardise(&[2.0, 2.0, 2.0, 0.5]).unwrap();
        let object: Vec<usize> =
            (0..found.at.len()).filter(|&p| ![2, 7, 18].contains(&found.class[p])).collect();
        let kept = Points::new(4, object.iter().flat_map(|&p| all.row(p).to_vec()).collect()).unwrap();
        let method = space::Dbscan { variant: kind, epsilon: 0.08, min_points: 6, max_points: 0 };
        let (labels, count) = method.cluster(&kept).unwrap();
        assert!(count > 10, "{count}");
        assert_eq!(object.iter().map(|&p| found.label[p]).collect::<Vec<_>>(), labels, "{variant}");
    }
}

#[test]
fn an_estimate_in_a_space_of_fields_is_the_same_in_any_tiles() {
    let folder = scratch();
    let sweep = [shipped("tests/data/tree_road_sweep.laz")];
    let estimate = |tile: &str| {
        let more = settings(&[FIELDS, &format!("tiling.tile_length={tile}"), "epsilon.max_queries=20000"]);
        estimated(&sweep, &folder.path().join(tile), &more).expect("an estimate")
    };
    let whole = estimate("1000");
    let tiled = estimate("8");
    assert_eq!(
        (&whole.estimate, &whole.space, whole.unit),
        (&tiled.estimate, &tiled.space, "standard deviations".into())
    );
    assert!(tiled.cost.asked_for_more > 0, "{:?}", tiled.cost);
}

#[test]
fn fields_that_are_not_there_or_reach_too_far_are_refused() {
    let folder = scratch();
    let sweep = [shipped("tests/data/tree_road_sweep.laz")];
    let refused = |name: &str, more: &[&str]| {
        let list = [settings(&["cluster.method=dbscan", "run.memory_mib=256"]), settings(more)].concat();
        let error = drive(&sweep, &folder.path().join(name), &list).unwrap_err();
        format!("{error}; {}", error.hint().unwrap_or_default())
    };
    let colour = refused("colour", &[r#"dbscan.fields=["x","y","z","nir"]"#]);
    assert!(
        colour.contains("has no nir: its point format is") && colour.contains("leave the field out"),
        "{colour}"
    );
    let far = refused("far", &[FIELDS, "dbscan.epsilon=1", "tiling.tile_length=5"]);
    assert!(far.contains("the longest tile is 6.0 m long") && far.contains("--tile-length"), "{far}");
}

/// A street of about 3,000 points, and the arguments of a run with an estimate.
fn resumable(folder: &Path) -> (Vec<PathBuf>, Vec<&'static str>) {
    let street = Street { things: 120, patches: 300, ..Street::middling(9, Course::Hairpin) };
    let path = folder.join("street.laz");
    Shape::default().write_in_chunks(&path, &street.points(), 300);
    let options = [
        "--method",
        "dbscan",
        "--set",
        "dbscan.epsilon=auto",
        "--set",
        "dbscan.min_points=5",
        "--tile-length",
        "4",
        "--memory",
        "256M",
    ];
    (vec![path], options.to_vec())
}

#[test]
fn only_what_depends_on_a_change_is_estimated_again() {
    let folder = scratch();
    let (inputs, options) = resumable(folder.path());
    let out = folder.path().join("out");
    let counts = |more: &[&str]| {
        let before = events(&out).len();
        run_to_the_end(&inputs, &out, &[&options[..], more].concat());
        let after = events(&out);
        ["ground", "epsilon", "cluster"].map(|pass| finished(&after[before..], pass) > 0)
    };
    assert_eq!(counts(&[]), [true, true, true]);
    assert_eq!(counts(&["--threads", "3"]), [false, false, false]);
    let status = program().args(["status", "--json"]).arg(&out).output().expect("starts");
    let status: serde_json::Value = serde_json::from_slice(&status.stdout).expect("JSON");
    let row = status["passes"]
        .as_array()
        .expect("passes")
        .iter()
        .find(|pass| pass["pass"] == "epsilon")
        .expect("a row");
    assert_eq!((&status["finished"], &row["done"], &row["stale"]), (&true.into(), &row["units"], &0.into()));
    assert_eq!(counts(&["--set", "dbscan.min_points=9"]), [false, false, true]);
    assert_eq!(counts(&["--set", "epsilon.max_queries=500"]), [false, true, true]);
    assert_eq!(counts(&["--set", "epsilon.seed=8"]), [false, true, true]);
    assert_eq!(counts(&["--set", "voxel-column.step=0.4"]), [true, true, true]);
}

#[test]
fn killed_while_it_estimates_it_goes_on_to_the_same_bytes() {
    let folder = scratch();
    let (inputs, options) = resumable(folder.path());
    let undisturbed = folder.path().join("undisturbed");
    let out = folder.path().join("killed");
    run_to_the_end(&inputs, &undisturbed, &options);
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut cut_short = 0;
    for round in 0..8_u64 {
        let mut child = run_command(&inputs, &out, &options).spawn().expect("starts");
        std::thread::sleep(std::time::Duration::from_millis(random.random_range(0..60 + round * 15)));
        child.kill().expect("killed");
        cut_short += u32::from(!child.wait().expect("ended").success());
    }
    run_to_the_end(&inputs, &out, &options);
    assert_same_outputs(&undisturbed, &out, "killed");
    assert!(cut_short > 0, "no run was killed in time");
    let report = |out: &Path| -> serde_json::Value {
        serde_json::from_slice(&std::fs::read(out.join("report.json")).expect("read")).expect("JSON")
    };
    assert_eq!(
        report(&undisturbed)["result"]["epsilon"]["curve"],
        report(&out)["result"]["epsilon"]["curve"]
    );
}

/// The output of the program: a table, JSON, a drawing; for a drive, whose state a run then uses, and for a
/// table.
#[test]
fn the_program_estimates_and_leaves_nothing_behind() {
    let folder = scratch();
    let sweep = shipped("tests/data/tree_road_sweep.laz");
    let call = |arguments: &[&str]| {
        let mut command = program();
        command
            .current_dir(folder.path())
            .arg("estimate-epsilon")
            .args(arguments)
            .args(["--progress", "none"]);
        let output = command.output().expect("starts");
        let (code, errors) = ended(&output);
        (code, String::from_utf8(output.stdout).expect("text"), errors)
    };
    let sweep = sweep.to_str().expect("text");
    let (code, text, errors) = call(&[sweep, "--scratch", "."]);
    assert!(
        code == 0 && text.contains("epsilon 0.") && text.contains("needed neighbours more than"),
        "{text}{errors}"
    );
    assert_eq!(std::fs::read_dir(folder.path()).expect("readable").count(), 0, "something is left");
    let (_, json, errors) = call(&[sweep, "-o", "state", "--json", "-", "--svg", "curve.svg"]);
    let json: serde_json::Value = serde_json::from_str(&json).unwrap_or_else(|_| panic!("{json}{errors}"));
    assert!(json["cost"]["share"].is_number() && json["fit"]["coefficients"].is_array(), "{json}");
    assert!(std::fs::read_to_string(folder.path().join("curve.svg")).expect("drawn").contains("epsilon"));
    // A run uses the state.
    let out = folder.path().join("state");
    let before = events(&out).len();
    let options = ["--method", "dbscan", "--ground", "opening", "--set", "dbscan.epsilon=auto"];
    run_to_the_end(&[PathBuf::from(sweep)], &out, &options);
    let after = &events(&out)[before..];
    assert_eq!(["ground", "epsilon"].map(|pass| finished(after, pass)), [0, 0]);
    // A table with the same points gives the same result.
    let labelled = Labelled::read(&[PathBuf::from(sweep)], &out);
    let rows = (0..labelled.at.len()).filter(|&p| ![2, 7, 18].contains(&labelled.class[p]));
    let text: String =
        rows.map(|p| labelled.at[p].map(|v| format!("{:.3}", v as f64 / 1e3)).join(",") + "\n").collect();
    std::fs::write(folder.path().join("objects.csv"), format!("x,y,z\n{text}")).expect("written");
    let (_, table, errors) = call(&["objects.csv", "--json", "-"]);
    let table: serde_json::Value = serde_json::from_str(&table).unwrap_or_else(|_| panic!("{table}{errors}"));
    let both = [&json, &table].map(|value| value["epsilon"].as_f64().expect("a number"));
    assert!((both[0] - both[1]).abs() < 1e-6, "{both:?}");
    for (arguments, code, text) in [
        (&["objects.csv", "--ground", "none"][..], 3, "left out for a table"),
        (&[sweep, "--method", "euclidean"], 3, "dbscan, which has an epsilon"),
        (&[sweep, "--fields", "x,y"], 3, "dbscan.fields = x, y"),
        (&[sweep, "--json", "-", "--svg", "-"], 3, "a file when --json is standard output"),
        (&[sweep, "--max-queries", "many"], 2, "is not a count"),
    ] {
        let (found, _, errors) = call(arguments);
        assert!(found == code && errors.contains(text), "{arguments:?}: {found} {errors}");
    }
}

#[test]
fn epsilon_is_a_number_or_auto() {
    let section = |text: &str| {
        chainage::config::section::<chainage::cluster::DbscanConfig>("dbscan", &text.parse().unwrap())
    };
    assert_eq!(section("epsilon = 0.5").unwrap().epsilon, Epsilon::Given(0.5));
    assert_eq!(section("epsilon = \"auto\"").unwrap().epsilon, Epsilon::AUTO);
    assert!(section("epsilon = \"much\"").is_err());
}

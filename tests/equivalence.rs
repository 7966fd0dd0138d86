//! The central tests: for any cut of a drive into tiles, files and threads, the result equals the result of
//! brute force over the whole cloud. Other changes that must not affect the result do not affect it.
//! Partitions, classes, ids and bytes are compared, never counts.

use std::cell::Cell as Counter;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use chainage::cluster::{self, ClusterEntry, Clusterer, Euclidean, EuclideanConfig, OneStep};
use chainage::ground::{self, GroundEntry, GroundFilter, VoxelColumn, VoxelColumnConfig};
use chainage::model::{AlgorithmError, Lattice, PointClass, Reach, TileCloud};
use chainage::run::Registries;
use chainage::spatial::{Cell, CellGrid, CellMap, PackedCells, TileView};
use chainage::tiling::{Plan, PlanRequest, Region, TileSize};
use proptest::prelude::*;
use proptest::test_runner::TestRunner;

use crate::util;
use crate::util::drive::{Labelled, assert_same_outputs, drive, outputs, run_with, scratch, settings};
use crate::util::las::{Point, Shape};
use crate::util::oracle;
use crate::util::street::{COURSES, Course, Street, number, permutation};

/// Settings of isolated noise for small scenes, in which fewer points form an object.
const SMALL: [&str; 6] = [
    "noise.voxel=0.3",
    "noise.keep_sparse=false",
    "noise.min_component_points=4",
    "noise.high=0.9",
    "euclidean.min_points=3",
    "run.memory_mib=256",
];

/// Settings for small scenes, with tiles of this many metres, this many threads, and further settings.
fn small(tile_m: f64, threads: usize, more: &[String]) -> Vec<String> {
    let mut list = settings(&SMALL);
    list.push(format!("tiling.tile_length={tile_m}"));
    list.push(format!("run.threads={threads}"));
    list.extend_from_slice(more);
    list
}

/// Everything in one tile.
const WHOLE_M: f64 = 1e6;

/// Writes points into files of these shapes, in order. With `chunk`, the files are compressed, with this many
/// records per chunk.
fn write_files(folder: &Path, points: &[Point], shapes: &[Shape], chunk: Option<u32>) -> Vec<PathBuf> {
    let bound = |part: usize| points.len() * part / shapes.len();
    let write = |(part, shape): (usize, &Shape)| {
        let path = folder.join(format!("part-{part}.{}", if chunk.is_some() { "laz" } else { "las" }));
        shape.write_in_chunks(&path, &points[bound(part)..bound(part + 1)], chunk.unwrap_or(0));
        path
    };
    shapes.iter().enumerate().map(write).collect()
}

fn one_file(folder: &Path, points: &[Point]) -> Vec<PathBuf> {
    write_files(folder, points, &[Shape::default()], None)
}

/// Classes and object ids of the whole cloud by brute force.
fn expected(
    points: &[Point],
    formats: &[u8],
    keep_sparse: bool,
    d_t_mm: i64,
    sizes: std::ops::RangeInclusive<usize>,
) -> (Vec<u8>, Vec<u32>) {
    let at: Vec<[i64; 3]> = points.iter().map(|point| point.mm).collect();
    let noise = oracle::noise(&at, [300, 900], 4, keep_sparse);
    let hidden: Vec<bool> = noise.iter().map(|&code| code != 0).collect();
    let ground = oracle::voxel_column(&at, &hidden, [300, 1_000, 500, 1_500], 2);
    let object: Vec<usize> = (0..at.len()).filter(|&point| !hidden[point] && !ground[point]).collect();
    let cloud: Vec<[i64; 3]> = object.iter().map(|&point| at[point]).collect();
    let names = oracle::single_link(&cloud, d_t_mm);
    let size = |name: usize| names.iter().filter(|&&other| other == name).count();
    let mut label = vec![0; at.len()];
    let mut next = 1;
    for (index, &name) in names.iter().enumerate().filter(|(_, name)| sizes.contains(&size(**name))) {
        if index == name {
            label[object[index]] = next;
            next += 1;
        } else {
            label[object[index]] = label[object[name]];
        }
    }
    let class = (0..at.len()).map(|point| match (ground[point], noise[point]) {
        (true, _) => 2,
        (_, 2) => 7,
        (_, 3) if formats[point] == 6 => 18,
        (_, 3) => 7,
        _ => 1,
    });
    (class.collect(), label)
}

/// One random case.
#[derive(Debug, Clone)]
struct Case {
    street: Street,
    shapes: Vec<Shape>,
    tile_m: f64,
    threads: usize,
    d_t_mm: i64,
    max_points: usize,
    keep_sparse: bool,
    trajectory: bool,
    shuffled: bool,
    /// Records per chunk of compressed files: few, so that tiles read some chunks and not the whole drive.
    chunk: Option<u32>,
}

fn cases() -> impl Strategy<Value = Case> {
    let base =
        prop::sample::select(vec![[0; 3], [651_000_120, 5_423_000_990, 98_300], [-7_350, -120, -3_010]]);
    let street = (
        any::<u64>(),
        prop::sample::select(COURSES.to_vec()),
        prop_oneof![1 => 1..4_usize, 4 => 4..16_usize],
        0..40_usize,
        prop_oneof![1 => Just(0), 4 => 3..14_usize],
        base,
    )
        .prop_map(|(seed, course, things, patches, strays, base_mm)| Street {
            seed,
            course,
            things,
            thing_points: 14,
            patches,
            strays,
            base_mm,
        });
    let shape = (
        prop::sample::select(vec![0_u8, 1, 6]),
        prop::sample::select(vec![1_i64, 10, 10, 20, 100]),
        0..5_000_i64,
    );
    let shapes = prop::collection::vec(shape, 1..=3);
    let tile_m = prop_oneof![3 => 1.0..6.0, 1 => 6.0..60.0];
    let chunk = prop_oneof![Just(None), (5..20_u32).prop_map(Some)];
    let d_t = prop::sample::select(vec![300_i64, 450, 1_200]);
    let flags = (any::<bool>(), prop::bool::weighted(0.3), prop::sample::select(vec![0_usize, 9]), chunk);
    (street, shapes, tile_m, prop::sample::select(vec![1_usize, 2, 4]), d_t, flags).prop_map(
        |(street, shapes, tile_m, threads, d_t_mm, (trajectory, shuffled, max_points, chunk))| {
            let shape = |(format, scale_tenths, shift): (u8, i64, i64)| Shape {
                format,
                scale_tenths,
                offset_mm: street.base_mm.map(|base| base + shift * 10),
                withheld: None,
                records: Vec::new(),
            };
            let shapes = shapes.into_iter().map(shape).collect();
            let keep_sparse = street.seed % 3 == 0;
            Case {
                street,
                shapes,
                tile_m,
                threads,
                d_t_mm,
                max_points,
                keep_sparse,
                trajectory,
                shuffled,
                chunk,
            }
        },
    )
}

impl Case {
    fn points(&self) -> Vec<Point> {
        let mut points = self.street.points();
        if self.shuffled {
            points =
                permutation(points.len(), self.street.seed).into_iter().map(|index| points[index]).collect();
            number(&mut points);
        }
        points
    }

    /// For each of `count` points, the format of its file.
    fn formats(&self, count: usize) -> Vec<u8> {
        let mut formats = Vec::new();
        for (part, shape) in self.shapes.iter().enumerate() {
            formats.resize(count * (part + 1) / self.shapes.len(), shape.format);
        }
        formats
    }
}

/// Any scene, cut in any way, on any number of threads: the result equals brute force over the whole cloud,
/// and its bytes are those of one tile.
#[test]
fn any_drive_cut_any_way_is_the_whole_by_brute_force_and_one_tile_byte_for_byte() {
    let [cases_run, rich, by_block] = [0; 3].map(|zero: u32| Counter::new(zero));
    let compare = |case: Case| {
        let folder = scratch();
        let points = case.points();
        let files = write_files(folder.path(), &points, &case.shapes, case.chunk);
        let mut more = vec![
            format!("euclidean.max_gap_m={}", case.d_t_mm as f64 / 1_000.0),
            format!("euclidean.max_points={}", case.max_points),
            format!("noise.keep_sparse={}", case.keep_sparse),
        ];
        if case.trajectory {
            let path = folder.path().join("trajectory.csv");
            std::fs::write(&path, case.street.trajectory()).unwrap();
            more.push(format!("axis.trajectory={:?}", path.display().to_string()));
        }
        let [tiled, whole] = ["tiled", "whole"].map(|name| folder.path().join(name));
        let in_tiles = drive(&files, &tiled, &small(case.tile_m, case.threads, &more)).unwrap();
        let summary = drive(&files, &whole, &small(WHOLE_M, 1, &more)).unwrap();
        prop_assert_eq!(summary.tiles, 1);
        assert_same_outputs(&tiled, &whole, "tiled against one tile");

        let found = Labelled::read(&files, &tiled);
        let most = if case.max_points == 0 { usize::MAX } else { case.max_points };
        let formats = case.formats(points.len());
        let (class, label) = expected(&points, &formats, case.keep_sparse, case.d_t_mm, 3..=most);
        prop_assert_eq!(&found.class, &class);
        prop_assert_eq!(&found.label, &label);
        let has = |class: &[u8]| found.class.iter().any(|code| class.contains(code));
        let count = |counter: &Counter<u32>, yes: bool| counter.set(counter.get() + u32::from(yes));
        count(&cases_run, true);
        count(&rich, in_tiles.tiles > 3 && summary.objects > 1 && has(&[2]) && has(&[7, 18]));
        count(&by_block, in_tiles.tiles > 3 && in_tiles.passes.iter().all(|pass| pass.pass != "scatter"));
        Ok(())
    };
    let config = ProptestConfig { cases: 96, ..ProptestConfig::with_source_file(file!()) };
    TestRunner::new(config).run(&cases(), compare).unwrap();
    // Drives of one tile, and drives without ground, noise or objects, prove little. Both ways to gather a
    // tile must occur.
    let counts = [rich, by_block].map(|counter| counter.get());
    assert!(
        counts[0] * 3 > cases_run.get() && counts[1] * 10 > cases_run.get(),
        "{counts:?} of {}",
        cases_run.get()
    );
}

/// A street of a few thousand points per course, for tests that need no brute force.
fn middling() -> impl Iterator<Item = (Course, Vec<Point>)> {
    COURSES.into_iter().map(|course| (course, Street::middling(17, course).points()))
}

/// The labelled points of one file with these points, in tiles of 5 m.
fn labelled(points: &[Point]) -> Labelled {
    labelled_by(points, &[])
}

/// The same with further settings.
fn labelled_by(points: &[Point], more: &[String]) -> Labelled {
    let folder = scratch();
    let files = one_file(folder.path(), points);
    let out = folder.path().join("out");
    let summary = drive(&files, &out, &small(5.0, 2, more)).unwrap();
    // In random points, `street` is certain of few parts.
    let least = if more.iter().any(|setting| setting.contains("street")) { 1 } else { 6 };
    assert!(
        summary.tiles > 4 && summary.objects >= least,
        "{} tiles, {} objects",
        summary.tiles,
        summary.objects
    );
    Labelled::read(&files, &out)
}

/// Settings with which small things are objects, for each registered method, including methods written after
/// this test.
fn methods() -> Vec<(&'static str, Vec<String>)> {
    // Small things have few points, and few and low voxels.
    let peaks = &["density-peaks.min_density=1.0", "density-peaks.min_separation=1.0"][..];
    let core = &["dbscan.variant=core", "dbscan.min_points=4"][..];
    // Epsilon from a share of the points.
    let sampled = &["dbscan.epsilon=auto", "dbscan.min_points=3", "epsilon.max_queries=300"][..];
    let variants = |name: &str| match name {
        "density-peaks" => vec![peaks],
        "dbscan" => vec![&["dbscan.min_points=3"][..], core, sampled],
        _ => vec![&[][..]],
    };
    let of = |entry: &ClusterEntry, variant| {
        let mut list = settings(variant);
        list.push(format!("cluster.method={:?}", entry.name));
        (entry.name, list)
    };
    cluster::REGISTRY
        .iter()
        .flat_map(|entry| variants(entry.name).into_iter().map(move |variant| of(entry, variant)))
        .collect()
}

#[test]
fn threads_and_tile_length_change_no_byte() {
    for (course, points) in middling() {
        let folder = scratch();
        let files = write_files(
            folder.path(),
            &points,
            &[Shape::default(), Shape { format: 1, ..Shape::default() }],
            Some(300),
        );
        let whole = folder.path().join("whole");
        drive(&files, &whole, &small(WHOLE_M, 1, &[])).unwrap();
        for (tile_m, threads) in [(1.0, 2), (3.3, 1), (3.3, 4), (20.0, 2), (60.0, 1)] {
            let out = folder.path().join(format!("{tile_m}-{threads}"));
            drive(&files, &out, &small(tile_m, threads, &[])).unwrap();
            assert_same_outputs(&whole, &out, &format!("{course:?}, tiles of {tile_m} m, {threads} threads"));
        }
    }
}

#[test]
fn every_method_gives_the_same_bytes_in_any_tiles_files_and_formats() {
    for (name, more) in methods() {
        for (course, points) in middling() {
            let folder = scratch();
            let shapes = [Shape::default(), Shape::default()];
            let las = write_files(folder.path(), &points, &shapes, None);
            let laz = write_files(folder.path(), &points, &shapes, Some(300));
            let whole = folder.path().join("whole");
            let summary = drive(&laz, &whole, &small(WHOLE_M, 1, &more)).unwrap();
            // In random points, `street` is certain of few parts.
            let least = if name == "street" { 1 } else { 6 };
            assert!(summary.objects >= least, "{name}: {} objects", summary.objects);
            for (tile_m, threads) in [(2.0, 2), (5.5, 4)] {
                let out = folder.path().join(format!("{tile_m}"));
                drive(&laz, &out, &small(tile_m, threads, &more)).unwrap();
                let what = format!("{name}, {course:?}, tiles of {tile_m} m, {threads} threads");
                assert_same_outputs(&whole, &out, &what);
            }
            let expected = Labelled::read(&laz, &whole);
            let out = folder.path().join("las");
            drive(&las, &out, &small(5.5, 2, &more)).unwrap();
            assert_eq!(Labelled::read(&las, &out), expected, "{name}, {course:?}: LAS");
            let one = folder.path().join("one");
            std::fs::create_dir(&one).unwrap();
            let files = one_file(&one, &points);
            drive(&files, &one.join("out"), &small(5.5, 2, &more)).unwrap();
            assert_eq!(Labelled::read(&files, &one.join("out")), expected, "{name}, {course:?}: one file");
        }
    }
}

/// Mark of withheld points.
const WITHHELD: u16 = u16::MAX;

/// A street with withheld points among its points, in the order of the file: a column on the ground, points
/// below the ground and beside objects, and some far from all others in space and time.
fn with_withheld(points: &[Point]) -> Vec<Point> {
    let at = |mm: [i64; 3], time: f64| Point { mm, time, mark: WITHHELD };
    let mut all = Vec::new();
    for (n, point) in (0_i64..).zip(points) {
        all.push(*point);
        let [x, y, z] = point.mm;
        match n % 5 {
            0 => all.push(at([30_000, 2_000, 10 * n], point.time)),
            1 => all.push(at([x + 100, y, z - 2_500], point.time + 100.0)),
            2 => all.push(at([x, y + 150, z + 50], point.time)),
            _ => {}
        }
        if n % 400 == 7 {
            all.push(at([x + 900_000, y - 700_000, z + 90_000], point.time + 500.0));
        }
    }
    all
}

/// The outputs of a run that must not show withheld points: all but copies, report and page.
fn tables(out: &Path) -> Vec<(String, Vec<u8>)> {
    let is_table = |name: &str| !name.starts_with("part-") && name != "report.html";
    outputs(out).into_iter().filter(|(name, _)| is_table(name)).collect()
}

/// The records of the copies of `files` in `out` that are withheld, with their classes and objects.
fn withheld_records(files: &[PathBuf], out: &Path) -> Vec<(u8, u32)> {
    let labelled = Labelled::read(files, out);
    let rows = labelled.mark.iter().zip(labelled.class.iter().zip(&labelled.label));
    rows.filter(|(mark, _)| **mark == WITHHELD).map(|(_, (class, label))| (*class, *label)).collect()
}

/// Compares runs with withheld points, in three tilings, with the run without them.
fn assert_withheld_do_not_show(name: &str, more: &[String]) {
    for (course, chunk, format, shuffles) in [
        (Course::Straight, None, 1, true),
        (Course::Hairpin, Some(300), 6, false),
        (Course::Loop, Some(70), 1, true),
    ] {
        let mut all = with_withheld(&Street::middling(17, course).points());
        if shuffles {
            all = permutation(all.len(), 5).into_iter().map(|index| all[index]).collect();
        }
        let used: Vec<Point> = all.iter().filter(|point| point.mark != WITHHELD).copied().collect();
        let shape = [Shape { format, withheld: Some(WITHHELD), ..Shape::default() }];
        let folder = scratch();
        let [here, there] = ["here", "there"].map(|name| folder.path().join(name));
        for folder in [&here, &there] {
            std::fs::create_dir(folder).unwrap();
        }
        let without = write_files(&here, &used, &shape, chunk);
        let with = write_files(&there, &all, &shape, chunk);
        let what = format!("{name}, {course:?}");
        let expected = here.join("out");
        let summary = drive(&without, &expected, &small(WHOLE_M, 1, more)).unwrap();
        assert!(summary.objects > 0, "{what}");
        let labels = Labelled::read(&without, &expected);
        let withheld = all.len() - used.len();
        let whole = there.join("out");
        for (tile_m, threads) in [(WHOLE_M, 1), (5.5, 2), (2.0, 4)] {
            let out = if threads == 1 { whole.clone() } else { there.join(format!("{tile_m}")) };
            let summary = drive(&with, &out, &small(tile_m, threads, more)).unwrap();
            assert_eq!(summary.counts.withheld, withheld as u64, "{what}");
            let told = format!("{} points are withheld", chainage::words::separated(withheld as u64));
            assert!(summary.warnings.iter().any(|text| text.starts_with(&told)), "{:?}", summary.warnings);
            assert_same_outputs(&whole, &out, &what);
            for (one, other) in tables(&expected).iter().zip(&tables(&out)) {
                assert!(one == other, "{what}, tiles of {tile_m} m: {} differs", one.0);
            }
            let found = Labelled::read(&with, &out);
            let kept = (0..found.mark.len()).filter(|&index| found.mark[index] != WITHHELD);
            assert_eq!(found.pick(&kept.collect::<Vec<_>>()), labels, "{what}, tiles of {tile_m} m");
            assert_eq!(withheld_records(&with, &out), vec![(1, 0); withheld], "{what}");
        }
    }
}

#[test]
fn withheld_points_are_as_if_they_were_not_there() {
    assert_withheld_do_not_show("euclidean", &[]);
    let with_fields = [
        "cluster.method=dbscan",
        "dbscan.fields=[\"x\", \"y\", \"intensity\"]",
        "dbscan.min_points=3",
        "dbscan.epsilon=0.03",
    ];
    assert_withheld_do_not_show("dbscan with intensity", &settings(&with_fields));
    assert_withheld_do_not_show("no ground", &settings(&["ground.method=none"]));
}

#[test]
#[ignore = "long; scripts/check.sh runs it"]
fn withheld_points_are_as_if_they_were_not_there_for_any_method() {
    methods().iter().for_each(|(name, more)| assert_withheld_do_not_show(name, more));
}

#[test]
fn a_drive_of_withheld_points_alone_is_refused() {
    let folder = scratch();
    let points: Vec<Point> = (0..90).map(|n| Point { mark: WITHHELD, ..Point::at([n, n, 0]) }).collect();
    let shape = [Shape { withheld: Some(WITHHELD), ..Shape::default() }];
    let files = write_files(folder.path(), &points, &shape, None);
    let error = drive(&files, &folder.path().join("out"), &small(5.0, 1, &[])).unwrap_err();
    assert!(error.to_string().starts_with("all 90 points are withheld"), "{error}");
}

#[test]
fn moving_the_drive_by_whole_voxels_and_cells_changes_no_label_and_no_class() {
    let (_, points) = middling().nth(1).unwrap();
    let before = labelled(&points);
    // Voxels of 300 mm and cells of 1 m have common faces every 3 m.
    for shift in [[3_000, 0, 0], [-651_000, 99_000, -300], [300_000_000, -300_000_000, 90_000]] {
        let move_by =
            |point: &Point| Point { mm: std::array::from_fn(|axis| point.mm[axis] + shift[axis]), ..*point };
        let moved: Vec<Point> = points.iter().map(move_by).collect();
        let after = labelled(&moved);
        assert_eq!(after.label, before.label, "{shift:?}");
        assert_eq!(after.class, before.class, "{shift:?}");
    }
}

/// Compares points at new places in the file with the same points at their old places.
fn assert_reordered(points: &[Point], order: &[usize], more: &[String], before: &Labelled, what: &str) {
    let moved: Vec<Point> = order.iter().map(|&index| points[index]).collect();
    let after = labelled_by(&moved, more);
    let picked = before.pick(order);
    assert_eq!((&after.at, &after.mark), (&picked.at, &picked.mark), "{what}: the test itself");
    assert_eq!(after.class, picked.class, "{what}");
    assert_eq!(after.partition(), picked.partition(), "{what}");
    // Ids follow the smallest point of an object, which is a different one now.
    let ids: Vec<u32> = {
        let mut firsts: Vec<usize> = after.partition().into_iter().flatten().collect();
        firsts.sort_unstable();
        firsts.dedup();
        firsts.iter().map(|&first| after.label[first]).collect()
    };
    assert_eq!(ids, (1..=u32::try_from(ids.len()).unwrap()).collect::<Vec<_>>(), "{what}");
}

#[test]
fn the_order_of_records_changes_neither_partition_nor_classes() {
    for (name, more) in methods() {
        for (course, mut points) in middling() {
            // Coordinates of 40 mm make ties everywhere, and some points are in one place.
            points.iter_mut().for_each(|point| point.mm = point.mm.map(|value| value.div_euclid(40) * 40));
            points.extend_from_within(points.len() / 3..points.len() / 2);
            let before = labelled_by(&points, &more);
            let reversed: Vec<usize> = (0..points.len()).rev().collect();
            let what = format!("{name} {more:?}, {course:?}");
            assert_reordered(&points, &reversed, &more, &before, &format!("{what} driven backwards"));
            let shuffled = permutation(points.len(), 4);
            assert_reordered(&points, &shuffled, &more, &before, &format!("{what} shuffled"));
        }
    }
}

#[test]
fn one_drive_in_five_files_is_the_same_drive() {
    for (course, points) in middling() {
        let folder = scratch();
        let out = folder.path().join("out");
        let files = write_files(folder.path(), &points, &vec![Shape::default(); 5], None);
        drive(&files, &out, &small(5.0, 2, &[])).unwrap();
        assert_eq!(Labelled::read(&files, &out), labelled(&points), "{course:?}");
    }
}

#[test]
fn points_beyond_reach_change_nothing_here() {
    let (_, mut points) = middling().next().unwrap();
    let before = labelled(&points);
    let count = points.len();
    let far: Vec<Point> = points
        .iter()
        .map(|point| Point {
            mm: [point.mm[0] + 30_000, point.mm[1] + 240_030, point.mm[2] + 1_230],
            ..*point
        })
        .collect();
    points.extend(far);
    let after = labelled(&points);
    assert_eq!(after.class[..count], before.class[..]);
    assert_eq!(after.label[..count], before.label[..]);
    assert!(after.label[count..].iter().any(|&label| label != 0));
}

#[test]
fn a_compressed_drive_has_the_records_of_the_uncompressed_one() {
    for (course, points) in middling() {
        for format in [1, 6] {
            let folder = scratch();
            let shapes = [Shape { format, ..Shape::default() }];
            let las = write_files(folder.path(), &points, &shapes, None);
            let laz = write_files(folder.path(), &points, &shapes, Some(700));
            let [one, other] = ["las", "laz"].map(|name| folder.path().join(name));
            drive(&las, &one, &small(5.0, 1, &[])).unwrap();
            drive(&laz, &other, &small(7.0, 2, &[])).unwrap();
            let found = Labelled::read(&las, &one);
            assert_eq!(found, Labelled::read(&laz, &other), "{course:?}, format {format}");
            assert_eq!(found.mark, points.iter().map(|point| point.mark).collect::<Vec<_>>());
            let table = |out: &Path| {
                let text = String::from_utf8(outputs(out).remove(0).1).unwrap();
                text.replace("part-0.laz", "part-0.las")
            };
            assert_eq!(table(&one), table(&other));
        }
    }
}

/// A clusterer or filter that declares a reach of zero.
#[derive(Debug)]
struct Shortsighted<T>(T);

impl Clusterer for Shortsighted<Euclidean> {
    fn name(&self) -> &'static str {
        "shortsighted-links"
    }
    fn reach(&self, _: Lattice) -> Reach {
        Reach::Exact { metres: 0.0 }
    }
    fn object_size(&self) -> std::ops::RangeInclusive<u64> {
        self.0.object_size()
    }
    fn cluster(&self, cloud: &TileCloud, labels: &mut [u32]) -> Result<u32, AlgorithmError> {
        self.0.cluster(cloud, labels)
    }
}

impl GroundFilter for Shortsighted<VoxelColumn> {
    fn name(&self) -> &'static str {
        "shortsighted-ground"
    }
    fn reach(&self, _: Lattice) -> Reach {
        Reach::Exact { metres: 0.0 }
    }
    fn classify(&self, view: &mut TileView<'_>, classes: &mut [PointClass]) -> Result<(), AlgorithmError> {
        self.0.classify(view, classes)
    }
}

const FAR_LINKS: EuclideanConfig = EuclideanConfig { max_gap_m: 3.5, min_points: 2, max_points: 0 };
const FAR_GROUND: VoxelColumnConfig =
    VoxelColumnConfig { voxel: 0.3, run_height: 1.0, step: 0.5, radius: 6.0, lowest_points: 1 };

const SHORTSIGHTED_LINKS: ClusterEntry = ClusterEntry {
    name: "shortsighted-links",
    summary: "links over 3.5 m, and says 0",
    reference: "none",
    build: |_| Ok(Box::new(OneStep::new(Shortsighted(Euclidean::new(&FAR_LINKS)?), &[]))),
};
const HONEST_LINKS: ClusterEntry = ClusterEntry {
    build: |_| Ok(Box::new(OneStep::new(Euclidean::new(&FAR_LINKS)?, &[]))),
    ..SHORTSIGHTED_LINKS
};
const SHORTSIGHTED_GROUND: GroundEntry = GroundEntry {
    name: "shortsighted-ground",
    summary: "looks 6 m far, and says 0",
    reference: "none",
    build: |_| Ok(Box::new(Shortsighted(VoxelColumn::new(&FAR_GROUND)?))),
};
const HONEST_GROUND: GroundEntry =
    GroundEntry { build: |_| Ok(Box::new(VoxelColumn::new(&FAR_GROUND)?)), ..SHORTSIGHTED_GROUND };

/// A row of posts 3 m apart on ground that rises in steps, over 60 m. It is linked and classified across
/// every seam.
fn posts() -> Vec<Point> {
    let mut points = Vec::new();
    for post in 0..20_i64 {
        points.extend((0..30).map(|step| Point::at([post * 3_000, 500, 2_000 + step * 100])));
        points.extend(
            (0..40).map(|step| Point::at([post * 3_000 + step % 8 * 100, step / 8 * 300, post * 400])),
        );
    }
    number(&mut points);
    points
}

/// Without a halo, the comparison of tiled and whole must fail. Otherwise the comparison would prove nothing.
#[test]
fn without_a_halo_the_comparison_fails() {
    let run = |ground: &[GroundEntry], cluster: &[ClusterEntry], tile_m: f64| {
        let folder = scratch();
        let files = one_file(folder.path(), &posts());
        let registries = Registries { ground, cluster };
        let mut list = small(tile_m, 2, &[]);
        // Noise is off, and cells are as small as possible, because the dilation of a core is at least one
        // cell.
        list.extend(settings(&["noise.enabled=false", "noise.min_component_points=1", "tiling.cell=0.5"]));
        list.push(format!("ground.method={:?}", ground[0].name));
        list.push(format!("cluster.method={:?}", cluster[0].name));
        // Sections must exist in the defaults. Methods of tests have no section, so they have no settings.
        run_with(&files, &folder.path().join("out"), &list, registries).unwrap();
        Labelled::read(&files, &folder.path().join("out"))
    };
    let honest = run(&[HONEST_GROUND], &[HONEST_LINKS], WHOLE_M);
    let tiled = run(&[HONEST_GROUND], &[HONEST_LINKS], 5.0);
    assert_eq!((&tiled.class, tiled.partition()), (&honest.class, honest.partition()));

    let links = run(&[HONEST_GROUND], &[SHORTSIGHTED_LINKS], 5.0);
    assert_eq!(links.class, honest.class);
    assert_ne!(links.partition(), honest.partition(), "a lying reach of the clustering went unnoticed");
    let ground = run(&[SHORTSIGHTED_GROUND], &[HONEST_LINKS], 5.0);
    assert_ne!(ground.class, honest.class, "a lying reach of the ground filter went unnoticed");
    assert_eq!(ground::REGISTRY.iter().filter(|entry| entry.name.starts_with("shortsighted")).count(), 0);
}

/// Occupied cells with arbitrary points and chainages, ascending by cell.
fn occupied() -> impl Strategy<Value = Vec<(Cell, u32, f64)>> {
    let near = (-40..40_i32, -40..40_i32);
    let any_cell = prop_oneof![9 => near, 1 => (any::<i32>(), any::<i32>())];
    let chainage = prop_oneof![Just(0.0), -5.0..200.0, (0..40_i32).prop_map(|step| f64::from(step) * 5.0)];
    prop::collection::btree_map(any_cell, (1..500_u32, chainage), 1..150).prop_map(|cells| {
        cells.into_iter().map(|((i, j), (points, chainage))| ([i, j], points, chainage)).collect()
    })
}

fn sizes() -> impl Strategy<Value = TileSize> {
    let places = prop::collection::btree_map((0..60_u32, (-40..40_i32, -40..40_i32)), 1..50_u64, 0..6);
    let equal = (0..60_u64, places).prop_map(|(tiles, weights)| {
        let weights = weights.into_iter().map(|((strip, (i, j)), weight)| ((strip, [i, j]), weight));
        TileSize::Equal { tiles, weights: weights.collect() }
    });
    prop_oneof![equal, (1.0..100.0).prop_map(TileSize::Metres)]
}

/// Border-to-border distance of two cells, squared, in lattice units.
fn gap_squared(a: Cell, b: Cell, edge: i64) -> i128 {
    let along = |axis: usize| {
        i128::from((i64::from(a[axis]) - i64::from(b[axis])).abs() - 1).max(0) * i128::from(edge)
    };
    along(0).pow(2) + along(1).pow(2)
}

proptest! {
    /// Every occupied cell is in the core of exactly one tile, and a region is the core plus everything near
    /// it.
    #[test]
    fn cores_are_complete_and_disjoint_and_halos_are_all_that_is_near(
        drawn in occupied(), size in sizes(), reach in 0..4_000_i64,
    ) {
        let cells: Vec<(Cell, u32)> = drawn.iter().map(|cell| (cell.0, cell.1)).collect();
        let mut chainage_m: Vec<f64> = drawn.iter().map(|cell| cell.2).collect();
        chainage_m.sort_by(f64::total_cmp);
        chainage_m.dedup();
        let strip =
            |chainage| u32::try_from(chainage_m.partition_point(|other| *other <= chainage)).unwrap();
        let mut points = CellMap::default();
        let mut strips = CellMap::default();
        for (cell, count, chainage) in &drawn {
            *points.entry(*cell) = *count;
            *strips.entry(*cell) = strip(*chainage);
        }
        let points = Arc::new(PackedCells::from(points));
        let strips = PackedCells::from(strips);
        let grid = CellGrid::new(700);
        let chainage_m = &chainage_m;
        let request = PlanRequest { cells: &points, strips: &strips, chainage_m, grid, size: &size, inside: None };
        let plan = Plan::new(&request);
        let cores: Vec<Vec<Cell>> = (0..plan.tiles.len()).map(|tile| plan.core(tile)).collect();
        let mut owned: Vec<Cell> = cores.concat();
        owned.sort_unstable();
        prop_assert_eq!(owned, cells.iter().map(|cell| cell.0).collect::<Vec<_>>());
        for (number, core) in cores.iter().enumerate() {
            prop_assert!(!core.is_empty());
            let region = plan.region(number, reach);
            let mut points = 0;
            for (cell, count) in &cells {
                let owner = plan.owners().get(*cell) as usize;
                let own = core.binary_search(cell).is_ok();
                prop_assert_eq!(own, owner == number + 1);
                let near = || core.iter().any(|own| gap_squared(*own, *cell, 700) <= i128::from(reach).pow(2));
                let role = if own { Region::CORE } else if near() { Region::HALO } else { 0 };
                prop_assert_eq!(region.roles.get(*cell), role, "tile {}, cell {:?}", number, cell);
                points += if role == 0 { 0 } else { u64::from(*count) };
            }
            prop_assert_eq!(region.points, points);
        }
    }
}

/// The same on a real street, if it is available. `scripts/exactness.sh` does this for all scenes.
#[test]
fn a_real_street_is_the_same_in_any_tiles() {
    let Some(data) = util::shared_data() else { return };
    let folder = scratch();
    let laz = vec![folder.path().join("street.laz")];
    std::fs::copy(data.join("real/lille_street.laz"), &laz[0]).unwrap();
    let list = |tile_m: f64, threads: usize| {
        vec![
            format!("tiling.tile_length={tile_m}"),
            format!("run.threads={threads}"),
            "run.memory_mib=512".to_owned(),
        ]
    };
    let whole = folder.path().join("whole");
    drive(&laz, &whole, &list(WHOLE_M, 1)).unwrap();
    for (tile_m, threads) in [(5.0, 2), (20.0, 4)] {
        let out = folder.path().join(format!("{tile_m}"));
        drive(&laz, &out, &list(tile_m, threads)).unwrap();
        assert_same_outputs(&whole, &out, &format!("tiles of {tile_m} m"));
    }
    let mut as_las = list(5.0, 2);
    as_las.push("output.format=las".to_owned());
    let copy = folder.path().join("copy");
    drive(&laz, &copy, &as_las).unwrap();
    let las = vec![copy.join("street.las")];
    let again = folder.path().join("again");
    drive(&las, &again, &list(7.0, 2)).unwrap();
    assert_eq!(Labelled::read(&las, &again), Labelled::read(&laz, &whole), "LAS against LAZ");
}

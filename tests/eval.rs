//! Properties of the metrics on random tables, agreement with scikit-learn, and matching of files in every
//! order.

use std::path::{Path, PathBuf};

use chainage::eval::metrics::Figures;
use chainage::eval::metrics::hoover::Tolerance;
use chainage::eval::table::{Cell, Counter, Table};
use chainage::eval::{
    self, ClassTable, CompareSettings, EvalError, Evaluation, MetricSettings, Provenance, Report,
};
use chainage::input::{Catalog, InputOptions};
use chainage::model::Lattice;
use chainage::survey::Axis;
use chainage::{Error, ErrorKind};
use proptest::prelude::*;

use crate::util::numbers::Numbers;
use crate::util::program::program;

fn settings() -> MetricSettings {
    let hoover = vec![Tolerance::new(0.8).unwrap(), Tolerance::new(0.5).unwrap()];
    MetricSettings { min_points: 30, hoover, classes: ClassTable::default() }
}

fn evaluate(table: &Table) -> Evaluation {
    Evaluation::of(table.clone(), &settings(), Lattice::MILLIMETRE)
}

/// The table of `(object, segment, points)`; objects take the classes 2 to 5 in turn, object 0 is ground.
fn table(parts: &[(i64, i64, u64)]) -> Table {
    let mut counter = Counter::default();
    for &(object, segment, points) in parts {
        let class = if object == 0 { 1 } else { 2 + u16::try_from(object % 4).unwrap() };
        counter.cells.add(Cell { object, segment, class, ..Cell::default() }, points);
    }
    counter.finish()
}

/// Random overlaps of a few objects and segments. No two overlaps have the same number of points, so that no
/// tie is broken by an id.
fn parts() -> impl Strategy<Value = Vec<(i64, i64, u64)>> {
    proptest::collection::vec((0_i64..9, 0_i64..9, 1_u64..40), 1..40).prop_map(|parts| {
        let numbered = parts.into_iter().enumerate();
        let mut distinct: Vec<_> =
            numbered.map(|(n, (o, s, points))| (o, s, points * 41 + n as u64)).collect();
        distinct.sort_unstable();
        distinct.dedup_by_key(|part| (part.0, part.1));
        distinct
    })
}

fn all_figures(evaluation: &Evaluation) -> Vec<Figures> {
    evaluation.classes.iter().map(|class| class.1.clone()).chain([evaluation.overall.clone()]).collect()
}

fn near(a: Option<f64>, b: Option<f64>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => (a - b).abs() < 1e-9,
        _ => a.is_none() && b.is_none(),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn pq_is_sq_times_rq_and_the_classes_add_up(parts in parts()) {
        let evaluation = evaluate(&table(&parts));
        for figures in all_figures(&evaluation) {
            let product = figures.sq().zip(figures.rq()).map(|(sq, rq)| sq * rq);
            prop_assert!(near(figures.pq(), product), "{figures:?}");
            let precision = figures.precision();
            let recall = figures.recall();
            if let Some((p, r)) = precision.zip(recall).filter(|(p, r)| p + r > 0.0) {
                prop_assert!(near(figures.f1(), Some(2.0 * p * r / (p + r))), "{figures:?}");
            }
            for counts in &figures.hoover {
                let sum = counts.correct + counts.over + counts.under + counts.missed;
                prop_assert_eq!(sum, figures.objects);
            }
        }
        let sum = |of: fn(&Figures) -> u64| evaluation.classes.iter().map(|class| of(&class.1)).sum::<u64>();
        prop_assert_eq!(sum(|f| f.objects), evaluation.overall.objects);
        prop_assert_eq!(sum(|f| f.true_positives), evaluation.overall.true_positives);
        prop_assert_eq!(sum(|f| f.false_positives), evaluation.overall.false_positives);
    }

    #[test]
    fn renaming_changes_nothing(parts in parts(), turn in 1_i64..8) {
        // Ids 1 to 8 are permuted on both sides; 0 still means none. The class belongs to the cell, not to
        // the id.
        let name = |id: i64| if id == 0 { 0 } else { 1 + (id - 1 + turn) % 8 * 1_000_000_007 };
        let original = table(&parts);
        let mut renamed = Counter::default();
        for (cell, points) in &original.cells {
            let to = Cell { object: name(cell.object), segment: name(cell.segment), ..*cell };
            renamed.cells.add(to, *points);
        }
        let before = evaluate(&original);
        let after = evaluate(&renamed.finish());
        prop_assert_eq!(before.classes.len(), after.classes.len());
        for (a, b) in all_figures(&before).iter().zip(all_figures(&after)) {
            prop_assert!(near(Some(a.iou_sum), Some(b.iou_sum)) && near(a.mean_best_iou(), b.mean_best_iou()));
            let counts = |f: &Figures| (f.objects, f.under, f.over, f.true_positives, f.false_positives);
            prop_assert_eq!(counts(a), counts(&b));
            prop_assert_eq!(&a.hoover, &b.hoover);
            prop_assert!(near(a.ari, b.ari));
        }
    }

    #[test]
    fn merging_two_correct_objects_lowers_oa(parts in parts(), sizes in (30_u64..500, 30_u64..500)) {
        let scene = |second: i64| {
            let mut all = parts.clone();
            all.extend([(100, 100, sizes.0), (101, second, sizes.1)]);
            evaluate(&table(&all))
        };
        let apart = scene(101);
        let merged = scene(100);
        prop_assert!(merged.overall.oa() < apart.overall.oa());
        prop_assert_eq!(merged.overall.under, apart.overall.under + 2);
        prop_assert!(merged.overall.pq() < apart.overall.pq());
        prop_assert!(merged.overall.ari < apart.overall.ari);
    }

    #[test]
    fn a_perfect_segmentation_has_perfect_figures(sizes in proptest::collection::vec(30_u64..300, 1..9)) {
        let parts: Vec<_> = sizes.iter().zip(1..).map(|(&points, id)| (id, 50 - id, points)).collect();
        for figures in all_figures(&evaluate(&table(&parts))) {
            for figure in [figures.oa(), figures.f1(), figures.pq(), figures.mean_best_iou(), figures.ari] {
                prop_assert!(near(figure, Some(1.0)), "{figures:?}");
            }
            prop_assert_eq!((figures.under, figures.over), (0, 0));
            prop_assert!(figures.hoover.iter().all(|c| c.correct == figures.objects && c.noise == 0));
        }
    }
}

#[test]
fn the_rand_index_is_that_of_scikit_learn() {
    // Seed, points, objects, segments, percent of random labels; sklearn.metrics.adjusted_rand_score 1.x on
    // the same labels (first number: object, second: segment modulo the segments, or random).
    for (seed, points, objects, segments, random_percent, expected) in [
        (1, 500, 3, 3, 100, 0.001_130_713_919_864_661_9),
        (2, 2000, 5, 4, 30, 0.405_529_219_898_801_3),
        (3, 2000, 7, 9, 10, 0.799_770_021_892_662_6),
        (4, 3000, 10, 25, 60, 0.196_004_754_184_104_4),
        (5, 300, 2, 1, 50, 0.0),
        (6, 1000, 4, 4, 0, 1.0),
    ] {
        let mut random = Numbers::new(seed);
        let labels: Vec<(i64, i64, u64)> = (0..points)
            .map(|_| {
                let object = random.below(objects);
                let draw = random.next();
                let is_copy = draw % 100 >= random_percent;
                let segment = if is_copy { object % segments } else { draw / 100 % segments };
                (i64::try_from(object).unwrap() + 1, i64::try_from(segment).unwrap(), 1)
            })
            .collect();
        let found = evaluate(&table(&labels)).overall.ari;
        assert!(near(found, Some(expected)), "seed {seed}: {found:?}, scikit-learn has {expected}");
    }
}

/// A point with its labels.
#[derive(Clone, Copy)]
struct Labelled {
    at: [f64; 3],
    time: f64,
    segment: u32,
    object: u32,
    class: u8,
    predicted_class: u8,
}

/// Class of points that are withheld.
const WITHHELD: u8 = 30;

/// A street of 40 objects in a row, some with two segments and some without one, on ground.
fn street(points: usize) -> Vec<Labelled> {
    let mut random = Numbers::new(11);
    let mut millimetres = |extent: u64| random.below(extent) as f64 / 1000.0;
    (0..points)
        .map(|index| {
            let object = u32::try_from(index % 50).unwrap();
            let at = [f64::from(object) * 10.0 + millimetres(4_000), millimetres(9_000), millimetres(5_000)];
            let is_ground = object >= 40;
            let segment = match object {
                _ if is_ground => 0,
                7 | 8 => 7,
                11 if at[2] > 2.5 => 2011,
                12 => 0,
                other => other + 1000,
            };
            Labelled {
                at,
                // Many points have equal times, and some have completely equal keys.
                time: (index / 4) as f64 * 1e-5,
                segment,
                object: if is_ground { 0 } else { object + 1 },
                class: if is_ground { 1 } else { 2 + u8::try_from(object % 4).unwrap() },
                predicted_class: if is_ground && at[2] < 4.5 { 2 } else { 1 },
            }
        })
        .chain([3, 4].map(|segment| Labelled {
            // Two points with one key and different segments: matched in order of appearance.
            at: [1.0, 1.0, 1.0],
            time: 0.5,
            segment,
            object: segment + 90,
            class: 2,
            predicted_class: 1,
        }))
        .collect()
}

/// Writes a LAS (or LAZ, by the extension) file of point format 6 with extra dimensions of the given types.
fn write(path: &Path, scale: f64, dims: &[(&str, u8)], points: &[Labelled], extra: fn(&Labelled) -> Vec<u8>) {
    let mut builder = las::Builder::from((1, 4));
    builder.point_format = las::point::Format::new(6).unwrap();
    builder.point_format.is_compressed = path.extension().is_some_and(|extension| extension == "laz");
    builder.point_format.extra_bytes = u16::try_from(extra(&points[0]).len()).unwrap();
    let transform = las::Transform { scale, offset: 0.0 };
    builder.transforms = las::Vector { x: transform, y: transform, z: transform };
    let mut data = Vec::new();
    for (name, data_type) in dims {
        let mut descriptor = [0_u8; 192];
        descriptor[2] = *data_type;
        descriptor[4..4 + name.len()].copy_from_slice(name.as_bytes());
        data.extend(descriptor);
    }
    let vlr = las::Vlr { user_id: "LASF_Spec".into(), record_id: 4, description: String::new(), data };
    builder.vlrs.push(vlr);
    let mut writer = las::Writer::from_path(path, builder.into_header().unwrap()).unwrap();
    for point in points {
        let [x, y, z] = point.at;
        let classification = las::point::Classification::new(point.predicted_class).unwrap();
        let extra_bytes = extra(point);
        let gps_time = Some(point.time);
        let is_withheld = point.predicted_class == WITHHELD;
        let standard = las::Point { is_withheld, ..las::Point::default() };
        writer
            .write_point(las::Point { x, y, z, gps_time, classification, extra_bytes, ..standard })
            .unwrap();
    }
    writer.close().unwrap();
}

fn write_prediction(path: &Path, points: &[Labelled]) {
    write(path, 0.001, &[("cluster_id", 5)], points, |point| point.segment.to_le_bytes().to_vec());
}

fn write_reference(path: &Path, points: &[Labelled]) {
    write(path, 0.001, &[("gt_instance", 5), ("gt_class", 1)], points, |point| {
        [&point.object.to_le_bytes()[..], &[point.class]].concat()
    });
}

fn compare_with(
    prediction: &[PathBuf],
    reference: &[PathBuf],
    settings: &CompareSettings,
) -> Result<(String, Table), Error> {
    let open = |paths: &[PathBuf]| Catalog::open(paths, &InputOptions::default());
    let prediction = open(prediction)?;
    let reference = open(reference)?;
    let counted = eval::count(&prediction, Some(&reference), settings, &|_| ())?;
    Ok((counted.matching.name().to_owned(), counted.table))
}

fn compare(prediction: &[PathBuf], reference: &[PathBuf]) -> Result<(String, Table), Error> {
    compare_with(prediction, reference, &CompareSettings::default())
}

/// Sorts by a random key.
fn shuffled(points: &[Labelled]) -> Vec<Labelled> {
    let mut random = Numbers::new(5);
    let mut keyed: Vec<(u64, usize)> = (0..points.len()).map(|index| (random.next(), index)).collect();
    keyed.sort_unstable();
    // The two points with one key keep their order, because the order decides how they are matched.
    let last = points.len() - 2;
    let order = keyed.iter().map(|key| key.1).filter(|&index| index < last).chain([last, last + 1]);
    order.map(|index| points[index]).collect()
}

#[test]
fn every_order_and_every_split_of_the_files_gives_the_same_table() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    // More than one block of 65,536 records in LAS, and of 50,000 in LAZ.
    let points = street(120_000);
    write_reference(&at("reference.laz"), &points);
    write_prediction(&at("whole.las"), &points);
    write_prediction(&at("shuffled.laz"), &shuffled(&points));
    let parts: Vec<PathBuf> = (0..5).map(|part| at(&format!("part{part}.las"))).collect();
    for (path, part) in parts.iter().zip(points.chunks(24_001)) {
        write_prediction(path, part);
    }
    write(&at("coarse.las"), 0.01, &[("cluster_id", 9)], &points, |p| {
        (p.segment as f32).to_le_bytes().to_vec()
    });
    let mut turned: Vec<PathBuf> = parts.clone();
    turned.rotate_left(2);

    let reference = [at("reference.laz")];
    let (how, table) = compare(&[at("whole.las")], &reference).unwrap();
    assert_eq!((how.as_str(), table.points()), ("record order", 120_002));
    for (files, expected) in [
        (vec![at("shuffled.laz")], "coordinates and time"),
        (parts, "record order"),
        (turned, "coordinates and time"),
        (vec![at("coarse.las")], "record order"),
    ] {
        let (how, other) = compare(&files, &reference).unwrap();
        assert_eq!(how, expected, "{files:?}");
        assert_eq!(other.cells, table.cells, "{files:?}");
        assert_eq!(other.objects, table.objects, "{files:?}");
    }
    let no_time = CompareSettings { ignore_time: true, ..CompareSettings::default() };
    assert_eq!(compare_with(&[at("shuffled.laz")], &reference, &no_time).unwrap().0, "coordinates");
    let figures = evaluate(&table).overall;
    assert_eq!((figures.objects, figures.under, figures.over, figures.without_segment), (40, 2, 1, 1));
}

#[test]
fn withheld_points_do_not_count() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mut points = street(20_000);
    points[..20_000].iter_mut().step_by(7).for_each(|point| point.predicted_class = WITHHELD);
    let used: Vec<Labelled> =
        points.iter().copied().filter(|point| point.predicted_class != WITHHELD).collect();
    write_reference(&at("used_reference.laz"), &used);
    write_prediction(&at("used.las"), &used);
    let (_, expected) = compare(&[at("used.las")], &[at("used_reference.laz")]).unwrap();
    assert_eq!(expected.points(), used.len() as u64);
    write_reference(&at("reference.laz"), &points);
    write_prediction(&at("whole.las"), &points);
    write_prediction(&at("shuffled.laz"), &shuffled(&points));
    for (file, order) in [("whole.las", "record order"), ("shuffled.laz", "coordinates and time")] {
        let (how, found) = compare(&[at(file)], &[at("reference.laz")]).unwrap();
        assert_eq!((how.as_str(), &found.cells, &found.objects), (order, &expected.cells, &expected.objects));
        assert_eq!(found.segments, expected.segments, "{file}");
    }
    // The flag of one side is enough.
    let plain: Vec<Labelled> = points.iter().map(|point| Labelled { predicted_class: 1, ..*point }).collect();
    write_reference(&at("plain.las"), &plain);
    for file in ["whole.las", "shuffled.laz"] {
        assert_eq!(compare(&[at(file)], &[at("plain.las")]).unwrap().1.cells, expected.cells, "{file}");
    }
    let both = at("both.laz");
    write(&both, 0.001, &[("cluster_id", 5), ("gt_instance", 6), ("gt_class", 1)], &points, |point| {
        [&point.segment.to_le_bytes()[..], &point.object.to_le_bytes(), &[point.class]].concat()
    });
    let catalog = Catalog::open(&[both], &InputOptions::default()).unwrap();
    let counted = eval::count(&catalog, None, &CompareSettings::default(), &|_| ()).unwrap();
    assert_eq!(counted.table.cells, expected.cells);
    assert_eq!(counted.withheld, (points.len() - used.len()) as u64);
}

#[test]
fn labels_in_the_same_files_need_no_reference() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("labelled.laz");
    let points = street(60_000);
    write(&path, 0.001, &[("cluster_id", 5), ("gt_instance", 6), ("gt_class", 1)], &points, |point| {
        [&point.segment.to_le_bytes()[..], &point.object.to_le_bytes(), &[point.class]].concat()
    });
    let catalog = Catalog::open(std::slice::from_ref(&path), &InputOptions::default()).unwrap();
    let counted = eval::count(&catalog, None, &CompareSettings::default(), &|_| ()).unwrap();
    let (_, table) = compare(std::slice::from_ref(&path), std::slice::from_ref(&path)).unwrap();
    assert_eq!(counted.table, table);
}

#[test]
fn one_point_that_differs_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let points = street(70_000);
    write_reference(&at("reference.las"), &points);
    let mut moved = points.clone();
    moved[66_000].at = [-1.0, 2.5, 3.25];
    write_prediction(&at("moved.las"), &moved);
    write_prediction(&at("short.laz"), &[&points[..500], &points[501..]].concat());
    write_prediction(&at("cut.laz"), &points[..60_000]);

    let error = compare(&[at("moved.las")], &[at("reference.las")]).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Difference);
    let Some(EvalError::Unmatched { unmatched, prediction, reference, .. }) = error.cause() else {
        panic!("{error}")
    };
    assert_eq!((*unmatched, prediction.record, reference.record), (1, 66_000, 66_000));
    assert!(
        error.to_string().contains("record 66000 of")
            && error.to_string().contains("(-1.0000, 2.5000, 3.2500)")
    );
    assert!(error.hint().unwrap().contains("--ignore-time"));

    // Rounded coordinates match in the same order only.
    let reversed: Vec<Labelled> = points.iter().rev().cloned().collect();
    write(&at("coarse.las"), 0.01, &[("cluster_id", 5)], &reversed, |point| {
        point.segment.to_le_bytes().to_vec()
    });
    let error = compare(&[at("coarse.las")], &[at("reference.las")]).unwrap_err();
    let hint = error.hint().unwrap();
    assert!(hint.contains("in steps of 0.01 and 0.001"), "{hint}");

    for (name, first, ends) in [("short.laz", 500, false), ("cut.laz", 60_000, true)] {
        let error = compare(&[at(name)], &[at("reference.las")]).unwrap_err();
        let Some(EvalError::PointCounts { prediction, reference, .. }) = error.cause() else {
            panic!("{error}")
        };
        assert_eq!(reference.as_ref().map(|site| site.record), Some(first), "{name}");
        assert_eq!(prediction.as_ref().map(|site| site.record), (!ends).then_some(first), "{name}");
        assert_eq!(error.kind(), ErrorKind::Difference);
    }
}

#[test]
fn a_dimension_that_is_not_there_or_holds_no_labels_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.las");
    let fractions = folder.path().join("b.las");
    let points = street(100);
    write_reference(&path, &points);
    write(&fractions, 0.001, &[("cluster_id", 9)], &points, |point| {
        (f32::from(point.class) + 0.25).to_le_bytes().to_vec()
    });
    let error = compare(std::slice::from_ref(&path), std::slice::from_ref(&path)).unwrap_err();
    assert!(error.to_string().ends_with("a.las has no dimension cluster_id"), "{error}");
    assert!(error.hint().unwrap().contains("gt_instance, gt_class"), "{:?}", error.hint());
    let error = compare(&[fractions], &[path]).unwrap_err();
    assert!(error.to_string().contains("in record 0 of"), "{error}");
}

#[test]
fn the_report_is_the_same_for_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let points = street(200_000);
    write_reference(&at("reference.las"), &points);
    write_prediction(&at("shuffled.las"), &shuffled(&points));
    let report = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let (matched_by, table) = compare(&[at("shuffled.las")], &[at("reference.las")]).unwrap();
            let evaluation = evaluate(&table);
            let objects = evaluation.judged.scene.objects.iter();
            let places: Vec<_> = objects.map(|o| [o.centroid_m[0], o.centroid_m[1]]).collect();
            let compared = Provenance {
                prediction: vec!["p.las".into()],
                reference: vec!["r.las".into()],
                prediction_dim: "cluster_id".into(),
                reference_dim: "gt_instance".into(),
                class_dim: Some("gt_class".into()),
                named_dim: None,
                matched_by,
                points_withheld: 0,
                chainage_along: "principal axis of the objects".into(),
            };
            let settings = settings();
            let axis = Axis::principal_of(&places);
            let report = Report::new(&evaluation, &settings, &axis, compared);
            let mut json = Vec::new();
            let mut csv = Vec::new();
            report.write_json(&mut json).unwrap();
            report.write_objects_csv(&mut csv).unwrap();
            (String::from_utf8(json).unwrap(), String::from_utf8(csv).unwrap(), report.text(5))
        })
    };
    let (json, csv, text) = report(1);
    assert_eq!((json.clone(), csv.clone(), text.clone()), report(3));

    let parsed: serde_json::Value = serde_json::from_str(&json).unwrap();
    // Objects 8 and 9 share segment 7, object 12 is in two segments, object 13 has none.
    let ids = |figure: &str| {
        let found = parsed["behind"][figure].as_array().unwrap();
        found.iter().map(|finding| finding["object"].as_i64().unwrap()).collect::<Vec<_>>()
    };
    assert_eq!(ids("under_segmented"), [8, 9]);
    assert_eq!(ids("over_segmented"), [12]);
    assert_eq!(ids("without_segment"), [13]);
    assert_eq!(ids("false_negatives"), [8, 9, 13]);
    assert_eq!(parsed["objects"].as_array().unwrap().len(), 40);
    // A header, 40 objects, and two of one point each.
    assert_eq!(csv.lines().count(), 43);
    assert!(csv.lines().all(|line| line.split(',').count() >= 24), "{csv}");
    assert!(csv.contains("segment 7 also contains 100.0 % of object 8 (building)"), "{csv}");
    insta::assert_snapshot!("eval_table", text);
}

#[test]
fn objects_too_small_to_be_evaluated_are_listed_where_their_id_is() {
    let settings = settings();
    let axis = Axis::principal_of(&[]);
    let evaluation = evaluate(&table(&[(1, 1, 29), (2, 2, 50), (3, 3, 12), (4, 4, 60), (9, 4, 1)]));
    let compared = Provenance {
        prediction: Vec::new(),
        reference: Vec::new(),
        prediction_dim: "p".into(),
        reference_dim: "r".into(),
        class_dim: None,
        named_dim: None,
        matched_by: "record order".into(),
        points_withheld: 1234,
        chainage_along: "principal axis of the objects".into(),
    };
    let mut csv = Vec::new();
    let report = Report::new(&evaluation, &settings, &axis, compared);
    report.write_objects_csv(&mut csv).unwrap();
    assert!(report.text(0).starts_with("152 points (1,234 withheld left out), matched by record order"));
    let csv = String::from_utf8(csv).unwrap();
    let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.iter().map(|row| row[0]).collect::<Vec<_>>(), ["object", "1", "2", "3", "4", "9"]);
    assert!(rows.iter().all(|row| row.len() == rows[0].len()), "{csv}");
    for (row, small) in rows[1..].iter().zip([true, false, true, false, true]) {
        assert_eq!(row.last() == Some(&"fewer than 30 points: not evaluated"), small, "{csv}");
        assert_eq!(row[13].is_empty(), small, "matched: {csv}");
    }
}

/// `run` and `eval` must give an object the same chainage, so that it is found again.
#[test]
fn a_trajectory_is_read_as_run_reads_it() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let points = street(10_000);
    write_prediction(&at("p.las"), &points);
    write_reference(&at("r.laz"), &points);
    let [reference, trajectory] = ["r.laz", "axis.csv"].map(|name| at(name).display().to_string());
    let chainages = |text: &str| {
        std::fs::write(&trajectory, text).unwrap();
        let arguments = ["--reference", &reference, "--trajectory", &trajectory, "--json"];
        let written = chainage(&arguments, &[&at("p.las")]);
        assert!(written.status.success(), "{}", String::from_utf8_lossy(&written.stderr));
        let json: serde_json::Value = serde_json::from_slice(&written.stdout).unwrap();
        let objects = json["objects"].as_array().unwrap();
        objects.iter().map(|object| object["chainage_m"].as_f64().unwrap()).collect::<Vec<_>>()
    };
    let driven = chainages("gps_time,x,y,z\n0,-100,4,0\n1,250,4,0\n2,600,4,0\n");
    for text in [
        "gps_time,x,y,z\n1,250,4,0\n2,600,4,0\n0,-100,4,0\n",
        "\u{feff}gps_time;x;y\r\n0;-100;4\r\n1;250;4\r\n2;600;4\r\n",
    ] {
        assert_eq!(chainages(text), driven, "{text}");
    }
    std::fs::write(&trajectory, "x,y\n0,0\n1,1\n").unwrap();
    let refused = chainage(&["--reference", &reference, "--trajectory", &trajectory], &[&at("p.las")]);
    assert!(String::from_utf8_lossy(&refused.stderr).contains("gps_time"));
    assert_eq!(refused.status.code(), Some(4));
}

fn chainage(arguments: &[&str], files: &[&Path]) -> std::process::Output {
    program().arg("eval").args(files).args(arguments).output().unwrap()
}

#[test]
fn the_program_writes_what_it_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let points = street(10_000);
    write_prediction(&at("p.las"), &points);
    write_reference(&at("r.laz"), &points);
    std::fs::write(at("axis.csv"), "gps_time,x,y,z\n0,-100,4,0\n1,600,4,0\n").unwrap();
    let [reference, trajectory, csv] =
        ["r.laz", "axis.csv", "objects.csv"].map(|n| at(n).display().to_string());

    let run = |more: &[&str]| chainage(&[&["--reference", &reference], more].concat(), &[&at("p.las")]);
    let written = run(&["--json", "-", "--objects", &csv, "--trajectory", &trajectory]);
    assert!(written.status.success(), "{}", String::from_utf8_lossy(&written.stderr));
    let json: serde_json::Value = serde_json::from_slice(&written.stdout).unwrap();
    assert_eq!(json["overall"]["objects"], 40);
    let first = &json["objects"][0];
    // Object 1 is around x = 2 m, and the trajectory starts at x = -100 m.
    assert!((first["chainage_m"].as_f64().unwrap() - 102.0).abs() < 0.3, "{first}");
    assert_eq!(std::fs::read_to_string(at("objects.csv")).unwrap().lines().count(), 43);

    let table = String::from_utf8(run(&["--class-dim", "none"]).stdout).unwrap();
    assert!(table.contains("0 object") && table.contains("ground                             -"), "{table}");
    let refused = run(&["--json", "-", "--objects", "-"]);
    assert!(!refused.status.success() && refused.stdout.is_empty());
    assert_eq!(chainage(&["--hoover", "0.4"], &[&at("p.las")]).status.code(), Some(2));
}

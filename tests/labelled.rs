//! Labelled copies: every file that can be opened is copied to LAS and LAZ with random labels. Everything
//! except label and class is compared with the original, byte by byte.

use std::fs::File;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use chainage::Failure;
use chainage::cluster::{
    EuclideanConfig, Method, NormalizedCut, NormalizedCutConfig, Street, StreetConfig, WantedClass,
};
use chainage::input::{Catalog, Fields, InputFile, InputOptions, LengthUnit};
use chainage::model::{Kind, PointClass};
use chainage::output::{LabelOptions, LabelledFile, OutputError, OutputFormat, check_names};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::util;
use crate::util::las::{Point, Shape};

/// The copied files: the shipped samples, and the conformance folder if it is available.
fn samples() -> Vec<PathBuf> {
    let mut files = util::las_files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data"));
    if let Some(data) = util::shared_data() {
        files.extend(util::las_files(&data.join("conformance")));
    }
    files
}

fn open(path: &Path) -> Option<Catalog> {
    let options = InputOptions { mmap: true, unit: LengthUnit::Metre };
    Catalog::open(&[path.to_owned()], &options).ok()
}

fn records(file: &InputFile) -> Vec<u8> {
    let mut all = Vec::new();
    for block in 0..file.blocks().len() {
        let mut buffer = Vec::new();
        all.extend_from_slice(file.records(block, Fields::All, &mut buffer).expect("readable"));
    }
    all
}

/// Labels and class codes that the copies get.
struct Truth {
    labels: Vec<u32>,
    classes: Vec<u8>,
}

impl Truth {
    fn random(points: u64, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let labels = (0..points).map(|_| if random.random_bool(0.3) { 0 } else { random.random() }).collect();
        Self { labels, classes: (0..points).map(|_| random.random_range(0..4)).collect() }
    }
}

/// Writes the copy like the engine and returns its path.
fn write(plan: &LabelledFile, input: &InputFile, original: &[u8], truth: &Truth, folder: &Path) -> PathBuf {
    let path = folder.join(plan.name());
    let mut out = BufWriter::new(File::create(&path).expect("a new file"));
    let record_len = input.layout().record_len;
    let labelled = |chunk: &std::ops::Range<u64>| {
        let indices =
            usize::try_from(chunk.start).expect("small")..usize::try_from(chunk.end).expect("small");
        let records = &original[indices.start * record_len..indices.end * record_len];
        let mut new = Vec::new();
        plan.label(records, &truth.labels[indices.clone()], &truth.classes[indices], &[], &mut new);
        new
    };
    if plan.is_compressed() {
        let chunks = plan.chunks().iter().map(|chunk| {
            let count = u32::try_from(chunk.end - chunk.start).expect("small");
            plan.compress(&labelled(chunk)).map(|bytes| (count, bytes))
        });
        plan.assemble_laz::<OutputError>(input, chunks, &mut out).expect("assembled");
    } else {
        out.write_all(plan.prologue()).expect("written");
        // Backwards: records may be written in any order.
        for chunk in plan.chunks().iter().rev() {
            out.seek(SeekFrom::Start(plan.record_offset(chunk.start))).expect("inside");
            out.write_all(&labelled(chunk)).expect("written");
        }
        out.seek(SeekFrom::Start(plan.epilogue_offset())).expect("inside");
        plan.write_epilogue(input, &mut out).expect("written");
    }
    out.flush().expect("written");
    path
}

/// User, number, description and payload of the records of a file, read without the crate.
type Record = (Vec<u8>, u16, Vec<u8>, Vec<u8>);

fn number(bytes: &[u8], at: usize, len: usize) -> usize {
    bytes[at..at + len].iter().rev().fold(0, |value, byte| value << 8 | usize::from(*byte))
}

fn chain(bytes: &[u8], mut at: usize, end: usize, count: usize, head: usize) -> Vec<Record> {
    let mut found = Vec::new();
    for _ in 0..count {
        if at + head > end {
            break;
        }
        let length = number(bytes, at + 20, if head == 54 { 2 } else { 8 });
        if at + head + length > end {
            break;
        }
        let user = bytes[at + 2..at + 18].to_vec();
        let description = bytes[at + head - 32..at + head].to_vec();
        let record = u16::try_from(number(bytes, at + 18, 2)).expect("two bytes");
        found.push((user, record, description, bytes[at + head..at + head + length].to_vec()));
        at += head + length;
    }
    found
}

/// The records that a copy must keep: all except those of LASzip and COPC, and the description of extra
/// bytes, which grows.
fn kept(records: Vec<Record>) -> Vec<Record> {
    let drop = |(user, record, ..): &Record| {
        user.starts_with(b"laszip encoded")
            || user.starts_with(b"copc")
            || (user.starts_with(b"LASF_Spec") && *record == 4)
    };
    records.into_iter().filter(|record| !drop(record)).collect()
}

fn vlrs(bytes: &[u8]) -> Vec<Record> {
    kept(chain(bytes, number(bytes, 94, 2), number(bytes, 96, 4), number(bytes, 100, 4), 54))
}

fn evlrs(bytes: &[u8]) -> Vec<Record> {
    if bytes[25] < 4 {
        return Vec::new();
    }
    kept(chain(bytes, number(bytes, 235, 8), bytes.len(), number(bytes, 243, 4), 60))
}

/// The bytes between the last record of the header and the points.
fn gap(bytes: &[u8]) -> &[u8] {
    let head = number(bytes, 94, 2);
    let start = number(bytes, 96, 4);
    let records = chain(bytes, head, start, number(bytes, 100, 4), 54);
    &bytes[head + records.iter().map(|record| 54 + record.3.len()).sum::<usize>()..start]
}

/// Compares the header, the records, and the data between and after them.
fn compare_around(original: &Path, copy: &Path, points: usize) {
    let before = std::fs::read(original).expect("read");
    let after = std::fs::read(copy).expect("read");
    assert_eq!(vlrs(&before), vlrs(&after), "{}", copy.display());
    assert_eq!(evlrs(&before), evlrs(&after), "{}", copy.display());
    assert_eq!(gap(&before), gap(&after), "{}", copy.display());
    if before[104] < 128 && after[104] < 128 {
        let end = |bytes: &[u8]| number(bytes, 96, 4) + points * number(bytes, 105, 2);
        assert_eq!(before[end(&before)..], after[end(&after)..], "{}: after the points", copy.display());
    }
    let extra = |bytes: &[u8]| {
        let head = number(bytes, 94, 2);
        let all = chain(bytes, head, number(bytes, 96, 4), number(bytes, 100, 4), 54);
        all.iter().filter(|record| record.0.starts_with(b"LASF_Spec") && record.1 == 4).count()
    };
    assert_eq!(extra(&after), 1, "{}: readers look at one extra-bytes record", copy.display());
    // Position and number of records, format, record length; position of waveforms and extended records.
    let changed = [96..107, 227..247];
    for at in 0..number(&before, 94, 2) {
        let may = changed.iter().any(|range| range.contains(&at));
        assert!(may || before[at] == after[at], "{}: header byte {at}", copy.display());
    }
    if before[25] >= 3 && number(&before, 227, 8) > 0 {
        let old = number(&before, 227, 8);
        let new = number(&after, 227, 8);
        assert_eq!(before[old..old + 60], after[new..new + 60], "{}: waveforms", copy.display());
    }
}

/// Compares every record of the copy with the original, except class and label.
fn compare_points(original: &InputFile, before: &[u8], copy: &InputFile, truth: &Truth) {
    let old = original.layout();
    let new = copy.layout();
    let after = records(copy);
    let label = new.dimension("cluster_id").expect("the label").offset;
    let kept = new.dimension("original_classification").expect("the class").offset;
    let mask = old.classification_mask;
    for dimension in &old.dimensions {
        assert_eq!(new.dimension(&dimension.name), old.dimension(&dimension.name));
    }
    let rows = before.chunks_exact(old.record_len).zip(after.chunks_exact(new.record_len));
    assert_eq!(rows.len(), truth.labels.len());
    for (index, (before, after)) in rows.enumerate() {
        let class = before[old.classification] & mask;
        let high = if old.point_format >= 6 { 18 } else { 7 };
        let expected = match truth.classes[index] {
            0 => class,
            1 => 2,
            2 => 7,
            _ => high,
        };
        let at = old.classification;
        assert_eq!(after[at] & mask, expected, "class of record {index}");
        let same = after[..at] == before[..at]
            && after[at] & !mask == before[at] & !mask
            && after[at + 1..old.record_len] == before[at + 1..];
        assert!(same, "record {index} of {}", copy.name());
        assert_eq!(after[label..label + 4], truth.labels[index].to_le_bytes());
        assert_eq!(after[kept], class);
    }
}

fn options(format: OutputFormat) -> LabelOptions {
    LabelOptions { format, keep_original: true, ..LabelOptions::default() }
}

#[test]
fn copies_keep_everything_but_label_and_class() {
    let samples = samples();
    let copies: u32 =
        samples.par_iter().enumerate().map(|(index, path)| copy_both_ways(path, index as u64)).sum();
    println!("{copies} copies compared");
    assert!(copies >= 4, "two shipped samples, two formats");
}

/// Copies one file to both formats; returns the number of copies.
fn copy_both_ways(path: &Path, seed: u64) -> u32 {
    let Some(catalog) = open(path) else { return 0 };
    let input = &catalog.files()[0];
    let before = records(input);
    let truth = Truth::random(input.point_count(), seed);
    for format in [OutputFormat::Las, OutputFormat::Laz] {
        let folder = tempfile::tempdir().expect("a folder");
        let plan = LabelledFile::plan(input, &options(format)).expect("a plan");
        assert_eq!(plan.is_compressed(), format == OutputFormat::Laz);
        let copy = write(&plan, input, &before, &truth, folder.path());
        compare_around(path, &copy, truth.labels.len());
        let again = open(&copy).expect("the copy opens");
        let copied = &again.files()[0];
        assert_eq!(copied.point_count(), input.point_count());
        assert_eq!(copied.is_compressed(), plan.is_compressed());
        assert!(!copied.is_copc());
        compare_points(input, &before, copied, &truth);
        relabel(copied, folder.path());
    }
    2
}

/// A labelled copy as input: the labels are replaced in place, the record does not grow, and the class of the
/// first input is kept.
fn relabel(copied: &InputFile, folder: &Path) {
    let first = records(copied);
    let truth = Truth::random(copied.point_count(), 7);
    let plan = LabelledFile::plan(copied, &options(OutputFormat::Same)).expect("a plan");
    assert_eq!(plan.record_len(), copied.layout().record_len);
    assert_eq!(plan.name(), copied.name());
    let folder = folder.join("again");
    std::fs::create_dir(&folder).expect("a folder");
    let path = write(&plan, copied, &first, &truth, &folder);
    let again = open(&path).expect("the copy of the copy opens");
    let twice = &again.files()[0];
    assert_eq!(twice.layout(), copied.layout());
    let label = twice.layout().dimension("cluster_id").expect("the label").offset;
    let kept = twice.layout().dimension("original_classification").expect("the class").offset;
    let size = twice.layout().record_len;
    let second = records(twice);
    for (index, (one, two)) in first.chunks_exact(size).zip(second.chunks_exact(size)).enumerate() {
        assert_eq!(two[label..label + 4], truth.labels[index].to_le_bytes());
        assert_eq!(one[kept], two[kept]);
    }
}

#[test]
fn the_descriptor_of_the_labels_says_what_they_are() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/mls_profiles.las");
    let catalog = open(&path).expect("opens");
    let input = &catalog.files()[0];
    let before = records(input);
    let truth = Truth::random(input.point_count(), 3);
    for (surfaces, text) in [(true, &b"surface, 0: none"[..]), (false, b"object, 0: none")] {
        let folder = tempfile::tempdir().expect("a folder");
        let options = LabelOptions { surfaces, ..LabelOptions::default() };
        let plan = LabelledFile::plan(input, &options).expect("a plan");
        let copy = std::fs::read(write(&plan, input, &before, &truth, folder.path())).expect("written");
        assert!(copy[..1_000].windows(text.len()).any(|part| part == text), "surfaces: {surfaces}");
    }
}

/// A run on a copy that an earlier run or another program has classified.
#[test]
fn classes_that_the_run_decides_are_kept_by_no_other_point() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/tree_road_sweep.laz");
    let catalog = open(&path).expect("opens");
    let input = &catalog.files()[0];
    let size = input.layout().record_len;
    let before = &records(input)[..9 * size];
    let place = input.layout().classification;
    let of_run = |kinds: &[Kind]| LabelOptions {
        finds_ground: true,
        finds_noise: true,
        kinds: kinds.to_vec(),
        ..LabelOptions::default()
    };
    // The classes of the points before: never classified, ground, three kinds of vegetation, building, wire,
    // two kinds of noise.
    let old = [0, 2, 3, 4, 5, 6, 14, 7, 18];
    let mut classified = before.to_vec();
    classified.chunks_exact_mut(size).zip(old).for_each(|(record, class)| record[place] = class);
    let new = |options: &LabelOptions, labels: [u32; 9], class: u8, kind: u8| {
        let plan = LabelledFile::plan(input, options).expect("a plan");
        let kinds = [Kind::new(kind, 0); 9];
        let kinds = if options.kinds.is_empty() { &[] } else { &kinds[..] };
        let mut out = Vec::new();
        plan.label(&classified, &labels, &[class; 9], kinds, &mut out);
        out.chunks_exact(plan.record_len()).map(|record| record[place]).collect::<Vec<_>>()
    };
    let [object, ground] = [PointClass::Object, PointClass::Ground].map(PointClass::code);
    // A method without classes keeps the classes of other programs, except ground and noise.
    assert_eq!(new(&of_run(&[]), [1; 9], object, 0), [0, 1, 3, 4, 5, 6, 14, 1, 1]);
    assert_eq!(new(&of_run(&[]), [0; 9], object, 0), [0, 1, 3, 4, 5, 6, 14, 1, 1]);
    assert_eq!(new(&of_run(&[]), [0; 9], ground, 0), [2; 9]);
    // Points of poles, and points without an object, are neither vegetation nor building nor wire.
    let street = |config: &StreetConfig| of_run(&Street::new(config).expect("valid").kinds());
    let all = street(&StreetConfig::default());
    assert_eq!(new(&all, [1; 9], object, 3), [0, 1, 1, 1, 1, 1, 1, 1, 1]);
    assert_eq!(new(&all, [0; 9], object, 0), [0, 1, 1, 1, 1, 1, 1, 1, 1]);
    assert_eq!(new(&all, [1; 9], object, 2), [5; 9]);
    // What the method does not find stays: hedges and wires, or everything but trees.
    let cut = NormalizedCut::new(&NormalizedCutConfig::default(), &EuclideanConfig::default());
    let cut = cut.expect("valid").kinds();
    assert_eq!(new(&of_run(&cut), [0; 9], object, 0), [0, 1, 3, 4, 1, 1, 14, 1, 1]);
    assert_eq!(new(&of_run(&cut), [1; 9], object, 9), [0, 1, 3, 4, 1, 1, 14, 1, 1]);
    let trees = street(&StreetConfig { classes: vec![WantedClass::Tree], ..StreetConfig::default() });
    assert_eq!(new(&trees, [0; 9], object, 0), [0, 1, 3, 4, 1, 6, 14, 1, 1]);
    // Outside a section, only the class of objects that reach there is decided.
    assert_eq!(new(&all, [0; 9], PointClass::UNDECIDED, 0), old);
    assert_eq!(new(&all, [1; 9], PointClass::UNDECIDED, 2), [5; 9]);
    // Without a ground filter and without a search for noise, both stay.
    let nothing = LabelOptions { finds_ground: false, finds_noise: false, ..of_run(&[]) };
    assert_eq!(new(&nothing, [1; 9], object, 0), old);
    let kept = LabelOptions { set_classification: false, ..all };
    assert_eq!(new(&kept, [1; 9], object, 2), old);
}

/// A method without classes does not keep `object_class` of an earlier run, unless it also keeps the objects
/// to which these classes belong.
#[test]
fn a_method_without_classes_clears_those_of_an_earlier_run() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/tree_road_sweep.laz");
    let catalog = open(&path).expect("opens");
    let input = &catalog.files()[0];
    let folder = tempfile::tempdir().expect("a folder");
    let named = LabelOptions { kinds: vec![Kind::new(2, 0)], ..options(OutputFormat::Las) };
    let plan = LabelledFile::plan(input, &named).expect("a plan");
    let truth = Truth::random(input.point_count(), 3);
    let copy = write(&plan, input, &records(input), &truth, folder.path());
    let again = open(&copy).expect("opens");
    let labelled = &again.files()[0];
    let place = labelled.layout().dimension("object_class").expect("the class").offset;
    let mut with_classes = records(labelled);
    let size = labelled.layout().record_len;
    with_classes.chunks_exact_mut(size).for_each(|record| record[place] = 2);
    let plan = LabelledFile::plan(labelled, &options(OutputFormat::Las)).expect("a plan");
    assert_eq!(plan.record_len(), size);
    let mut out = Vec::new();
    plan.label(&with_classes, &truth.labels, &truth.classes, &[], &mut out);
    assert!(out.chunks_exact(size).all(|record| record[place] == 0));
    // Surfaces have a dimension of their own, unless the user gives it the name of the objects.
    let objects = labelled.layout().dimension("cluster_id").expect("the object").offset;
    for (dimension, kept) in [("surface_id", true), ("cluster_id", false)] {
        let surfaces =
            LabelOptions { surfaces: true, dimension: dimension.into(), ..options(OutputFormat::Las) };
        let plan = LabelledFile::plan(labelled, &surfaces).expect("a plan");
        let new_labels = vec![77; truth.labels.len()];
        let mut out = Vec::new();
        plan.label(&with_classes, &new_labels, &truth.classes, &[], &mut out);
        let records = out.chunks_exact(plan.record_len());
        assert_eq!(records.len(), truth.labels.len());
        for (record, label) in records.zip(&truth.labels) {
            let object = u32::from_le_bytes(std::array::from_fn(|byte| record[objects + byte]));
            let expected = if kept { (*label, 2) } else { (77, 0) };
            assert_eq!((object, record[place]), expected, "{dimension}");
        }
    }
}

#[test]
fn names_follow_the_format_and_must_differ() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/tree_road_sweep.laz");
    let folder = tempfile::tempdir().expect("a folder");
    let name = |file: &str, format| {
        let copy = folder.path().join(file);
        std::fs::copy(&path, &copy).expect("copied");
        let catalog = open(&copy).expect("opens");
        LabelledFile::plan(&catalog.files()[0], &options(format)).expect("a plan")
    };
    let cases = [
        ("a.laz", OutputFormat::Same, "a.laz"),
        ("B.LAZ", OutputFormat::Same, "B.LAZ"),
        ("B.LAZ", OutputFormat::Las, "B.las"),
        ("x.copc.laz", OutputFormat::Same, "x.laz"),
        ("x.copc.laz", OutputFormat::Las, "x.las"),
        ("scan", OutputFormat::Same, "scan"),
        ("scan.1", OutputFormat::Las, "scan.1.las"),
    ];
    for (file, format, expected) in cases {
        assert_eq!(name(file, format).name(), expected);
    }
    let [one, two] = [name("x.laz", OutputFormat::Las), name("x.copc.laz", OutputFormat::Las)];
    assert!(matches!(check_names([&one, &two]), Err(OutputError::NameClash { name }) if name == "x.las"));
    check_names([&one, &name("y.laz", OutputFormat::Las)]).expect("different names");
}

#[test]
fn a_dimension_of_another_type_or_an_impossible_name_is_refused() {
    let Some(data) = util::shared_data() else { return };
    let catalog = open(&data.join("conformance/laspy/tests/data/extrabytes.las")).expect("opens");
    let input = &catalog.files()[0];
    let taken = &input.layout().dimensions[0];
    let with = |dimension: &str| {
        LabelledFile::plan(input, &LabelOptions { dimension: dimension.into(), ..LabelOptions::default() })
    };
    assert!(matches!(with(&taken.name), Err(OutputError::DimensionType { .. })), "{taken:?}");
    assert!(matches!(with(""), Err(OutputError::DimensionName { .. })));
    assert!(matches!(with(&"x".repeat(32)), Err(OutputError::DimensionName { .. })));
    with(&"x".repeat(31)).expect("a name of 31 bytes fits");
}

/// The uncompressed sample with `extra` more bytes in every record and, if given, descriptors of (name, type,
/// options) in an extra-bytes record.
fn with_extra_bytes(extra: usize, descriptors: &[(&str, u8, u8)]) -> Vec<u8> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/mls_profiles.las");
    let bytes = std::fs::read(path).expect("a shipped sample");
    let start = number(&bytes, 96, 4);
    let count = number(&bytes, 107, 4);
    let old = number(&bytes, 105, 2);
    let mut new = bytes[..227].to_vec();
    if !descriptors.is_empty() {
        let mut record = vec![0; 54];
        record[2..11].copy_from_slice(b"LASF_Spec");
        record[18] = 4;
        let payload = u16::try_from(descriptors.len() * 192).expect("few");
        record[20..22].copy_from_slice(&payload.to_le_bytes());
        for (name, data_type, options) in descriptors {
            let mut descriptor = vec![0; 192];
            (descriptor[2], descriptor[3]) = (*data_type, *options);
            descriptor[4..4 + name.len()].copy_from_slice(name.as_bytes());
            record.extend(descriptor);
        }
        new.extend(record);
    }
    let point_start = u32::try_from(new.len()).expect("small");
    new[96..100].copy_from_slice(&point_start.to_le_bytes());
    new[100..104].copy_from_slice(&u32::from(!descriptors.is_empty()).to_le_bytes());
    new[105..107].copy_from_slice(&u16::try_from(old + extra).expect("short").to_le_bytes());
    for record in bytes[start..start + count * old].chunks_exact(old) {
        new.extend_from_slice(record);
        new.extend((0..extra).map(|at| record[at % 12] ^ u8::try_from(at % 251).expect("small")));
    }
    new
}

/// A file may use the name for something else. Only `--keep-original` needs the dimension.
#[test]
fn a_dimension_that_is_not_needed_may_have_any_type() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("in.las");
    std::fs::write(&path, with_extra_bytes(2, &[("original_classification", 3, 0)])).expect("written");
    let catalog = open(&path).expect("opens");
    let input = &catalog.files()[0];
    let with =
        |keep_original| LabelledFile::plan(input, &LabelOptions { keep_original, ..LabelOptions::default() });
    with(false).expect("the dimension stays as it is");
    let error = with(true).expect_err("refused");
    assert!(matches!(error, OutputError::DimensionType { .. }), "{error}");
    let hint = Failure::hint(&error).expect("a hint");
    assert!(hint.contains("--keep-original") && !hint.contains("output.dimension"), "{hint}");

    std::fs::write(&path, with_extra_bytes(2, &[("object_class", 3, 0)])).expect("written");
    let catalog = open(&path).expect("opens");
    let classifies = LabelOptions { kinds: vec![Kind::new(2, 0)], ..LabelOptions::default() };
    let error = LabelledFile::plan(&catalog.files()[0], &classifies).expect_err("refused");
    let hint = Failure::hint(&error).expect("a hint");
    assert!(hint.contains("does not classify") && !hint.contains("output.dimension"), "{hint}");
}

/// A dimension of another program with the name of ours has other values, so that the class would be lost.
#[test]
fn a_dimension_that_another_program_called_original_classification_does_not_keep_the_class() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("in.las");
    std::fs::write(&path, with_extra_bytes(1, &[("original_classification", 1, 0)])).expect("written");
    let catalog = open(&path).expect("opens");
    let input = &catalog.files()[0];
    let with =
        |keep_original| LabelledFile::plan(input, &LabelOptions { keep_original, ..LabelOptions::default() });
    with(false).expect("the dimension stays as it is");
    let error = with(true).expect_err("refused");
    assert!(matches!(error, OutputError::DimensionOfOthers { .. }), "{error}");
    assert!(Failure::hint(&error).expect("a hint").contains("--keep-original"), "{error}");
}

/// Moves the description of the extra bytes behind the points of a LAS 1.4 file, as an extended record.
fn describe_behind(path: &Path) {
    let mut bytes = std::fs::read(path).expect("read");
    let mut at = number(&bytes, 94, 2);
    let mut payload = Vec::new();
    for _ in 0..number(&bytes, 100, 4) {
        let length = number(&bytes, at + 20, 2);
        if bytes[at + 2..].starts_with(b"LASF_Spec\0") && number(&bytes, at + 18, 2) == 4 {
            payload = bytes[at + 54..at + 54 + length].to_vec();
            bytes[at + 2..at + 11].copy_from_slice(b"LASF_none");
        }
        at += 54 + length;
    }
    assert!(!payload.is_empty() && number(&bytes, 243, 4) == 0);
    let start = bytes.len() as u64;
    bytes[235..243].copy_from_slice(&start.to_le_bytes());
    bytes[243] = 1;
    let mut head = [0; 60];
    head[2..11].copy_from_slice(b"LASF_Spec");
    head[18] = 4;
    head[20..28].copy_from_slice(&(payload.len() as u64).to_le_bytes());
    bytes.extend(head);
    bytes.extend(payload);
    std::fs::write(path, bytes).expect("written");
}

/// With a no-data of an earlier run, readers would hide the new object of that number.
#[test]
fn descriptors_lose_the_minimum_and_maximum_of_values_that_the_run_replaces() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/tree_road_sweep.laz");
    let catalog = open(&path).expect("opens");
    let sample = &catalog.files()[0];
    let truth = Truth::random(sample.point_count(), 5);
    let named = LabelOptions { kinds: vec![Kind::new(2, 0)], ..options(OutputFormat::Las) };
    // The options and the values of a descriptor.
    let facts = |bytes: &[u8], name: &str| {
        let name = [name.as_bytes(), &[0]].concat();
        let found = bytes.windows(name.len()).rposition(|part| part == name).expect("described");
        (found - 4, bytes[found - 1], bytes[found + 36..found + 108].to_vec())
    };
    for behind in [false, true] {
        let folder = tempfile::tempdir().expect("a folder");
        let plan = LabelledFile::plan(sample, &named).expect("a plan");
        let input = write(&plan, sample, &records(sample), &truth, folder.path());
        let mut bytes = std::fs::read(&input).expect("read");
        for name in ["cluster_id", "object_class", "original_classification"] {
            let at = facts(&bytes, name).0;
            bytes[at + 3] = 0b111;
            bytes[at + 40..at + 112].fill(3);
        }
        std::fs::write(&input, &bytes).expect("written");
        if behind {
            describe_behind(&input);
        }
        let catalog = open(&input).expect("opens");
        let input = &catalog.files()[0];
        // With the dimensions that are there, and with a new one.
        for (dimension, replaced) in [("cluster_id", true), ("other", false)] {
            let wanted = LabelOptions { dimension: dimension.into(), ..named.clone() };
            let plan = LabelledFile::plan(input, &wanted).expect("a plan");
            let copies = folder.path().join(dimension);
            std::fs::create_dir(&copies).expect("a folder");
            let copy = write(&plan, input, &records(input), &truth, &copies);
            let bytes = std::fs::read(copy).expect("read");
            let (cleared, stale) = ((0, vec![0; 72]), (0b111, vec![3; 72]));
            let of = |name: &str| {
                let (_, options, values) = facts(&bytes, name);
                (options, values)
            };
            assert_eq!(of("cluster_id"), *if replaced { &cleared } else { &stale }, "{dimension}");
            assert_eq!(of("object_class"), cleared, "{dimension}");
            // The class before stays as it is.
            assert_eq!(of("original_classification"), stale, "{dimension}");
        }
    }
}

/// LAS 1.4 allows descriptions after the points, but many readers look for them only before the points.
#[test]
fn descriptions_after_the_points_are_read_and_come_before_them_in_copies() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/tree_road_sweep.laz");
    let catalog = open(&path).expect("opens");
    let sample = &catalog.files()[0];
    for format in [OutputFormat::Las, OutputFormat::Laz] {
        let folder = tempfile::tempdir().expect("a folder");
        let vendor = LabelOptions { dimension: "vendor".into(), ..options(format) };
        let plan = LabelledFile::plan(sample, &vendor).expect("a plan");
        let first = Truth::random(sample.point_count(), 5);
        let input = write(&plan, sample, &records(sample), &first, folder.path());
        describe_behind(&input);
        let catalog = open(&input).expect("opens");
        assert!(catalog.warnings().is_empty(), "{:?}", catalog.warnings());
        let input = &catalog.files()[0];
        // With a new dimension, and with those that are there.
        for (dimension, more) in [("cluster_id", 4), ("vendor", 0)] {
            let wanted = LabelOptions { dimension: dimension.into(), ..options(format) };
            let plan = LabelledFile::plan(input, &wanted).expect("a plan");
            assert_eq!(plan.record_len(), input.layout().record_len + more);
            let truth = Truth::random(sample.point_count(), 6);
            let folder = folder.path().join(dimension);
            std::fs::create_dir(&folder).expect("a folder");
            let copy = write(&plan, input, &records(input), &truth, &folder);
            let bytes = std::fs::read(&copy).expect("read");
            assert_eq!([number(&bytes, 235, 8), number(&bytes, 243, 4)], [0, 0], "{dimension}");
            let again = open(&copy).expect("the copy opens");
            assert!(again.warnings().is_empty(), "{:?}", again.warnings());
            let layout = again.files()[0].layout();
            let names: Vec<&str> = layout.dimensions.iter().map(|found| &*found.name).collect();
            assert_eq!(names[..2], ["vendor", "original_classification"]);
            assert_eq!(names.get(2).copied(), (more > 0).then_some("cluster_id"));
            let at = |name: &str| layout.dimension(name).expect("described").offset;
            for (index, record) in records(&again.files()[0]).chunks_exact(layout.record_len).enumerate() {
                let vendor = if more > 0 { &first } else { &truth };
                assert_eq!(record[at("vendor")..][..4], vendor.labels[index].to_le_bytes());
                assert_eq!(record[at(dimension)..][..4], truth.labels[index].to_le_bytes());
            }
        }
    }
}

/// Two counts that disagree: the copy states its own number of points, and for point formats 6 to 10 nothing
/// in the legacy fields (LAS 1.4 R15, table 3).
#[test]
fn the_legacy_counts_of_point_format_6_become_zero_where_the_counts_disagree() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("in.las");
    let points: Vec<Point> = (0..50).map(|n| Point::at([n, n, 0])).collect();
    for (legacy, expected) in [(77_u32, 0_u32), (50, 50), (0, 0)] {
        let mut bytes = Shape::default().bytes(&points);
        bytes[107..111].copy_from_slice(&legacy.to_le_bytes());
        bytes[111..115].copy_from_slice(&legacy.to_le_bytes());
        std::fs::write(&path, bytes).expect("written");
        let catalog = open(&path).expect("opens");
        let plan = LabelledFile::plan(&catalog.files()[0], &LabelOptions::default()).expect("a plan");
        let header = plan.prologue();
        assert_eq!([number(header, 107, 4), number(header, 111, 4)], [expected as usize; 2], "{legacy}");
        assert_eq!(number(header, 247, 8), 50);
    }
}

#[test]
fn the_label_follows_bytes_that_nobody_described() {
    // (extra bytes, descriptors, dimensions found, warnings, descriptors of the copy)
    type Case = (usize, &'static [(&'static str, u8, u8)], usize, usize, usize);
    let cases: [Case; 5] = [
        (300, &[], 0, 0, 4),                              // 231 and 69 bytes, label, class
        (7, &[("height", 9, 0)], 1, 0, 4),                // 4 described, 3 not
        (7, &[("none", 0, 0), ("three", 0, 3)], 1, 0, 4), // nothing, 3 bytes; 4 not described
        (3, &[("one", 1, 0), ("wide", 10, 0), ("late", 1, 0)], 1, 1, 4), // 8 bytes do not fit into 2
        (8, &[("cluster_id", 5, 0), ("strange", 31, 0)], 1, 1, 3), // 4 bytes of no known type, class
    ];
    for (extra, descriptors, dimensions, warnings, of_copy) in cases {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("in.las");
        std::fs::write(&path, with_extra_bytes(extra, descriptors)).expect("written");
        let catalog = open(&path).expect("opens");
        let input = &catalog.files()[0];
        assert_eq!(input.layout().dimensions.len(), dimensions, "{descriptors:?}");
        assert_eq!(catalog.warnings().len(), warnings, "{:?}", catalog.warnings());
        let before = records(input);
        let truth = Truth::random(input.point_count(), 3);
        for format in [OutputFormat::Las, OutputFormat::Laz] {
            let plan = LabelledFile::plan(input, &options(format)).expect("a plan");
            let copies = folder.path().join(if format == OutputFormat::Las { "las" } else { "laz" });
            std::fs::create_dir(&copies).expect("a folder");
            let copy = write(&plan, input, &before, &truth, &copies);
            let again = open(&copy).expect("the copy opens");
            let layout = again.files()[0].layout();
            assert_eq!(layout.dimensions.len(), of_copy, "{:?}", layout.dimensions);
            assert!(layout.undescribed().is_empty());
            let label = layout.dimension("cluster_id").expect("the label").offset;
            let kept = layout.dimension("original_classification").expect("the class").offset;
            let new = records(&again.files()[0]);
            for (index, record) in new.chunks_exact(layout.record_len).enumerate() {
                assert_eq!(record[label..label + 4], truth.labels[index].to_le_bytes());
                assert_eq!(record[kept], before[index * input.layout().record_len + 15] & 0x1f);
            }
            if label >= input.layout().record_len {
                compare_points(input, &before, &again.files()[0], &truth);
            }
        }
    }
}

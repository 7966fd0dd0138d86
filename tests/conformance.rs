//! Every LAS and LAZ file of the test suites of three projects, each with its expected outcome.
//!
//! `tests/conformance.csv` has one row per file: path, outcome (`ok` or the variant of the error), and the
//! number of readable points. Geographic files are refused; they are read again with a unit in the settings
//! to test their points as well. The files are optional data. The test says so if they are missing.

use std::collections::BTreeMap;
use std::path::Path;

use chainage::Failure;
use chainage::input::{Catalog, Fields, InputError, InputFile, InputOptions, LengthUnit, record_xyz};

use rayon::prelude::*;

use crate::util;

/// One row of the table.
struct Expected {
    outcome: String,
    points: u64,
}

fn table() -> BTreeMap<String, Expected> {
    let rows = include_str!("conformance.csv").lines().filter(|row| !row.starts_with('#') && !row.is_empty());
    rows.skip(1)
        .map(|row| {
            let mut cells = row.splitn(4, ',');
            let mut cell = || cells.next().expect("path, outcome, points, reason");
            let path = cell().to_owned();
            let outcome = cell().to_owned();
            let points = cell();
            (path, Expected { outcome, points: points.parse().expect("a number of points") })
        })
        .collect()
}

/// The name of the variant.
fn variant(error: &InputError) -> String {
    let text = format!("{error:?}");
    text.split([' ', '{']).next().expect("a name").to_owned()
}

fn options(mmap: bool, unit: LengthUnit) -> InputOptions {
    InputOptions { mmap, unit }
}

/// Reads every block with both kinds of fields, mapped and unmapped, and compares the parts that must be
/// equal.
fn read_all(path: &Path, unit: LengthUnit) -> u64 {
    let open = |mmap| Catalog::open(&[path.to_owned()], &options(mmap, unit)).expect("opened before");
    let mapped = open(true);
    let read = open(false);
    let mapped = &mapped.files()[0];
    let read = &read.files()[0];
    assert_eq!(mapped.blocks(), read.blocks());
    let mut points = 0;
    for block in 0..mapped.blocks().len() {
        points += compare_block(mapped, read, block);
    }
    mapped.check_unchanged().expect("nobody changed it");
    points
}

fn compare_block(mapped: &InputFile, read: &InputFile, block: usize) -> u64 {
    let record_len = mapped.layout().record_len;
    let mut one = Vec::new();
    let mut two = vec![7; 5];
    let mut three = Vec::new();
    mapped.prefetch(block);
    let all = mapped.records(block, Fields::All, &mut one).expect("readable");
    let same = read.records(block, Fields::All, &mut two).expect("readable");
    assert!(all == same, "{}: block {block} differs without mapping", mapped.name());
    let geometry = mapped.records(block, Fields::Geometry, &mut three).expect("readable");
    assert_eq!(geometry.len(), all.len());
    for (full, part) in all.chunks_exact(record_len).zip(geometry.chunks_exact(record_len)) {
        assert_eq!(record_xyz(full), record_xyz(part));
        if let Some(time) = mapped.layout().gps_time {
            assert_eq!(full[time..time + 8], part[time..time + 8]);
        }
    }
    mapped.release(block);
    assert_eq!(all.len(), mapped.blocks()[block].count as usize * record_len);
    u64::from(mapped.blocks()[block].count)
}

#[test]
fn every_file_of_the_conformance_folder_has_the_outcome_of_the_table() {
    let Some(data) = util::shared_data() else { return };
    let root = data.join("conformance");
    let expected = table();
    let files = util::las_files(&root);
    files.par_iter().for_each(|path| check(path, &name(path, &root), &expected));
    let missing = expected.keys().filter(|row| !root.join(row).is_file()).collect::<Vec<_>>();
    assert!(missing.is_empty(), "in the table but not in the folder: {missing:?}");
}

fn name(path: &Path, root: &Path) -> String {
    path.strip_prefix(root).expect("below").to_string_lossy().into_owned()
}

fn check(path: &Path, name: &str, expected: &BTreeMap<String, Expected>) {
    let row = expected.get(name).unwrap_or_else(|| panic!("{name} is not in tests/conformance.csv"));
    let opened = Catalog::open(&[path.to_owned()], &options(true, LengthUnit::Auto));
    let outcome = opened.as_ref().map_or_else(variant, |_| "ok".to_owned());
    assert_eq!(outcome, row.outcome, "{name}: {:?}", opened.err().map(|error| error.to_string()));
    if let Err(error) = &opened {
        assert!(error.hint().is_some(), "{name}: {error} has no hint");
    }
    let unit = if outcome == "Geographic" { LengthUnit::Metre } else { LengthUnit::Auto };
    if outcome == "ok" || outcome == "Geographic" {
        assert_eq!(read_all(path, unit), row.points, "{name}");
    }
}

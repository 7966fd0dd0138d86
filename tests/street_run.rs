//! `street` in the engine, on the shipped scan: the same bytes for any tiles and threads, and after an
//! interruption in every pass and in every round.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use chainage::input::{Catalog, Fields, InputOptions};

use crate::util::drive::scratch;
use crate::util::method_run::{MethodRun, resumed};

const STREET: MethodRun =
    MethodRun { method: "street", results: &["tree_road_sweep.laz", "objects.csv", "objects.geojson"] };

#[test]
fn tiles_and_threads_do_not_show() {
    STREET.assert_tiles_do_not_show(scratch().path());
}

#[test]
#[ignore = "long; scripts/check.sh runs it"]
fn a_run_stopped_in_any_pass_or_round_ends_in_the_same_bytes() {
    let folder = scratch();
    let settings = ["tiling.tile_length=20", "run.threads=2"];
    let straight: PathBuf = folder.path().join("straight");
    let passes: Vec<&'static str> =
        STREET.run_in(&straight, &settings).passes.iter().map(|figures| figures.pass).collect();
    assert!(passes.iter().filter(|pass| **pass == "growth").count() > 1, "{passes:?}");
    let expected = STREET.results(&straight);
    for pass in ["classes", "context", "cores", "leftovers", "objects"] {
        let out = folder.path().join(pass);
        assert!(STREET.interrupted_in(pass, 1, &out, &settings).is_err());
        let summary = STREET.run_in(&out, &settings);
        let before = passes.iter().position(|name| *name == pass).unwrap();
        assert!(resumed(&summary)[..before].iter().all(|pass| pass.1), "{pass}: {:?}", resumed(&summary));
        STREET.assert_same(&out, &expected, &format!("stopped in {pass}"));
    }
    // One run, stopped in each round of growth and resumed.
    let out = folder.path().join("rounds");
    let mut stops = 0;
    while STREET.interrupted_in("growth", 1, &out, &settings).is_err() {
        stops += 1;
        assert!(stops < 200, "the run never ends");
    }
    assert!(stops > 1);
    STREET.assert_same(&out, &expected, "stopped in every round");
}

#[test]
fn objects_of_classes_that_are_not_wanted_have_no_id_and_change_no_other() {
    let folder = scratch();
    let run = |name: &str, settings: &[&str]| {
        let out = folder.path().join(name);
        STREET.run_in(&out, settings);
        let table = std::fs::read_to_string(out.join("objects.csv")).unwrap();
        let mut rows = table.lines().map(|row| row.split(',').map(str::to_owned).collect::<Vec<String>>());
        let names = rows.next().unwrap();
        let place = |name: &str| names.iter().position(|column| column == name).unwrap();
        let (class, uid, points) = (place("class"), place("uid"), place("points"));
        let row = |row: Vec<String>| (row[class].clone(), row[uid].clone(), row[points].clone());
        rows.map(row).collect::<Vec<_>>()
    };
    let all = run("all", &[]);
    let some = run("some", &["street.classes=[\"pole\", \"vehicle\"]", "tiling.tile_length=20"]);
    let expected: Vec<_> = all.iter().filter(|(class, ..)| class == "3" || class == "4").cloned().collect();
    assert!(expected.len() > 3 && expected.len() < all.len() / 2, "{} of {}", expected.len(), all.len());
    assert_eq!(some, expected);
}

#[test]
fn chosen_las_codes_change_the_class_of_these_objects_and_of_nothing_else() {
    let folder = scratch();
    let copy = |name: &str, settings: &[&str]| {
        let out = folder.path().join(name);
        STREET.run_in(&out, settings);
        let copy = Catalog::open(&[out.join("tree_road_sweep.laz")], &InputOptions::default()).unwrap();
        let (file, mut buffer, mut all) = (&copy.files()[0], Vec::new(), Vec::new());
        let kind = file.layout().dimension("object_class").unwrap().offset;
        let length = file.layout().record_len;
        for block in 0..file.blocks().len() {
            let records = file.records(block, Fields::All, &mut buffer).unwrap();
            all.extend(records.chunks_exact(length).map(<[u8]>::to_vec));
        }
        (file.layout().classification, kind, all)
    };
    let (at, kind, plain) = copy("plain", &[]);
    let (_, _, chosen) =
        copy("chosen", &["output.classification=\"tree=4,pole=64\"", "tiling.tile_length=20"]);
    let mut changed = [0, 0];
    for (plain, chosen) in plain.iter().zip(&chosen) {
        let expected = match plain[kind] {
            2 => 4,
            3 => 64,
            _ => plain[at],
        };
        changed[0] += usize::from(expected == 4);
        changed[1] += usize::from(expected == 64);
        assert_eq!(chosen[at], expected);
        assert!(chosen[..at] == plain[..at] && chosen[at + 1..] == plain[at + 1..]);
    }
    assert!(plain.len() == chosen.len() && changed.iter().all(|&points| points > 100), "{changed:?}");
}

#[test]
fn hedges_have_the_las_class_of_vegetation_and_fences_none_and_both_can_be_chosen() {
    let folder = scratch();
    let copy = |name: &str, settings: &[&str]| {
        let out = folder.path().join(name);
        STREET.run_in(&out, &[&["output.original_classification=true"], settings].concat());
        let is_hedge = hedges(&out);
        let copy = Catalog::open(&[out.join("tree_road_sweep.laz")], &InputOptions::default()).unwrap();
        let (file, mut buffer) = (&copy.files()[0], Vec::new());
        let layout = file.layout();
        let [object, class, before] = ["cluster_id", "object_class", "original_classification"]
            .map(|name| layout.dimension(name).unwrap().offset);
        // Points of class 6: whether they belong to a hedge, and their LAS class.
        let mut found = BTreeMap::<(bool, Option<u8>), usize>::new();
        for block in 0..file.blocks().len() {
            let records = file.records(block, Fields::All, &mut buffer).unwrap();
            for record in records.chunks_exact(layout.record_len).filter(|record| record[class] == 6) {
                let id = u32::from_le_bytes(record[object..object + 4].try_into().unwrap());
                let now = record[layout.classification] & layout.classification_mask;
                let changed = (now != record[before]).then_some(now);
                *found.entry((is_hedge[&id], changed)).or_default() += 1;
            }
        }
        found
    };
    let plain = copy("plain", &[]);
    let hedges: usize = plain.iter().filter(|((is_hedge, _), _)| *is_hedge).map(|(_, points)| points).sum();
    let fences = plain[&(false, None)];
    assert!(hedges > 1_000 && fences > 1_000, "{plain:?}");
    assert!(plain.keys().all(|key| matches!(key, (true, Some(3 | 4)) | (false, None))), "{plain:?}");
    let chosen = copy("chosen", &["output.classification=\"fence=64,hedge=65\"", "tiling.tile_length=20"]);
    assert_eq!(chosen, BTreeMap::from([((true, Some(65)), hedges), ((false, Some(64)), fences)]));
}

/// Whether each object of class 6 is a hedge, by the table of objects.
fn hedges(out: &Path) -> BTreeMap<u32, bool> {
    let table = std::fs::read_to_string(out.join("objects.csv")).unwrap();
    let mut rows = table.lines().map(|row| row.split(',').collect::<Vec<_>>());
    let names = rows.next().unwrap();
    let place = |name: &str| names.iter().position(|column| *column == name).unwrap();
    let [id, class, hedge] = ["id", "class", "hedge"].map(place);
    let mut found = BTreeMap::new();
    for row in rows {
        assert_eq!(row[hedge].is_empty(), row[class] != "6", "{row:?}");
        if row[class] == "6" {
            found.insert(row[id].parse().unwrap(), row[hedge] == "true");
        }
    }
    found
}

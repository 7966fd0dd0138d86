//! Headers and arguments that must be refused, each with the right error, and others that only need a
//! warning.

use std::path::{Path, PathBuf};

use chainage::Failure;
use chainage::input::{Catalog, Fields, InputError, InputOptions, LengthUnit, record_xyz};
use chainage::model::{Lattice, LatticeTransform};
use rayon::prelude::*;

use crate::util::las::{Point, Shape};

/// 10,310 points, LAS 1.2, point format 1, no record of a coordinate system.
const LAS: &str = "mls_profiles.las";
/// 71,841 points, LAS 1.4, point format 6, compressed.
const LAZ: &str = "tree_road_sweep.laz";

fn sample(name: &str) -> Vec<u8> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name);
    std::fs::read(path).expect("a shipped sample")
}

fn put(bytes: &mut [u8], at: usize, value: &[u8]) {
    bytes[at..at + value.len()].copy_from_slice(value);
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    fn file(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, bytes).expect("written");
        path
    }
}

fn open(paths: &[PathBuf]) -> Result<Catalog, InputError> {
    Catalog::open(paths, &InputOptions::default())
}

fn open_bytes(bytes: &[u8]) -> Result<Catalog, InputError> {
    let folder = Folder::new();
    open(&[folder.file("a.las", bytes)])
}

/// The error as `Variant: text`, or the warnings.
fn outcome(result: &Result<Catalog, InputError>) -> String {
    match result {
        Ok(catalog) => format!("ok {:?}", catalog.warnings()),
        Err(error) => {
            assert!(error.hint().is_some(), "{error} has no hint");
            let debug = format!("{error:?}");
            format!("{}: {error}", debug.split([' ', '{']).next().expect("a name"))
        }
    }
}

#[test]
fn every_field_of_the_header_is_checked() {
    let f64_at = |at: usize, value: f64| (at, value.to_le_bytes().to_vec());
    type Case = (&'static str, (usize, Vec<u8>), &'static str);
    let cases: Vec<Case> = vec![
        (LAS, (0, b"LASX".to_vec()), "NotLas"),
        (LAS, (24, vec![2]), "Version"),
        (LAS, (25, vec![5]), "Version"),
        (LAS, (94, vec![226, 0]), "HeaderField"),
        (LAZ, (94, vec![235, 0]), "HeaderField"),
        (LAS, (94, vec![255, 255]), "HeaderField"), // the points then start inside the header
        (LAS, (96, 226_u32.to_le_bytes().to_vec()), "HeaderField"),
        (LAS, (96, u32::MAX.to_le_bytes().to_vec()), "HeaderField"),
        (LAS, (104, vec![11]), "HeaderField"),
        (LAS, (104, vec![1 | 0x80]), "LaszipRecord"), // compressed, but no laszip record
        (LAZ, (104, vec![7 | 0x80]), "HeaderField"),  // records of 30 bytes are too short for format 7
        (LAZ, (104, vec![3]), "HeaderField"),
        (LAS, (105, vec![27, 0]), "HeaderField"),
        (LAZ, (105, vec![34, 0]), "LaszipRecord"), // 4 extra bytes that are not coded
        (LAS, (107, 10_311_u32.to_le_bytes().to_vec()), "Truncated"),
        (LAS, (107, u32::MAX.to_le_bytes().to_vec()), "Truncated"),
        (LAS, f64_at(131, f64::NAN), "HeaderField"),
        (LAS, f64_at(139, 0.0), "HeaderField"),
        (LAS, f64_at(147, -0.001), "HeaderField"),
        (LAS, f64_at(131, 1e-10), "HeaderField"),
        (LAS, f64_at(131, 1e4), "HeaderField"),
        (LAS, f64_at(155, f64::INFINITY), "HeaderField"),
        (LAS, f64_at(163, f64::NAN), "HeaderField"),
        (LAS, f64_at(171, -1e15), "HeaderField"),
        (LAS, f64_at(179, f64::NAN), "ok"), // the extent is not believed, so it may be anything
        (LAZ, (247, 71_842_u64.to_le_bytes().to_vec()), "ok"), // still as many chunks; the last one notices
        (LAZ, (247, (1_u64 << 40).to_le_bytes().to_vec()), "ChunkTable"),
        (LAZ, (100, vec![0, 0, 0, 0]), "LaszipRecord"),
        (LAZ, (235, vec![1, 2, 3, 4, 0, 0, 0, 0, 9, 0, 0, 0]), "ok"), // extended records that are not there
    ];
    for (name, (at, value), expected) in cases {
        let mut bytes = sample(name);
        put(&mut bytes, at, &value);
        let text = outcome(&open_bytes(&bytes));
        assert!(text.starts_with(expected), "{name} with {value:?} at {at}: {text}, not {expected}");
    }
}

#[test]
fn every_prefix_of_a_file_up_to_its_points_is_refused() {
    let folder = Folder::new();
    for name in [LAS, LAZ] {
        let bytes = sample(name);
        let start = u32::from_le_bytes(bytes[96..100].try_into().expect("four bytes")) as usize;
        for end in (0..=start).chain([start + 1, bytes.len() / 2, bytes.len() - 1]) {
            let result = open(&[folder.file("a.las", &bytes[..end])]);
            assert!(result.is_err(), "{name} cut to {end} bytes: {}", outcome(&result));
        }
    }
}

#[test]
fn a_truncated_file_says_how_many_points_are_there() {
    let bytes = sample(LAS);
    let text = outcome(&open_bytes(&bytes[..bytes.len() - 29]));
    assert!(
        text.ends_with("is truncated: its header promises 10310 points, but the file has 10308"),
        "{text}"
    );
}

#[test]
fn a_wrong_count_of_a_layered_file_is_noticed_in_its_last_chunk() {
    let mut bytes = sample(LAZ);
    put(&mut bytes, 247, &71_842_u64.to_le_bytes());
    put(&mut bytes, 107, &[0; 4]);
    let folder = Folder::new();
    let catalog = open(&[folder.file("a.laz", &bytes)]).expect("the header is plausible");
    let file = &catalog.files()[0];
    let last = file.blocks().len() - 1;
    let text = file.records(last, Fields::All, &mut Vec::new()).expect_err("refused").to_string();
    assert!(
        text.contains(&format!("chunk {last}"))
            && text.ends_with("21841 points, but the header and the table promise 21842"),
        "{text}"
    );
}

/// A sample whose header promises this many points.
fn counting(name: &str, count: u32) -> Vec<u8> {
    let mut bytes = sample(name);
    let is_new = bytes[25] == 4;
    if is_new {
        put(&mut bytes, 247, &u64::from(count).to_le_bytes());
    }
    put(&mut bytes, 107, &if is_new { 0 } else { count }.to_le_bytes());
    bytes
}

#[test]
fn a_file_without_points_is_accepted_with_a_warning() {
    for name in [LAS, LAZ] {
        let mut bytes = counting(name, 0);
        let start = u32::from_le_bytes(bytes[96..100].try_into().expect("four bytes")) as usize;
        bytes.truncate(start);
        // No bytes, zeros that a writer reserved, and the bytes that LASzip writes: a position and a table
        // without chunks.
        let mut table = (start as u64 + 8).to_le_bytes().to_vec();
        table.extend([0; 8]);
        for rest in [Vec::new(), vec![0; 200_000], table] {
            let catalog = open_bytes(&[&bytes[..], &rest].concat()).expect("accepted");
            assert_eq!(catalog.point_count(), 0);
            assert!(catalog.files()[0].blocks().is_empty());
            assert_eq!(catalog.warnings().last().map(String::as_str), Some("a.las: there are no points"));
        }
    }
}

#[test]
fn points_in_a_file_that_promises_none_are_refused_with_their_number() {
    let folder = Folder::new();
    let good = folder.file("good.las", &sample(LAS));
    for (name, found) in [(LAS, "10310 whole records"), (LAZ, "2 compressed chunks with up to 100000 points")]
    {
        let bad = folder.file("zero.las", &counting(name, 0));
        for arguments in [vec![bad.clone()], vec![good.clone(), bad], vec![folder.0.path().to_owned()]] {
            let text = outcome(&open(&arguments));
            assert!(text.starts_with("NotCounted"), "{text}");
            let expected = format!("zero.las: the header promises no points, but the file has {found}");
            assert!(text.ends_with(&expected), "{text}");
        }
    }
}

#[test]
fn records_beyond_the_count_are_not_dropped_in_silence() {
    let warnings = |bytes: &[u8]| open_bytes(bytes).expect("accepted").warnings().to_vec();
    let text = warnings(&counting(LAS, 10_000)).join("\n");
    assert!(
        text.starts_with(
            "a.las: the header promises 10000 points, but 310 more records follow them (10310 in all)"
        ) && text.contains("-set_number_of_point_records 10310"),
        "{text}"
    );
    // Reserved space does not count as records, and neither does a part of a record.
    let mut reserved = counting(LAS, 10_000);
    reserved.extend(vec![0; 300_000]);
    assert_eq!(warnings(&reserved).join("\n"), text);
    for padding in [vec![0; 300_000], vec![7; 27]] {
        assert!(warnings(&[sample(LAS), padding].concat()).is_empty());
    }
}

#[test]
fn of_two_counts_the_one_that_the_file_holds_is_taken() {
    let catalog = |legacy: u32, large: u64| {
        let mut bytes = sample(LAS);
        // A header of LAS 1.4 before the same points.
        let (head, points) = bytes.split_at_mut(227);
        let mut head = head.to_vec();
        head.resize(375, 0);
        head[25] = 4;
        put(&mut head, 94, &375_u16.to_le_bytes());
        let start = u32::from_le_bytes(head[96..100].try_into().expect("four bytes"));
        put(&mut head, 96, &(start + 375 - 227).to_le_bytes());
        put(&mut head, 107, &legacy.to_le_bytes());
        put(&mut head, 247, &large.to_le_bytes());
        head.extend_from_slice(points);
        open_bytes(&head)
    };
    for (legacy, large, points, warnings) in [
        (10_310, 10_310, 10_310, 0),
        (0, 10_310, 10_310, 0),
        (10_310, 0, 10_310, 0),
        (10_310, 10_311, 10_310, 1),
        (77, 10_310, 10_310, 1),
        // 310 records are beyond both.
        (10_000, 9_000, 10_000, 2),
    ] {
        let catalog = catalog(legacy, large).expect("accepted");
        assert_eq!(catalog.point_count(), points, "{legacy} {large}");
        assert_eq!(catalog.warnings().len(), warnings, "{:?}", catalog.warnings());
    }
    assert!(matches!(
        catalog(10_311, 20_000),
        Err(InputError::Truncated { promised: 20_000, present: 10_310, .. })
    ));
}

#[test]
fn arguments_are_files_folders_and_patterns_and_none_twice() {
    let folder = Folder::new();
    let names = ["b.las", "a.LAS", "c.laz"];
    let files = names.map(|name| folder.file(name, &sample(if name == "c.laz" { LAZ } else { LAS })));
    folder.file("notes.txt", b"no points");
    std::fs::create_dir(folder.0.path().join("deeper.las")).expect("a folder");
    let root = folder.0.path();
    let found = |arguments: &[PathBuf]| {
        let catalog = open(arguments).expect("opens");
        catalog.files().iter().map(|file| file.name().to_owned()).collect::<Vec<_>>()
    };
    assert_eq!(found(&[root.to_owned()]), ["a.LAS", "b.las", "c.laz"]);
    assert_eq!(found(&[root.join("*.la[sz]")]), ["b.las", "c.laz"]);
    assert_eq!(found(&[files[2].clone(), files[0].clone()]), ["c.laz", "b.las"], "the order given");
    let error = |arguments: &[PathBuf]| outcome(&open(arguments));
    assert!(error(&[]).starts_with("NothingFound"));
    assert!(error(&[root.join("*.xyz")]).starts_with("NothingFound"));
    assert!(error(&[root.join("deeper.las")]).starts_with("NothingFound"));
    assert!(error(&[root.join("[")]).starts_with("Pattern"));
    assert!(error(&[root.join("missing.las")]).starts_with("Read"));
    assert!(error(&[files[0].clone(), root.join(".").join("b.las")]).starts_with("Duplicate"));
    assert!(error(&[root.to_owned(), files[0].clone()]).starts_with("Duplicate"));
}

#[test]
fn points_of_all_files_have_one_numbering_and_one_lattice() {
    let folder = Folder::new();
    let mut fine = sample(LAS);
    put(&mut fine, 131, &0.0001_f64.to_le_bytes());
    let files =
        [folder.file("a.las", &sample(LAS)), folder.file("b.laz", &sample(LAZ)), folder.file("c.las", &fine)];
    let catalog = open(&files).expect("opens");
    assert_eq!([0, 1, 2].map(|file| catalog.first_id(file).number()), [0, 10_310, 82_151]);
    assert_eq!(catalog.point_count(), 92_461);
    assert_eq!(catalog.lattice(), Lattice::TENTH_MILLIMETRE);
    assert_eq!(open(&files[..2]).expect("opens").lattice(), Lattice::MILLIMETRE);
}

#[test]
fn feet_become_metres_in_the_lattice() {
    let folder = Folder::new();
    let path = folder.file("a.las", &sample(LAS));
    let lattice_point = |unit| {
        let catalog = Catalog::open(std::slice::from_ref(&path), &InputOptions { mmap: true, unit });
        let catalog = catalog.expect("opens");
        let mut buffer = Vec::new();
        let records = catalog.files()[0].records(0, Fields::All, &mut buffer).expect("readable");
        let transform: &LatticeTransform = catalog.files()[0].transform();
        (transform.apply(record_xyz(records)), catalog.lattice(), catalog.warnings().len())
    };
    let (metres, lattice, quiet) = lattice_point(LengthUnit::Metre);
    let (feet, fine, warned) = lattice_point(LengthUnit::Foot);
    assert_eq!((quiet, warned), (0, 1));
    for axis in 0..3 {
        let metres = lattice.metres(metres[axis]);
        let feet = fine.metres(feet[axis]);
        assert!((feet - metres * 0.3048).abs() <= fine.step_m(), "axis {axis}: {feet} {metres}");
    }
}

#[test]
fn blocks_may_be_read_on_any_thread_in_any_order() {
    let folder = Folder::new();
    let catalog =
        open(&[folder.file("a.laz", &sample(LAZ)), folder.file("b.las", &sample(LAS))]).expect("opens");
    for file in catalog.files() {
        let read = |block: usize| {
            let mut buffer = Vec::new();
            file.records(block, Fields::All, &mut buffer).expect("readable").to_vec()
        };
        let blocks = file.blocks().len();
        let one_by_one: Vec<Vec<u8>> = (0..blocks).map(read).collect();
        let together: Vec<Vec<u8>> =
            (0..4 * blocks).into_par_iter().rev().map(|at| read(at % blocks)).collect();
        for (index, records) in together.iter().rev().enumerate() {
            assert!(*records == one_by_one[index % blocks], "{}: block {}", file.name(), index % blocks);
        }
    }
}

/// A file with the sample's points and a well-known text.
fn with_wkt(wkt: &str) -> Vec<u8> {
    with_record(2112, wkt.as_bytes())
}

/// A file with the sample's points and a record about the coordinate system.
fn with_record(id: u16, payload: &[u8]) -> Vec<u8> {
    let bytes = sample(LAS);
    let start = u32::from_le_bytes(bytes[96..100].try_into().expect("four bytes"));
    let mut record = vec![0; 54];
    put(&mut record, 2, b"LASF_Projection");
    put(&mut record, 18, &id.to_le_bytes());
    put(&mut record, 20, &u16::try_from(payload.len()).expect("short").to_le_bytes());
    record.extend_from_slice(payload);
    let mut new = bytes[..227].to_vec();
    put(&mut new, 96, &(start + u32::try_from(record.len()).expect("short")).to_le_bytes());
    let count = u32::from_le_bytes(bytes[100..104].try_into().expect("four bytes"));
    put(&mut new, 100, &(count + 1).to_le_bytes());
    new.extend(record);
    new.extend_from_slice(&bytes[227..]);
    new
}

#[test]
fn coordinate_systems_of_one_drive_must_agree() {
    let utm = |zone: u32| {
        with_wkt(&format!(
            "PROJCS[\"zone {zone}\",UNIT[\"metre\",1],AUTHORITY[\"EPSG\",\"{}\"]]",
            25_800 + zone
        ))
    };
    let folder = Folder::new();
    let one = folder.file("a.las", &utm(32));
    // Files with equal points get a warning of their own, so the last x of these differs.
    let with_end = |mut bytes: Vec<u8>, bit: u8| {
        let last = bytes.len() - 28;
        bytes[last] ^= bit;
        bytes
    };
    let two = folder.file("b.las", &with_end(utm(32), 1));
    let other = folder.file("c.las", &utm(33));
    let plain = folder.file("d.las", &with_end(sample(LAS), 2));
    let catalog = open(&[one.clone(), two]).expect("the same system");
    assert_eq!(catalog.crs().epsg, Some(25_832));
    assert!(catalog.warnings().is_empty(), "{:?}", catalog.warnings());
    let text = outcome(&open(&[one.clone(), other]));
    assert!(text.starts_with("CrsDiffers") && text.contains("zone 33 (EPSG:25833)"), "{text}");
    // A file without points has no coordinates, so its system does not count.
    let mut empty = counting(LAS, 0);
    empty.truncate(227);
    let empty = folder.file("e.las", &empty);
    let catalog = open(&[plain, empty, one]).expect("one without a system");
    assert_eq!(catalog.crs().epsg, Some(25_832));
    let warnings = catalog.warnings();
    assert_eq!(warnings.len(), 2, "{warnings:?}");
    assert!(
        warnings[1].starts_with("1 of 2 files does not name a coordinate reference system"),
        "{warnings:?}"
    );
    let degrees = folder.file("f.las", &with_wkt("GEOGCS[\"WGS 84\",UNIT[\"degree\",0.0174]]"));
    let stated = InputOptions { unit: LengthUnit::Metre, ..InputOptions::default() };
    Catalog::open(&[degrees], &stated).expect("a stated unit overrides the record");
}

/// A transverse Mercator projection without a code.
fn nameless(meridian: u32, end: &str) -> String {
    format!(
        "PROJCS[\"site\",GEOGCS[\"g\",DATUM[\"d\",SPHEROID[\"s\",6378137,298.257222101]],PRIMEM[\"Greenwich\",0],\
         UNIT[\"degree\",0.0174532925199433]],PROJECTION[\"Transverse_Mercator\"],PARAMETER[\"latitude_of_origin\",0],\
         PARAMETER[\"central_meridian\",{meridian}],PARAMETER[\"scale_factor\",0.9996],\
         PARAMETER[\"false_easting\",500000],PARAMETER[\"false_northing\",0],UNIT[\"metre\",1]{end}]"
    )
}

#[test]
fn systems_without_a_code_must_agree_in_their_numbers() {
    let folder = Folder::new();
    let file = |name: &str, text: &str| folder.file(name, &with_wkt(text));
    let nine = file("a.las", &nameless(9, ""));
    let fifteen = file("b.las", &nameless(15, ""));
    let by_code = file("c.las", "PROJCS[\"UTM 32\",UNIT[\"metre\",1],AUTHORITY[\"EPSG\",\"25832\"]]");
    let unreadable = file("d.las", "PROJCS[\"another\",UNIT[\"metre\",1]]");
    let text = outcome(&open(&[nine.clone(), fifteen.clone()]));
    assert!(text.starts_with("CrsDiffers"), "{text}");
    // The texts of these files have no numbers of a projection to compare.
    for other in [&by_code, &unreadable] {
        open(&[nine.clone(), other.clone()]).expect("nothing contradicts");
        open(&[other.clone(), nine.clone()]).expect("nothing contradicts");
    }
    let full = file("e.las", &nameless(15, ",AUTHORITY[\"EPSG\",\"25833\"]"));
    let text = outcome(&open(&[full.clone(), nine]));
    assert!(text.starts_with("CrsDiffers"), "{text}");
    open(&[full, fifteen]).expect("the same numbers");
}

#[test]
fn a_code_that_nobody_knows_is_not_named() {
    let text = nameless(9, ",AUTHORITY[\"EPSG\",\"99999\"]");
    let catalog = open_bytes(&with_wkt(&text)).expect("accepted");
    assert_eq!(catalog.crs().epsg, None);
    let warnings = catalog.warnings().join("\n");
    assert!(warnings.starts_with("a.las: EPSG:99999 is not known"), "{warnings}");
    // Other programs look up a code in the text as well, so the text must not have one.
    assert_eq!(catalog.crs().text(), Some(nameless(9, "").as_str()));
    // The code of a system in metres, but coordinates in feet.
    let feet = nameless(9, ",AUTHORITY[\"EPSG\",\"25832\"]").replace("\"metre\",1", "\"foot\",0.3048");
    let catalog = open_bytes(&with_wkt(&feet)).expect("accepted");
    assert_eq!(catalog.crs().text(), Some(feet.replace(",AUTHORITY[\"EPSG\",\"25832\"]", "").as_str()));
}

#[cfg(unix)]
#[test]
fn a_link_and_its_file_are_named_both() {
    let folder = Folder::new();
    let file = folder.file("a.las", &sample(LAS));
    let link = folder.0.path().join("link.las");
    std::os::unix::fs::symlink(&file, &link).expect("a link");
    let text = outcome(&open(&[file, link]));
    assert!(
        text.starts_with("SameFile")
            && text.contains("link.las and ")
            && text.ends_with("a.las are the same file")
    );
}

#[test]
fn a_file_that_changes_is_noticed() {
    let folder = Folder::new();
    let path = folder.file("a.las", &sample(LAS));
    let catalog = open(std::slice::from_ref(&path)).expect("opens");
    let file = &catalog.files()[0];
    file.check_unchanged().expect("nobody changed it");
    let mut longer = sample(LAS);
    longer.push(0);
    std::fs::write(&path, longer).expect("written");
    let text = outcome(&file.check_unchanged().map(|()| open(&[]).expect("never")));
    assert!(text.starts_with("Changed"), "{text}");
    std::fs::remove_file(&path).expect("removed");
    assert!(matches!(file.check_unchanged(), Err(InputError::Read { .. })));
}

#[test]
fn a_system_that_is_not_understood_is_told_and_its_text_is_kept() {
    let folder = Folder::new();
    let text = "PROJCS[\"of the site\",UNIT[\"metre\",1]";
    let cut = folder.file("cut.las", &with_wkt(text));
    let catalog = open(std::slice::from_ref(&cut)).expect("accepted");
    let crs = catalog.crs();
    assert_eq!(crs.description, "given but not understood (coordinates are taken as metres)");
    assert_eq!((crs.is_known(), crs.epsg, crs.text()), (false, None, Some(text)));
    let told = |catalog: &Catalog| {
        let texts = catalog.warnings().iter();
        texts.filter(|text| text.contains("given but not understood (well-known text)")).count()
    };
    assert_eq!(told(&catalog), 1, "{:?}", catalog.warnings());
    assert!(!catalog.warnings()[0].contains("  "), "{:?}", catalog.warnings());
    let options = InputOptions { unit: LengthUnit::Foot, ..InputOptions::default() };
    let in_feet = Catalog::open(std::slice::from_ref(&cut), &options).expect("accepted");
    assert_eq!(in_feet.crs().description, "given but not understood (input.unit is foot)");
    // Another file of the drive has a system that is understood, and it is that of all.
    let right = folder.file("right.las", &with_wkt("PROJCS[\"of the site\",UNIT[\"metre\",1]]"));
    let both = open(&[cut, right]).expect("accepted");
    assert_eq!((both.crs().description.as_str(), told(&both)), ("of the site", 1));
    // Keys that promise more than they have.
    let keys: Vec<u8> = [1_u16, 1, 0, 9].iter().flat_map(|word| word.to_le_bytes()).collect();
    let keys = with_record(34_735, &keys);
    let catalog = open_bytes(&keys).expect("accepted");
    assert!(catalog.crs().description.starts_with("given but not understood"), "{:?}", catalog.crs());
    assert!(catalog.warnings()[0].contains("(GeoTIFF keys)"), "{:?}", catalog.warnings());
}

/// Units of x and y and of heights in metres, and the text for outputs.
fn units_and_text(bytes: &[u8]) -> ([f64; 2], String) {
    let catalog = open_bytes(bytes).expect("accepted");
    let crs = catalog.crs();
    ([crs.horizontal_unit_m, crs.vertical_unit_m], crs.text().expect("a text").to_owned())
}

#[test]
fn heights_that_only_keys_describe_are_in_the_text_for_outputs() {
    let survey_foot = 1_200.0 / 3_937.0;
    let keys = |keys: &[(u16, u16)]| {
        let count = u16::try_from(keys.len()).expect("few");
        let words =
            [1, 1, 0, count].into_iter().chain(keys.iter().flat_map(|(id, value)| [*id, 0, 1, *value]));
        with_record(34_735, &words.flat_map(u16::to_le_bytes).collect::<Vec<u8>>())
    };
    for (entries, units_m, part) in [
        // UTM 18 in metres with NAVD88 in US survey feet, by code and unit, and by unit alone.
        (vec![(3072, 26_918), (4096, 6360), (4099, 9003)], [1.0, survey_foot], "\"NAVD88 height (ftUS)\""),
        (vec![(3072, 26_918), (4099, 9003)], [1.0, survey_foot], "\"unknown\""),
        // New York in US survey feet with NAVD88 in metres.
        (vec![(3072, 2263), (4096, 5703), (4099, 9001)], [survey_foot, 1.0], "\"NAVD88 height\""),
        (vec![(3072, 25_832), (4096, 7837)], [1.0, 1.0], "\"EPSG:7837\""),
    ] {
        let (found, text) = units_and_text(&keys(&entries));
        let agree = |found: [f64; 2]| found.iter().zip(units_m).all(|(a, b)| (a / b - 1.0).abs() < 1e-9);
        assert!(agree(found), "{entries:?}: {found:?}");
        assert!(text.starts_with("COMPD_CS[") && text.contains(&format!("VERT_CS[{part}")), "{text}");
        let (again, same) = units_and_text(&with_wkt(&text));
        assert!(agree(again) && same == text, "{again:?} {same}");
    }
    let (_, plane) = units_and_text(&keys(&[(3072, 25_832)]));
    assert!(plane.starts_with("PROJCS["), "{plane}");
}

#[test]
fn a_compound_system_has_its_own_code_and_not_that_of_its_horizontal_part() {
    let plane = "PROJCS[\"UTM 32\",UNIT[\"metre\",1],AUTHORITY[\"EPSG\",\"25832\"]]";
    let compound = |end: &str| {
        with_wkt(&format!("COMPD_CS[\"UTM 32 + v\",{plane},VERT_CS[\"v\",UNIT[\"metre\",1]]{end}]"))
    };
    for (bytes, description, code) in [
        (with_wkt(plane), "UTM 32 (EPSG:25832)", Some(25_832)),
        (compound(",AUTHORITY[\"EPSG\",\"5555\"]"), "UTM 32 + v (EPSG:5555)", Some(5_555)),
        (compound(""), "UTM 32 + v", None),
    ] {
        let catalog = open_bytes(&bytes).expect("accepted");
        let crs = catalog.crs();
        assert_eq!((crs.description.as_str(), crs.epsg, crs.text_epsg()), (description, Some(25_832), code));
    }
}

/// From byte 179 on, a header has the largest and the smallest x, then those of y and z.
#[test]
fn boxes_that_no_points_can_have_are_named_with_their_numbers() {
    let folder = Folder::new();
    let with = |name: &str, ends: &[(usize, f64)]| {
        let mut bytes = sample(LAS);
        ends.iter().for_each(|(at, value)| put(&mut bytes, 179 + 8 * at, &value.to_le_bytes()));
        folder.file(name, &bytes)
    };
    let warned = |paths: &[PathBuf]| -> Vec<String> {
        let catalog = open(paths).expect("a box is no reason to refuse a file");
        catalog.warnings().iter().filter(|text| text.contains("which is impossible")).cloned().collect()
    };
    assert_eq!(warned(&[with("right.las", &[])]), [""; 0]);
    for (name, ends, numbers) in [
        ("nan.las", vec![(0, f64::NAN), (3, f64::NAN)], [" to NaN, ", "y NaN to "]),
        ("far.las", vec![(2, 1e12)], ["y ", " to 1000000000000.00"]),
        ("turned.las", vec![(4, -1e5), (5, 1e5)], ["z 100000.00 to -100000.00", "z "]),
    ] {
        let found = warned(&[with(name, &ends)]);
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].starts_with(name), "{found:?}");
        assert!(numbers.iter().all(|number| found[0].contains(number)), "{found:?}");
    }
    // Many files are counted, and not named.
    let many: Vec<PathBuf> = (0..9).map(|k| with(&format!("{k}.las"), &[(2, 1e12 + f64::from(k))])).collect();
    assert_eq!(warned(&many).len(), 5);
    let catalog = open(&many).expect("opens");
    let rest: Vec<&String> = catalog.warnings().iter().filter(|text| text.contains("same way")).collect();
    assert_eq!(rest, ["the headers of 4 more files are wrong in the same way"]);
}

#[test]
fn a_scan_that_is_given_twice_is_named() {
    let folder = Folder::new();
    let warned = |paths: &[PathBuf]| -> Vec<String> {
        let catalog = open(paths).expect("opens");
        let is_meant =
            |text: &&String| text.contains("the points of another") || text.contains("the same points");
        catalog.warnings().iter().filter(is_meant).cloned().collect()
    };
    let whole = sample(LAS);
    let start = u32::from_le_bytes(whole[96..100].try_into().expect("four bytes")) as usize;
    let first = folder.file("a.las", &whole);
    let found = warned(&[first.clone(), folder.file("b.las", &whole)]);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].contains("a.las and ") && found[0].contains("b.las have the same points"), "{found:?}");
    // The coding is another, the points are the same.
    let points: Vec<Point> = (0..5_000).map(|k| Point::at([k, 2 * k, k % 7])).collect();
    let both = ["c.las", "c.laz"].map(|name| folder.0.path().join(name));
    both.iter().for_each(|path| Shape::default().write_in_chunks(path, &points, 700));
    assert_eq!(warned(&both).len(), 1);
    // Equal headers with other points are no copy.
    let mut other = whole.clone();
    other[start + 20 * 28] ^= 1;
    assert_eq!(warned(&[first, folder.file("other.las", &other)]), [""; 0]);
    // Many copies are counted, and not named.
    let many: Vec<PathBuf> = (0..70).map(|k| folder.file(&format!("{k:02}.las"), &whole)).collect();
    let found = warned(&many);
    assert_eq!(found.len(), 7, "{found:?}");
    assert!(found.iter().any(|text| text == "58 more files have the points of another file"), "{found:?}");
    assert!(found.iter().any(|text| text.starts_with("6 more files may have the points")), "{found:?}");
}

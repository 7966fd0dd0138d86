//! Tables of compressed chunks: written in all the ways of existing writers, missing, and wrong.

use std::io::Cursor;
use std::path::Path;

use chainage::input::{Catalog, Fields, InputError, InputOptions};
use laz::{LasZipCompressor, LazVlr, LazVlrBuilder};

/// A compressed file made from the records of a sample, together with these records.
struct Made {
    bytes: Vec<u8>,
    records: Vec<u8>,
    points_start: usize,
    /// Position of the table of chunks.
    table: usize,
}

/// Records per chunk.
const CHUNK: u32 = 1_000;
/// Number of points used.
const POINTS: usize = 3_500;

/// Compresses the first points of the samples: point format 1 (one point after the other) or 6 (layers).
fn make(layered: bool, variable: bool) -> Made {
    let name = if layered { "tree_road_sweep.laz" } else { "mls_profiles.las" };
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name);
    let catalog = Catalog::open(std::slice::from_ref(&path), &InputOptions::default()).expect("opens");
    let file = &catalog.files()[0];
    let mut buffer = Vec::new();
    let size = file.layout().record_len;
    let records = file.records(0, Fields::All, &mut buffer).expect("readable")[..POINTS * size].to_vec();
    let head = if layered { 375 } else { 227 };
    let mut bytes = std::fs::read(&path).expect("read")[..head].to_vec();
    let builder = LazVlrBuilder::default()
        .with_point_format(
            file.layout().point_format,
            u16::try_from(size - file.layout().base_len).expect("few"),
        )
        .expect("a known format");
    let vlr = match variable {
        true => builder.with_variable_chunk_size().build(),
        false => builder.with_fixed_chunk_size(CHUNK).build(),
    };
    let mut payload = Vec::new();
    vlr.write_to(&mut payload).expect("written");
    let mut record = vec![0; 54];
    put(&mut record, 2, LazVlr::USER_ID.as_bytes());
    put(&mut record, 18, &LazVlr::RECORD_ID.to_le_bytes());
    put(&mut record, 20, &u16::try_from(payload.len()).expect("short").to_le_bytes());
    bytes.extend(record);
    bytes.extend(payload);
    let points_start = bytes.len();
    put(&mut bytes, 96, &u32::try_from(points_start).expect("short").to_le_bytes());
    put(&mut bytes, 100, &1_u32.to_le_bytes());
    put(&mut bytes, 104, &[file.layout().point_format | 0x80]);
    let legacy = if layered { 0 } else { u32::try_from(POINTS).expect("few") };
    put(&mut bytes, 107, &legacy.to_le_bytes());
    if layered {
        put(&mut bytes, 235, &[0; 12]);
        put(&mut bytes, 247, &(POINTS as u64).to_le_bytes());
    }
    let mut out = Cursor::new(bytes);
    out.set_position(points_start as u64);
    let mut compressor = LasZipCompressor::new(out, vlr).expect("a compressor");
    for chunk in records.chunks(CHUNK as usize * size) {
        compressor.compress_many(chunk).expect("compressed");
        // `done` finishes the last chunk.
        if variable && chunk.len() == CHUNK as usize * size {
            compressor.finish_current_chunk().expect("compressed");
        }
    }
    compressor.done().expect("compressed");
    let bytes = compressor.into_inner().into_inner();
    let table =
        usize::try_from(i64::from_le_bytes(bytes[points_start..points_start + 8].try_into().expect("eight")));
    Made { bytes, records, points_start, table: table.expect("a position") }
}

fn put(bytes: &mut [u8], at: usize, value: &[u8]) {
    bytes[at..at + value.len()].copy_from_slice(value);
}

/// The records of the file and the number of warnings.
fn read(bytes: &[u8]) -> Result<(Vec<u8>, usize), InputError> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.laz");
    std::fs::write(&path, bytes).expect("written");
    let mut all = Vec::new();
    let mut warnings = 0;
    for mmap in [true, false] {
        let catalog =
            Catalog::open(std::slice::from_ref(&path), &InputOptions { mmap, ..InputOptions::default() })?;
        let file = &catalog.files()[0];
        assert_eq!(file.blocks().len(), 4);
        all.clear();
        for block in 0..file.blocks().len() {
            let mut buffer = Vec::new();
            all.extend_from_slice(file.records(block, Fields::All, &mut buffer)?);
        }
        warnings = catalog.warnings().len();
    }
    Ok((all, warnings))
}

fn problem(bytes: &[u8]) -> String {
    match read(bytes).expect_err("refused") {
        InputError::ChunkTable { problem, .. } => format!("{problem:?}"),
        error @ InputError::Chunk { .. } => error.to_string(),
        error => panic!("{error:?}"),
    }
}

const KINDS: [(bool, bool); 4] = [(false, false), (false, true), (true, false), (true, true)];

#[test]
fn tables_at_their_place_or_named_at_the_end_are_found() {
    for (layered, variable) in KINDS {
        let made = make(layered, variable);
        let (records, warnings) = read(&made.bytes).expect("reads");
        assert!(records == made.records, "layered {layered}, variable {variable}");
        assert_eq!(warnings, 0);
        let mut late = made.bytes.clone();
        put(&mut late, made.points_start, &(-1_i64).to_le_bytes());
        late.extend((made.table as u64).to_le_bytes());
        let (records, warnings) = read(&late).expect("reads");
        assert!(records == made.records, "position at the end: layered {layered}, variable {variable}");
        assert_eq!(warnings, 0);
    }
}

#[test]
fn without_a_table_the_chunks_are_searched_where_that_is_possible() {
    for (layered, variable) in KINDS {
        let mut made = make(layered, variable);
        made.bytes.truncate(made.table);
        put(&mut made.bytes, made.points_start, &(-1_i64).to_le_bytes());
        if variable && !layered {
            // There is no information about the end of a chunk.
            assert_eq!(problem(&made.bytes), "Missing { promised: 3500, found: 0 }");
            continue;
        }
        let (records, warnings) = read(&made.bytes).expect("reads");
        assert!(records == made.records, "layered {layered}, variable {variable}");
        assert_eq!(warnings, 1);
        // A file that was truncated while it was written has no table either.
        made.bytes.truncate(made.bytes.len() - 10);
        assert_eq!(problem(&made.bytes), "Missing { promised: 3500, found: 3000 }");
    }
}

#[test]
fn chunks_beyond_the_count_are_noticed() {
    for (layered, variable) in KINDS {
        let made = make(layered, variable);
        let counting = |count: u64| {
            let mut bytes = made.bytes.clone();
            let (at, length) = if layered { (247, 8) } else { (107, 4) };
            put(&mut bytes, at, &count.to_le_bytes()[..length]);
            bytes
        };
        // By the table.
        let present = if variable { 3_500 } else { 4_000 };
        assert_eq!(problem(&counting(2_500)), format!("Points {{ promised: 2500, present: {present} }}"));
        let points = if variable { "3500" } else { "up to 4000" };
        let none = read(&counting(0)).expect_err("refused").to_string();
        assert!(none.ends_with(&format!("has 4 compressed chunks with {points} points")), "{none}");
        // Files without a table, as a recorder that was stopped leaves them.
        let stopped = |count: u64| {
            let mut bytes = counting(count);
            bytes.truncate(made.table);
            put(&mut bytes, made.points_start, &(-1_i64).to_le_bytes());
            bytes
        };
        let bytes = made.table - made.points_start - 8;
        let none = read(&stopped(0)).expect_err("refused").to_string();
        assert!(none.ends_with(&format!("has {bytes} bytes of compressed points")), "{none}");
        if variable && !layered {
            continue;
        }
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.laz");
        std::fs::write(&path, stopped(2_000)).expect("written");
        let catalog = Catalog::open(&[path], &InputOptions::default()).expect("opens");
        assert_eq!(catalog.point_count(), 2_000);
        let text = catalog.warnings().join("\n");
        let expected = "the header promises 2000 points, but ";
        assert!(text.contains(expected) && text.contains("more bytes follow their chunks"), "{text}");
    }
}

#[test]
fn a_count_that_the_last_chunk_does_not_have_is_noticed() {
    for layered in [false, true] {
        let made = make(layered, false);
        for count in [3_001_u64, 3_400, 3_499, 3_501, 3_600, 4_000] {
            let mut bytes = made.bytes.clone();
            let (at, length) = if layered { (247, 8) } else { (107, 4) };
            put(&mut bytes, at, &count.to_le_bytes()[..length]);
            let text = problem(&bytes);
            let chunk = format!("chunk 3 (points 3000 to {}) cannot be decoded: ", count - 1);
            assert!(text.contains(&chunk), "{text}");
            let promised = count - 3_000;
            let reason = match (layered, count < POINTS as u64) {
                (true, _) => {
                    format!("says that it has 500 points, but the header and the table promise {promised}")
                }
                (false, true) => format!("the {promised} points that the header and the table promise take "),
                (false, false) => "damaged data".to_owned(),
            };
            assert!(text.contains(&reason), "{text}");
        }
    }
}

#[test]
fn an_empty_table_counts_as_none() {
    let mut made = make(true, false);
    put(&mut made.bytes, made.table + 4, &[0; 4]);
    let (records, warnings) = read(&made.bytes).expect("reads");
    assert!(records == made.records);
    assert_eq!(warnings, 1);
}

#[test]
fn wrong_tables_are_refused_before_anything_is_allocated_for_them() {
    for (layered, variable) in KINDS {
        let made = make(layered, variable);
        let changed = |at: usize, value: &[u8]| {
            let mut bytes = made.bytes.clone();
            put(&mut bytes, at, value);
            problem(&bytes)
        };
        assert!(changed(made.table + 4, &u32::MAX.to_le_bytes()).starts_with("TooMany { chunks: 4294967295"));
        assert_eq!(changed(made.table, &[1]), "Version { version: 1 }");
        let size = made.bytes.len();
        let far = changed(made.points_start, &(size as u64 * 2).to_le_bytes());
        assert_eq!(far, format!("Outside {{ offset: {}, size: {size} }}", size * 2));
        let count = if layered { 247 } else { 107 };
        let more = changed(count, &4_001_u32.to_le_bytes());
        let present = if variable { 3_500 } else { 4_000 };
        assert_eq!(more, format!("Points {{ promised: 4001, present: {present} }}"));
        let mut cut = made.bytes.clone();
        cut.truncate(made.table + 9);
        assert!(problem(&cut).starts_with("Damaged"), "layered {layered}, variable {variable}");
    }
}

#[test]
fn a_chunk_that_cannot_hold_its_points_is_refused() {
    let mut made = make(true, false);
    // One chunk of 2^31 points: the record says so, and the header agrees.
    let record = made.points_start - 34 - 6 - usize::from(made.records.len() / POINTS > 30) * 6;
    put(&mut made.bytes, record + 12, &(1_u32 << 31).to_le_bytes());
    put(&mut made.bytes, 247, &(4_u64 << 31).to_le_bytes());
    assert!(problem(&made.bytes).starts_with("Dense { chunk: 0, points: 2147483648"));
}

#[test]
fn layers_larger_than_their_chunk_are_refused_with_chunk_and_records() {
    let mut made = make(true, false);
    let size = made.records.len() / POINTS;
    // The chunk begins with a record and the number of points. The sizes of the layers follow.
    put(&mut made.bytes, made.points_start + 8 + size + 4, &u32::MAX.to_le_bytes());
    let text = problem(&made.bytes);
    assert!(text.contains("chunk 0 (points 0 to 999) cannot be decoded: its layers need 42949"), "{text}");
}

//! Damaged files: whatever bytes are removed or changed, reading ends quickly and in bounded memory, with
//! points or with an error.
//!
//! Every file of the conformance folder and of the shipped samples is truncated and changed at seeded random
//! places. The rounds run in a child process with a memory limit, because an allocation of a damaged size
//! must fail the test. `CHAINAGE_DAMAGE_ROUNDS` sets the number of rounds per file and kind (default 2).

use std::fs::{File, OpenOptions};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use chainage::input::{Catalog, Fields, InputOptions, LengthUnit};
use chainage::output::{LabelOptions, LabelledFile, OutputFormat};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::util;

/// Address space of the child in KiB: program, stacks, mapped file and all allocations.
const MEMORY_KIB: u32 = 512 << 10;
/// Longest time for one damaged file.
const PATIENCE: Duration = Duration::from_secs(10);

fn rounds() -> u32 {
    std::env::var("CHAINAGE_DAMAGE_ROUNDS").map_or(2, |text| text.parse().expect("a number of rounds"))
}

#[test]
#[cfg(unix)]
fn damaged_files_give_points_or_an_error_soon_and_in_bounded_memory() {
    let program = std::env::current_exe().expect("this program");
    let outcome = std::process::Command::new("sh")
        .args(["-c", &format!("ulimit -v {MEMORY_KIB}; exec \"$0\" \"$@\"")])
        .arg(program)
        .args(["damage::rounds_of_the_child", "--exact", "--ignored", "--nocapture", "--test-threads=1"])
        .output()
        .expect("a shell");
    let text = String::from_utf8_lossy(&outcome.stdout);
    let last = text.lines().rev().take(12).collect::<Vec<_>>();
    let errors = String::from_utf8_lossy(&outcome.stderr);
    assert!(outcome.status.success(), "{}\n{errors}", last.into_iter().rev().collect::<Vec<_>>().join("\n"));
    println!("{}", text.lines().filter(|line| line.starts_with("damage:")).collect::<Vec<_>>().join("\n"));
}

#[test]
#[ignore = "run by the test above, with limited memory"]
fn rounds_of_the_child() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut files = util::las_files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data"));
    if let Some(data) = util::shared_data() {
        files.extend(util::las_files(&data.join("conformance")));
    }
    let mut tally = Tally::default();
    for (index, path) in files.iter().enumerate() {
        println!("{}", path.display());
        let mut bench = Bench::new(path, folder.path(), index as u64);
        for round in 0..rounds() {
            bench.cut(round, &mut tally);
            bench.flip(round, &mut tally);
        }
    }
    println!(
        "damage: {} damaged files, {} readable all the same, {} refused at opening, {} with a damaged block, \
         slowest {:.2} s ({})",
        tally.cases,
        tally.read,
        tally.refused,
        tally.broken,
        tally.slowest.as_secs_f64(),
        tally.slowest_case
    );
}

#[derive(Default)]
struct Tally {
    cases: u32,
    read: u32,
    refused: u32,
    broken: u32,
    slowest: Duration,
    slowest_case: String,
}

/// A copy of one file, which is damaged and repaired in place.
struct Bench {
    copy: PathBuf,
    original: Vec<u8>,
    random: ChaCha8Rng,
}

impl Bench {
    fn new(path: &Path, folder: &Path, seed: u64) -> Self {
        let original = std::fs::read(path).expect("readable");
        let copy = folder.join(path.file_name().expect("a name"));
        std::fs::write(&copy, &original).expect("written");
        Self { copy, original, random: ChaCha8Rng::seed_from_u64(seed) }
    }

    fn file(&self) -> File {
        OpenOptions::new().write(true).open(&self.copy).expect("the copy")
    }

    fn put(&self, start: usize, bytes: &[u8]) {
        let mut file = self.file();
        file.seek(SeekFrom::Start(start as u64)).expect("inside");
        file.write_all(bytes).expect("written");
    }

    /// A place to damage: half of the places are in the description of the points (start and end of the
    /// file), half anywhere.
    fn place(&mut self) -> usize {
        let size = self.original.len();
        let start = u32::from_le_bytes(self.original[96..100].try_into().expect("four bytes")) as usize;
        match self.random.random_range(0..8) {
            0..=1 => self.random.random_range(0..size.min(375)),
            2..=3 => self.random.random_range(0..size.min(start.min(size) + 100)),
            4 => self.random.random_range(size.saturating_sub(400)..size),
            _ => self.random.random_range(0..size),
        }
    }

    fn cut(&mut self, round: u32, tally: &mut Tally) {
        let size = self.place();
        self.file().set_len(size as u64).expect("cut");
        self.attempt(round, &format!("cut to {size} bytes"), tally);
        self.put(size, &self.original[size..]);
    }

    fn flip(&mut self, round: u32, tally: &mut Tally) {
        let count = self.random.random_range(1..=4);
        let changes: Vec<(usize, u8)> = (0..count).map(|_| (self.place(), self.value())).collect();
        changes.iter().for_each(|(at, value)| self.put(*at, &[*value]));
        self.attempt(round, &format!("(byte, value) {changes:?}"), tally);
        changes.iter().for_each(|(at, _)| self.put(*at, &self.original[*at..=*at]));
    }

    fn value(&mut self) -> u8 {
        match self.random.random_range(0..4) {
            0 => 0,
            1 => 0xff,
            _ => self.random.random(),
        }
    }

    fn attempt(&self, round: u32, damage: &str, tally: &mut Tally) {
        println!("  {damage}");
        let before = Instant::now();
        let options = InputOptions { mmap: round.is_multiple_of(2), unit: LengthUnit::Metre };
        tally.cases += 1;
        match Catalog::open(std::slice::from_ref(&self.copy), &options) {
            Err(error) => {
                assert!(!error.to_string().is_empty());
                tally.refused += 1;
            }
            Ok(catalog) if read_blocks(&catalog) => {
                plan_copies(&catalog);
                tally.read += 1;
            }
            Ok(_) => tally.broken += 1,
        }
        let took = before.elapsed();
        assert!(took < PATIENCE, "{} {damage} took {took:?}", self.copy.display());
        if took > tally.slowest {
            tally.slowest = took;
            tally.slowest_case = format!("{} {damage}", self.copy.display());
        }
    }
}

/// Plans copies and writes everything around their points. This follows the damaged records of the header.
fn plan_copies(catalog: &Catalog) {
    let input = &catalog.files()[0];
    for format in [OutputFormat::Las, OutputFormat::Laz] {
        let options = LabelOptions { format, keep_original: true, ..LabelOptions::default() };
        if let Ok(plan) = LabelledFile::plan(input, &options) {
            plan.write_epilogue(input, &mut std::io::sink()).expect("the bytes are there");
        }
    }
}

/// Whether all blocks can be read.
fn read_blocks(catalog: &Catalog) -> bool {
    let file = &catalog.files()[0];
    let mut buffer = Vec::new();
    let mut good = true;
    for block in 0..file.blocks().len() {
        for fields in [Fields::All, Fields::Geometry] {
            match file.records(block, fields, &mut buffer) {
                Ok(records) => {
                    let expected = file.blocks()[block].count as usize * file.layout().record_len;
                    assert_eq!(records.len(), expected);
                }
                Err(_) => good = false,
            }
        }
        file.release(block);
    }
    good
}

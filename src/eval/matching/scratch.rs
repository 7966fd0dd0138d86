//! Scratch files. Points are partitioned into them by a hash of their key, so that one bucket at a time can
//! be sorted in memory.

use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use bytemuck::{Pod, Zeroable};

use crate::eval::error::EvalError;
use crate::model::PointId;
use crate::scratch_folder::{NoScratchFolder, ScratchFolder};

/// Number of entries that a bucket should have: 4 MiB. Every thread has four buckets in memory.
const BUCKET_ENTRIES: u64 = 1 << 18;
/// Maximum number of buckets. 250 million points have this many; more points have larger buckets.
const MAX_BUCKETS: u64 = 1024;
/// Number of entries that are collected before the file of a bucket is opened to append them: 32 KiB.
const FLUSH_ENTRIES: usize = 2048;

/// A point in a bucket, as one number that sorts by key, then by order of appearance: 56 bits of the hash of
/// the key, 40 bits of the index among the points of its side, 32 bits of the number of its label.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
#[repr(transparent)]
pub(super) struct Entry(u128);

/// Bits of the index, enough for 10^12 points.
const INDEX_BITS: u32 = 40;

#[expect(clippy::cast_possible_truncation, reason = "parts of a number are cut out of it")]
impl Entry {
    /// The entry of a point. It keeps the upper bits of `hash`; the lower 64 choose its bucket.
    pub(super) fn new(hash: u128, index: PointId, label: u32) -> Self {
        let index = u128::from(index.number() & ((1 << INDEX_BITS) - 1));
        Self((hash >> (32 + INDEX_BITS)) << (32 + INDEX_BITS) | index << 32 | u128::from(label))
    }

    /// The part of the hash of the key that the entry keeps.
    pub(super) fn key(&self) -> u64 {
        (self.0 >> (32 + INDEX_BITS)) as u64
    }

    /// Index among the points of its side.
    pub(super) fn index(self) -> PointId {
        PointId::new((self.0 >> 32) as u64 & ((1 << INDEX_BITS) - 1))
    }

    /// Number of its label.
    pub(super) fn label(self) -> u32 {
        self.0 as u32
    }
}

/// Entries grouped by one of their digits, and the end of each group. The value is kept, so that its memory
/// is reused.
#[derive(Debug, Default)]
struct ByDigit {
    entries: Vec<Entry>,
    ends: Vec<usize>,
}

impl ByDigit {
    /// Takes entries with their digits below `count`. Entries of one digit keep their order.
    fn fill<'e>(&mut self, count: usize, from: impl Iterator<Item = (usize, &'e Entry)> + Clone) {
        let Self { entries, ends } = self;
        ends.clear();
        ends.resize(count + 1, 0);
        from.clone().for_each(|(digit, _)| ends[digit + 1] += 1);
        (0..count).for_each(|digit| ends[digit + 1] += ends[digit]);
        entries.resize(ends[count], Entry::zeroed());
        for (digit, entry) in from {
            // The start of a group advances until it is the end of the group.
            entries[ends[digit]] = *entry;
            ends[digit] += 1;
        }
        ends.truncate(count);
    }

    /// The entries of every digit, in the order of the digits.
    fn groups(&mut self) -> impl Iterator<Item = &mut [Entry]> {
        let mut rest = &mut self.entries[..];
        let mut start = 0;
        self.ends.iter().map(move |&end| {
            let group = rest.split_off_mut(..end - start).unwrap_or_default();
            start = end;
            group
        })
    }
}

/// Entries that are not written to their buckets yet.
#[derive(Debug, Default)]
pub(super) struct Batch {
    buckets: Vec<u16>,
    entries: Vec<Entry>,
    by_bucket: ByDigit,
}

impl Batch {
    /// Adds an entry for a bucket.
    #[inline]
    pub(super) fn push(&mut self, bucket: u16, entry: Entry) {
        self.buckets.push(bucket);
        self.entries.push(entry);
    }
}

/// The sorted entries of a bucket.
#[derive(Debug, Default)]
pub(super) struct Taken {
    read: Vec<Entry>,
    by_key: ByDigit,
}

impl Taken {
    /// The entries by key and index.
    pub(super) fn entries(&self) -> &[Entry] {
        &self.by_key.entries
    }

    /// Sorts the entries that were read. Keys are hashes and spread evenly, so after grouping by a digit of
    /// few bits, few comparisons are left.
    fn sort(&mut self) {
        const DIGIT_BITS: u32 = 8;
        let digit = |entry: &Entry| (entry.0 >> (u128::BITS - DIGIT_BITS)) as usize;
        self.by_key.fill(1 << DIGIT_BITS, self.read.iter().map(|entry| (digit(entry), entry)));
        self.by_key.groups().for_each(<[Entry]>::sort_unstable);
    }
}

/// A new folder for the scratch files of a comparison.
///
/// # Errors
/// [`EvalError::Scratch`].
pub(super) fn folder(parent: &Path) -> Result<ScratchFolder, EvalError> {
    ScratchFolder::create(parent, "eval")
        .map_err(|NoScratchFolder { path, source }| EvalError::Scratch { path, source })
}

/// The buckets of one side.
#[derive(Debug)]
pub(super) struct Buckets<'a> {
    folder: &'a ScratchFolder,
    name: &'static str,
    waiting: Vec<Mutex<Vec<Entry>>>,
}

impl<'a> Buckets<'a> {
    /// Empty buckets for this number of points. The same number of points gives the same buckets.
    pub(super) fn new(folder: &'a ScratchFolder, name: &'static str, points: u64) -> Self {
        let count = points.div_ceil(BUCKET_ENTRIES).clamp(1, MAX_BUCKETS) as usize;
        Self { folder, name, waiting: (0..count).map(|_| Mutex::default()).collect() }
    }

    /// Number of buckets.
    pub(super) fn count(&self) -> usize {
        self.waiting.len()
    }

    /// The bucket of the points with this hash of their key.
    #[inline]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "half of a hash, and a remainder by the number of buckets"
    )]
    pub(super) fn of(&self, hash: u128) -> u16 {
        (hash as u64 % self.waiting.len() as u64) as u16
    }

    /// Moves the entries of a batch to their buckets.
    ///
    /// # Errors
    /// [`EvalError::Scratch`].
    pub(super) fn add(&self, batch: &mut Batch) -> Result<(), EvalError> {
        let Batch { buckets, entries, by_bucket } = batch;
        by_bucket.fill(self.waiting.len(), buckets.iter().map(|bucket| usize::from(*bucket)).zip(&*entries));
        buckets.clear();
        entries.clear();
        for (bucket, group) in by_bucket.groups().enumerate() {
            let mut waiting = self.waiting[bucket].lock().unwrap_or_else(PoisonError::into_inner);
            waiting.extend_from_slice(group);
            if waiting.len() >= FLUSH_ENTRIES {
                self.append(bucket, &waiting)?;
                waiting.clear();
            }
        }
        Ok(())
    }

    fn path(&self, bucket: usize) -> PathBuf {
        self.folder.join(&format!("{}-{bucket:04}", self.name))
    }

    fn append(&self, bucket: usize, entries: &[Entry]) -> Result<(), EvalError> {
        let path = self.path(bucket);
        OpenOptions::new()
            .append(true)
            .create(true)
            .open(&path)
            .and_then(|mut file| file.write_all(bytemuck::cast_slice(entries)))
            .map_err(|source| EvalError::Scratch { path, source })
    }

    /// Replaces the contents of `taken` with the sorted entries of a bucket, and removes the file of the
    /// bucket.
    ///
    /// # Errors
    /// [`EvalError::Scratch`].
    pub(super) fn take(&self, bucket: usize, taken: &mut Taken) -> Result<(), EvalError> {
        let path = self.path(bucket);
        let mut waiting = self.waiting[bucket].lock().unwrap_or_else(PoisonError::into_inner);
        taken.read.clear();
        match std::fs::File::open(&path) {
            Ok(file) => read_entries(file, &mut taken.read)
                .map_err(|source| EvalError::Scratch { path: path.clone(), source })?,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
            Err(source) => return Err(EvalError::Scratch { path, source }),
        }
        taken.read.append(&mut waiting);
        taken.sort();
        // This frees the space early. If it fails, the file is removed with the folder.
        let _ = std::fs::remove_file(&path);
        Ok(())
    }
}

fn read_entries(mut file: std::fs::File, entries: &mut Vec<Entry>) -> std::io::Result<()> {
    let bytes = file.metadata()?.len();
    entries.resize(usize::try_from(bytes).unwrap_or(usize::MAX) / size_of::<Entry>(), Entry::zeroed());
    std::io::Read::read_exact(&mut file, bytemuck::cast_slice_mut(entries))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_entry_holds_the_largest_values_and_sorts_by_key_then_index() {
        let index = PointId::new((1 << INDEX_BITS) - 1);
        let first = PointId::new(0);
        let entry = Entry::new(u128::MAX, index, u32::MAX);
        assert_eq!((entry.key(), entry.index(), entry.label()), ((1 << 56) - 1, index, u32::MAX));
        assert!(Entry::new(1 << 72, first, 0) > Entry::new(0, index, 9));
        assert!(Entry::new(0, first + 1, 0) > Entry::new(0, first, 9));
    }

    #[test]
    fn buckets_give_back_every_entry_and_the_folder_goes_away() {
        let parent = tempfile::tempdir().unwrap();
        let folder = folder(parent.path()).unwrap();
        let buckets = Buckets::new(&folder, "test", 3 * BUCKET_ENTRIES);
        let all: Vec<(u128, Entry)> = (0..10_000_u64)
            .map(|i| (u128::from(i.wrapping_mul(0x9e37_79b9_7f4a_7c15)) << 64 | u128::from(i * 7 % 1000), i))
            .map(|(hash, i)| (hash, Entry::new(hash, PointId::new(i), 1)))
            .collect();
        let mut batch = Batch::default();
        for part in all.chunks(3_000) {
            part.iter().for_each(|(hash, entry)| batch.push(buckets.of(*hash), *entry));
            buckets.add(&mut batch).unwrap();
        }
        assert_eq!(buckets.count(), 3);
        let mut found = Vec::new();
        let mut taken = Taken::default();
        for bucket in 0..3 {
            buckets.take(bucket, &mut taken).unwrap();
            assert!(taken.entries().len() > 3_000 && taken.entries().is_sorted());
            found.extend_from_slice(taken.entries());
        }
        found.sort_by_key(|entry| entry.index());
        assert!(found.iter().eq(all.iter().map(|(_, entry)| entry)));
        drop(folder);
        assert_eq!(parent.path().read_dir().unwrap().count(), 0);
    }

    #[test]
    fn a_folder_that_is_not_there_is_an_error() {
        let error = folder(Path::new("there/is/no/such/folder")).unwrap_err();
        assert!(error.to_string().contains("chainage-eval-"), "{error}");
    }
}

//! Scratch files that points are sorted into by a hash of their key, a bucket at a time in memory.

use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, PoisonError};

use bytemuck::{Pod, Zeroable};

use crate::eval::error::EvalError;

/// Entries that a bucket should have: 16 MiB, of which every thread holds two.
const BUCKET_ENTRIES: u64 = 1 << 19;
/// Buckets at most; 500 million points have this many, and more points have larger buckets.
const MAX_BUCKETS: u64 = 1024;
/// Entries that are collected before a bucket's file is opened to append them.
const FLUSH_ENTRIES: usize = 2048;

/// A point in a bucket.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Entry {
    /// Hash of the key, 128 bits.
    pub(super) key: [u64; 2],
    /// Index among the points of its side.
    pub(super) index: u64,
    /// Object or segment.
    pub(super) id: i64,
    /// Class of the reference, or code of what is predicted.
    pub(super) class: u64,
}

/// A folder for scratch files that goes away with this value.
#[derive(Debug)]
pub(super) struct ScratchFolder {
    path: PathBuf,
}

impl ScratchFolder {
    /// Makes a folder of its own in `parent`.
    ///
    /// # Errors
    /// [`EvalError::Scratch`].
    pub(super) fn create(parent: &Path) -> Result<Self, EvalError> {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        loop {
            let number = NUMBER.fetch_add(1, Ordering::Relaxed);
            let path = parent.join(format!("chainage-eval-{}-{number}", std::process::id()));
            match fs_err::create_dir(&path) {
                Ok(()) => return Ok(Self { path }),
                // Left by a process of the same number that was killed: the next name will do.
                Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {}
                Err(source) => return Err(EvalError::Scratch { path, source }),
            }
        }
    }
}

impl Drop for ScratchFolder {
    fn drop(&mut self) {
        // Nothing depends on it, and there is nobody to tell.
        let _ = fs_err::remove_dir_all(&self.path);
    }
}

/// The buckets of one side.
#[derive(Debug)]
pub(super) struct Buckets<'a> {
    folder: &'a ScratchFolder,
    name: &'static str,
    waiting: Vec<Mutex<Vec<Entry>>>,
}

impl<'a> Buckets<'a> {
    /// Empty buckets for so many points; the same number of points gives the same buckets.
    pub(super) fn new(folder: &'a ScratchFolder, name: &'static str, points: u64) -> Self {
        let count = points.div_ceil(BUCKET_ENTRIES).clamp(1, MAX_BUCKETS) as usize;
        Self { folder, name, waiting: (0..count).map(|_| Mutex::default()).collect() }
    }

    /// Number of buckets.
    pub(super) fn count(&self) -> usize {
        self.waiting.len()
    }

    /// Adds entries to their buckets.
    ///
    /// # Errors
    /// [`EvalError::Scratch`].
    #[expect(clippy::cast_possible_truncation, reason = "a remainder by the number of buckets")]
    pub(super) fn add(&self, entries: &mut Vec<Entry>) -> Result<(), EvalError> {
        let bucket_of = |entry: &Entry| (entry.key[0] % self.waiting.len() as u64) as usize;
        entries.sort_unstable_by_key(bucket_of);
        for group in entries.chunk_by(|a, b| bucket_of(a) == bucket_of(b)) {
            let bucket = bucket_of(&group[0]);
            let mut waiting = self.waiting[bucket].lock().unwrap_or_else(PoisonError::into_inner);
            waiting.extend_from_slice(group);
            if waiting.len() >= FLUSH_ENTRIES {
                self.append(bucket, &waiting)?;
                waiting.clear();
            }
        }
        entries.clear();
        Ok(())
    }

    fn path(&self, bucket: usize) -> PathBuf {
        self.folder.path.join(format!("{}-{bucket:04}", self.name))
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

    /// The entries of a bucket by key and index, and the end of its file.
    ///
    /// # Errors
    /// [`EvalError::Scratch`].
    pub(super) fn take_sorted(&self, bucket: usize) -> Result<Vec<Entry>, EvalError> {
        let path = self.path(bucket);
        let mut waiting = self.waiting[bucket].lock().unwrap_or_else(PoisonError::into_inner);
        let mut entries = match std::fs::File::open(&path) {
            Ok(file) => {
                read_entries(file).map_err(|source| EvalError::Scratch { path: path.clone(), source })?
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Vec::new(),
            Err(source) => return Err(EvalError::Scratch { path, source }),
        };
        entries.append(&mut waiting);
        entries.sort_unstable_by_key(|entry| (entry.key, entry.index));
        // The space is wanted back, but the folder goes away in any case.
        let _ = std::fs::remove_file(&path);
        Ok(entries)
    }
}

fn read_entries(mut file: std::fs::File) -> std::io::Result<Vec<Entry>> {
    let bytes = file.metadata()?.len();
    let count = usize::try_from(bytes).unwrap_or(usize::MAX) / size_of::<Entry>();
    let mut entries = vec![Entry::zeroed(); count];
    std::io::Read::read_exact(&mut file, bytemuck::cast_slice_mut(&mut entries))?;
    Ok(entries)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buckets_give_back_every_entry_and_the_folder_goes_away() {
        let parent = tempfile::tempdir().unwrap();
        let folder = ScratchFolder::create(parent.path()).unwrap();
        let buckets = Buckets::new(&folder, "test", 3 * BUCKET_ENTRIES);
        let all: Vec<Entry> =
            (0..10_000).map(|i| Entry { key: [i * 7 % 1000, i], index: i, id: 1, class: 0 }).collect();
        for part in all.chunks(3_000) {
            buckets.add(&mut part.to_vec()).unwrap();
        }
        assert_eq!(buckets.count(), 3);
        let mut found: Vec<Entry> = (0..3).flat_map(|bucket| buckets.take_sorted(bucket).unwrap()).collect();
        found.sort_by_key(|entry| entry.index);
        assert_eq!(found, all);
        drop(folder);
        assert_eq!(parent.path().read_dir().unwrap().count(), 0);
    }

    #[test]
    fn a_folder_that_is_not_there_is_an_error() {
        let error = ScratchFolder::create(Path::new("there/is/no/such/folder")).unwrap_err();
        assert!(error.to_string().contains("chainage-eval-"), "{error}");
    }
}

//! One small value per point of one file (position, field, class, object), on disk by record. Passes whose units own
//! whole runs of records write it, so that every value has one writer. Not checksummed: the unit file of the writing
//! unit says that its values are there.

use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use bytemuck::Pod;

/// A file with one little-endian `T` per record.
#[derive(Debug)]
pub(crate) struct Column<T> {
    path: PathBuf,
    file: File,
    len: u64,
    /// Whether anything was written since the last sync began.
    unsynced: AtomicBool,
    value: std::marker::PhantomData<T>,
}

impl<T: Pod + Default> Column<T> {
    const WIDTH: u64 = size_of::<T>() as u64;

    /// Whether a column of `len` records is there.
    pub(crate) fn is_whole(path: &Path, len: u64) -> bool {
        std::fs::metadata(path).is_ok_and(|facts| facts.len() == len * Self::WIDTH)
    }

    /// Opens or creates the column of a file with `len` records. New records are zero and take no space.
    pub(crate) fn open(path: &Path, len: u64) -> io::Result<Self> {
        let file = File::options().read(true).write(true).create(true).truncate(false).open(path)?;
        if file.metadata()?.len() != len * Self::WIDTH {
            file.set_len(len * Self::WIDTH)?;
        }
        let (path, value) = (path.to_owned(), std::marker::PhantomData);
        Ok(Self { path, file, len, unsynced: AtomicBool::new(false), value })
    }

    /// The file, for messages.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Reads the values of `values.len()` records from record `first` on.
    pub(crate) fn read(&self, first: u64, values: &mut [T]) -> io::Result<()> {
        debug_assert!(first + values.len() as u64 <= self.len);
        self.file.read_exact_at(bytemuck::cast_slice_mut(values), first * Self::WIDTH)
    }

    /// Writes the values of consecutive records.
    pub(crate) fn write_run(&self, first: u64, values: &[T]) -> io::Result<()> {
        debug_assert!(first + values.len() as u64 <= self.len);
        let written = self.file.write_all_at(bytemuck::cast_slice(values), first * Self::WIDTH);
        // After the write: a sync that runs meanwhile must not count as the one that covers it.
        self.unsynced.store(true, Ordering::Release);
        written
    }

    /// Makes everything written so far survive a power cut; called by one thread at a time.
    pub(crate) fn sync(&self) -> io::Result<()> {
        // Cleared before the sync, so that what is written meanwhile counts for the next one.
        if self.unsynced.swap(false, Ordering::Acquire) { self.file.sync_data() } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_of_several_writers_stand_beside_each_other() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("objects");
        let column = Column::<u32>::open(&path, 200_000).unwrap();
        std::thread::scope(|scope| {
            for run in 0..4_u32 {
                let column = &column;
                scope.spawn(move || {
                    column.write_run(u64::from(run) * 50_000, &vec![run + 1; 50_000]).unwrap()
                });
            }
        });
        column.sync().unwrap();
        let mut values = vec![0; 200_000];
        column.read(0, &mut values).unwrap();
        assert!(values.chunks(50_000).zip(1..).all(|(run, value)| run.iter().all(|&found| found == value)));
        assert!(Column::<u32>::is_whole(&path, 200_000) && !Column::<u32>::is_whole(&path, 199_999));
    }
}

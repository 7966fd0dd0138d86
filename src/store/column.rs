//! One small value per point of one file (class, label), on disk by record: written by the tile that owns the point,
//! read in runs of records. Not checksummed; the unit file of the writing tile says that its values are there.

use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use bytemuck::Pod;

/// Records per page: the unit of reading, and of read-modify-write where tiles interleave.
const PAGE_RECORDS: u64 = 65_536;

/// A file with one little-endian `T` per record.
#[derive(Debug)]
pub(crate) struct Column<T> {
    path: PathBuf,
    file: File,
    len: u64,
    /// Held while a span is read, patched and written back, because neighbouring tiles own interleaved records.
    patching: Mutex<()>,
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
        Ok(Self {
            path: path.to_owned(),
            file,
            len,
            patching: Mutex::new(()),
            unsynced: AtomicBool::new(false),
            value: std::marker::PhantomData,
        })
    }

    /// The file, for messages.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Reads the values of `records` into `values`.
    pub(crate) fn read(&self, first: u64, values: &mut [T]) -> io::Result<()> {
        debug_assert!(first + values.len() as u64 <= self.len);
        self.file.read_exact_at(bytemuck::cast_slice_mut(values), first * Self::WIDTH)
    }

    /// Writes the values of consecutive records.
    pub(crate) fn write_run(&self, first: u64, values: &[T]) -> io::Result<()> {
        let written = self.file.write_all_at(bytemuck::cast_slice(values), first * Self::WIDTH);
        // After the write: a sync that runs meanwhile must not count as the one that holds it.
        self.unsynced.store(true, Ordering::Release);
        written
    }

    /// Writes `values[i]` at `records[i]`; records ascend.
    pub(crate) fn write(&self, records: &[u64], values: &[T]) -> io::Result<()> {
        let mut start = 0;
        while start < records.len() {
            let page_end = (records[start] / PAGE_RECORDS + 1) * PAGE_RECORDS;
            let end = start + records[start..].partition_point(|&record| record < page_end);
            self.write_page(&records[start..end], &values[start..end])?;
            start = end;
        }
        Ok(())
    }

    /// Writes values of one page: in one piece if the records have no gap, else by patching the span they cover.
    #[expect(clippy::cast_possible_truncation, reason = "a span is at most a page of 65,536 records")]
    fn write_page(&self, records: &[u64], values: &[T]) -> io::Result<()> {
        let (first, last) = (records[0], records[records.len() - 1]);
        let span = (last - first + 1) as usize;
        let _patching = self.patching.lock().map_err(|_| io::Error::other("another thread failed here"))?;
        if span == records.len() {
            return self.write_run(first, values);
        }
        let mut page = vec![T::default(); span];
        self.read(first, &mut page)?;
        for (record, value) in records.iter().zip(values) {
            page[(record - first) as usize] = *value;
        }
        self.write_run(first, &page)
    }

    /// Makes everything written so far survive a power cut; called by one thread at a time.
    pub(crate) fn sync(&self) -> io::Result<()> {
        // Taken back before the sync, so that what is written while it goes on counts for the next one.
        if self.unsynced.swap(false, Ordering::Acquire) { self.file.sync_data() } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interleaved_writers_keep_each_others_values() {
        let folder = tempfile::tempdir().unwrap();
        let column = Column::<u32>::open(&folder.path().join("labels"), 200_000).unwrap();
        let even: Vec<u64> = (0..200_000).step_by(2).collect();
        let odd: Vec<u64> = (1..200_000).step_by(2).collect();
        std::thread::scope(|scope| {
            scope.spawn(|| column.write(&even, &vec![7; even.len()]).unwrap());
            scope.spawn(|| column.write(&odd, &vec![9; odd.len()]).unwrap());
        });
        let mut values = vec![0; 200_000];
        column.read(0, &mut values).unwrap();
        assert!(values.chunks(2).all(|pair| pair == [7, 9]));
    }
}

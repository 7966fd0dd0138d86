//! Byte strings in a temporary file: values of the whole drive that are read back one at a time. Only their
//! places are in memory.

use std::io;
use std::path::{Path, PathBuf};

use fs_err::File;
use fs_err::os::unix::fs::FileExt;

use crate::whole_file;

/// Number of bytes collected before a write.
const BUFFER_BYTES: usize = 1 << 18;

/// Where a string is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Spilled {
    at: u64,
    length: u32,
}

/// A temporary file of strings. It is removed when this value is dropped.
#[derive(Debug)]
pub(crate) struct Spill {
    path: PathBuf,
    file: File,
    /// Bytes in the file.
    written: u64,
    /// Strings that are not in the file yet. A string is never divided.
    buffer: Vec<u8>,
}

impl Spill {
    /// An empty file with a temporary name beside `path`.
    pub(crate) fn create(path: &Path) -> io::Result<Self> {
        let path = whole_file::temporary(path);
        let file = File::options().read(true).write(true).create(true).truncate(true).open(&path)?;
        Ok(Self { path, file, written: 0, buffer: Vec::new() })
    }

    /// Adds a string.
    pub(crate) fn push(&mut self, bytes: &[u8]) -> io::Result<Spilled> {
        let length = u32::try_from(bytes.len()).map_err(io::Error::other)?;
        let place = Spilled { at: self.written + self.buffer.len() as u64, length };
        self.buffer.extend_from_slice(bytes);
        if self.buffer.len() >= BUFFER_BYTES {
            self.file.write_all_at(&self.buffer, self.written)?;
            self.written += self.buffer.len() as u64;
            self.buffer.clear();
        }
        Ok(place)
    }

    /// A string that was added.
    pub(crate) fn read(&self, place: Spilled) -> io::Result<Vec<u8>> {
        let mut bytes = vec![0; place.length as usize];
        match place.at.checked_sub(self.written) {
            None => self.file.read_exact_at(&mut bytes, place.at)?,
            Some(start) => {
                let start = usize::try_from(start).map_err(io::Error::other)?;
                let stored = self.buffer.get(start..start + bytes.len());
                bytes.copy_from_slice(stored.ok_or(io::ErrorKind::UnexpectedEof)?);
            }
        }
        Ok(bytes)
    }
}

impl Drop for Spill {
    fn drop(&mut self) {
        // Nobody else knows the file. If it stays, it only takes space.
        let _ = fs_err::remove_file(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strings_come_back_from_the_buffer_and_from_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let mut spill = Spill::create(&folder.path().join("rows")).unwrap();
        let string = |number: usize| number.to_le_bytes().repeat(number * 991 % 12_503);
        let places: Vec<Spilled> = (0..50).map(|number| spill.push(&string(number)).unwrap()).collect();
        assert!(spill.written > 0 && !spill.buffer.is_empty(), "both are tested");
        assert!(spill.buffer.len() < BUFFER_BYTES);
        for (number, place) in places.iter().enumerate().rev() {
            assert_eq!(spill.read(*place).unwrap(), string(number), "{number}");
        }
        let beyond = Spilled { at: spill.written, length: u32::MAX };
        assert_eq!(spill.read(beyond).unwrap_err().kind(), io::ErrorKind::UnexpectedEof);
    }

    #[test]
    fn nothing_stays_on_disk() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rows");
        let (one, other) = (Spill::create(&path).unwrap(), Spill::create(&path).unwrap());
        assert_eq!(folder.path().read_dir().unwrap().count(), 2, "two do not share a file");
        drop((one, other));
        assert_eq!(folder.path().read_dir().unwrap().count(), 0);
    }
}

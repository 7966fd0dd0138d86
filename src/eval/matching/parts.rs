//! Adds up the tables of the parts of a drive. The points are counted elsewhere.
//!
//! The counts of a few objects and segments are kept in memory. Further counts go to a scratch file until all
//! points are read. Therefore memory does not grow with the drive while blocks of both sides are in memory,
//! too.

use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::codec;
use crate::error::Result;
use crate::eval::error::EvalError;
use crate::eval::matching::scratch;
use crate::eval::table::Table;
use crate::scratch_folder::ScratchFolder;

/// Entries kept in memory: half a mebibyte, about a kilometre of a dense street.
const HELD_ENTRIES: usize = 1 << 13;

/// Tables of parts that come in any order, from any thread.
#[derive(Debug)]
pub(super) struct Parts<'a> {
    scratch: &'a Path,
    collected: Mutex<Collected>,
}

#[derive(Debug, Default)]
struct Collected {
    held: Table,
    waiting: Option<Waiting>,
}

/// Tables in a file, one after the other.
#[derive(Debug)]
struct Waiting {
    path: PathBuf,
    file: File,
    /// Bytes of each.
    sizes: Vec<usize>,
    /// Removes the file.
    _folder: ScratchFolder,
}

impl<'a> Parts<'a> {
    /// Starts without parts. Many parts are stored in a file, in a new folder inside `scratch`.
    pub(super) fn new(scratch: &'a Path) -> Self {
        Self { scratch, collected: Mutex::default() }
    }

    /// Adds the table of a part.
    ///
    /// # Errors
    /// [`EvalError::Scratch`].
    pub(super) fn add(&self, part: Table) -> Result<()> {
        let mut collected = self.collected.lock().unwrap_or_else(PoisonError::into_inner);
        let Collected { held, waiting } = &mut *collected;
        held.append(part);
        if held.len() <= HELD_ENTRIES {
            return Ok(());
        }
        held.add_up();
        let waiting = match waiting {
            Some(waiting) => waiting,
            None => waiting.insert(Waiting::create(self.scratch)?),
        };
        waiting.push(&std::mem::take(held))
    }

    /// The table of all parts.
    ///
    /// # Errors
    /// [`EvalError::Scratch`].
    pub(super) fn finish(self) -> Result<Table> {
        let Collected { held: mut table, waiting } =
            self.collected.into_inner().unwrap_or_else(PoisonError::into_inner);
        if let Some(waiting) = waiting {
            waiting.append_to(&mut table)?;
        }
        table.add_up();
        Ok(table)
    }
}

impl Waiting {
    fn create(parent: &Path) -> Result<Self> {
        let folder = scratch::folder(parent)?;
        let path = folder.join("parts");
        let file = OpenOptions::new().read(true).write(true).create_new(true).open(&path);
        let file = file.map_err(|source| EvalError::Scratch { path: path.clone(), source })?;
        Ok(Self { path, file, sizes: Vec::new(), _folder: folder })
    }

    fn push(&mut self, table: &Table) -> Result<()> {
        let bytes = codec::encode(table)?;
        self.sizes.push(bytes.len());
        Ok(self
            .file
            .write_all(&bytes)
            .map_err(|source| EvalError::Scratch { path: self.path.clone(), source })?)
    }

    fn append_to(mut self, table: &mut Table) -> Result<()> {
        let failed = |source| EvalError::Scratch { path: self.path.clone(), source };
        self.file.rewind().map_err(failed)?;
        let mut bytes = Vec::new();
        for size in self.sizes {
            bytes.resize(size, 0);
            self.file.read_exact(&mut bytes).map_err(failed)?;
            table.append(codec::decode(&bytes)?);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eval::table::{Cell, Counter};

    #[test]
    fn parts_that_waited_in_a_file_are_added_up_like_those_that_did_not() {
        let parent = tempfile::tempdir().unwrap();
        let parts = Parts::new(parent.path());
        let mut whole = Counter::default();
        // Every part shares objects with three others, and the objects of all parts do not fit into memory.
        for part in 0..40 {
            let mut counter = Counter::default();
            for object in part * 100..(part + 4) * 100 {
                let cell = Cell { object, segment: 1 - object % 2, ..Cell::default() };
                let at = [-object, i64::MAX, object];
                counter.add(cell, at);
                whole.add(cell, at);
            }
            parts.add(counter.finish()).unwrap();
        }
        assert_eq!(parent.path().read_dir().unwrap().count(), 1);
        let table = parts.finish().unwrap();
        assert_eq!(table.points(), 16_000);
        assert_eq!(table, whole.finish());
        assert_eq!(parent.path().read_dir().unwrap().count(), 0);
    }

    #[test]
    fn a_few_parts_need_no_folder_and_many_name_the_one_that_is_not_there() {
        let parts = Parts::new(Path::new("there/is/no/such/folder"));
        let part = |objects| {
            let mut counter = Counter::default();
            (0..objects).for_each(|object| counter.add(Cell { object, ..Cell::default() }, [0; 3]));
            counter.finish()
        };
        parts.add(part(10)).unwrap();
        let error = parts.add(part(10_000)).unwrap_err();
        assert!(error.to_string().contains("there/is/no/such/folder/chainage-eval-"), "{error}");
    }
}

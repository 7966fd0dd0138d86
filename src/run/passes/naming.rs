//! Gives complete labelled copies their names, many small ones together, and records that they get them.
//!
//! The record is on disk before the first copy is renamed. So a copy in the record whose temporary file is
//! missing has its name, also after a kill in between.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::output::OutputError;
use crate::store::{PassDir, RunDir};
use crate::whole_file::{FINISHED_TOGETHER, sync_each, sync_folder};

/// Name of the record in the state.
const RECORD: &str = "export/named.json";
/// Bytes of copies that get their names together. After a kill, at most this many are assembled again.
/// Chosen: they take seconds.
const BYTES_TOGETHER: u64 = 256 << 20;

/// The copies of one state of the drive.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Record {
    /// The fingerprint of the export.
    fingerprint: String,
    /// Length of each copy in bytes, by the number of its file. One that was cut off since is written again.
    bytes: BTreeMap<usize, u64>,
}

/// A complete copy under its temporary name.
struct Complete {
    file: usize,
    part: File,
    from: PathBuf,
    to: PathBuf,
}

/// Copies that have their names, and those that get them next.
pub(super) struct Naming<'a> {
    run_dir: &'a RunDir,
    record: Record,
    complete: Vec<Complete>,
    bytes: u64,
}

impl<'a> Naming<'a> {
    /// What an earlier call has recorded for the state of `dir`.
    pub(super) fn read(run_dir: &'a RunDir, dir: &PassDir) -> Result<Self> {
        let fingerprint = dir.fingerprint().to_string();
        let stored = run_dir.read_json::<Record>(RECORD)?.filter(|stored| stored.fingerprint == fingerprint);
        let record = stored.unwrap_or(Record { fingerprint, ..Record::default() });
        Ok(Self { run_dir, record, complete: Vec::new(), bytes: 0 })
    }

    /// Whether the copy of a file has its name `path` and its length, and no temporary file `part` any more.
    pub(super) fn has(&self, file: usize, path: &Path, part: &Path) -> bool {
        let length = fs_err::metadata(path).ok().map(|facts| facts.len());
        length.is_some() && length == self.record.bytes.get(&file).copied() && !part.exists()
    }

    /// Adds the complete copy of a file, `part`. It has the temporary name `from`, and gets the name `to`.
    pub(super) fn add(&mut self, file: usize, part: File, from: &Path, to: PathBuf) -> Result<()> {
        let length = part.metadata().map_err(failed(&to))?.len();
        self.record.bytes.insert(file, length);
        self.complete.push(Complete { file, part, from: from.to_owned(), to });
        self.bytes += length;
        let is_full = self.complete.len() >= FINISHED_TOGETHER || self.bytes >= BYTES_TOGETHER;
        if is_full { self.finish() } else { Ok(()) }
    }

    /// Syncs the copies that were added, and gives them their names.
    pub(super) fn finish(&mut self) -> Result<()> {
        let complete = std::mem::take(&mut self.complete);
        self.bytes = 0;
        let Some(last) = complete.last() else { return Ok(()) };
        for (copy, synced) in complete.iter().zip(sync_each(&complete, |copy| copy.part.sync_all())) {
            if let Err(source) = synced {
                self.record.bytes.remove(&copy.file);
                return Err(failed(&copy.to)(source).into());
            }
        }
        self.run_dir.write_json(RECORD, &self.record)?;
        for copy in &complete {
            fs_err::rename(&copy.from, &copy.to).map_err(failed(&copy.to))?;
        }
        Ok(sync_folder(&last.to).map_err(failed(&last.to))?)
    }
}

fn failed(path: &Path) -> impl FnOnce(std::io::Error) -> OutputError {
    let path = path.to_owned();
    move |source| OutputError::Write { path, source }
}

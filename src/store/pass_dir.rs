//! The folder of one pass: a file per unit, the values that the pass depends on, and the mark that the pass
//! is complete.

use std::fs::File;
use std::io;
use std::ops::Range;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::codec;
use crate::error::Result;
use crate::model::in_u32;
use crate::spill::Spill;
use crate::store::unit_file::{self, Refusal};
use crate::store::wait::waited_for;
use crate::store::{Fingerprint, Inputs, StaleReason, StoreError};
use crate::whole_file::{self, FINISHED_TOGETHER, WholeFile};

/// Name of the record of the values that the pass depends on.
const INPUTS: &str = "inputs.json";
/// Name of the mark that all units exist and were checked, and that their reduction is stored.
const COMPLETE: &str = "complete.json";
/// Number of attempts to remove a folder while other processes write to it (chosen: each of them can
/// interfere once).
const CLEARED_AGAIN: usize = 100;

/// Whether a unit has a stored result.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum UnitState {
    /// Nothing has been stored.
    Missing,
    /// The result is complete and fits.
    Done,
    /// A file exists that cannot be used.
    Refused(Refusal),
}

/// Reads parts of the payload of one unit.
#[derive(Debug)]
pub(crate) struct UnitReader {
    path: PathBuf,
    file: File,
    payload: Range<u64>,
}

impl UnitReader {
    /// A part of the payload.
    pub(crate) fn read(&self, part: Range<u64>) -> Result<Vec<u8>, StoreError> {
        let outside = || StoreError::Damaged {
            path: self.path.clone(),
            what: format!("bytes {} to {} of its payload are not there", part.start, part.end),
        };
        let length = part.end.checked_sub(part.start).ok_or_else(outside)?;
        if part.end > self.payload.end - self.payload.start {
            return Err(outside());
        }
        let mut bytes = vec![0; usize::try_from(length).map_err(|_| outside())?];
        let at = self.payload.start + part.start;
        self.file.read_exact_at(&mut bytes, at).map_err(StoreError::io("read", &self.path))?;
        Ok(bytes)
    }

    /// Fills a buffer with the bytes of the payload from an offset on.
    pub(crate) fn read_into(&self, at: u64, bytes: &mut [u8]) -> Result<(), StoreError> {
        if at + bytes.len() as u64 > self.payload.end - self.payload.start {
            let what = format!("bytes {at} to {} of its payload are not there", at + bytes.len() as u64);
            return Err(StoreError::Damaged { path: self.path.clone(), what });
        }
        let at = self.payload.start + at;
        self.file.read_exact_at(bytes, at).map_err(StoreError::io("read", &self.path))
    }

    /// The range of a section of the payload, see [`codec::pack`].
    pub(crate) fn section(&self, number: usize) -> Result<Range<u64>> {
        let mut failure = None;
        let range = codec::section_range(
            &mut |part| match self.read(part) {
                Ok(bytes) => Some(bytes),
                Err(error) => {
                    failure = Some(error);
                    None
                }
            },
            number,
        );
        match (range, failure) {
            (Some(range), _) => Ok(range),
            (None, Some(error)) => Err(error.into()),
            (None, None) => Err(codec::no_section(number)),
        }
    }

    /// A whole section of the payload.
    pub(crate) fn read_section(&self, number: usize) -> Result<Vec<u8>> {
        Ok(self.read(self.section(number)?)?)
    }
}

/// The folder of one pass: a file per unit, and the values that the pass depends on.
#[derive(Debug, Clone)]
pub struct PassDir {
    folder: PathBuf,
    inputs: Inputs,
    fingerprint: Fingerprint,
    /// How long to wait for a unit that another process may still be writing.
    wait: Duration,
}

/// The mark of a complete pass.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Complete {
    fingerprint: String,
    units: usize,
}

impl PassDir {
    pub(super) fn new(folder: PathBuf, inputs: Inputs, wait: Duration) -> Self {
        Self { folder, fingerprint: inputs.fingerprint(), inputs, wait }
    }

    /// One number for all values that the pass depends on.
    #[must_use]
    pub fn fingerprint(&self) -> Fingerprint {
        self.fingerprint
    }

    /// The file of a unit.
    pub(crate) fn unit_path(&self, unit: usize) -> PathBuf {
        self.folder.join(format!("unit-{unit:06}.bin"))
    }

    /// Turns an error of the system into an error about this folder.
    pub(crate) fn failed(&self, action: &'static str) -> impl Fn(io::Error) -> StoreError + use<> {
        let path = self.folder.clone();
        move |source| StoreError::Io { action, path: path.clone(), source }
    }

    /// A temporary file in the folder. If the process is killed, the mark of the complete pass removes it.
    pub(crate) fn spill(&self, name: &str) -> Result<Spill, StoreError> {
        let path = self.folder.join(name);
        Spill::create(&path).map_err(StoreError::io("create", &path))
    }

    fn number(unit: usize) -> u32 {
        in_u32(unit, "units of a pass")
    }

    /// Creates the folder and records the values that the pass depends on. Results that depend on other
    /// values are removed all at once, because with other tiles there may be fewer units.
    ///
    /// # Errors
    /// When the file system refuses.
    pub fn prepare(&self) -> Result<(), StoreError> {
        let same = self.stored_inputs()?.as_ref() == Some(&self.inputs);
        if !same {
            self.clear()?;
        }
        fs_err::create_dir_all(&self.folder).map_err(StoreError::io("create", &self.folder))?;
        if !same {
            let path = self.folder.join(INPUTS);
            let text = serde_json::to_string_pretty(&self.inputs)
                .map_err(|error| StoreError::Damaged { path: path.clone(), what: error.to_string() })?;
            whole_file::write(&path, |to| to.write_all(text.as_bytes()))
                .map_err(StoreError::io("write", &path))?;
        }
        Ok(())
    }

    /// Whether the pass was prepared for the values that it depends on. Workers may add units then.
    pub(crate) fn is_prepared(&self) -> Result<bool, StoreError> {
        let same = || Ok(self.is_prepared_now()?.then_some(()));
        Ok(waited_for(&self.folder, self.wait, same)?.is_some())
    }

    /// The same at this moment, without waiting for another process that may be writing.
    pub(crate) fn is_prepared_now(&self) -> Result<bool, StoreError> {
        Ok(self.stored_inputs()?.as_ref() == Some(&self.inputs))
    }

    /// Marks that all units exist and were checked, and that their reduction is stored. Removes what
    /// processes left behind in the folder.
    pub(crate) fn mark_complete(&self, units: usize) -> Result<(), StoreError> {
        let path = self.folder.join(COMPLETE);
        let text = serde_json::to_string(&self.complete(units))
            .map_err(|error| StoreError::Damaged { path: path.clone(), what: error.to_string() })?;
        whole_file::remove_temporary(&self.folder).map_err(StoreError::io("clear", &self.folder))?;
        whole_file::write(&path, |to| to.write_all(text.as_bytes())).map_err(StoreError::io("write", &path))
    }

    /// Whether the pass is marked as complete for the values that it depends on.
    pub(crate) fn is_complete(&self, units: usize) -> Result<bool, StoreError> {
        let marked = || Ok(self.is_complete_now(units)?.then_some(()));
        Ok(waited_for(&self.folder, self.wait, marked)?.is_some())
    }

    /// The same at this moment, without waiting for a mark that another process may be writing.
    pub(crate) fn is_complete_now(&self, units: usize) -> Result<bool, StoreError> {
        let path = self.folder.join(COMPLETE);
        match fs_err::read(&path) {
            Ok(bytes) => Ok(serde_json::from_slice(&bytes).ok() == Some(self.complete(units))),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
            Err(source) => Err(StoreError::Io { action: "read", path, source }),
        }
    }

    /// Removes the mark before units are computed again.
    pub(crate) fn withdraw_complete(&self) -> Result<(), StoreError> {
        self.remove(&self.folder.join(COMPLETE))
    }

    fn complete(&self, units: usize) -> Complete {
        Complete { fingerprint: self.fingerprint.to_string(), units }
    }

    fn stored_inputs(&self) -> Result<Option<Inputs>, StoreError> {
        let path = self.folder.join(INPUTS);
        match fs_err::read(&path) {
            // If this record is damaged, the run goes on, because each unit file has its own fingerprint.
            Ok(bytes) => Ok(serde_json::from_slice(&bytes).ok()),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(source) => Err(StoreError::Io { action: "read", path, source }),
        }
    }

    /// Why stored results of this pass would not be used now; empty when they fit or nothing is stored.
    ///
    /// # Errors
    /// When the file system refuses.
    pub fn stale_reasons(&self) -> Result<Vec<StaleReason>, StoreError> {
        Ok(self.stored_inputs()?.map_or_else(Vec::new, |stored| self.inputs.differences(&stored)))
    }

    /// The payload of a unit, if it exists and fits.
    ///
    /// # Errors
    /// When the file system refuses.
    pub fn load(&self, unit: usize) -> Result<Result<Vec<u8>, UnitState>, StoreError> {
        let mut payload = Vec::new();
        Ok(match self.check(unit, Some(&mut payload))? {
            UnitState::Done => Ok(payload),
            state => Err(state),
        })
    }

    /// Whether a unit has a stored result. Every byte of it is checked.
    ///
    /// # Errors
    /// When the file system refuses.
    pub fn state(&self, unit: usize) -> Result<UnitState, StoreError> {
        self.check(unit, None)
    }

    fn check(&self, unit: usize, payload: Option<&mut Vec<u8>>) -> Result<UnitState, StoreError> {
        let path = self.unit_path(unit);
        let file = match File::open(&path) {
            Ok(file) => file,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(UnitState::Missing),
            Err(source) => return Err(StoreError::Io { action: "open", path, source }),
        };
        let failed = StoreError::io("read", &path);
        let checked = file.metadata().and_then(|facts| {
            unit_file::check(&file, facts.len(), Self::number(unit), self.fingerprint, payload)
        });
        Ok(match checked.map_err(failed)? {
            Ok(()) => UnitState::Done,
            Err(refusal) => UnitState::Refused(refusal),
        })
    }

    /// The units among `units` that have no stored result at this moment, with their state.
    pub(crate) fn not_done_now(&self, units: &[usize]) -> Result<Vec<(usize, UnitState)>, StoreError> {
        let mut left = Vec::new();
        for &unit in units {
            match self.state(unit)? {
                UnitState::Done => {}
                state => left.push((unit, state)),
            }
        }
        Ok(left)
    }

    /// The units among `units` that have no stored result, with their state. Waits for missing units.
    pub(crate) fn not_done(&self, units: &[usize]) -> Result<Vec<(usize, UnitState)>, StoreError> {
        let mut left: Vec<(usize, UnitState)> =
            units.iter().map(|&unit| (unit, UnitState::Missing)).collect();
        waited_for(&self.folder, self.wait, || {
            let units: Vec<usize> = left.iter().map(|(unit, _)| *unit).collect();
            left = self.not_done_now(&units)?;
            let missing = left.iter().any(|(_, state)| *state == UnitState::Missing);
            Ok::<_, StoreError>((!missing).then_some(()))
        })?;
        Ok(left)
    }

    /// The payload of a unit that the pass has just finished.
    ///
    /// # Errors
    /// When it is missing or damaged.
    pub fn payload(&self, unit: usize) -> Result<Vec<u8>, StoreError> {
        self.await_unit(unit)?;
        self.load(unit)?.map_err(|state| StoreError::Damaged {
            path: self.unit_path(unit),
            what: match state {
                UnitState::Refused(refusal) => refusal.to_string(),
                _ => "it was lost after it was written".to_owned(),
            },
        })
    }

    /// A reader of parts of the payload of a finished unit.
    ///
    /// # Errors
    /// When it is missing or belongs to another pass.
    pub(crate) fn reader(&self, unit: usize) -> Result<UnitReader, StoreError> {
        let path = self.unit_path(unit);
        self.await_unit(unit)?;
        let file = File::open(&path).map_err(StoreError::io("open", &path))?;
        let length = file.metadata().map_err(StoreError::io("read", &path))?.len();
        let mut header = [0; unit_file::HEADER_LEN];
        file.read_exact_at(&mut header, 0).map_err(StoreError::io("read", &path))?;
        match unit_file::payload_range(&header, length, Self::number(unit), self.fingerprint) {
            Ok(payload) => Ok(UnitReader { path, file, payload }),
            Err(refusal) => Err(StoreError::Damaged { path, what: refusal.to_string() }),
        }
    }

    /// Waits for the file of a unit that another host has written.
    fn await_unit(&self, unit: usize) -> Result<(), StoreError> {
        let path = self.unit_path(unit);
        waited_for(&self.folder, self.wait, || Ok(path.exists().then_some(()))).map(|_| ())
    }

    /// Numbers of the units that have a file, whether or not it fits, ascending.
    ///
    /// # Errors
    /// When the file system refuses.
    pub fn stored_units(&self) -> Result<Vec<usize>, StoreError> {
        let entries = match fs_err::read_dir(&self.folder) {
            Ok(entries) => entries,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
            Err(source) => return Err(StoreError::Io { action: "read", path: self.folder.clone(), source }),
        };
        let mut units = Vec::new();
        for entry in entries {
            let name = entry.map_err(StoreError::io("read", &self.folder))?.file_name();
            let number = name.to_str().and_then(|name| name.strip_prefix("unit-")?.strip_suffix(".bin"));
            units.extend(number.and_then(|number| number.parse::<usize>().ok()));
        }
        units.sort_unstable();
        Ok(units)
    }

    /// Removes the pass with all its results.
    ///
    /// # Errors
    /// When the file system refuses.
    pub fn clear(&self) -> Result<(), StoreError> {
        // A worker with the previous settings can store a unit while the folder is emptied.
        for _ in 0..CLEARED_AGAIN {
            match fs_err::remove_dir_all(&self.folder) {
                Err(error) if error.kind() == io::ErrorKind::DirectoryNotEmpty => {}
                Err(error) if error.kind() != io::ErrorKind::NotFound => {
                    return Err(StoreError::Io {
                        action: "remove",
                        path: self.folder.clone(),
                        source: error,
                    });
                }
                _ => return Ok(()),
            }
        }
        Err(StoreError::Io {
            action: "remove",
            path: self.folder.clone(),
            source: io::ErrorKind::DirectoryNotEmpty.into(),
        })
    }

    /// Invalidates a unit's result, because a file that belongs to it was lost.
    ///
    /// # Errors
    /// When the file system refuses.
    pub fn invalidate(&self, unit: usize) -> Result<(), StoreError> {
        self.remove(&self.unit_path(unit))
    }

    fn remove(&self, path: &Path) -> Result<(), StoreError> {
        match fs_err::remove_file(path) {
            Ok(()) => whole_file::sync_folder(path).map_err(StoreError::io("sync", &self.folder)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
            Err(source) => Err(StoreError::Io { action: "remove", path: path.to_owned(), source }),
        }
    }

    /// Makes the names of units that other processes have stored durable.
    pub(crate) fn sync(&self) -> Result<(), StoreError> {
        whole_file::sync_folder(&self.folder.join(COMPLETE)).map_err(StoreError::io("sync", &self.folder))
    }

    /// Stores the result of a unit. From then on the unit is done. Another process may store the same unit at
    /// the same time: both write the same bytes, and each replaces the whole file of the other.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn commit(&self, unit: usize, payload: &[u8]) -> Result<(), StoreError> {
        self.commit_together(&[(unit, payload)]).pop().unwrap_or(Ok(()))
    }

    /// Stores the results of several units, as [`Self::commit`] does with one. Returns the result of each in
    /// order. To sync many small files together takes a fraction of the time.
    pub(crate) fn commit_together(&self, units: &[(usize, &[u8])]) -> Vec<Result<(), StoreError>> {
        units.chunks(FINISHED_TOGETHER).flat_map(|units| self.commit_some(units)).collect()
    }

    fn commit_some(&self, units: &[(usize, &[u8])]) -> Vec<Result<(), StoreError>> {
        let mut results: Vec<io::Result<()>> = Vec::with_capacity(units.len());
        let mut written = Vec::with_capacity(units.len());
        for &(unit, payload) in units {
            let file = WholeFile::create(&self.unit_path(unit)).and_then(|mut to| {
                unit_file::write(&mut to, Self::number(unit), self.fingerprint, payload).map(|()| to)
            });
            results.push(file.map(|file| written.push(file)));
        }
        let mut finished = whole_file::finish_together(written).into_iter();
        for result in results.iter_mut().filter(|result| result.is_ok()) {
            *result = finished.next().unwrap_or(Ok(()));
        }
        units.iter().zip(results).map(|(&(unit, _), result)| self.committed(unit, result)).collect()
    }

    /// What came of storing a unit.
    fn committed(&self, unit: usize, written: io::Result<()>) -> Result<(), StoreError> {
        match written {
            // Other processes completed the pass in the meantime, and removed our temporary file.
            Err(error) if error.kind() == io::ErrorKind::NotFound && self.state(unit)? == UnitState::Done => {
                Ok(())
            }
            written => written.map_err(StoreError::io("write", &self.unit_path(unit))),
        }
    }

    /// Records why a unit failed, for people to read.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn record_failure(&self, unit: usize, failure: &serde_json::Value) -> Result<(), StoreError> {
        let path = self.folder.join(format!("unit-{unit:06}.err.json"));
        let text = format!("{failure:#}\n");
        whole_file::write(&path, |to| to.write_all(text.as_bytes())).map_err(StoreError::io("write", &path))
    }

    /// Removes the record of an earlier failure.
    pub fn clear_failure(&self, unit: usize) {
        let _ = fs_err::remove_file(self.folder.join(format!("unit-{unit:06}.err.json")));
    }
}

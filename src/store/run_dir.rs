//! The run directory `OUT/.chainage`: lock, identity of the run, one folder per pass, per-point columns.

use std::fs::{File, TryLockError};
use std::io::{Read, Seek, Write};
use std::ops::Range;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use bytemuck::Pod;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::codec;
use crate::error::Result;
use crate::model::in_u32;
use crate::store::column::Column;
use crate::store::unit_file::{self, FORMAT_VERSION, Refusal};
use crate::store::{Fingerprint, Inputs, StaleReason, StoreError};
use crate::whole_file;

/// Name of the folder with the state inside the output directory.
pub const STATE_FOLDER: &str = ".chainage";

/// Name of the record of the files that were written beside the state.
const OUTPUTS: &str = "outputs.json";

/// The program version that started the run.
#[derive(Debug, Serialize, Deserialize)]
struct Identity {
    program: String,
    state_version: u32,
}

/// An output directory with its state. This process holds the lock as long as the value lives (not if it was
/// opened to look only).
#[derive(Debug)]
pub struct RunDir {
    out: PathBuf,
    state: PathBuf,
    _lock: Option<File>,
}

impl RunDir {
    /// Creates or reopens the state in `out` and locks it. `fresh` discards the state of an earlier run.
    ///
    /// # Errors
    /// When another process holds the lock, the state is of another version, or the file system refuses.
    pub fn open(out: &Path, fresh: bool) -> Result<Self, StoreError> {
        let state = out.join(STATE_FOLDER);
        fs_err::create_dir_all(&state).map_err(StoreError::io("create", &state))?;
        let lock = lock(out, &state.join("lock"))?;
        let run = Self { out: out.to_owned(), state, _lock: Some(lock) };
        if fresh {
            run.discard()?;
        }
        match run.read_json::<Identity>("version.json")? {
            None => run.write_json("version.json", &identity())?,
            Some(old) => run.check_version(old)?,
        }
        Ok(run)
    }

    /// Opens the state in `out` to look at it. It takes no lock and changes nothing.
    ///
    /// # Errors
    /// When there is none, or it is of another version.
    pub fn inspect(out: &Path) -> Result<Self, StoreError> {
        let run = Self { out: out.to_owned(), state: out.join(STATE_FOLDER), _lock: None };
        match run.read_json::<Identity>("version.json")? {
            None => Err(StoreError::NoRun { path: out.to_owned() }),
            Some(old) => run.check_version(old).map(|()| run),
        }
    }

    fn check_version(&self, old: Identity) -> Result<(), StoreError> {
        if old.state_version == FORMAT_VERSION {
            return Ok(());
        }
        let new = identity();
        Err(StoreError::Version {
            path: self.out.clone(),
            old: old.program,
            old_version: old.state_version,
            new: new.program,
            new_version: new.state_version,
        })
    }

    /// Removes the state except for the lock and the names of the outputs, which remain files of chainage.
    fn discard(&self) -> Result<(), StoreError> {
        for entry in fs_err::read_dir(&self.state).map_err(StoreError::io("read", &self.state))? {
            let path = entry.map_err(StoreError::io("read", &self.state))?.path();
            if path.file_name().is_some_and(|name| name == "lock" || name == OUTPUTS) {
                continue;
            }
            let removed =
                if path.is_dir() { fs_err::remove_dir_all(&path) } else { fs_err::remove_file(&path) };
            removed.map_err(StoreError::io("remove", &path))?;
        }
        Ok(())
    }

    /// The output directory.
    #[must_use]
    pub fn out(&self) -> &Path {
        &self.out
    }

    /// A path inside the state.
    #[must_use]
    pub fn path(&self, name: &str) -> PathBuf {
        self.state.join(name)
    }

    /// Names of the files beside the state that this run and earlier runs have written or were about to
    /// write. All other files there are foreign.
    ///
    /// # Errors
    /// When the record cannot be read.
    pub fn own_outputs(&self) -> Result<Vec<String>, StoreError> {
        Ok(self.read_json(OUTPUTS)?.unwrap_or_default())
    }

    /// Records that files of these names are about to be written.
    ///
    /// # Errors
    /// When the record cannot be written.
    pub fn claim_outputs(&self, names: &[String]) -> Result<(), StoreError> {
        let mut all = self.own_outputs()?;
        let before = all.len();
        all.extend(names.iter().filter(|name| !all.contains(name)).cloned().collect::<Vec<_>>());
        if all.len() == before { Ok(()) } else { self.write_json(OUTPUTS, &all) }
    }

    /// Records that the files of these names are the only outputs.
    pub(crate) fn replace_outputs(&self, names: &[String]) -> Result<(), StoreError> {
        self.write_json(OUTPUTS, &names)
    }

    /// Reads a small JSON file of the state; `None` when there is none.
    ///
    /// # Errors
    /// When it cannot be read or does not have the expected content.
    pub fn read_json<T: DeserializeOwned>(&self, name: &str) -> Result<Option<T>, StoreError> {
        let path = self.path(name);
        match fs_err::read(&path) {
            Ok(bytes) => serde_json::from_slice(&bytes)
                .map(Some)
                .map_err(|error| StoreError::Damaged { path, what: error.to_string() }),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(StoreError::Io { action: "read", path, source: error }),
        }
    }

    /// Writes a small JSON file of the state.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write_json<T: Serialize>(&self, name: &str, value: &T) -> Result<(), StoreError> {
        let path = self.path(name);
        let mut bytes = serde_json::to_vec_pretty(value)
            .map_err(|error| StoreError::Damaged { path: path.clone(), what: error.to_string() })?;
        bytes.push(b'\n');
        whole_file::write(&path, |to| to.write_all(&bytes)).map_err(StoreError::io("write", &path))
    }

    /// Writes a text file of the state.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write_text(&self, name: &str, text: &str) -> Result<(), StoreError> {
        let path = self.path(name);
        whole_file::write(&path, |to| to.write_all(text.as_bytes())).map_err(StoreError::io("write", &path))
    }

    /// Appends a line to the log of events. A failure of this does not stop a run.
    pub fn log_event(&self, line: &str) {
        let path = self.path("events.jsonl");
        let appended = File::options().create(true).append(true).open(path);
        if let Ok(mut file) = appended {
            // One write call per line, so that lines of several threads do not mix.
            let _ = file.write_all(format!("{line}\n").as_bytes());
        }
    }

    /// The folder of a pass that depends on `inputs`.
    #[must_use]
    pub fn pass(&self, folder: &str, inputs: Inputs) -> PassDir {
        PassDir { folder: self.state.join(folder), fingerprint: inputs.fingerprint(), inputs }
    }

    /// Removes every pass whose folder begins with `prefix`, except those that `keep` accepts.
    ///
    /// # Errors
    /// When the file system refuses.
    pub fn remove_passes(&self, prefix: &str, keep: impl Fn(&str) -> bool) -> Result<(), StoreError> {
        for entry in fs_err::read_dir(&self.state).map_err(StoreError::io("read", &self.state))? {
            let path = entry.map_err(StoreError::io("read", &self.state))?.path();
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or("");
            if name.starts_with(prefix) && !keep(name) {
                fs_err::remove_dir_all(&path).map_err(StoreError::io("remove", &path))?;
            }
        }
        Ok(())
    }

    /// A column with one value per record of file number `file`, which has `records` records. The passes
    /// whose folders begin with `writers` fill it. If the column was lost or cut, these passes are
    /// removed.
    ///
    /// # Errors
    /// When it cannot be opened or created.
    pub(crate) fn column<T: Pod + Default>(
        &self,
        name: &str,
        file: usize,
        records: u64,
        writers: &str,
    ) -> Result<Column<T>, StoreError> {
        let folder = self.state.join(name);
        fs_err::create_dir_all(&folder).map_err(StoreError::io("create", &folder))?;
        let path = folder.join(format!("{file:05}"));
        if !Column::<T>::is_whole(&path, records) {
            self.remove_passes(writers, |_| false)?;
        }
        Column::open(&path, records).map_err(StoreError::io("open", &path))
    }
}

fn identity() -> Identity {
    Identity { program: env!("CARGO_PKG_VERSION").to_owned(), state_version: FORMAT_VERSION }
}

/// Takes the lock. The system releases it when the process ends, for whatever reason.
fn lock(out: &Path, path: &Path) -> Result<File, StoreError> {
    let io = |action| StoreError::io(action, path);
    let mut file =
        File::options().read(true).write(true).create(true).truncate(false).open(path).map_err(io("open"))?;
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => {
            let mut holder = String::new();
            let known = file.read_to_string(&mut holder).is_ok() && !holder.trim().is_empty();
            let holder = if known { holder.trim().to_owned() } else { "another process".to_owned() };
            return Err(StoreError::Locked { path: out.to_owned(), holder });
        }
        Err(TryLockError::Error(source)) => return Err(io("lock")(source)),
    }
    let text = format!("process {}\n", std::process::id());
    file.set_len(0)
        .and_then(|()| file.rewind())
        .and_then(|()| file.write_all(text.as_bytes()))
        .map_err(io("write"))?;
    Ok(file)
}

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

    /// The range of a section of the payload, see [`codec::pack`].
    pub(crate) fn section(&self, number: usize) -> Result<Range<u64>> {
        codec::section_range(&mut |part| self.read(part).ok(), number)
            .ok_or_else(|| codec::no_section(number))
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
}

impl PassDir {
    /// One number for all values that the pass depends on.
    #[must_use]
    pub fn fingerprint(&self) -> Fingerprint {
        self.fingerprint
    }

    fn unit_path(&self, unit: usize) -> PathBuf {
        self.folder.join(format!("unit-{unit:06}.bin"))
    }

    fn number(unit: usize) -> u32 {
        in_u32(unit, "units of a pass")
    }

    /// Creates the folder and records the values that the pass depends on. Results that depend on other
    /// values are removed all at once: units of this pass will overwrite the column values that belong to
    /// them, and with other tiles a unit overwrites values of several old units.
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
            let path = self.folder.join("inputs.json");
            let text = serde_json::to_string_pretty(&self.inputs)
                .map_err(|error| StoreError::Damaged { path: path.clone(), what: error.to_string() })?;
            whole_file::write(&path, |to| to.write_all(text.as_bytes()))
                .map_err(StoreError::io("write", &path))?;
        }
        Ok(())
    }

    fn stored_inputs(&self) -> Result<Option<Inputs>, StoreError> {
        let path = self.folder.join("inputs.json");
        match fs_err::read(&path) {
            // If this record is damaged, the run goes on, because each unit file has its own fingerprint.
            Ok(bytes) => Ok(serde_json::from_slice(&bytes).ok()),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
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
        let path = self.unit_path(unit);
        let mut bytes = match fs_err::read(&path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Err(UnitState::Missing)),
            Err(source) => return Err(StoreError::Io { action: "read", path, source }),
        };
        let range = match unit_file::decode(&bytes, Self::number(unit), self.fingerprint) {
            Ok(payload) => payload.len(),
            Err(refusal) => return Ok(Err(UnitState::Refused(refusal))),
        };
        // The payload ends before the footer; cut both ends in place instead of copying.
        let end = bytes.len() - unit_file::FOOTER_LEN;
        bytes.truncate(end);
        bytes.drain(..end - range);
        Ok(Ok(bytes))
    }

    /// Whether a unit has a stored result.
    ///
    /// # Errors
    /// When the file system refuses.
    pub fn state(&self, unit: usize) -> Result<UnitState, StoreError> {
        Ok(match self.load(unit)? {
            Ok(_) => UnitState::Done,
            Err(state) => state,
        })
    }

    /// The payload of a unit that the pass has just finished.
    ///
    /// # Errors
    /// When it is missing or damaged.
    pub fn payload(&self, unit: usize) -> Result<Vec<u8>, StoreError> {
        self.load(unit)?.map_err(|state| StoreError::Damaged {
            path: self.unit_path(unit),
            what: format!("{state:?} after it was written"),
        })
    }

    /// A reader of parts of the payload of a finished unit.
    ///
    /// # Errors
    /// When it is missing or belongs to another pass.
    pub(crate) fn reader(&self, unit: usize) -> Result<UnitReader, StoreError> {
        let path = self.unit_path(unit);
        let file = File::open(&path).map_err(StoreError::io("open", &path))?;
        let length = file.metadata().map_err(StoreError::io("read", &path))?.len();
        let mut header = [0; unit_file::HEADER_LEN];
        file.read_exact_at(&mut header, 0).map_err(StoreError::io("read", &path))?;
        match unit_file::payload_range(&header, length, Self::number(unit), self.fingerprint) {
            Ok(payload) => Ok(UnitReader { path, file, payload }),
            Err(refusal) => {
                Err(StoreError::Damaged { path, what: format!("{refusal:?} after it was written") })
            }
        }
    }

    /// Numbers of the units that have a file, whether or not it fits, ascending.
    ///
    /// # Errors
    /// When the file system refuses.
    pub fn stored_units(&self) -> Result<Vec<usize>, StoreError> {
        let entries = match fs_err::read_dir(&self.folder) {
            Ok(entries) => entries,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
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
        match fs_err::remove_dir_all(&self.folder) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(StoreError::Io { action: "remove", path: self.folder.clone(), source: error })
            }
            _ => Ok(()),
        }
    }

    /// Invalidates a unit's result before the values that belong to it are overwritten.
    ///
    /// # Errors
    /// When the file system refuses.
    pub fn invalidate(&self, unit: usize) -> Result<(), StoreError> {
        let path = self.unit_path(unit);
        match fs_err::remove_file(&path) {
            Ok(()) => whole_file::sync_folder(&path).map_err(StoreError::io("sync", &self.folder)),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
            Err(source) => Err(StoreError::Io { action: "remove", path, source }),
        }
    }

    /// Stores the result of a unit. From then on the unit is done.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn commit(&self, unit: usize, payload: &[u8]) -> Result<(), StoreError> {
        let path = self.unit_path(unit);
        let bytes = unit_file::encode(Self::number(unit), self.fingerprint, payload);
        whole_file::write(&path, |to| to.write_all(&bytes)).map_err(StoreError::io("write", &path))
    }

    /// Records for people why a unit failed.
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

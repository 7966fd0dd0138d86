//! The run directory `OUT/.chainage`: its lock, the identity of the run, one folder per pass, and small
//! files.

use std::fs::File;
use std::io::{ErrorKind, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::host;
use crate::store::lock::lock;
use crate::store::unit_file::FORMAT_VERSION;
use crate::store::wait::waited_for;
use crate::store::{Inputs, PassDir, StoreError};
use crate::whole_file;

/// Name of the folder with the state inside the output directory.
pub const STATE_FOLDER: &str = ".chainage";

/// Name of the record of the files that were written beside the state.
const OUTPUTS: &str = "outputs.json";

/// Name of the file that is locked.
const LOCK: &str = "lock";

/// Name of the record of the program version.
const VERSION: &str = "version.json";

/// The program version that drives the run.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Identity {
    program: String,
    state_version: u32,
}

/// An output directory with its state. A process that drives the run holds the lock as long as this value
/// lives. A worker has no lock: it only adds units. A process that inspects the run changes nothing.
#[derive(Debug)]
pub struct RunDir {
    out: PathBuf,
    state: PathBuf,
    _lock: Option<File>,
    /// Path of the log of events of this process, inside the state.
    events: String,
    /// How long to wait for a file that another process may still be writing.
    wait: Duration,
}

/// The log of events of the process that drives the run.
const EVENTS: &str = "events.jsonl";
/// The folder with a log of events per worker.
const EVENTS_OF_WORKERS: &str = "events";

impl RunDir {
    /// Creates or reopens the state in `out` and locks it. `fresh` discards the state of an earlier run.
    ///
    /// # Errors
    /// When another process holds the lock, the state is of another version, or the file system refuses.
    pub fn open(out: &Path, fresh: bool) -> Result<Self, StoreError> {
        let run = Self::lock(out)?;
        run.begin(fresh)?;
        Ok(run)
    }

    /// Creates the folder of the state in `out` if there is none, and locks it. Its content does not change
    /// before [`Self::begin`].
    pub(crate) fn lock(out: &Path) -> Result<Self, StoreError> {
        let state = out.join(STATE_FOLDER);
        fs_err::create_dir_all(&state).map_err(StoreError::io("create", &state))?;
        refuse_apart(out, &state)?;
        let lock = lock(out, &state.join(LOCK))?;
        let events = EVENTS.to_owned();
        Ok(Self { out: out.to_owned(), state, _lock: Some(lock), events, wait: Duration::ZERO })
    }

    /// Starts with the existing state, or discards it if `fresh`.
    pub(crate) fn begin(&self, fresh: bool) -> Result<(), StoreError> {
        if fresh {
            self.discard()?;
        }
        match self.read_json::<Identity>(VERSION)? {
            Some(old) if old == identity() => Ok(()),
            // Another program with the same state version may continue, and from now on its workers may, too.
            Some(old) => self.check_version(old).and_then(|()| self.write_json(VERSION, &identity())),
            None => self.write_json(VERSION, &identity()),
        }
    }

    /// Opens the state in `out` as a worker, which adds units and holds no lock. Waits up to `wait` for
    /// missing files.
    ///
    /// # Errors
    /// When there is none, or another version of the program drives the run.
    pub fn join(out: &Path, wait: Duration) -> Result<Self, StoreError> {
        let state = out.join(STATE_FOLDER);
        let events = format!("{EVENTS_OF_WORKERS}/{}-{}.jsonl", host::name(), std::process::id());
        let run = Self { out: out.to_owned(), state, _lock: None, events, wait };
        let old = waited_for(&run.state, wait, || run.read_json::<Identity>(VERSION))?;
        match old {
            None => return Err(StoreError::NoRun { path: out.to_owned() }),
            Some(old) if old == identity() => {}
            Some(old) => return Err(run.other_version(old)),
        }
        let folder = run.path(EVENTS_OF_WORKERS);
        fs_err::create_dir_all(&folder).map_err(StoreError::io("create", &folder))?;
        Ok(run)
    }

    /// Opens the state in `out` to inspect it. Takes no lock and changes nothing.
    ///
    /// # Errors
    /// When there is none, or it is of another version.
    pub fn inspect(out: &Path) -> Result<Self, StoreError> {
        let (events, wait) = (EVENTS.to_owned(), Duration::ZERO);
        let run = Self { out: out.to_owned(), state: out.join(STATE_FOLDER), _lock: None, events, wait };
        match run.read_json::<Identity>(VERSION)? {
            None => Err(StoreError::NoRun { path: out.to_owned() }),
            Some(old) => run.check_version(old).map(|()| run),
        }
    }

    fn check_version(&self, old: Identity) -> Result<(), StoreError> {
        if old.state_version == FORMAT_VERSION { Ok(()) } else { Err(self.other_version(old)) }
    }

    fn other_version(&self, old: Identity) -> StoreError {
        let new = identity();
        StoreError::Version {
            path: self.out.clone(),
            old: old.program,
            old_version: old.state_version,
            new: new.program,
            new_version: new.state_version,
        }
    }

    /// The same directory, waiting up to `wait` for missing files.
    #[must_use]
    pub fn waiting(self, wait: Duration) -> Self {
        Self { wait, ..self }
    }

    /// Removes the state except for the lock and the names of the outputs, which remain files of chainage.
    /// The passes go first, and the records of their input and version go last: if the process is killed in
    /// between, no result is mistaken for a result of other input.
    fn discard(&self) -> Result<(), StoreError> {
        for path in self.to_discard()? {
            let removed =
                if path.is_dir() { fs_err::remove_dir_all(&path) } else { fs_err::remove_file(&path) };
            removed.map_err(StoreError::io("remove", &path))?;
        }
        Ok(())
    }

    /// The paths to remove to start over, in this order.
    fn to_discard(&self) -> Result<Vec<PathBuf>, StoreError> {
        let rank = |path: &Path| match path.file_name() {
            _ if path.is_dir() => 0,
            Some(name) if name == Self::INPUT => 2,
            Some(name) if name == VERSION => 3,
            _ => 1,
        };
        let mut paths = Vec::new();
        for entry in fs_err::read_dir(&self.state).map_err(StoreError::io("read", &self.state))? {
            let path = entry.map_err(StoreError::io("read", &self.state))?.path();
            if path.file_name().is_some_and(|name| name != LOCK && name != OUTPUTS) {
                paths.push((rank(&path), path));
            }
        }
        paths.sort();
        Ok(paths.into_iter().map(|(_, path)| path).collect())
    }

    /// Whether a pass has a folder in the state.
    pub(crate) fn has_passes(&self) -> Result<bool, StoreError> {
        Ok(self.entries()?.iter().any(|name| name.starts_with(Self::PASS) && self.path(name).is_dir()))
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
        let names: Result<Option<Vec<String>>, StoreError> = self.read_json(OUTPUTS);
        let names = names.map_err(|error| match error {
            StoreError::Damaged { path, what } => StoreError::DamagedRecord { path, what },
            other => other,
        });
        Ok(names?.unwrap_or_default())
    }

    /// The real paths of the existing files in `out` that runs there have written.
    ///
    /// # Errors
    /// When the record cannot be read.
    pub(crate) fn outputs_in(out: &Path) -> Result<Vec<PathBuf>, StoreError> {
        let (events, wait) = (EVENTS.to_owned(), Duration::ZERO);
        let run = Self { out: out.to_owned(), state: out.join(STATE_FOLDER), _lock: None, events, wait };
        let names = run.own_outputs()?;
        Ok(names.iter().filter_map(|name| fs_err::canonicalize(out.join(name)).ok()).collect())
    }

    /// Records that files with these names are about to be written.
    ///
    /// # Errors
    /// When the record cannot be written.
    pub fn claim_outputs(&self, names: &[String]) -> Result<(), StoreError> {
        let mut all = self.own_outputs()?;
        let before = all.len();
        all.extend(names.iter().filter(|name| !all.contains(name)).cloned().collect::<Vec<_>>());
        if all.len() == before { Ok(()) } else { self.write_json(OUTPUTS, &all) }
    }

    /// Records that the files with these names are the only outputs.
    pub(crate) fn replace_outputs(&self, names: &[String]) -> Result<(), StoreError> {
        self.write_json(OUTPUTS, &names)
    }

    /// Reads a small JSON file of the state that another process may be writing; `None` when it does not
    /// appear in time.
    ///
    /// # Errors
    /// As [`Self::read_json`].
    pub fn await_json<T: DeserializeOwned>(&self, name: &str) -> Result<Option<T>, StoreError> {
        self.awaited(|| self.read_json(name))
    }

    /// Calls `look` until it finds something that another process may be writing, or until the waiting time
    /// is over.
    pub(crate) fn awaited<T>(
        &self,
        look: impl FnMut() -> Result<Option<T>, StoreError>,
    ) -> Result<Option<T>, StoreError> {
        waited_for(&self.state, self.wait, look)
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
            // If the folder is a file, nothing is in it, either.
            Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => Ok(None),
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

    /// Name of the record of the input with which the run was started.
    pub(crate) const INPUT: &'static str = "input.json";

    /// Beginning of the names of the folders of passes.
    pub(crate) const PASS: &'static str = "pass-";

    /// Names of its own files and folders in the state.
    pub(crate) const NAMES: [&'static str; 5] = [LOCK, OUTPUTS, VERSION, EVENTS, EVENTS_OF_WORKERS];

    /// Names of the files and folders in the state, in order.
    pub(crate) fn entries(&self) -> Result<Vec<String>, StoreError> {
        let mut names = Vec::new();
        for entry in fs_err::read_dir(&self.state).map_err(StoreError::io("read", &self.state))? {
            let name = entry.map_err(StoreError::io("read", &self.state))?.file_name();
            names.push(name.to_string_lossy().into_owned());
        }
        names.sort();
        Ok(names)
    }

    /// Appends a line to the log of events. A failure to do so does not stop a run.
    pub fn log_event(&self, line: &str) {
        let path = self.path(&self.events);
        let appended = File::options().create(true).append(true).open(path);
        if let Ok(mut file) = appended {
            // One write call per line, so that lines of several threads do not mix.
            let _ = file.write_all(format!("{line}\n").as_bytes());
        }
    }

    /// The folder of a pass that depends on `inputs`.
    #[must_use]
    pub fn pass(&self, folder: &str, inputs: Inputs) -> PassDir {
        PassDir::new(self.state.join(folder), inputs, self.wait)
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
}

/// Refuses a state on another file system than the outputs, because outputs are made in the state and then
/// renamed. A run would notice that at its end.
fn refuse_apart(out: &Path, state: &Path) -> Result<(), StoreError> {
    let device =
        |path: &Path| fs_err::metadata(path).map(|facts| facts.dev()).map_err(StoreError::io("read", path));
    // Two mounts of one device count as two file systems. The system compares the mounts before it looks for
    // the file, so a file that does not exist is enough.
    let [from, to] = [state, out].map(|folder| whole_file::temporary(&folder.join("none")));
    let refused = std::fs::rename(from, to).is_err_and(|error| error.kind() == ErrorKind::CrossesDevices);
    if refused || device(out)? != device(state)? {
        return Err(StoreError::Apart { out: out.to_owned(), state: state.to_owned() });
    }
    Ok(())
}

fn identity() -> Identity {
    Identity { program: env!("CARGO_PKG_VERSION").to_owned(), state_version: FORMAT_VERSION }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_tells_the_input_is_discarded_after_every_pass() {
        let out = tempfile::tempdir().unwrap();
        let run = RunDir::open(out.path(), false).unwrap();
        for name in [RunDir::INPUT, "a.json", "z.toml", OUTPUTS] {
            run.write_text(name, "[]").unwrap();
        }
        assert!(!run.has_passes().unwrap());
        for folder in ["pass-05-relabel", "pass-00-survey", "zz"] {
            fs_err::create_dir(run.path(folder)).unwrap();
        }
        assert!(run.has_passes().unwrap());
        let order = ["pass-00-survey", "pass-05-relabel", "zz", "a.json", "z.toml", RunDir::INPUT, VERSION];
        assert_eq!(run.to_discard().unwrap(), order.map(|name| run.path(name)));
        run.begin(true).unwrap();
        assert_eq!(run.entries().unwrap(), [LOCK, OUTPUTS, VERSION]);
    }

    #[test]
    fn a_state_on_another_file_system_is_refused_at_the_start() {
        // The one is on a disk, the other in memory.
        let disk = tempfile::tempdir_in(env!("CARGO_MANIFEST_DIR")).unwrap();
        let memory = tempfile::tempdir_in("/dev/shm").unwrap();
        std::os::unix::fs::symlink(memory.path(), disk.path().join(STATE_FOLDER)).unwrap();
        let error = RunDir::open(disk.path(), false).unwrap_err();
        assert!(matches!(error, StoreError::Apart { .. }), "{error}");
        assert_eq!(memory.path().read_dir().unwrap().count(), 0, "a run was begun");
        // A link to a folder of the same file system is fine.
        let out = tempfile::tempdir_in("/dev/shm").unwrap();
        std::os::unix::fs::symlink(memory.path(), out.path().join(STATE_FOLDER)).unwrap();
        RunDir::open(out.path(), false).unwrap();
    }

    #[test]
    fn a_folder_in_the_place_of_a_file_is_named_with_the_next_step() {
        for name in [LOCK, VERSION] {
            let out = tempfile::tempdir().unwrap();
            std::fs::create_dir_all(out.path().join(STATE_FOLDER).join(name)).unwrap();
            let error = crate::error::Error::from(RunDir::open(out.path(), false).unwrap_err());
            assert!(error.to_string().contains(name), "{error}");
            let hint = error.hint().unwrap_or_default();
            assert!(hint.starts_with("a folder is in the place of this file"), "{name}: {hint}");
        }
        let out = tempfile::tempdir().unwrap();
        std::fs::write(out.path().join(STATE_FOLDER), "a file").unwrap();
        let error = crate::error::Error::from(RunDir::open(out.path(), false).unwrap_err());
        let hint = error.hint().unwrap_or_default();
        assert!(hint.starts_with("a file is in the place of this folder"), "{error}: {hint}");
    }
}

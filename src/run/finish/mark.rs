//! The mark that says that every output of a run is there.

use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::run::finish::names::BESIDE;
use crate::store::{Fingerprint, PassDir, RunDir, StoreError};

const FINISHED: &str = "finished.json";

/// What a finished run left.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Finished {
    pub(crate) objects: usize,
    /// Names of the labelled copies.
    pub(crate) files: Vec<String>,
}

#[derive(Debug, Serialize, Deserialize)]
struct Mark {
    fingerprint: String,
    objects: usize,
    files: Vec<String>,
    /// Bytes of each file, so that one that was cut or replaced is noticed.
    bytes: Vec<u64>,
}

/// What an earlier call finished under the same fingerprint, if all of it is still there.
pub(crate) fn already_finished(run_dir: &RunDir, export: Fingerprint) -> Result<Option<Finished>> {
    let Some(mark) = run_dir.read_json::<Mark>(FINISHED)? else { return Ok(None) };
    let names = mark.files.iter().map(String::as_str).chain(BESIDE);
    let size = |name: &str| fs_err::metadata(run_dir.out().join(name)).map(|facts| facts.len()).ok();
    let whole = names.zip(&mark.bytes).all(|(name, &bytes)| size(name) == Some(bytes));
    let same = mark.fingerprint == export.to_string();
    Ok((same && whole).then_some(Finished { objects: mark.objects, files: mark.files }))
}

/// Removes the mark before outputs are written again. Units of the export whose files have already been named have
/// nothing left to resume from, so they go too.
pub(crate) fn withdraw(run_dir: &RunDir, export: &PassDir) -> Result<()> {
    if run_dir.read_json::<Mark>(FINISHED)?.is_some() {
        export.clear()?;
        let path = run_dir.path(FINISHED);
        fs_err::remove_file(&path).map_err(StoreError::io("remove", &path))?;
    }
    Ok(())
}

/// Marks the run, whose last output has been written, as finished and removes what only an unfinished export needs.
pub(crate) fn mark_finished(run_dir: &RunDir, export: &PassDir, finished: &Finished) -> Result<()> {
    let mut bytes = Vec::new();
    for name in finished.files.iter().map(String::as_str).chain(BESIDE) {
        let path = run_dir.out().join(name);
        bytes.push(fs_err::metadata(&path).map_err(StoreError::io("read", &path))?.len());
    }
    let fingerprint = export.fingerprint().to_string();
    let (objects, files) = (finished.objects, finished.files.clone());
    run_dir.write_json(FINISHED, &Mark { fingerprint, objects, files, bytes })?;
    export.clear()?;
    let folder = run_dir.path("export");
    Ok(fs_err::remove_dir_all(&folder).map_err(StoreError::io("remove", &folder))?)
}

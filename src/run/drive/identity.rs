//! Whether the input of a run directory is still the input of this call, and whether the two stay apart.

use std::path::Path;
use std::time::UNIX_EPOCH;

use serde::{Deserialize, Serialize};

use crate::codec;
use crate::error::Result;
use crate::input::{Catalog, InputFile};
use crate::run::drive::{BlockRun, Drive};
use crate::store::{PassDir, RunDir, StoreError, UnitState};
use crate::survey::SurveyPart;

/// One input file as it was when the run began.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct FileIdentity {
    name: String,
    bytes: u64,
    records: u64,
    /// Nanoseconds since 1970.
    modified_ns: u128,
}

impl FileIdentity {
    fn of(file: &InputFile) -> Self {
        let modified_ns = file.modified().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos());
        let name = file.name().to_owned();
        Self { name, bytes: file.size_bytes(), records: file.point_count(), modified_ns }
    }
}

const NAME: &str = "input.json";

/// Refuses an output directory that holds an input file: input is never written, and never at risk.
pub(crate) fn check_apart(catalog: &Catalog, out: &Path) -> Result<()> {
    let Ok(out) = fs_err::canonicalize(out) else { return Ok(()) };
    for file in catalog.files() {
        if let Ok(path) = fs_err::canonicalize(file.path())
            && path.parent() == Some(&out)
        {
            return Err(StoreError::InTheWay { path }.into());
        }
    }
    Ok(())
}

/// Refuses files with other names, sizes or record counts than those the run was begun with; records them when the
/// run begins.
pub(crate) fn check_input(run_dir: &RunDir, catalog: &Catalog) -> Result<()> {
    let now: Vec<FileIdentity> = catalog.files().iter().map(FileIdentity::of).collect();
    let Some(stored) = run_dir.read_json::<Vec<FileIdentity>>(NAME)? else {
        return Ok(run_dir.write_json(NAME, &now)?);
    };
    let other = |what: String| Err(StoreError::OtherInput { path: run_dir.out().to_owned(), what }.into());
    if stored.len() != now.len() {
        return other(format!("{} files then, {} now", stored.len(), now.len()));
    }
    for (old, new) in stored.iter().zip(&now) {
        if old.name != new.name {
            return other(format!("file {} then, {} in its place now", old.name, new.name));
        }
        if old.bytes != new.bytes || old.records != new.records {
            return other(format!(
                "{} had {} bytes and {} records then, {} bytes and {} records now",
                old.name, old.bytes, old.records, new.bytes, new.records
            ));
        }
    }
    Ok(())
}

/// Compares the content of files whose time of modification differs with what the survey saw, and refuses other
/// content. A file that was only copied or touched is accepted. `runs` are the units of the survey in `dir`, and `survey`
/// surveys one of them without keeping anything.
pub(crate) fn check_content(
    run_dir: &RunDir,
    drive: &Drive,
    dir: &PassDir,
    runs: &[BlockRun],
    survey: &dyn Fn(usize) -> Result<SurveyPart>,
) -> Result<()> {
    let now: Vec<FileIdentity> = drive.catalog.files().iter().map(FileIdentity::of).collect();
    let stored = run_dir.read_json::<Vec<FileIdentity>>(NAME)?.unwrap_or_default();
    if stored == now {
        return Ok(());
    }
    for (unit, run) in runs.iter().enumerate() {
        if stored.get(run.file) == now.get(run.file) || dir.state(unit)? != UnitState::Done {
            continue;
        }
        let old: SurveyPart = codec::decode(&dir.payload(unit)?)?;
        if old.content != survey(unit)?.content {
            let what = format!("the points of {} have changed", now[run.file].name);
            return Err(StoreError::OtherInput { path: run_dir.out().to_owned(), what }.into());
        }
    }
    Ok(run_dir.write_json(NAME, &now)?)
}

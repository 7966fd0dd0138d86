//! Checks that the input is still the input with which the run was started, and that it is not in the output
//! directory.

use std::path::Path;
use std::time::UNIX_EPOCH;

use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::input::{Catalog, InputFile};
use crate::run::drive::{BlockRun, Drive};
use crate::store::{PassDir, RunDir, StoreError, UnitState};
use crate::survey::SurveyPart;

/// One input file at the start of the run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct FileIdentity {
    name: String,
    bytes: u64,
    records: u64,
    /// Digest of what is in the file besides points.
    header: u64,
    /// Nanoseconds since 1970.
    modified_ns: u128,
}

impl FileIdentity {
    fn of(file: &InputFile) -> Result<Self> {
        let modified_ns = file.modified().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos());
        let name = file.name().to_owned();
        let (bytes, records, header) = (file.size_bytes(), file.point_count(), file.header_digest()?);
        Ok(Self { name, bytes, records, header, modified_ns })
    }
}

const NAME: &str = RunDir::INPUT;

/// Refuses an output directory that contains an input file, so that input is never overwritten.
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

/// Refuses files whose names, sizes, record counts or headers differ from those at the start of the run. At
/// the start, before any pass has results, it records them.
pub(crate) fn check_input(run_dir: &RunDir, catalog: &Catalog) -> Result<()> {
    if run_dir.read_json::<Vec<FileIdentity>>(NAME)?.is_none() && !run_dir.has_passes()? {
        let now = catalog.files().iter().map(FileIdentity::of).collect::<Result<Vec<_>>>()?;
        run_dir.write_json(NAME, &now)?;
    }
    check_recorded(run_dir, catalog)
}

/// Refuses files whose names, sizes, record counts or headers differ from those that the start of the run has
/// recorded.
pub(crate) fn check_recorded(run_dir: &RunDir, catalog: &Catalog) -> Result<()> {
    let now = catalog.files().iter().map(FileIdentity::of).collect::<Result<Vec<_>>>()?;
    let Some(stored) = run_dir.await_json::<Vec<FileIdentity>>(NAME)? else {
        // Without the record, results of other input would pass for results of this one.
        return Err(match run_dir.has_passes()? {
            true => StoreError::NoIdentity { path: run_dir.path(NAME) }.into(),
            false => StoreError::NoRun { path: run_dir.out().to_owned() }.into(),
        });
    };
    let other = |what: String| Err(StoreError::OtherInput { path: run_dir.out().to_owned(), what }.into());
    if stored.len() != now.len() {
        return other(format!("number of files: {} before, {} now", stored.len(), now.len()));
    }
    for (old, new) in stored.iter().zip(&now) {
        if old.name != new.name {
            return other(format!("file {} before, {} now", old.name, new.name));
        }
        if old.bytes != new.bytes || old.records != new.records {
            return other(format!(
                "{} had {} bytes and {} records before, now it has {} bytes and {} records",
                old.name, old.bytes, old.records, new.bytes, new.records
            ));
        }
        if old.header != new.header {
            return other(format!(
                "the header of {} is another one than before (scale, offset, extent or coordinate reference system)",
                old.name
            ));
        }
    }
    Ok(())
}

/// Name of the record that files with these modification times were compared.
fn compared(files: &[FileIdentity]) -> String {
    let mut hasher = xxhash_rust::xxh3::Xxh3::new();
    for file in files {
        hasher.update(file.name.as_bytes());
        hasher.update(&file.modified_ns.to_le_bytes());
    }
    format!("input-{:016x}.json", hasher.digest())
}

/// Whether a file of the state records input files.
pub(crate) fn is_name(name: &str) -> bool {
    name == NAME || is_comparison(name)
}

/// Whether it records that input files were compared. Workers write it, too.
pub(crate) fn is_comparison(name: &str) -> bool {
    name.starts_with("input-")
}

/// For files with another modification time, compares their content with the content at the survey. Other
/// content is refused. A file that was only copied or touched is accepted, and the comparison is recorded:
/// otherwise, nodes with copies of the input would repeat it in every process. `runs` are the units of the
/// survey in `dir`, `stored_part` reads one of them, and `survey` surveys one and stores nothing.
pub(crate) fn check_content(
    run_dir: &RunDir,
    drive: &Drive,
    dir: &PassDir,
    runs: &[BlockRun],
    stored_part: &dyn Fn(usize) -> Result<SurveyPart>,
    survey: &dyn Fn(usize) -> Result<SurveyPart>,
) -> Result<()> {
    let now = drive.catalog.files().iter().map(FileIdentity::of).collect::<Result<Vec<_>>>()?;
    let stored = run_dir.read_json::<Vec<FileIdentity>>(NAME)?.unwrap_or_default();
    if stored == now || was_compared(run_dir, &now)? {
        return Ok(());
    }
    for (unit, run) in runs.iter().enumerate() {
        if stored.get(run.file) == now.get(run.file) || dir.state(unit)? != UnitState::Done {
            continue;
        }
        if stored_part(unit)?.content != survey(unit)?.content {
            let what = format!("the points of {} have changed", now[run.file].name);
            return Err(StoreError::OtherInput { path: run_dir.out().to_owned(), what }.into());
        }
    }
    Ok(run_dir.write_json(&compared(&now), &now)?)
}

/// Whether an earlier call has compared the content of these files with the content at the survey.
fn was_compared(run_dir: &RunDir, now: &[FileIdentity]) -> Result<bool> {
    let recorded = run_dir.read_json::<Vec<FileIdentity>>(&compared(now))?;
    Ok(recorded.is_some_and(|recorded| recorded == now))
}

/// Names of the files whose modification time differs from the start of the run and whose content no call has
/// compared since.
pub(crate) fn touched(run_dir: &RunDir, catalog: &Catalog) -> Result<Vec<String>> {
    let now = catalog.files().iter().map(FileIdentity::of).collect::<Result<Vec<_>>>()?;
    let stored = run_dir.read_json::<Vec<FileIdentity>>(NAME)?.unwrap_or_default();
    if was_compared(run_dir, &now)? {
        return Ok(Vec::new());
    }
    let changed = now.into_iter().zip(&stored).filter(|(now, stored)| now != *stored);
    Ok(changed.map(|(now, _)| now.name).collect())
}

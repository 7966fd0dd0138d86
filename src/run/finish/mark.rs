//! The mark that every output of a run is complete.

use serde::{Deserialize, Serialize};

use crate::config::Config;
use crate::error::Result;
use crate::run::finish::names;
use crate::store::{Fingerprint, PassDir, RunDir, StoreError};

pub(crate) const FINISHED: &str = "finished.json";

/// The outputs of a finished run.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Finished {
    pub(crate) objects: usize,
    /// Names of the labelled copies and charts.
    pub(crate) files: Vec<String>,
}

#[derive(Debug, Serialize, Deserialize)]
struct Mark {
    fingerprint: String,
    objects: usize,
    files: Vec<String>,
    /// Size of each file in bytes, so that a cut or replaced file is noticed.
    bytes: Vec<u64>,
    /// Digest of the settings of the last call that found all outputs complete. Without the input, only this
    /// digest shows that the outputs fit the settings. `None` in marks of earlier versions.
    #[serde(default)]
    settings: Option<String>,
}

impl Mark {
    /// Whether all outputs exist: the files of the mark, and those beside them.
    fn is_whole(&self, run_dir: &RunDir, beside: &[&str]) -> bool {
        let names = self.files.iter().map(String::as_str).chain(beside.iter().copied());
        let size = |name: &str| fs_err::metadata(run_dir.out().join(name)).map(|facts| facts.len()).ok();
        names.map(size).eq(self.bytes.iter().copied().map(Some))
    }
}

/// The outputs of an earlier call with the same fingerprint, if all of them still exist.
pub(crate) fn already_finished(
    run_dir: &RunDir,
    export: Fingerprint,
    beside: &[&str],
) -> Result<Option<Finished>> {
    let Some(mark) = run_dir.read_json::<Mark>(FINISHED)? else { return Ok(None) };
    let fits = mark.fingerprint == export.to_string() && mark.is_whole(run_dir, beside);
    Ok(fits.then_some(Finished { objects: mark.objects, files: mark.files }))
}

/// Whether an earlier call finished with these settings and all of its outputs still exist. It is for runs
/// whose input or model is gone, so that the values that the outputs depend on cannot be known.
pub(crate) fn is_finished_with(run_dir: &RunDir, config: &Config) -> Result<bool> {
    let Some(mark) = run_dir.read_json::<Mark>(FINISHED)? else { return Ok(false) };
    // Without its model, the method cannot be asked whether it finds surfaces.
    let whole = [false, true].map(|surfaces| mark.is_whole(run_dir, &names::beside(config, surfaces)));
    Ok(mark.settings == Some(config.digest()) && whole.contains(&true))
}

/// Records that the outputs fit these settings as well. `rewritten`: whether files beside the copies were
/// written again.
pub(crate) fn fits_also(run_dir: &RunDir, config: &Config, beside: &[&str], rewritten: bool) -> Result<()> {
    let settings = Some(config.digest());
    match run_dir.read_json::<Mark>(FINISHED)? {
        Some(mark) if rewritten || mark.settings != settings => {
            let bytes = sizes(run_dir, &mark.files, beside)?;
            Ok(run_dir.write_json(FINISHED, &Mark { settings, bytes, ..mark })?)
        }
        _ => Ok(()),
    }
}

/// Size of each output in bytes.
fn sizes(run_dir: &RunDir, files: &[String], beside: &[&str]) -> Result<Vec<u64>> {
    let names = files.iter().map(String::as_str).chain(beside.iter().copied());
    let size = |name| {
        let path = run_dir.out().join(name);
        Ok(fs_err::metadata(&path).map_err(StoreError::io("read", &path))?.len())
    };
    names.map(size).collect()
}

/// Removes the mark before outputs are written again. If the output files already have their names, the units
/// of the export have no files to resume from, so these units are removed as well.
pub(crate) fn withdraw(run_dir: &RunDir, export: &PassDir) -> Result<()> {
    if run_dir.read_json::<Mark>(FINISHED)?.is_some() {
        export.clear()?;
        let path = run_dir.path(FINISHED);
        fs_err::remove_file(&path).map_err(StoreError::io("remove", &path))?;
    }
    Ok(())
}

/// Marks the run as finished after its last output was written, and removes what only unfinished outputs
/// need: the files of the export, its units, and the units of the cloud-optimised file, which may be from an
/// earlier run that did not finish.
pub(crate) fn mark_finished(
    run_dir: &RunDir,
    export: &PassDir,
    cloud: &[PassDir],
    finished: &Finished,
    (config, beside): (&Config, &[&str]),
) -> Result<()> {
    let bytes = sizes(run_dir, &finished.files, beside)?;
    let fingerprint = export.fingerprint().to_string();
    let objects = finished.objects;
    let files = finished.files.clone();
    let settings = Some(config.digest());
    run_dir.write_json(FINISHED, &Mark { fingerprint, objects, files, bytes, settings })?;
    clear(run_dir, export, cloud)
}

/// Removes what only unfinished outputs need. If a run was killed between the mark and this removal, the next
/// call removes it.
pub(crate) fn clear(run_dir: &RunDir, export: &PassDir, cloud: &[PassDir]) -> Result<()> {
    export.clear()?;
    cloud.iter().try_for_each(PassDir::clear)?;
    let folder = run_dir.path("export");
    match fs_err::remove_dir_all(&folder) {
        // Without labelled copies there is none.
        Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
            Err(StoreError::io("remove", &folder)(source).into())
        }
        _ => Ok(()),
    }
}

//! Opens a request: the drive, its methods, and a run directory that is locked, or shared with other
//! processes.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::config::Config;
use crate::error::Result;
use crate::host;
use crate::input::{Catalog, InputOptions};
use crate::run::chain::{Chain, Registries};
use crate::run::drive::{Drive, identity};
use crate::run::passes::survey::SurveyPass;
use crate::run::plan::Budget;
use crate::store::{RunDir, StoreError};
use crate::survey::SurveyError;

/// A drive with the methods and the settings of a run.
pub(crate) struct Opened<'a> {
    pub(crate) config: &'a Config,
    pub(crate) drive: Drive,
    pub(crate) chain: Chain,
    pub(crate) budget: Budget,
}

/// File with the input paths of the last call, and the digest of its settings.
pub(crate) const REQUEST: &str = "request.json";
/// File with the settings of the last call.
pub(crate) const CONFIGURATION: &str = "run.toml";

/// Opens the files of a drive according to the settings.
pub(crate) fn catalog(inputs: &[PathBuf], config: &Config) -> Result<Catalog> {
    catalog_beside(inputs, config, None)
}

/// The same for a run in the folder `out`. Files that an earlier call wrote there are not input, even if the
/// folder is among the searched ones.
pub(crate) fn catalog_beside(inputs: &[PathBuf], config: &Config, out: Option<&Path>) -> Result<Catalog> {
    let mmap = config.input.mmap && shared_by(inputs).is_none();
    let written = match out {
        // A state that cannot be read is an error once the state is opened.
        Some(out) => RunDir::outputs_in(out).unwrap_or_default(),
        None => Vec::new(),
    };
    let options = InputOptions { mmap, unit: config.input.unit };
    Ok(Catalog::open_without(inputs, &written, &options)?)
}

/// Refuses a drive without points.
pub(crate) fn refuse_empty(catalog: &Catalog) -> Result<()> {
    if catalog.point_count() > 0 {
        return Ok(());
    }
    let files = catalog.files();
    let file = files.first().filter(|_| files.len() == 1).map(|file| file.path().to_owned());
    Err(SurveyError::Empty { files: files.len(), file }.into())
}

/// The first of these paths that is on a network file system, and the kind of that file system.
fn shared_by(inputs: &[PathBuf]) -> Option<(&Path, &'static str)> {
    inputs.iter().find_map(|input| {
        // A pattern is not a path, but its folder is.
        let mut path = Some(&**input);
        while let Some(here) = path.filter(|here| !here.exists()) {
            path = here.parent();
        }
        let path = path.filter(|path| !path.as_os_str().is_empty()).unwrap_or(Path::new("."));
        host::shared_file_system(path).map(|kind| (&**input, kind))
    })
}

/// The warning about the file system of the input, if any.
pub(crate) fn file_system_warning(inputs: &[PathBuf], config: &Config) -> Option<String> {
    let (path, kind) = shared_by(inputs).filter(|_| config.input.mmap)?;
    let path = path.display();
    Some(format!("{path} is on {kind}: files are read and not mapped into memory (as with --no-mmap)"))
}

impl<'a> Opened<'a> {
    /// Opens a drive to inspect it, without a run directory, or with one that is not changed.
    pub(crate) fn to_look(
        inputs: &[PathBuf],
        out: Option<&Path>,
        config: &'a Config,
        registries: &Registries<'_>,
    ) -> Result<Self> {
        let drive = Drive::new(catalog_beside(inputs, config, out)?, config);
        let chain = Chain::build(config, registries, drive.lattice())?;
        Ok(Self { config, drive, chain, budget: Budget::resolve(&config.run) })
    }

    /// Opens a drive to run its passes in a locked run directory. Checks that the run directory belongs to
    /// this input, and to its content. Nothing of the request is recorded before [`Self::record`].
    pub(crate) fn to_run(
        catalog: Catalog,
        chain: Chain,
        config: &'a Config,
        run_dir: &RunDir,
    ) -> Result<Self> {
        identity::check_input(run_dir, &catalog)?;
        let drive = Drive::new(catalog, config);
        SurveyPass::of(&drive, config, Some(run_dir)).check_content()?;
        Ok(Self { config, drive, chain, budget: Budget::resolve(&config.run) })
    }

    /// Records the input paths and the settings of a run that was not refused, for `status`, workers and
    /// reductions.
    pub(crate) fn record(&self, run_dir: &RunDir, inputs: &[PathBuf]) -> Result<()> {
        let paths: Vec<PathBuf> =
            inputs.iter().map(|path| fs_err::canonicalize(path).unwrap_or_else(|_| path.clone())).collect();
        let version = env!("CARGO_PKG_VERSION");
        let settings = self.config.to_toml();
        let text = format!("# configuration of the last call, chainage {version}\n{settings}");
        run_dir.write_text(CONFIGURATION, &text)?;
        Ok(run_dir
            .write_json(REQUEST, &Recorded { inputs: paths, configuration: digest(text.as_bytes()) })?)
    }

    /// Opens the drive of a run that another process drives. Checks that the run directory belongs to this
    /// input.
    pub(crate) fn to_share(
        inputs: &[PathBuf],
        config: &'a Config,
        registries: &Registries<'_>,
        run_dir: &RunDir,
    ) -> Result<Self> {
        let catalog = catalog_beside(inputs, config, Some(run_dir.out()))?;
        identity::check_recorded(run_dir, &catalog)?;
        let drive = Drive::new(catalog, config);
        let chain = Chain::build(config, registries, drive.lattice())?;
        Ok(Self { config, drive, chain, budget: Budget::resolve(&config.run) })
    }
}

/// The request of the last call.
#[derive(Debug, Serialize, Deserialize)]
struct Recorded {
    inputs: Vec<PathBuf>,
    /// XXH3 of the text of the settings. A truncated text would still be valid settings, with defaults for
    /// the lost part.
    configuration: String,
}

fn digest(text: &[u8]) -> String {
    format!("{:016x}", xxhash_rust::xxh3::xxh3_64(text))
}

/// The input paths of the last call, and the path of its settings.
pub(crate) fn recorded(run_dir: &RunDir) -> Result<(Vec<PathBuf>, PathBuf)> {
    let path = run_dir.path(CONFIGURATION);
    let mut recorded = false;
    // Another process may have written only one of the two files so far.
    let found = run_dir.awaited(|| {
        let Some(request) = run_dir.read_json::<Recorded>(REQUEST)? else { return Ok(None) };
        recorded = true;
        let text = fs_err::read(&path).map_err(StoreError::io("read", &path))?;
        Ok((digest(&text) == request.configuration).then_some(request.inputs))
    })?;
    match found {
        Some(inputs) => Ok((inputs, path)),
        None if recorded => {
            let what = "its content is not what the last call has written".to_owned();
            Err(StoreError::Damaged { path, what }.into())
        }
        None => Err(StoreError::NoRun { path: run_dir.out().to_owned() }.into()),
    }
}

/// Whether the settings of the last call are still those that a process has read as the text `settings`. A
/// record that cannot be read counts as unchanged.
pub(crate) fn is_recorded_now(run_dir: &RunDir, settings: &[u8]) -> bool {
    match run_dir.read_json::<Recorded>(REQUEST) {
        Ok(now) => now.is_some_and(|now| now.configuration == digest(settings)),
        Err(_) => true,
    }
}

/// Locks the run directory `out`, after checks that there are points to process and that no input is in that
/// directory. The state is not read before [`RunDir::begin`].
pub(crate) fn lock(catalog: &Catalog, out: &Path) -> Result<RunDir> {
    refuse_empty(catalog)?;
    identity::check_apart(catalog, out)?;
    Ok(RunDir::lock(out)?)
}

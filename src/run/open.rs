//! From a request to an opened drive, its methods, and a locked run directory.

use std::path::{Path, PathBuf};

use crate::config::Config;
use crate::error::Result;
use crate::input::{Catalog, InputOptions};
use crate::run::chain::{Chain, Registries};
use crate::run::drive::{Drive, identity};
use crate::run::passes::survey;
use crate::run::plan::Budget;
use crate::store::RunDir;

/// A drive with the methods and the settings that it is processed with.
pub(crate) struct Opened<'a> {
    pub(crate) config: &'a Config,
    pub(crate) drive: Drive,
    pub(crate) chain: Chain,
    pub(crate) budget: Budget,
}

/// Record of the input paths of the last call.
const REQUEST: &str = "request.json";
/// Record of its settings.
const CONFIGURATION: &str = "run.toml";

/// Opens the files of a drive as the settings say.
pub(crate) fn catalog(inputs: &[PathBuf], config: &Config) -> Result<Catalog> {
    Ok(Catalog::open(inputs, &InputOptions { mmap: config.input.mmap, unit: config.input.unit })?)
}

impl<'a> Opened<'a> {
    /// A drive to look at: without a run directory, or with one that stays as it is.
    pub(crate) fn to_look(
        inputs: &[PathBuf],
        config: &'a Config,
        registries: &Registries<'_>,
    ) -> Result<Self> {
        let drive = Drive::without_columns(catalog(inputs, config)?, config);
        let chain = Chain::build(config, registries, drive.lattice())?;
        Ok(Self { config, drive, chain, budget: Budget::resolve(&config.run) })
    }

    /// A drive whose passes are run in a locked run directory, which is that of this input.
    pub(crate) fn to_run(
        inputs: &[PathBuf],
        catalog: Catalog,
        chain: Chain,
        config: &'a Config,
        run_dir: &RunDir,
    ) -> Result<Self> {
        identity::check_input(run_dir, &catalog)?;
        record(run_dir, inputs, config)?;
        let drive = Drive::open(catalog, config, run_dir, &survey::folder())?;
        Ok(Self { config, drive, chain, budget: Budget::resolve(&config.run) })
    }
}

/// Records the input paths and the settings of a run, for `status`.
fn record(run_dir: &RunDir, inputs: &[PathBuf], config: &Config) -> Result<()> {
    let paths: Vec<PathBuf> =
        inputs.iter().map(|path| fs_err::canonicalize(path).unwrap_or_else(|_| path.clone())).collect();
    run_dir.write_json(REQUEST, &paths)?;
    let version = env!("CARGO_PKG_VERSION");
    let text = format!("# configuration of the last call, chainage {version}\n{}", config.to_toml());
    Ok(run_dir.write_text(CONFIGURATION, &text)?)
}

/// The input paths of the last call, and the path of its settings.
pub(crate) fn recorded(run_dir: &RunDir) -> Result<(Vec<PathBuf>, PathBuf)> {
    Ok((run_dir.read_json(REQUEST)?.unwrap_or_default(), run_dir.path(CONFIGURATION)))
}

/// The run directory `out`, locked, and apart from the input.
pub(crate) fn lock(catalog: &Catalog, out: &Path, fresh: bool) -> Result<RunDir> {
    identity::check_apart(catalog, out)?;
    Ok(RunDir::open(out, fresh)?)
}

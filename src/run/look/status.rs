//! The state of a run directory: which units are done, which are left, which are stale and why. It changes
//! nothing: it walks the flow with a driver that computes nothing.

use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::config::{Config, DEFAULT_TOML};
use crate::error::{Error, ErrorKind, Result};
use crate::run::chain::Registries;
use crate::run::drive::identity;
use crate::run::engine::{Nobody, PassState};
use crate::run::finish::mark;
use crate::run::flow::{self, Outcome};
use crate::run::open::{self, Opened};
use crate::store::{RunDir, StaleReason};

/// The state of one pass.
#[derive(Debug, Clone, Serialize)]
pub struct PassStatus {
    /// Its name.
    pub pass: &'static str,
    /// Its name with its round, as `work --pass` takes it: `growth`, `growth-round-2`.
    pub title: String,
    /// Number of units. `None` if it is not known before an earlier pass is complete.
    pub units: Option<usize>,
    /// Number of units with a stored result that fits.
    pub done: usize,
    /// Number of units with a stored result that is damaged, or that depends on a value that has changed.
    pub stale: usize,
    /// The changed values.
    pub why: Vec<StaleReason>,
}

/// The state of a run.
#[derive(Debug, Clone, Serialize)]
pub struct RunStatus {
    /// Output directory.
    pub out: PathBuf,
    /// Input files.
    pub inputs: Vec<PathBuf>,
    /// Passes in order. The last passes of a finished run have no units, because their state is not kept.
    /// Empty if something is [`Self::missing`].
    pub passes: Vec<PassStatus>,
    /// The old and the new method, if the settings ask for another method than the last call.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub method: Option<StaleReason>,
    /// Whether all outputs exist and fit.
    pub finished: bool,
    /// Whether the settings equal those of the last call. Only the settings of the last call say what the
    /// same command will do.
    pub same_settings: bool,
    /// Whether all outputs exist and fit the settings of the last call.
    pub finished_before: bool,
    /// Names of the input files that were changed or touched since the run was started. The next run compares
    /// their content.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub touched: Vec<String>,
    /// Why the input or the model can no longer be opened. The run is finished nevertheless.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub missing: Option<String>,
}

/// The state of the run in `out`. It is compared with the last configuration, or with the settings that
/// `resolve` returns for the path of that configuration.
///
/// # Errors
/// When there is no run, when its input differs, or when it is not finished and its input can no longer be
/// opened.
pub fn status(
    out: &Path,
    registries: &Registries<'_>,
    resolve: impl FnOnce(&Path) -> Result<Config>,
) -> Result<RunStatus> {
    let run_dir = RunDir::inspect(out)?;
    let (inputs, configuration) = open::recorded(&run_dir)?;
    let last = Config::resolve(Some(&configuration), &[])?;
    let config = resolve(&configuration)?;
    let seen = |config: &Config| {
        let open = Opened::to_share(&inputs, config, registries, &run_dir)?;
        let touched = identity::touched(&run_dir, &open.drive.catalog)?;
        let mut driver = Nobody::new(&run_dir);
        let outcome = walk(&open, &mut driver, &run_dir)?;
        let finished = outcome.is_some_and(|outcome| outcome.unmarked.is_none());
        let passes: Vec<PassStatus> = driver.finish()?.into_iter().map(PassStatus::of).collect();
        Ok::<_, Error>(Seen { finished, passes, touched, missing: None })
    };
    let same_settings = last.first_difference(&config).is_none();
    let (Seen { finished, passes, touched, missing }, finished_before) = match seen(&config) {
        Ok(now) if now.finished || same_settings => {
            let before = now.finished;
            (now, before)
        }
        Ok(now) => (now, seen(&last)?.finished),
        Err(error) if error.kind() == ErrorKind::Input && mark::is_finished_with(&run_dir, &last)? => {
            (Seen { finished: same_settings, missing: Some(error.to_string()), ..Seen::default() }, true)
        }
        Err(error) => return Err(error),
    };
    let (old, new) = (last.cluster.method, config.cluster.method);
    let method = (old != new).then(|| StaleReason {
        name: "cluster.method".to_owned(),
        old: Some(old),
        new: Some(new),
    });
    let out = out.to_owned();
    Ok(RunStatus { out, inputs, passes, method, finished, same_settings, finished_before, touched, missing })
}

/// The state of the run, compared with some settings.
#[derive(Default)]
struct Seen {
    finished: bool,
    passes: Vec<PassStatus>,
    touched: Vec<String>,
    missing: Option<String>,
}

impl RunStatus {
    /// The change of the method in words.
    #[must_use]
    pub fn other_method(&self) -> Option<String> {
        self.method.as_ref().map(changed)
    }
}

/// Walks along the flow up to the first incomplete pass.
fn walk(open: &Opened<'_>, driver: &mut Nobody<'_>, run_dir: &RunDir) -> Result<Option<Outcome>> {
    let Some(surveyed) = flow::survey(open, driver, None)? else { return Ok(None) };
    let Some(planned) = flow::plan(open, driver, surveyed)? else { return Ok(None) };
    flow::to_files(open, driver, run_dir, &planned, Vec::new())
}

impl PassStatus {
    fn of(state: PassState) -> Self {
        let PassState { outline, units, done, stale, why } = state;
        Self { pass: outline.name, title: outline.title(), units, done, stale, why }
    }

    /// The changed values in words, with their units. Empty if the pass only follows a pass that has changed.
    #[must_use]
    pub fn causes(&self) -> Vec<String> {
        let own: Vec<&StaleReason> = self.why.iter().filter(|reason| !reason.is_of_another_pass()).collect();
        causes(&own).into_iter().map(changed).collect()
    }
}

/// The settings among the changed values. The tiles and the reach are derived from settings, so they are
/// named only if no setting of the pass has changed.
fn causes<'a>(changed: &[&'a StaleReason]) -> Vec<&'a StaleReason> {
    let settings: Vec<_> = changed.iter().copied().filter(|reason| reason.name.contains('.')).collect();
    if settings.is_empty() { changed.to_vec() } else { settings }
}

/// A changed value with its old and its new value.
fn changed(reason: &StaleReason) -> String {
    let unit = unit(&reason.name);
    match (&reason.old, &reason.new) {
        (Some(old), Some(new)) => format!("{} changed from {old} to {new}{unit}", reason.name),
        (None, Some(new)) => format!("{} is new: {new}{unit}", reason.name),
        (Some(old), None) => format!("{} was {old}{unit} and is no longer used", reason.name),
        (None, None) => reason.name.clone(),
    }
}

/// The unit of a setting after a space, from the comments of the defaults; empty if there is none.
fn unit(setting: &str) -> &'static str {
    let Some((section, key)) = setting.split_once('.') else { return "" };
    let header = format!("[{section}]");
    let lines = DEFAULT_TOML.lines().skip_while(|line| !line.starts_with(&header)).skip(1);
    let mut lines = lines.take_while(|line| !line.starts_with('['));
    let line = lines.find(|line| line.split('=').next().is_some_and(|name| name.trim() == key));
    let comment = line.and_then(|line| line.split_once('#')).map_or("", |(_, comment)| comment.trim());
    match comment.split([',', ' ']).next() {
        Some("m") => " m",
        Some("voxels") => " voxels",
        Some("MiB") => " MiB",
        _ => "",
    }
}

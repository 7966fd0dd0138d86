//! A run that several processes share. One process opens it and completes each pass; any number of workers
//! compute units. Each of these functions walks the one list of passes in `flow.rs` with a driver of its own.
//!
//! Workers hold no lock and only add units, so any engine may start them anywhere, twice, and kill them at
//! any moment.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::Serialize;

use crate::config::{Config, OutputConfig};
use crate::error::{Error, ErrorKind, Result};
use crate::run::chain::Registries;
use crate::run::computed;
use crate::run::engine::{
    Barrier, CancelToken, Driver, Due, DuePass, Event, Here, Observer, PassFigures, Share, Units,
};
use crate::run::error::{RunError, ranges};
use crate::run::finish::outputs::{self, Course};
use crate::run::finish::{mark, names};
use crate::run::flow::{self, Outcome, Planned};
use crate::run::open::{self, Opened};
use crate::run::request::{self, Begun, RunRequest};
use crate::run::summary::RunSummary;
use crate::store::{RunDir, StoreError};

/// A run in a directory that other processes may be working in.
#[derive(Debug, Clone)]
pub struct SharedRun<'a> {
    /// Output directory.
    pub out: PathBuf,
    /// How long to wait for a file that another process may still be writing.
    pub wait: Duration,
    /// The registries of methods.
    pub registries: Registries<'a>,
}

/// The pass that is due, and its units.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct DueUnits {
    /// Its name, with the number of the round for a repeated step. `None` if nothing is due, because every
    /// output is complete.
    pub pass: Option<String>,
    /// Units without a stored result. If there are none, the reduction of the pass is due.
    pub units: Vec<usize>,
    /// Number of all units of the pass.
    pub of: usize,
    /// The units in the form that `work --units` takes.
    pub ranges: String,
}

impl DueUnits {
    fn of(due: Option<DuePass>) -> Self {
        let Some(DuePass { pass, missing, units }) = due else {
            return Self { pass: None, units: Vec::new(), of: 0, ranges: String::new() };
        };
        Self { pass: Some(pass), ranges: ranges(&missing), units: missing, of: units }
    }
}

/// The result of the reduction of a pass.
#[derive(Debug)]
pub struct Reduced {
    /// The pass that workers may start.
    pub next: DueUnits,
    /// The result of the run, if this was its last pass, and which outputs it has.
    pub finished: Option<(RunSummary, OutputConfig)>,
}

/// Opens a run for workers: surveys the drive, divides it into tiles, and opens the first pass after that.
/// With `leave_survey` the survey is the first pass of the workers. Returns what is due.
///
/// # Errors
/// As [`run`](crate::run::run).
pub fn open_for_workers(
    request: &RunRequest<'_>,
    leave_survey: bool,
    observer: &dyn Observer,
    cancel: &CancelToken,
) -> Result<DueUnits> {
    let Begun { run_dir, open, labelled: _, mut warnings } = Begun::from(request)?;
    if !leave_survey {
        let limits = open.budget.limits();
        let mut driver = Here::new(&run_dir, limits, open.config.run.fail_fast, observer, cancel);
        let surveyed = computed(flow::survey(&open, &mut driver, Some(&run_dir))?)?;
        warnings.extend(surveyed.warnings.iter().cloned());
        computed(flow::plan(&open, &mut driver, surveyed)?)?;
    }
    warnings.iter().for_each(|text| observer.event(&Event::Warning { text }));
    let after = (!leave_survey).then_some(SURVEY);
    let mut driver = Barrier::new(&run_dir, after, Duration::ZERO, observer);
    walk(&open, &mut driver, &run_dir)?;
    // Earlier calls may have computed more than the first pass.
    due_in(&open, &run_dir)
}

/// Title of the first pass.
const SURVEY: &str = "survey";

/// Computes units of a pass. Returns when all of them are stored, whichever process computed them. `resolve`
/// gets the path of the configuration of the run and returns the settings of this process, which may differ
/// only in how the machine is used.
///
/// # Errors
/// A [`StoreError`] when another version drives the run; a [`RunError`] when the settings differ, when an
/// earlier pass is not complete, or when units failed; any error of [`run`](crate::run::run).
pub fn work(
    shared: &SharedRun<'_>,
    (pass, units): (&str, &Units),
    resolve: impl FnOnce(&Path) -> Result<Config>,
    observer: &dyn Observer,
    cancel: &CancelToken,
) -> Result<PassFigures> {
    let run_dir = RunDir::join(&shared.out, shared.wait)?;
    let (inputs, configuration) = open::recorded(&run_dir)?;
    let settings = fs_err::read(&configuration).map_err(StoreError::io("read", &configuration))?;
    let config = resolve(&configuration)?;
    let of_run = Config::resolve(Some(&configuration), &[])?;
    if let Some((key, of_run, here)) = of_run.first_difference(&config) {
        return Err(RunError::OtherSettings { key, of_run, here }.into());
    }
    let open = Opened::to_share(&inputs, &config, &shared.registries, &run_dir)?;
    let limits = (open.budget.limits(), config.run.fail_fast);
    let mut driver = Share::new(&run_dir, (pass, units), limits, observer, cancel);
    let walked = walk(&open, &mut driver, &run_dir);
    if let Some(figures) = driver.figures {
        return Ok(figures);
    }
    let pass_name = driver.named().unwrap_or(EXPORT);
    let title = pass.to_owned();
    let nothing = PassFigures { pass: pass_name, title, units: 0, resumed: 0, points: 0, seconds: 0.0 };
    match walked {
        // Every output is complete, so this unit has been computed as well.
        Ok(Some((_, outcome))) if outcome.unmarked.is_none() => Ok(nothing),
        // The end of a run removes the files that its last passes read. A late worker finds nothing and is
        // not needed.
        Err(error) if is_of_files(&error) && due_in(&open, &run_dir).is_ok_and(|due| due.pass.is_none()) => {
            Ok(nothing)
        }
        // Files of earlier passes are removed where they do not belong to the new settings.
        Err(error) if is_of_files(&error) && !open::is_recorded_now(&run_dir, &settings) => {
            Err(RunError::NotOpened { pass: pass.to_owned() }.into())
        }
        Err(error) => Err(error),
        Ok(_) => Err(RunError::NotReduced { pass: SURVEY.to_owned(), asked: pass.to_owned() }.into()),
    }
}

/// Whether an error may come from missing files.
fn is_of_files(error: &Error) -> bool {
    !matches!(error.kind(), ErrorKind::Bug | ErrorKind::Config | ErrorKind::Interrupted)
}

/// Name of the last pass.
const EXPORT: &str = "export";

/// Completes a pass: checks every unit, reduces them, and opens the next pass. After the last pass it writes
/// the tables and the report.
///
/// # Errors
/// A [`RunError`] that names the units that are missing or cannot be used, or an earlier pass that is not
/// complete; a [`StoreError`] when another process drives the run.
pub fn reduce(shared: &SharedRun<'_>, after: &str, observer: &dyn Observer) -> Result<Reduced> {
    let started = Instant::now();
    // Inspected first, so that no directory is created where there is no run.
    RunDir::inspect(&shared.out)?;
    let run_dir = RunDir::open(&shared.out, false)?.waiting(shared.wait);
    let (inputs, configuration) = open::recorded(&run_dir)?;
    let config = Config::resolve(Some(&configuration), &[])?;
    let open = Opened::to_share(&inputs, &config, &shared.registries, &run_dir)?;
    let mut driver = Barrier::new(&run_dir, Some(after), shared.wait, observer);
    let walked = walk(&open, &mut driver, &run_dir)?;
    let Some((planned, outcome)) = walked else {
        let next = driver.opened.take();
        return match next {
            Some(next) => Ok(Reduced { next: DueUnits::of(Some(next)), finished: None }),
            None => Err(Error::bug(format!("no pass follows {after}"))),
        };
    };
    if !driver.reached() && outcome.unmarked.is_some() {
        let known = driver.figures.iter().map(|figures| figures.pass.to_owned()).collect();
        return Err(RunError::NoSuchPass { pass: after.to_owned(), known }.into());
    }
    // The process that opened the run has already reported the warnings about the drive. The report contains
    // them as well.
    let (_, of_copies) =
        names::copies(&open.drive.catalog, &config, open.chain.method.as_ref(), open.chain.finds())?;
    let mut warnings = request::warnings_of(&config, &open.chain, &open.drive.catalog, of_copies);
    warnings.extend(planned.surveyed.warnings.iter().cloned());
    warnings.extend(driver.warnings.take());
    let course = Course { started, warnings, passes: driver.figures };
    let summary = outputs::finish(&run_dir, &open, &planned, outcome, course, observer)?;
    Ok(Reduced { next: DueUnits::of(None), finished: Some((summary, config.output)) })
}

/// Which pass and which units are due. Changes nothing. In a finished run nothing is due, even if its input
/// is gone.
///
/// # Errors
/// A [`StoreError`] when there is no run, or one of another version.
pub fn next(shared: &SharedRun<'_>) -> Result<DueUnits> {
    let run_dir = RunDir::inspect(&shared.out)?;
    let (inputs, configuration) = open::recorded(&run_dir)?;
    if inputs.is_empty() {
        return Err(StoreError::NoRun { path: shared.out.clone() }.into());
    }
    let config = Config::resolve(Some(&configuration), &[])?;
    match Opened::to_share(&inputs, &config, &shared.registries, &run_dir) {
        Ok(open) => due_in(&open, &run_dir),
        Err(error) if error.kind() == ErrorKind::Input && mark::is_finished_with(&run_dir, &config)? => {
            Ok(DueUnits::of(None))
        }
        Err(error) => Err(error),
    }
}

fn due_in(open: &Opened<'_>, run_dir: &RunDir) -> Result<DueUnits> {
    let mut driver = Due::new(run_dir);
    let walked = walk(open, &mut driver, run_dir)?;
    match (driver.due, walked) {
        (Some(due), _) => Ok(DueUnits::of(Some(due))),
        (None, Some((_, outcome))) if outcome.unmarked.is_none() => Ok(DueUnits::of(None)),
        // The survey is marked, but the plan was lost.
        _ => Err(RunError::NotReduced { pass: SURVEY.to_owned(), asked: EXPORT.to_owned() }.into()),
    }
}

/// Walks along the flow as far as the driver goes.
fn walk<D: Driver>(
    open: &Opened<'_>,
    driver: &mut D,
    run_dir: &RunDir,
) -> Result<Option<(Planned, Outcome)>> {
    let Some(surveyed) = flow::survey(open, driver, Some(run_dir))? else { return Ok(None) };
    let Some(planned) = flow::plan(open, driver, surveyed)? else { return Ok(None) };
    let (labelled, _) =
        names::copies(&open.drive.catalog, open.config, open.chain.method.as_ref(), open.chain.finds())?;
    let outcome = flow::to_files(open, driver, run_dir, &planned, labelled)?;
    Ok(outcome.map(|outcome| (planned, outcome)))
}

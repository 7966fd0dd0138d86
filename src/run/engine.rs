//! The engine: runs the units of one pass on worker threads, stores what they return, and resumes where it stopped.
//!
//! A pass is a pure function over its units (tiles, runs of blocks): files and small values in, a payload and column
//! values out. Units go to workers in order, each as soon as there is memory for it; a worker reads and computes its unit,
//! a keeper syncs what has come in meanwhile and then commits it, so that finished work survives whatever comes next and
//! no worker waits for the disk. Order is restored where it matters, in the reductions, which read the payloads in unit
//! order.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use crossbeam_channel::bounded;
use serde_json::json;

use crate::error::{Error, Result};
use crate::input::InputError;
use crate::run::error::RunError;
use crate::run::in_flight::InFlight;
use crate::run::observe::{Event, Observer};
use crate::store::{PassDir, RunDir, UnitState};
use crate::survey::SurveyError;

/// One pass over units.
pub(crate) trait Pass: Sync {
    /// Name, as the user sees it.
    fn name(&self) -> &'static str;
    /// Number of units.
    fn units(&self) -> usize;
    /// Points of a unit, for progress.
    fn points(&self, unit: usize) -> u64;
    /// Estimated bytes that a unit in flight needs.
    fn bytes(&self, unit: usize) -> u64;
    /// Asks the system to read ahead what `unit` will need.
    fn prefetch(&self, _unit: usize) {}
    /// Computes a unit: returns its payload, and may write beside it what [`Pass::sync`] makes durable.
    fn run(&self, unit: usize) -> Result<Vec<u8>>;
    /// Makes everything that finished units wrote beside their payloads survive a power cut.
    fn sync(&self) -> Result<()> {
        Ok(())
    }
}

/// Stops a run: finishes units in flight, keeps everything.
#[derive(Debug, Default)]
pub struct CancelToken(AtomicBool);

impl CancelToken {
    /// Asks the run to stop.
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether the run was asked to stop.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// What the engine works with.
pub(crate) struct Engine<'a> {
    pub(crate) run_dir: &'a RunDir,
    pub(crate) threads: usize,
    /// Bytes for all units in flight together.
    pub(crate) memory: u64,
    pub(crate) fail_fast: bool,
    pub(crate) observer: &'a dyn Observer,
    pub(crate) cancel: &'a CancelToken,
}

/// What a pass cost.
#[derive(Debug, Clone, serde::Serialize)]
pub struct PassFigures {
    /// Name of the pass.
    pub pass: &'static str,
    /// Units in all.
    pub units: usize,
    /// Units that were already there.
    pub resumed: usize,
    /// Points processed now.
    pub points: u64,
    /// Wall time in seconds.
    pub seconds: f64,
}

impl Engine<'_> {
    /// Runs every unit of `pass` whose result is not there yet.
    pub(crate) fn execute(&self, pass: &dyn Pass, dir: &PassDir) -> Result<PassFigures> {
        let started = Instant::now();
        dir.prepare()?;
        let mut todo = Vec::new();
        let (mut points, mut points_done) = (0, 0);
        for unit in 0..pass.units() {
            points += pass.points(unit);
            match dir.state(unit)? {
                UnitState::Done => points_done += pass.points(unit),
                UnitState::Missing => todo.push(unit),
                UnitState::Refused(refusal) => {
                    let text =
                        format!("pass {}, unit {unit}: stored result not used ({refusal:?})", pass.name());
                    self.run_dir.log_event(&json!({ "event": "refused", "text": text }).to_string());
                    todo.push(unit);
                }
            }
        }
        let done = pass.units() - todo.len();
        let (name, units) = (pass.name(), pass.units());
        self.tell(&Event::PassStarted { pass: name, units, done, points, points_done });
        let failures = if todo.is_empty() { Vec::new() } else { self.work(pass, dir, &todo) };
        let seconds = started.elapsed().as_secs_f64();
        if let Some(error) = conclude(pass, dir, failures, self.cancel, todo.len())? {
            return Err(error);
        }
        self.tell(&Event::PassFinished { pass: name, seconds });
        Ok(PassFigures { pass: name, units, resumed: done, points: points - points_done, seconds })
    }

    /// Hands units to workers until all are done, one fails fatally, or the run is cancelled.
    fn work(&self, pass: &dyn Pass, dir: &PassDir, todo: &[usize]) -> Vec<(usize, Error)> {
        let workers = self.threads.min(todo.len()).max(1);
        let (stop, flight) = (AtomicBool::new(false), InFlight::default());
        // Without a place to wait in: a unit that was handed over is being worked on.
        let (jobs, inbox) = bounded::<(usize, u64)>(0);
        let (report, results) = bounded(workers);
        let mut failures = Vec::new();
        std::thread::scope(|scope| {
            for _ in 0..workers {
                let (inbox, report, flight) = (inbox.clone(), report.clone(), &flight);
                scope.spawn(move || {
                    for (unit, bytes) in inbox {
                        let began = Instant::now();
                        let payload = run_unit(pass, dir, unit);
                        flight.land(bytes);
                        let seconds = began.elapsed().as_secs_f64();
                        if report.send(Computed { unit, seconds, payload }).is_err() {
                            break;
                        }
                    }
                });
            }
            drop((inbox, report));
            let (stop, flight) = (&stop, &flight);
            scope.spawn(move || {
                for &unit in todo {
                    pass.prefetch(unit);
                    let bytes = pass.bytes(unit);
                    flight.start(bytes, self.memory);
                    let stopped = stop.load(Ordering::Relaxed) || self.cancel.is_cancelled();
                    if stopped || jobs.send((unit, bytes)).is_err() {
                        break;
                    }
                }
            });
            // One sync serves all units that have come in while the last one went on.
            for first in &results {
                let batch: Vec<Computed> = std::iter::once(first).chain(results.try_iter()).collect();
                for (unit, error) in self.keep(pass, dir, batch) {
                    let reason = error.to_string();
                    self.tell(&Event::UnitFailed { pass: pass.name(), unit, reason: &reason });
                    if self.fail_fast || error.stops_all() {
                        stop.store(true, Ordering::Relaxed);
                    }
                    failures.push((unit, error));
                }
            }
        });
        failures
    }

    /// Commits computed units: first what they wrote beside their payloads must be on the disk, then the payloads.
    fn keep(&self, pass: &dyn Pass, dir: &PassDir, batch: Vec<Computed>) -> Vec<(usize, Error)> {
        let mut failures = Vec::new();
        let mut done = Vec::new();
        for Computed { unit, seconds, payload } in batch {
            match payload {
                Ok(payload) => done.push((unit, seconds, payload)),
                Err(error) => failures.push((unit, error)),
            }
        }
        if let Some(&(unit, ..)) = done.first()
            && let Err(error) = pass.sync()
        {
            failures.push((unit, error));
            return failures;
        }
        for (unit, seconds, payload) in done {
            match dir.commit(unit, &payload) {
                Ok(()) => {
                    dir.clear_failure(unit);
                    let points = pass.points(unit);
                    self.tell(&Event::UnitFinished { pass: pass.name(), unit, points, seconds });
                }
                Err(error) => failures.push((unit, error.into())),
            }
        }
        failures
    }

    /// Tells the observer and the log.
    pub(crate) fn tell(&self, event: &Event<'_>) {
        self.observer.event(event);
        self.run_dir.log_event(&event.to_json().to_string());
    }
}

/// A unit that a worker is done with.
struct Computed {
    unit: usize,
    seconds: f64,
    payload: Result<Vec<u8>>,
}

/// Computes one unit; a panic is caught here and counts as a bug of this unit.
fn run_unit(pass: &dyn Pass, dir: &PassDir, unit: usize) -> Result<Vec<u8>> {
    // Values in columns are about to be overwritten: the old record of this unit must not vouch for them.
    dir.invalidate(unit)?;
    catch_unwind(AssertUnwindSafe(|| pass.run(unit))).unwrap_or_else(|panic| {
        let text = panic
            .downcast_ref::<&str>()
            .map(ToString::to_string)
            .or_else(|| panic.downcast_ref::<String>().cloned())
            .unwrap_or_else(|| "panic without a text".to_owned());
        Err(Error::bug(format!("pass {}, unit {unit}: {text}", pass.name())))
    })
}

/// Whether a failure is one of the input, which says so itself.
fn is_of_the_input(error: &Error) -> bool {
    error.cause::<InputError>().is_some() || error.cause::<SurveyError>().is_some()
}

/// What the pass as a whole came to: the error to return, if any.
fn conclude(
    pass: &dyn Pass,
    dir: &PassDir,
    mut failures: Vec<(usize, Error)>,
    cancel: &CancelToken,
    todo: usize,
) -> Result<Option<Error>> {
    failures.sort_by_key(|failure| failure.0);
    if let Some(fatal) = failures.iter().position(|failure| failure.1.stops_all()) {
        return Ok(Some(failures.swap_remove(fatal).1));
    }
    if !failures.is_empty() {
        for (unit, error) in &failures {
            let kind = format!("{:?}", error.kind());
            dir.record_failure(
                *unit,
                &json!({ "pass": pass.name(), "unit": unit, "kind": kind, "error": error.to_string() }),
            )?;
        }
        // An input that cannot be read says so itself; the same command would fail again.
        if failures.iter().all(|(_, error)| is_of_the_input(error)) {
            return Ok(Some(failures.swap_remove(0).1));
        }
        let (unit, first) = &failures[0];
        return Ok(Some(
            RunError::UnitsFailed {
                pass: pass.name().to_owned(),
                failed: failures.len(),
                total: pass.units(),
                first: format!("unit {unit}: {first}"),
            }
            .into(),
        ));
    }
    if cancel.is_cancelled() && todo > 0 {
        let mut done = 0;
        for unit in 0..pass.units() {
            done += usize::from(dir.state(unit)? == UnitState::Done);
        }
        if done < pass.units() {
            let (pass, total) = (pass.name().to_owned(), pass.units());
            return Ok(Some(RunError::Interrupted { pass, done, total }.into()));
        }
    }
    Ok(None)
}

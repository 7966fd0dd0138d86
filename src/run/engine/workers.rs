//! The units of one pass on worker threads, within the memory budget; what is finished is kept and resumed.
//!
//! A pass is a pure function over its units (tiles, runs of blocks): files and small values in, a payload and column
//! values out. Units go to workers in order, each as soon as there is memory for it. A worker reads and computes its
//! unit. A keeper syncs what has come in meanwhile and then commits it, so that finished work survives whatever comes
//! next and no worker waits for the disk. Order is restored where it matters, in the reductions, which read the
//! payloads in unit order.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use crossbeam_channel::bounded;
use serde_json::json;

use crate::error::{Error, Result};
use crate::run::engine::in_flight::InFlight;
use crate::run::engine::pass::Pass;
use crate::run::engine::{CancelToken, Event, Observer};
use crate::run::error::RunError;
use crate::store::{PassDir, Refusal, RunDir, UnitState};

/// What units in flight may take together.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    /// Worker threads.
    pub(crate) threads: usize,
    /// Bytes for all units in flight together.
    pub(crate) memory: u64,
}

/// Runs the units of one pass and keeps their results.
pub(crate) struct Keeper<'a> {
    pub(crate) run_dir: &'a RunDir,
    pub(crate) dir: &'a PassDir,
    pub(crate) limits: Limits,
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

impl Keeper<'_> {
    /// Runs every unit of `pass` whose result is not there yet.
    pub(crate) fn execute<P: Pass>(&self, pass: &P) -> Result<PassFigures> {
        let started = Instant::now();
        let dir = self.dir;
        let name = pass.outline().name;
        let mut todo = Vec::new();
        let (mut points, mut points_done) = (0, 0);
        for unit in 0..pass.units() {
            points += pass.points(unit);
            match dir.state(unit)? {
                UnitState::Done => points_done += pass.points(unit),
                UnitState::Missing => todo.push(unit),
                UnitState::Refused(refusal) => {
                    log_refusal(self.run_dir, name, unit, &refusal);
                    todo.push(unit);
                }
            }
        }
        let done = pass.units() - todo.len();
        let units = pass.units();
        self.tell(&Event::PassStarted { pass: name, units, done, points, points_done });
        let failures = if todo.is_empty() { Vec::new() } else { self.work(pass, &todo) };
        let seconds = started.elapsed().as_secs_f64();
        if let Some(error) = conclude(pass, dir, failures, self.cancel, todo.len())? {
            return Err(error);
        }
        self.tell(&Event::PassFinished { pass: name, seconds });
        Ok(PassFigures { pass: name, units, resumed: done, points: points - points_done, seconds })
    }

    /// Hands units to workers until all are done, one fails fatally, or the run is cancelled.
    fn work<P: Pass>(&self, pass: &P, todo: &[usize]) -> Vec<(usize, Error)> {
        let (dir, name) = (self.dir, pass.outline().name);
        let workers = self.limits.threads.min(todo.len()).max(1);
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
                    flight.start(bytes, self.limits.memory);
                    let stopped = stop.load(Ordering::Relaxed) || self.cancel.is_cancelled();
                    if stopped || jobs.send((unit, bytes)).is_err() {
                        break;
                    }
                }
            });
            // One sync serves all units that have come in while the last one went on.
            for first in &results {
                let batch: Vec<Computed> = std::iter::once(first).chain(results.try_iter()).collect();
                for (unit, error) in self.keep(pass, batch) {
                    let reason = error.to_string();
                    self.tell(&Event::UnitFailed { pass: name, unit, reason: &reason });
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
    fn keep<P: Pass>(&self, pass: &P, batch: Vec<Computed>) -> Vec<(usize, Error)> {
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
            match self.dir.commit(unit, &payload) {
                Ok(()) => {
                    self.dir.clear_failure(unit);
                    let points = pass.points(unit);
                    self.tell(&Event::UnitFinished { pass: pass.outline().name, unit, points, seconds });
                }
                Err(error) => failures.push((unit, error.into())),
            }
        }
        failures
    }

    /// Tells the observer and the log.
    fn tell(&self, event: &Event<'_>) {
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

/// Computes one unit anew.
fn run_unit<P: Pass>(pass: &P, dir: &PassDir, unit: usize) -> Result<Vec<u8>> {
    // Values beside the payload are about to be overwritten: the old record of this unit must not vouch for them.
    dir.invalidate(unit)?;
    compute_unit(pass, unit)
}

/// Computes one unit; a panic is caught here and counts as a bug of this unit.
fn compute_unit<P: Pass>(pass: &P, unit: usize) -> Result<Vec<u8>> {
    catch_unwind(AssertUnwindSafe(|| pass.run(unit))).unwrap_or_else(|panic| {
        let text = panic
            .downcast_ref::<&str>()
            .map(ToString::to_string)
            .or_else(|| panic.downcast_ref::<String>().cloned())
            .unwrap_or_else(|| "panic without a text".to_owned());
        Err(Error::bug(format!("pass {}, unit {unit}: {text}", pass.outline().name)))
    })
}

/// How the pass as a whole ended: the error to return, if any.
fn conclude<P: Pass>(
    pass: &P,
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
                &json!({ "pass": pass.outline().name, "unit": unit, "kind": kind, "error": error.to_string() }),
            )?;
        }
        // An input that cannot be read says so itself; the same command would fail again.
        if failures.iter().all(|(_, error)| error.concerns_input()) {
            return Ok(Some(failures.swap_remove(0).1));
        }
        let (unit, first) = &failures[0];
        return Ok(Some(
            RunError::UnitsFailed {
                pass: pass.outline().name.to_owned(),
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
            let (pass, total) = (pass.outline().name.to_owned(), pass.units());
            return Ok(Some(RunError::Interrupted { pass, done, total }.into()));
        }
    }
    Ok(None)
}

/// Says in the log that a stored unit is not used.
fn log_refusal(run_dir: &RunDir, pass: &str, unit: usize, refusal: &Refusal) {
    let text = format!("pass {pass}, unit {unit}: stored result not used ({refusal:?})");
    run_dir.log_event(&json!({ "event": "refused", "text": text }).to_string());
}

/// The payloads of all units, computed on threads and kept in memory; the first error by unit where any failed.
pub(crate) fn compute<P: Pass>(pass: &P, limits: Limits) -> Result<Vec<Vec<u8>>> {
    let workers = limits.threads.min(pass.units()).max(1);
    let flight = InFlight::default();
    let (jobs, inbox) = bounded::<(usize, u64)>(0);
    let (report, results) = bounded(workers);
    let mut found: Vec<Option<Result<Vec<u8>>>> = Vec::new();
    found.resize_with(pass.units(), || None);
    std::thread::scope(|scope| {
        for _ in 0..workers {
            let (inbox, report, flight) = (inbox.clone(), report.clone(), &flight);
            scope.spawn(move || {
                for (unit, bytes) in inbox {
                    let payload = compute_unit(pass, unit);
                    flight.land(bytes);
                    if report.send((unit, payload)).is_err() {
                        break;
                    }
                }
            });
        }
        drop((inbox, report));
        let flight = &flight;
        scope.spawn(move || {
            for unit in 0..pass.units() {
                pass.prefetch(unit);
                let bytes = pass.bytes(unit);
                flight.start(bytes, limits.memory);
                if jobs.send((unit, bytes)).is_err() {
                    break;
                }
            }
        });
        for (unit, payload) in &results {
            found[unit] = Some(payload);
        }
    });
    let missing = |unit| Error::bug(format!("pass {}, unit {unit} was lost", pass.outline().name));
    found.into_iter().enumerate().map(|(unit, found)| found.unwrap_or_else(|| Err(missing(unit)))).collect()
}

//! Computes the units of one pass on worker threads within the memory budget, stores finished units, and
//! resumes.
//!
//! A pass is a pure function over its units (tiles, runs of blocks): the input is files and small values, the
//! output is a payload. Units go to workers in order, as soon as there is memory for them. A worker thread
//! reads and computes its unit. The calling thread receives finished units, syncs the files that they wrote
//! beside their payloads, and then commits them. So finished work survives an interruption, and no worker
//! waits for the disk. Reductions need an order, so they read the payloads in the order of the units.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use crossbeam_channel::{bounded, select};
use serde_json::json;

use crate::error::{Error, Result, panic_text};
use crate::run::engine::in_flight::InFlight;
use crate::run::engine::pass::Pass;
use crate::run::engine::{CancelToken, Event, Observer};
use crate::run::error::RunError;
use crate::store::{PassDir, Refusal, RunDir, UnitState};

/// Limits for all units in flight.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    /// Worker threads.
    pub(crate) threads: usize,
    /// Bytes for all units in flight together.
    pub(crate) memory: u64,
}

/// Runs the units of one pass and stores their results.
pub(crate) struct Keeper<'a> {
    pub(crate) run_dir: &'a RunDir,
    pub(crate) dir: &'a PassDir,
    pub(crate) limits: Limits,
    pub(crate) fail_fast: bool,
    /// Whether this process drives the run. A worker only adds units.
    pub(crate) drives: bool,
    pub(crate) observer: &'a dyn Observer,
    pub(crate) cancel: &'a CancelToken,
}

/// Figures of a pass.
#[derive(Debug, Clone, serde::Serialize)]
pub struct PassFigures {
    /// Name of the pass.
    pub pass: &'static str,
    /// Its name with its round, as in the state of a run.
    pub title: String,
    /// Number of units.
    pub units: usize,
    /// Number of units that were finished earlier.
    pub resumed: usize,
    /// Points processed by this call.
    pub points: u64,
    /// Wall time in seconds.
    pub seconds: f64,
}

impl Keeper<'_> {
    /// Runs the given units of `pass` that have no stored result.
    pub(crate) fn execute<P: Pass>(&self, pass: &P, units: &[usize]) -> Result<PassFigures> {
        let started = Instant::now();
        let dir = self.dir;
        let name = pass.outline().name;
        let mut todo = Vec::new();
        let mut points = 0;
        let mut points_done = 0;
        for &unit in units {
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
        let done = units.len() - todo.len();
        if !todo.is_empty() && self.drives {
            dir.withdraw_complete()?;
        }
        let total = units.len();
        self.tell(&Event::PassStarted { pass: name, units: total, done, points, points_done });
        let failures = if todo.is_empty() { Vec::new() } else { self.work(pass, &todo) };
        let seconds = started.elapsed().as_secs_f64();
        if let Some(error) = conclude(pass, dir, failures, self.cancel, &todo)? {
            return Err(error);
        }
        self.tell(&Event::PassFinished { pass: name, seconds });
        let title = pass.outline().title();
        let points = points - points_done;
        Ok(PassFigures { pass: name, title, units: total, resumed: done, points, seconds })
    }

    /// Hands units to workers until all are done, one fails fatally, or the run is cancelled.
    fn work<P: Pass>(&self, pass: &P, todo: &[usize]) -> Vec<(usize, Error)> {
        let name = pass.outline().name;
        let stop = AtomicBool::new(false);
        let mut failures = Vec::new();
        let mut lost = false;
        let stopped = || stop.load(Ordering::Relaxed) || self.cancel.is_cancelled();
        // One sync covers all units that have arrived during the previous sync.
        on_workers(pass, todo, self.limits, &stopped, |batch| {
            for (unit, error) in self.keep(pass, batch, &mut lost) {
                let reason = error.to_string();
                self.tell(&Event::UnitFailed { pass: name, unit, reason: &reason });
                if self.fail_fast || error.stops_all() || lost {
                    stop.store(true, Ordering::Relaxed);
                }
                failures.push((unit, error));
            }
        });
        failures
    }

    /// Commits computed units. The files beside their payloads are synced first, then the payloads are
    /// stored. If a sync fails, what was written is `lost`: the system may drop it and report success at the
    /// next sync (`fsync(2)`), so no unit of this call is committed from then on. The same applies to units
    /// that belong to other settings.
    fn keep<P: Pass>(&self, pass: &P, batch: Vec<Computed>, lost: &mut bool) -> Vec<(usize, Error)> {
        let mut failures = Vec::new();
        let mut done = Vec::new();
        for Computed { unit, seconds, payload } in batch {
            match payload {
                Ok(payload) => done.push((unit, seconds, payload)),
                Err(error) => failures.push((unit, error)),
            }
        }
        if *lost {
            return failures;
        }
        // Another process may have opened the pass again with other settings since this worker started. The
        // units of this worker then do not belong there.
        if let Some(&(unit, ..)) = done.first()
            && !self.drives
        {
            let opened = self.dir.is_prepared_now();
            if !opened.as_ref().is_ok_and(|opened| *opened) {
                *lost = true;
                let reopened = RunError::NotOpened { pass: pass.outline().title() };
                failures.push((unit, opened.map_or_else(Error::from, |_| reopened.into())));
                return failures;
            }
        }
        if let Some(&(unit, ..)) = done.first()
            && let Err(error) = pass.sync()
        {
            *lost = true;
            failures.push((unit, error));
            return failures;
        }
        let units: Vec<(usize, &[u8])> =
            done.iter().map(|(unit, _, payload)| (*unit, &payload[..])).collect();
        let committed = self.dir.commit_together(&units);
        for (&(unit, seconds, _), committed) in done.iter().zip(committed) {
            match committed {
                Ok(()) => {
                    self.dir.clear_failure(unit);
                    let points = pass.points(unit);
                    self.tell(&Event::UnitFinished { pass: pass.outline().name, unit, points, seconds });
                }
                // The folder was cleared between the check and the commit.
                Err(_) if !self.drives && self.dir.is_prepared_now().is_ok_and(|opened| !opened) => {
                    *lost = true;
                    failures.push((unit, RunError::NotOpened { pass: pass.outline().title() }.into()));
                }
                Err(error) => failures.push((unit, error.into())),
            }
        }
        failures
    }

    /// Reports an event to the observer and the log.
    fn tell(&self, event: &Event<'_>) {
        self.observer.event(event);
        self.run_dir.log_event(&event.to_json().to_string());
    }
}

/// Largest payload that counts as small, and number of small ones that may wait to be stored together.
/// Chosen: they take 4 MiB at most, and syncing so many at once takes about an eighth of the time.
const SMALL_BYTES: usize = 1 << 16;
const SMALL_TOGETHER: usize = 64;

/// A unit that a worker has finished.
struct Computed {
    unit: usize,
    seconds: f64,
    payload: Result<Vec<u8>>,
}

/// Computes `units` on worker threads, in order and as memory allows, until `stopped` returns true. This
/// thread calls `receive` with the units that have finished since the last call.
fn on_workers<P: Pass>(
    pass: &P,
    units: &[usize],
    limits: Limits,
    stopped: &(dyn Fn() -> bool + Sync),
    mut receive: impl FnMut(Vec<Computed>),
) {
    let workers = limits.threads.min(units.len()).max(1);
    let flight = InFlight::default();
    // The channel has no buffer, so every unit that was handed over is in progress.
    let (jobs, inbox) = bounded::<(usize, u64)>(0);
    let (report, results) = bounded(workers);
    let (report_small, small_results) = bounded(SMALL_TOGETHER);
    std::thread::scope(|scope| {
        for _ in 0..workers {
            let inbox = inbox.clone();
            let (report, report_small) = (report.clone(), report_small.clone());
            let flight = &flight;
            scope.spawn(move || {
                for (unit, bytes) in inbox {
                    let began = Instant::now();
                    let payload = compute_unit(pass, unit);
                    flight.land(bytes);
                    let seconds = began.elapsed().as_secs_f64();
                    let is_small = payload.as_ref().is_ok_and(|payload| payload.len() <= SMALL_BYTES);
                    let report = if is_small { &report_small } else { &report };
                    if report.send(Computed { unit, seconds, payload }).is_err() {
                        break;
                    }
                }
            });
        }
        drop((inbox, report, report_small));
        let flight = &flight;
        scope.spawn(move || {
            for &unit in units {
                pass.prefetch(unit);
                let bytes = pass.bytes(unit);
                flight.start(bytes, limits.memory);
                if stopped() || jobs.send((unit, bytes)).is_err() {
                    break;
                }
            }
        });
        loop {
            let first = select! { recv(results) -> first => first, recv(small_results) -> first => first };
            // One channel has ended when all workers have: what is left is in the other.
            let Ok(first) = first.or_else(|_| results.recv()).or_else(|_| small_results.recv()) else {
                break;
            };
            let others = results.try_iter().chain(small_results.try_iter().take(SMALL_TOGETHER));
            receive(std::iter::once(first).chain(others).collect());
        }
    });
}

/// Computes one unit. A panic is caught here and counts as a bug in this unit.
fn compute_unit<P: Pass>(pass: &P, unit: usize) -> Result<Vec<u8>> {
    catch_unwind(AssertUnwindSafe(|| pass.run(unit))).unwrap_or_else(|panic| {
        Err(Error::bug(format!("pass {}, unit {unit}: {}", pass.outline().name, panic_text(&*panic))))
    })
}

/// The error of the pass as a whole, if any.
fn conclude<P: Pass>(
    pass: &P,
    dir: &PassDir,
    mut failures: Vec<(usize, Error)>,
    cancel: &CancelToken,
    todo: &[usize],
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
        // If an input cannot be read, its own error is returned, because the same command would fail again.
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
    if cancel.is_cancelled() {
        let mut left = 0;
        for &unit in todo {
            left += usize::from(dir.state(unit)? != UnitState::Done);
        }
        if left > 0 {
            let (total, pass) = (pass.units(), pass.outline().name.to_owned());
            return Ok(Some(RunError::Interrupted { pass, done: total - left, total }.into()));
        }
    }
    Ok(None)
}

/// Logs that a stored unit is not used.
fn log_refusal(run_dir: &RunDir, pass: &str, unit: usize, refusal: &Refusal) {
    let text = format!("pass {pass}, unit {unit}: stored result not used: {refusal}");
    run_dir.log_event(&json!({ "event": "refused", "text": text }).to_string());
}

/// The payloads of all units, computed on threads and kept in memory. If units failed, returns the error of
/// the first one.
pub(crate) fn compute<P: Pass>(pass: &P, limits: Limits) -> Result<Vec<Vec<u8>>> {
    let units: Vec<usize> = (0..pass.units()).collect();
    let mut found: Vec<Option<Result<Vec<u8>>>> = Vec::new();
    found.resize_with(units.len(), || None);
    on_workers(pass, &units, limits, &|| false, |batch| {
        for Computed { unit, payload, .. } in batch {
            found[unit] = Some(payload);
        }
    });
    let missing = |unit| Error::bug(format!("pass {}, unit {unit} was lost", pass.outline().name));
    found.into_iter().enumerate().map(|(unit, found)| found.unwrap_or_else(|| Err(missing(unit)))).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicUsize;
    use std::time::Duration;

    use super::*;
    use crate::error::ErrorKind;
    use crate::run::engine::Silent;
    use crate::run::engine::folders::Outline;
    use crate::run::engine::pass::Payloads;
    use crate::store::Inputs;

    /// A pass of units that write beside their payloads, and whose first sync fails.
    struct Failing {
        outline: Outline,
        units: usize,
        syncs: AtomicUsize,
    }

    impl Failing {
        fn new(units: usize, syncs: usize) -> Self {
            let syncs = AtomicUsize::new(syncs);
            Self { outline: Outline::new(1, "failing", Inputs::new()), units, syncs }
        }
    }

    impl Pass for Failing {
        type Global = ();

        fn outline(&self) -> &Outline {
            &self.outline
        }

        fn units(&self) -> usize {
            self.units
        }

        fn points(&self, _unit: usize) -> u64 {
            1
        }

        fn bytes(&self, _unit: usize) -> u64 {
            1
        }

        fn run(&self, unit: usize) -> Result<Vec<u8>> {
            Ok(unit.to_le_bytes().to_vec())
        }

        fn sync(&self) -> Result<()> {
            match self.syncs.fetch_add(1, Ordering::Relaxed) {
                0 => Err(Error::bug("the disk lost what was written")),
                _ => {
                    std::thread::sleep(Duration::from_millis(20));
                    Ok(())
                }
            }
        }

        fn reduce(&self, _payloads: &Payloads) -> Result<()> {
            Ok(())
        }
    }

    fn keeper<'a>(
        run_dir: &'a RunDir,
        dir: &'a PassDir,
        cancel: &'a CancelToken,
        drives: bool,
    ) -> Keeper<'a> {
        let limits = Limits { threads: 3, memory: 3 };
        Keeper { run_dir, dir, limits, fail_fast: false, drives, observer: &Silent, cancel }
    }

    #[test]
    fn a_worker_adds_nothing_to_a_pass_that_was_opened_with_other_settings() {
        let out = tempfile::tempdir().unwrap();
        let run_dir = RunDir::open(out.path(), false).unwrap();
        let pass = Failing::new(8, 1);
        let dir = run_dir.pass(&pass.outline.folder, pass.outline.depends.clone());
        dir.prepare().unwrap();
        let cancel = CancelToken::default();
        let keeper = keeper(&run_dir, &dir, &cancel, false);
        keeper.execute(&pass, &[0]).unwrap();
        // Another process opens the pass again while the worker computes.
        let anew = run_dir.pass(&pass.outline.folder, Inputs::new().with("gap", "0.5 m"));
        anew.prepare().unwrap();
        let error = keeper.execute(&pass, &[1, 2, 3]).unwrap_err();
        // Not that some units failed: the same command would fail again.
        assert_eq!(error.kind(), ErrorKind::State, "{error}");
        let error = error.to_string();
        assert!(error.contains("has not been opened for workers with these settings"), "{error}");
        assert!((0..8).all(|unit| !dir.unit_path(unit).exists()), "a unit of other settings");
    }

    #[test]
    fn after_a_failed_sync_no_unit_of_the_call_is_committed() {
        let out = tempfile::tempdir().unwrap();
        let run_dir = RunDir::open(out.path(), false).unwrap();
        let pass = Failing::new(8, 0);
        let dir = run_dir.pass(&pass.outline.folder, pass.outline.depends.clone());
        dir.prepare().unwrap();
        let cancel = CancelToken::default();
        let keeper = keeper(&run_dir, &dir, &cancel, true);
        let units: Vec<usize> = (0..8).collect();
        let error = keeper.execute(&pass, &units).unwrap_err().to_string();
        assert!(error.contains("failing"), "{error}");
        let committed = units.iter().filter(|&&unit| dir.state(unit).unwrap() == UnitState::Done).count();
        assert_eq!(committed, 0);
        // The next call computes all of them.
        assert_eq!(keeper.execute(&pass, &units).unwrap().resumed, 0);
        assert!(units.iter().all(|&unit| dir.state(unit).unwrap() == UnitState::Done));
    }

    /// A drive in thousands of small files has as many units, and a disk syncs some hundred times a second.
    #[test]
    fn many_small_units_are_stored_together() {
        let out = tempfile::tempdir().unwrap();
        let run_dir = RunDir::open(out.path(), false).unwrap();
        let pass = Failing::new(512, 1);
        let dir = run_dir.pass(&pass.outline.folder, pass.outline.depends.clone());
        dir.prepare().unwrap();
        let cancel = CancelToken::default();
        let units: Vec<usize> = (0..512).collect();
        keeper(&run_dir, &dir, &cancel, true).execute(&pass, &units).unwrap();
        assert!(dir.not_done_now(&units).unwrap().is_empty());
        let syncs = pass.syncs.into_inner() - 1;
        assert!(syncs <= 32, "{syncs} syncs for 512 units");
    }
}

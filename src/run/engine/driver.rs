//! The drivers of a pass: this process ([`Here`]), this process without a run directory ([`InMemory`]), or
//! nobody ([`Nobody`], which only looks at stored results). All of them walk the same list of passes.

use crate::error::Result;
use crate::run::engine::folders::Outline;
use crate::run::engine::pass::{Pass, Payloads};
use crate::run::engine::workers::{self, Keeper, Limits, PassFigures};
use crate::run::engine::{CancelToken, Event, Observer};
use crate::store::{PassDir, RunDir, StaleReason, UnitState};

/// Walks the list of passes.
pub(crate) trait Driver {
    /// Announces the passes that will follow, as far as they are known, with their numbers of units.
    fn expect(&mut self, _passes: &[(Outline, Option<usize>)]) {}

    /// The result of `pass` for the drive once it is complete. `None` if it is incomplete and this driver
    /// does not compute it.
    fn complete<P: Pass>(&mut self, pass: &P) -> Result<Option<P::Global>>;

    /// The run directory, if there is one.
    fn run_dir(&self) -> Option<&RunDir>;

    /// Whether this driver may change the run directory.
    fn computes(&self) -> bool;

    /// Sets the memory for all units in flight together from now on, in bytes.
    fn limit_memory(&mut self, _bytes: u64) {}

    /// Reports an event to the observer.
    fn tell(&self, _event: &Event<'_>) {}
}

/// Computes missing units on the threads of this process, and stores them in the run directory.
pub(crate) struct Here<'a> {
    run_dir: &'a RunDir,
    limits: Limits,
    fail_fast: bool,
    observer: &'a dyn Observer,
    cancel: &'a CancelToken,
    /// Figures of the passes so far.
    pub(crate) figures: Vec<PassFigures>,
}

impl<'a> Here<'a> {
    pub(crate) fn new(
        run_dir: &'a RunDir,
        limits: Limits,
        fail_fast: bool,
        observer: &'a dyn Observer,
        cancel: &'a CancelToken,
    ) -> Self {
        Self { run_dir, limits, fail_fast, observer, cancel, figures: Vec::new() }
    }
}

impl Driver for Here<'_> {
    fn expect(&mut self, passes: &[(Outline, Option<usize>)]) {
        let names: Vec<&'static str> = passes.iter().map(|(outline, _)| outline.name).collect();
        self.tell(&Event::PassesAhead { passes: &names });
    }

    fn complete<P: Pass>(&mut self, pass: &P) -> Result<Option<P::Global>> {
        let outline = pass.outline();
        let dir = self.run_dir.pass(&outline.folder, outline.depends.clone());
        // First the files beside the units: if they were lost, the pass may remove its folder.
        pass.prepare(&dir)?;
        dir.prepare()?;
        let keeper = Keeper {
            run_dir: self.run_dir,
            dir: &dir,
            limits: self.limits,
            fail_fast: self.fail_fast,
            observer: self.observer,
            cancel: self.cancel,
        };
        self.figures.push(keeper.execute(pass)?);
        pass.reduce(&Payloads::Stored(dir)).map(Some)
    }

    fn run_dir(&self) -> Option<&RunDir> {
        Some(self.run_dir)
    }

    fn computes(&self) -> bool {
        true
    }

    fn limit_memory(&mut self, bytes: u64) {
        self.limits.memory = bytes;
    }

    fn tell(&self, event: &Event<'_>) {
        self.observer.event(event);
        self.run_dir.log_event(&event.to_json().to_string());
    }
}

/// Computes every unit on the threads of this process and stores nothing.
pub(crate) struct InMemory {
    pub(crate) limits: Limits,
}

impl Driver for InMemory {
    fn complete<P: Pass>(&mut self, pass: &P) -> Result<Option<P::Global>> {
        let payloads = workers::compute(pass, self.limits)?;
        pass.reduce(&Payloads::InMemory(payloads)).map(Some)
    }

    fn run_dir(&self) -> Option<&RunDir> {
        None
    }

    fn computes(&self) -> bool {
        true
    }
}

/// The state of a pass.
#[derive(Debug, Clone)]
pub(crate) struct PassState {
    pub(crate) outline: Outline,
    pub(crate) units: Option<usize>,
    pub(crate) done: usize,
    pub(crate) stale: usize,
    pub(crate) why: Vec<StaleReason>,
}

/// Computes nothing and changes nothing. It counts the stored units.
pub(crate) struct Nobody<'a> {
    pub(crate) run_dir: &'a RunDir,
    /// Passes in the order of the flow: first those that were visited, then those that are expected to
    /// follow.
    pub(crate) passes: Vec<PassState>,
    /// Number of visited passes.
    looked_at: usize,
}

impl<'a> Nobody<'a> {
    pub(crate) fn new(run_dir: &'a RunDir) -> Self {
        Self { run_dir, passes: Vec::new(), looked_at: 0 }
    }

    /// The passes. For those that were only expected, the stored units are counted now.
    pub(crate) fn finish(mut self) -> Result<Vec<PassState>> {
        for state in &mut self.passes[self.looked_at..] {
            *state = look(self.run_dir, &state.outline, state.units)?.0;
        }
        Ok(self.passes)
    }
}

/// The state of a pass, and its folder.
fn look(run_dir: &RunDir, outline: &Outline, units: Option<usize>) -> Result<(PassState, PassDir)> {
    let dir = run_dir.pass(&outline.folder, outline.depends.clone());
    let mut done = 0;
    let mut stale = 0;
    for unit in dir.stored_units()? {
        match dir.state(unit)? {
            UnitState::Done if units.is_none_or(|units| unit < units) => done += 1,
            UnitState::Done | UnitState::Missing => {}
            UnitState::Refused(_) => stale += 1,
        }
    }
    let why = dir.stale_reasons()?;
    Ok((PassState { outline: outline.clone(), units, done, stale, why }, dir))
}

impl Driver for Nobody<'_> {
    fn expect(&mut self, passes: &[(Outline, Option<usize>)]) {
        self.passes.truncate(self.looked_at);
        self.passes.extend(passes.iter().map(|(outline, units)| PassState {
            outline: outline.clone(),
            units: *units,
            done: 0,
            stale: 0,
            why: Vec::new(),
        }));
    }

    fn complete<P: Pass>(&mut self, pass: &P) -> Result<Option<P::Global>> {
        let (state, dir) = look(self.run_dir, pass.outline(), Some(pass.units()))?;
        let complete = state.done == pass.units();
        // Later rounds, and those with more neighbours, are known only once the round before is complete:
        // they were not expected.
        let expected = self.passes.get(self.looked_at);
        if expected.is_some_and(|expected| expected.outline.folder == state.outline.folder) {
            self.passes[self.looked_at] = state;
        } else {
            self.passes.insert(self.looked_at, state);
        }
        self.looked_at += 1;
        if complete { pass.reduce(&Payloads::Stored(dir)).map(Some) } else { Ok(None) }
    }

    fn run_dir(&self) -> Option<&RunDir> {
        Some(self.run_dir)
    }

    fn computes(&self) -> bool {
        false
    }
}

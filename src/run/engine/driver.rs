//! Who computes the units of a pass: this process ([`Here`]), this process without a run directory ([`InMemory`]), or
//! nobody ([`Nobody`], which looks at what is there). All of them walk the same list of passes.

use crate::error::Result;
use crate::run::engine::folders::Outline;
use crate::run::engine::pass::{Pass, Payloads};
use crate::run::engine::workers::{self, Keeper, Limits, PassFigures};
use crate::run::engine::{CancelToken, Event, Observer};
use crate::store::{PassDir, RunDir, StaleReason, UnitState};

/// Walks the list of passes.
pub(crate) trait Driver {
    /// Says which passes are to follow, as far as that is known now, with their numbers of units.
    fn expect(&mut self, _passes: &[(Outline, Option<usize>)]) {}

    /// What the drive knows once `pass` is complete; `None` where it is not and this driver does not compute it.
    fn complete<P: Pass>(&mut self, pass: &P) -> Result<Option<P::Global>>;

    /// The run directory, if there is one.
    fn run_dir(&self) -> Option<&RunDir>;

    /// Whether this driver may change the run directory.
    fn computes(&self) -> bool;

    /// Bytes for all units in flight together, from here on.
    fn limit_memory(&mut self, _bytes: u64) {}

    /// Tells whoever watches.
    fn tell(&self, _event: &Event<'_>) {}
}

/// Computes what is missing on the threads of this process, and keeps it in the run directory.
pub(crate) struct Here<'a> {
    run_dir: &'a RunDir,
    limits: Limits,
    fail_fast: bool,
    observer: &'a dyn Observer,
    cancel: &'a CancelToken,
    /// What the passes cost so far.
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
    fn complete<P: Pass>(&mut self, pass: &P) -> Result<Option<P::Global>> {
        let outline = pass.outline();
        let dir = self.run_dir.pass(&outline.folder, outline.depends.clone());
        // First what is beside the units: where that was lost, the pass may remove its folder.
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

/// Computes every unit on the threads of this process and keeps nothing.
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

/// The state of a pass that was looked at.
#[derive(Debug, Clone)]
pub(crate) struct PassState {
    pub(crate) outline: Outline,
    pub(crate) units: Option<usize>,
    pub(crate) done: usize,
    pub(crate) stale: usize,
    pub(crate) why: Vec<StaleReason>,
}

/// Computes nothing and changes nothing: counts the units that are there.
pub(crate) struct Nobody<'a> {
    pub(crate) run_dir: &'a RunDir,
    /// Passes in the order of the flow: those that were looked at, then those that are expected to follow.
    pub(crate) passes: Vec<PassState>,
    /// How many of them were looked at.
    looked_at: usize,
}

impl<'a> Nobody<'a> {
    pub(crate) fn new(run_dir: &'a RunDir) -> Self {
        Self { run_dir, passes: Vec::new(), looked_at: 0 }
    }

    /// The passes, with the units of those that only were expected counted too.
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
    let (mut done, mut stale) = (0, 0);
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
        // A round or a longer curve is only known once the one before is complete: it was not expected.
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

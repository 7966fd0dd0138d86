//! Drivers that only inspect: [`Nobody`] counts the stored units of every pass, and [`Due`] finds the pass
//! that is due.

use crate::error::Result;
use crate::run::engine::driver::Driver;
use crate::run::engine::folders::Outline;
use crate::run::engine::pass::{Pass, Payloads};
use crate::store::{PassDir, RunDir, StaleReason, UnitState};

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
    /// Passes in the order of the flow: first the visited ones, then the ones expected to follow.
    pub(crate) passes: Vec<PassState>,
    /// Number of visited passes.
    looked_at: usize,
}

impl<'a> Nobody<'a> {
    pub(crate) fn new(run_dir: &'a RunDir) -> Self {
        Self { run_dir, passes: Vec::new(), looked_at: 0 }
    }

    /// The passes. For passes that were only expected, the stored units are counted now.
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
    // The global of a pass is stored under the number after its last unit.
    for unit in dir.stored_units()?.into_iter().filter(|unit| units.is_none_or(|units| *unit < units)) {
        match dir.state(unit)? {
            UnitState::Done => done += 1,
            UnitState::Missing => {}
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
        // Later rounds, and rounds with more neighbours, are known only once the previous round is complete,
        // so they were not expected.
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

    fn walks_to_files(&self) -> bool {
        false
    }
}

/// The pass that is due.
#[derive(Debug, Clone)]
pub(crate) struct DuePass {
    /// Its title.
    pub(crate) pass: String,
    /// Units without a stored result that fits. If there are none, its reduction is due.
    pub(crate) missing: Vec<usize>,
    /// Number of its units.
    pub(crate) units: usize,
}

/// Computes nothing and changes nothing. It finds the first pass that is not marked as complete.
pub(crate) struct Due<'a> {
    run_dir: &'a RunDir,
    pub(crate) due: Option<DuePass>,
}

impl<'a> Due<'a> {
    pub(crate) fn new(run_dir: &'a RunDir) -> Self {
        Self { run_dir, due: None }
    }
}

impl Driver for Due<'_> {
    fn complete<P: Pass>(&mut self, pass: &P) -> Result<Option<P::Global>> {
        let outline = pass.outline();
        let dir = self.run_dir.pass(&outline.folder, outline.depends.clone());
        if dir.is_complete(pass.units())? {
            return pass.reduce(&Payloads::Stored(dir)).map(Some);
        }
        let all: Vec<usize> = (0..pass.units()).collect();
        let missing = dir.not_done(&all)?.into_iter().map(|(unit, _)| unit).collect();
        self.due = Some(DuePass { pass: outline.title(), missing, units: pass.units() });
        Ok(None)
    }

    fn run_dir(&self) -> Option<&RunDir> {
        Some(self.run_dir)
    }

    fn computes(&self) -> bool {
        false
    }
}

//! The drivers of a pass: this process ([`Here`]), and this process without a run directory ([`InMemory`]).
//! Other drivers only inspect (`looks.rs`), or share a run with other processes (`shares.rs`). All of them
//! walk the same list of passes.

use std::sync::{Mutex, PoisonError};

use crate::error::Result;
use crate::run::engine::folders::Outline;
use crate::run::engine::pass::{Pass, Payloads};
use crate::run::engine::workers::{self, Keeper, Limits, PassFigures};
use crate::run::engine::{CancelToken, Event, Observer};
use crate::store::{PassDir, RunDir, StoreError};

/// Walks the list of passes.
pub(crate) trait Driver {
    /// Announces the passes that will follow, as far as they are known, with their numbers of units.
    fn expect(&mut self, _passes: &[(Outline, Option<usize>)]) {}

    /// The result of `pass` for the drive once it is complete. `None` if it is incomplete and this driver
    /// does not compute it.
    fn complete<P: Pass>(&mut self, pass: &P) -> Result<Option<P::Global>>;

    /// The run directory, if there is one.
    fn run_dir(&self) -> Option<&RunDir>;

    /// Whether this driver may change the run directory beyond adding units.
    fn computes(&self) -> bool;

    /// Whether a stored plan is used as it is, however much memory this host has, because other hosts work by
    /// it.
    fn keeps_plan(&self) -> bool {
        false
    }

    /// Whether this driver continues to the passes that write files.
    fn walks_to_files(&self) -> bool {
        true
    }

    /// Sets the memory for all units in flight together from now on, in bytes.
    fn limit_memory(&mut self, _bytes: u64) {}

    /// Reports an event to the observer.
    fn tell(&self, _event: &Event<'_>) {}
}

/// The warnings that a driver has reported, in order. The report contains them all, because the terminal of a
/// long run is often closed.
#[derive(Debug, Default)]
pub(crate) struct Warnings(Mutex<Vec<String>>);

impl Warnings {
    /// Keeps the text of a warning. Other events are not kept.
    pub(crate) fn keep(&self, event: &Event<'_>) {
        if let Event::Warning { text } = event {
            self.0.lock().unwrap_or_else(PoisonError::into_inner).push((*text).to_owned());
        }
    }

    /// Returns the texts and forgets them.
    pub(crate) fn take(&self) -> Vec<String> {
        std::mem::take(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
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
    /// The warnings so far.
    pub(crate) warnings: Warnings,
    /// The last pass, complete but not yet marked, and its number of units.
    unmarked: Option<(PassDir, usize)>,
}

impl<'a> Here<'a> {
    pub(crate) fn new(
        run_dir: &'a RunDir,
        limits: Limits,
        fail_fast: bool,
        observer: &'a dyn Observer,
        cancel: &'a CancelToken,
    ) -> Self {
        let (figures, warnings) = (Vec::new(), Warnings::default());
        Self { run_dir, limits, fail_fast, observer, cancel, figures, warnings, unmarked: None }
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
        // The files beside the units come first: if they were lost, the pass may remove its folder.
        pass.prepare(&dir)?;
        dir.prepare()?;
        // Workers may start this pass as soon as the previous pass is marked.
        if let Some((before, units)) = self.unmarked.take() {
            before.mark_complete(units)?;
        }
        let keeper = Keeper {
            run_dir: self.run_dir,
            dir: &dir,
            limits: self.limits,
            fail_fast: self.fail_fast,
            drives: true,
            observer: self.observer,
            cancel: self.cancel,
        };
        let all: Vec<usize> = (0..pass.units()).collect();
        self.figures.push(keeper.execute(pass, &all)?);
        self.unmarked = Some((dir.clone(), pass.units()));
        match pass.reduce(&Payloads::Stored(dir.clone())) {
            // A worker of an earlier call may have overwritten a unit with one for its own settings.
            Err(error)
                if matches!(error.cause(), Some(StoreError::Damaged { .. }))
                    && !dir.not_done_now(&all)?.is_empty() =>
            {
                keeper.execute(pass, &all)?;
                pass.reduce(&Payloads::Stored(dir)).map(Some)
            }
            reduced => reduced.map(Some),
        }
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
        self.warnings.keep(event);
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

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;
    use crate::run::engine::Silent;
    use crate::store::Inputs;

    /// A pass whose first unit is overwritten with one for other settings before the first reduction.
    struct Replaced {
        outline: Outline,
        runs: AtomicUsize,
        reductions: AtomicUsize,
        foreign: PassDir,
    }

    impl Pass for Replaced {
        type Global = Vec<u8>;

        fn outline(&self) -> &Outline {
            &self.outline
        }

        fn units(&self) -> usize {
            3
        }

        fn points(&self, _unit: usize) -> u64 {
            1
        }

        fn bytes(&self, _unit: usize) -> u64 {
            1
        }

        fn run(&self, unit: usize) -> Result<Vec<u8>> {
            self.runs.fetch_add(1, Ordering::Relaxed);
            Ok(unit.to_le_bytes().to_vec())
        }

        fn reduce(&self, payloads: &Payloads) -> Result<Vec<u8>> {
            if self.reductions.fetch_add(1, Ordering::Relaxed) == 0 {
                self.foreign.commit(0, &[9])?;
            }
            let payloads = (0..3).map(|unit| payloads.get(unit)).collect::<Result<Vec<_>>>()?;
            Ok(payloads.iter().map(|payload| payload[0]).collect())
        }
    }

    #[test]
    fn a_unit_that_a_worker_with_other_settings_replaced_is_computed_again() {
        let out = tempfile::tempdir().unwrap();
        let run_dir = RunDir::open(out.path(), false).unwrap();
        let outline = Outline::new(1, "replaced", Inputs::new());
        let foreign = run_dir.pass(&outline.folder, Inputs::new().with("gap", "0.5 m"));
        let pass = Replaced { outline, runs: AtomicUsize::new(0), reductions: AtomicUsize::new(0), foreign };
        let cancel = CancelToken::default();
        let mut driver = Here::new(&run_dir, Limits { threads: 2, memory: 2 }, false, &Silent, &cancel);
        assert_eq!(driver.complete(&pass).unwrap(), Some(vec![0, 1, 2]));
        assert_eq!((pass.runs.into_inner(), pass.reductions.into_inner()), (4, 2));
    }
}

//! Drivers for a run that several processes share: [`Share`] computes some units of one pass, and [`Barrier`]
//! completes one pass once all of its units are stored.

use std::time::Duration;

use crate::error::Result;
use crate::run::engine::driver::{Driver, Warnings};
use crate::run::engine::folders::Outline;
use crate::run::engine::looks::DuePass;
use crate::run::engine::pass::{Pass, Payloads};
use crate::run::engine::workers::{Keeper, Limits, PassFigures};
use crate::run::engine::{CancelToken, Event, Observer};
use crate::run::error::RunError;
use crate::store::{PassDir, RunDir, UnitState};

/// Which units of a pass.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Units {
    /// Every unit that has no stored result.
    All,
    /// These.
    Some(Vec<usize>),
}

/// Computes some units of one pass. The passes before it must be marked as complete.
pub(crate) struct Share<'a> {
    run_dir: &'a RunDir,
    /// Title of the pass.
    pass: &'a str,
    units: &'a Units,
    limits: Limits,
    fail_fast: bool,
    observer: &'a dyn Observer,
    cancel: &'a CancelToken,
    /// What was computed.
    pub(crate) figures: Option<PassFigures>,
    /// The passes after the survey, once they are known.
    known: Option<Vec<&'static str>>,
    /// The name among `known` that `pass` has.
    named: Option<&'static str>,
}

impl<'a> Share<'a> {
    pub(crate) fn new(
        run_dir: &'a RunDir,
        (pass, units): (&'a str, &'a Units),
        (limits, fail_fast): (Limits, bool),
        observer: &'a dyn Observer,
        cancel: &'a CancelToken,
    ) -> Self {
        let (known, named) = (None, None);
        Self { run_dir, pass, units, limits, fail_fast, observer, cancel, figures: None, known, named }
    }

    /// The name of the pass, if it is one after the survey.
    pub(crate) fn named(&self) -> Option<&'static str> {
        self.named
    }

    fn share<P: Pass>(&self, pass: &P, dir: &PassDir) -> Result<PassFigures> {
        let title = pass.outline().title();
        if !dir.is_prepared()? {
            return Err(RunError::NotOpened { pass: title }.into());
        }
        let mut units = match self.units {
            Units::All => (0..pass.units()).collect(),
            Units::Some(units) => units.clone(),
        };
        units.sort_unstable();
        units.dedup();
        if let Some(&unit) = units.iter().find(|&&unit| unit >= pass.units()) {
            return Err(RunError::NoSuchUnit { pass: title, unit, units: pass.units() }.into());
        }
        let keeper = Keeper {
            run_dir: self.run_dir,
            dir,
            limits: self.limits,
            fail_fast: self.fail_fast,
            drives: false,
            observer: self.observer,
            cancel: self.cancel,
        };
        let figures = keeper.execute(pass, &units)?;
        // Units that another process has stored count as soon as their names are durable.
        dir.sync()?;
        Ok(figures)
    }
}

impl Driver for Share<'_> {
    fn expect(&mut self, passes: &[(Outline, Option<usize>)]) {
        self.named =
            passes.iter().find(|(outline, _)| outline.is_named(self.pass)).map(|(outline, _)| outline.name);
        self.known = Some(passes.iter().map(|(outline, _)| outline.name).collect());
    }

    fn complete<P: Pass>(&mut self, pass: &P) -> Result<Option<P::Global>> {
        if self.figures.is_some() {
            return Ok(None);
        }
        let outline = pass.outline();
        let dir = self.run_dir.pass(&outline.folder, outline.depends.clone());
        if let (Some(known), None) = (&self.known, self.named) {
            let known = known.iter().map(ToString::to_string).collect();
            return Err(RunError::NoSuchPass { pass: self.pass.to_owned(), known }.into());
        }
        if outline.title() == self.pass {
            self.figures = Some(self.share(pass, &dir)?);
            return Ok(None);
        }
        if !dir.is_complete(pass.units())? {
            return Err(RunError::NotReduced { pass: outline.title(), asked: self.pass.to_owned() }.into());
        }
        pass.verify(&dir)?;
        pass.reduce(&Payloads::Stored(dir)).map(Some)
    }

    fn run_dir(&self) -> Option<&RunDir> {
        Some(self.run_dir)
    }

    fn computes(&self) -> bool {
        false
    }

    fn limit_memory(&mut self, bytes: u64) {
        self.limits.memory = bytes;
    }

    /// Warnings about the drive are left to the process that drives the run: a hundred workers would repeat
    /// them.
    fn tell(&self, event: &Event<'_>) {
        if !matches!(event, Event::Warning { .. }) {
            self.observer.event(event);
            self.run_dir.log_event(&event.to_json().to_string());
        }
    }
}

/// Completes one pass: checks that all of its units are stored, reduces them, and opens the next pass for
/// workers. It does not compute units.
pub(crate) struct Barrier<'a> {
    run_dir: &'a RunDir,
    /// Title of the pass to complete. `None` opens the first pass.
    after: Option<&'a str>,
    wait: Duration,
    observer: &'a dyn Observer,
    /// Whether `after` is complete.
    reached: bool,
    /// `after` with its number of units, until it is marked.
    unmarked: Option<(PassDir, usize)>,
    /// The pass that was opened.
    pub(crate) opened: Option<DuePass>,
    /// Figures of the passes that were walked through.
    pub(crate) figures: Vec<PassFigures>,
    /// The warnings so far.
    pub(crate) warnings: Warnings,
    /// The passes after the survey, once they are known, and whether `after` is missing among them.
    known: Vec<String>,
    unknown: bool,
}

impl<'a> Barrier<'a> {
    pub(crate) fn new(
        run_dir: &'a RunDir,
        after: Option<&'a str>,
        wait: Duration,
        observer: &'a dyn Observer,
    ) -> Self {
        let reached = after.is_none();
        let (unmarked, opened, known, unknown) = (None, None, Vec::new(), false);
        let (figures, warnings) = (Vec::new(), Warnings::default());
        Self { run_dir, after, wait, observer, reached, unmarked, opened, figures, warnings, known, unknown }
    }

    /// Whether the pass to complete was reached.
    pub(crate) fn reached(&self) -> bool {
        self.reached
    }

    /// Refuses units that are missing or cannot be used.
    fn check<P: Pass>(&self, pass: &P, dir: &PassDir) -> Result<()> {
        let title = pass.outline().title();
        let all: Vec<usize> = (0..pass.units()).collect();
        let left = dir.not_done(&all)?;
        if let Some((unit, UnitState::Refused(refusal))) =
            left.iter().find(|(_, state)| *state != UnitState::Missing)
        {
            let (unit, path) = (*unit, dir.unit_path(*unit));
            return Err(RunError::UnitRefused { pass: title, unit, path, why: refusal.to_string() }.into());
        }
        if left.is_empty() {
            return Ok(());
        }
        let missing = left.iter().map(|(unit, _)| *unit).collect();
        let waited_s = self.wait.as_secs();
        Err(RunError::UnitsMissing { pass: title, missing, units: pass.units(), waited_s }.into())
    }
}

impl Driver for Barrier<'_> {
    fn expect(&mut self, passes: &[(Outline, Option<usize>)]) {
        let named = |after| passes.iter().any(|(outline, _)| outline.is_named(after));
        self.unknown = !self.reached && self.after.is_some_and(|after| !named(after));
        self.known = passes.iter().map(|(outline, _)| outline.name.to_owned()).collect();
    }

    fn complete<P: Pass>(&mut self, pass: &P) -> Result<Option<P::Global>> {
        let outline = pass.outline();
        let title = outline.title();
        let dir = self.run_dir.pass(&outline.folder, outline.depends.clone());
        let units = pass.units();
        if let (true, Some(after)) = (self.unknown, self.after) {
            return Err(RunError::NoSuchPass { pass: after.to_owned(), known: self.known.clone() }.into());
        }
        pass.prepare(&dir)?;
        if self.reached {
            // Earlier calls may have completed passes after the one to complete: these stay as they are.
            let is_done = dir.is_complete_now(units)?;
            if !is_done {
                dir.prepare()?;
            }
            // Workers may start this pass as soon as the previous pass is marked.
            if let Some((before, units)) = self.unmarked.take() {
                before.mark_complete(units)?;
            }
            if !is_done {
                let all: Vec<usize> = (0..units).collect();
                let left = dir.not_done_now(&all)?;
                let missing = left.into_iter().map(|(unit, _)| unit).collect();
                self.opened = Some(DuePass { pass: title, missing, units });
                return Ok(None);
            }
        } else if self.after == Some(&*title) {
            self.check(pass, &dir)?;
            self.reached = true;
            self.unmarked = Some((dir.clone(), units));
        } else if !dir.is_complete(units)? {
            let asked = self.after.unwrap_or_default().to_owned();
            return Err(RunError::NotReduced { pass: title, asked }.into());
        }
        let (pass_name, title) = (outline.name, outline.title());
        let resumed = units;
        self.figures.push(PassFigures { pass: pass_name, title, units, resumed, points: 0, seconds: 0.0 });
        pass.reduce(&Payloads::Stored(dir)).map(Some)
    }

    fn run_dir(&self) -> Option<&RunDir> {
        Some(self.run_dir)
    }

    fn computes(&self) -> bool {
        true
    }

    fn keeps_plan(&self) -> bool {
        true
    }

    fn tell(&self, event: &Event<'_>) {
        self.warnings.keep(event);
        self.observer.event(event);
        self.run_dir.log_event(&event.to_json().to_string());
    }
}

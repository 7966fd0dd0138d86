//! What a run tells whoever watches it: progress as a trait of the library, so that it never prints.

/// Something that happened.
#[derive(Debug, Clone, PartialEq)]
pub enum Event<'a> {
    /// A pass begins; `done` of its `units` are already there from an earlier run.
    PassStarted {
        /// Name of the pass.
        pass: &'static str,
        /// Units in all.
        units: usize,
        /// Units already there.
        done: usize,
        /// Points in all units.
        points: u64,
        /// Points in the units already there.
        points_done: u64,
    },
    /// A unit was finished and stored.
    UnitFinished {
        /// Name of the pass.
        pass: &'static str,
        /// Number of the unit.
        unit: usize,
        /// Points in it.
        points: u64,
        /// Seconds it took one worker.
        seconds: f64,
    },
    /// A unit failed; the others go on.
    UnitFailed {
        /// Name of the pass.
        pass: &'static str,
        /// Number of the unit.
        unit: usize,
        /// Why.
        reason: &'a str,
    },
    /// A pass is complete.
    PassFinished {
        /// Name of the pass.
        pass: &'static str,
        /// Seconds since it started.
        seconds: f64,
    },
    /// Something the user should know.
    Warning {
        /// What.
        text: &'a str,
    },
}

/// Watches a run. Calls come from one thread at a time.
pub trait Observer: Sync {
    /// Something happened.
    fn event(&self, event: &Event<'_>);
}

/// An observer that looks away.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Observer for Silent {
    fn event(&self, _: &Event<'_>) {}
}

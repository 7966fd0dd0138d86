//! What a run tells whoever watches it: progress as a trait of the library, so that it never prints.

use serde_json::json;

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

impl Event<'_> {
    /// The event as a JSON object, one line of a log.
    #[must_use]
    pub fn to_json(&self) -> serde_json::Value {
        match self {
            Self::PassStarted { pass, units, done, points, points_done } => json!({
                "event": "pass-started", "pass": pass, "units": units, "done": done, "points": points,
                "points_done": points_done
            }),
            Self::UnitFinished { pass, unit, points, seconds } => {
                json!({ "event": "unit-finished", "pass": pass, "unit": unit, "points": points, "seconds": seconds })
            }
            Self::UnitFailed { pass, unit, reason } => {
                json!({ "event": "unit-failed", "pass": pass, "unit": unit, "reason": reason })
            }
            Self::PassFinished { pass, seconds } => {
                json!({ "event": "pass-finished", "pass": pass, "seconds": seconds })
            }
            Self::Warning { text } => json!({ "event": "warning", "text": text }),
        }
    }
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

//! The events of a run, and the trait for observers. The library itself prints nothing.

use serde_json::json;

/// Something that happened.
#[derive(Debug, Clone, PartialEq)]
pub enum Event<'a> {
    /// The passes that follow are known.
    PassesAhead {
        /// Their names in order. A pass that settles is named once.
        passes: &'a [&'static str],
    },
    /// A pass starts. `done` of its `units` were finished by an earlier run.
    PassStarted {
        /// Name of the pass.
        pass: &'static str,
        /// Number of units.
        units: usize,
        /// Number of units finished earlier.
        done: usize,
        /// Points in all units.
        points: u64,
        /// Points in the units finished earlier.
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
        /// Seconds on one worker.
        seconds: f64,
    },
    /// A unit failed. The others continue.
    UnitFailed {
        /// Name of the pass.
        pass: &'static str,
        /// Number of the unit.
        unit: usize,
        /// The reason.
        reason: &'a str,
    },
    /// A pass is complete.
    PassFinished {
        /// Name of the pass.
        pass: &'static str,
        /// Seconds since it started.
        seconds: f64,
    },
    /// A warning for the user.
    Warning {
        /// The text.
        text: &'a str,
    },
}

impl Event<'_> {
    /// The event as a JSON object, one line of a log.
    #[must_use]
    pub fn to_json(&self) -> serde_json::Value {
        match self {
            Self::PassesAhead { passes } => json!({ "event": "passes-ahead", "passes": passes }),
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
    /// Receives an event.
    fn event(&self, event: &Event<'_>);
}

/// An observer that ignores all events.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Observer for Silent {
    fn event(&self, _: &Event<'_>) {}
}

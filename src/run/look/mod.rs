//! Looking without touching: what is in a drive, which tiles a run would work on, what a run directory holds, and what a
//! run cannot be faster than.

mod floors;
mod info;
mod plan;
mod status;

pub use floors::{codec_floor, copy_floor, files_of};
pub use info::{DriveFacts, FileFacts, look_at};
pub use plan::{PlanFacts, TileFacts, plan_of};
pub use status::{PassStatus, RunStatus, status};

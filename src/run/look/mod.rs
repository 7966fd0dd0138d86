//! Commands that change nothing: facts of a drive, the tiles that a run would process, the state of a run
//! directory, and the lower limits of the running time.

mod check;
mod floors;
mod info;
mod plan;
mod status;

pub use check::check_settings;
pub use floors::{codec_floor, copy_floor, files_of};
pub use info::{DriveFacts, FileFacts, look_at};
pub use plan::{PlanFacts, TileFacts, plan_of};
pub use status::{PassStatus, RunStatus, status};

//! The engine: it computes the units of passes on threads within a memory budget, stores their results and
//! resumes. It knows units, bytes and files, but no points and no drive.

mod cancel;
mod driver;
mod folders;
mod in_flight;
mod looks;
mod memory;
mod observe;
mod pass;
mod rounds;
mod sections;
mod shares;
mod workers;

pub use cancel::CancelToken;
pub(crate) use driver::{Driver, Here, InMemory};
pub(crate) use folders::{Outline, prefix};
pub(crate) use looks::{Due, DuePass, Nobody, PassState};
pub(crate) use memory::{free_bytes, peak_resident_bytes};
pub use observe::{Event, Observer, Silent};
pub(crate) use pass::{Pass, Payloads};
pub(crate) use rounds::Rounds;
pub(crate) use sections::Sections;
pub use shares::Units;
pub(crate) use shares::{Barrier, Share};
pub(crate) use workers::Limits;
pub use workers::PassFigures;

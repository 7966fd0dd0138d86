//! The engine: passes over units, computed on threads within a memory budget, kept on disk and resumed. It knows units,
//! bytes and files; no points and no drive.

mod cancel;
mod driver;
mod folders;
mod in_flight;
mod memory;
mod observe;
mod pass;
mod rounds;
mod workers;

pub use cancel::CancelToken;
pub(crate) use driver::{Driver, Here, InMemory, Nobody, PassState};
pub(crate) use folders::{Outline, prefix};
pub(crate) use memory::{free_bytes, peak_resident_bytes};
pub use observe::{Event, Observer, Silent};
pub(crate) use pass::{Pass, Payloads};
pub(crate) use rounds::Rounds;
pub(crate) use workers::Limits;
pub use workers::PassFigures;

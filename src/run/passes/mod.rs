//! One file per pass: its units, their memory, the values that it depends on, the computation of a unit, and
//! its reduction. `flow` walks the list of passes.

pub(crate) mod copc_nodes;
pub(crate) mod copc_points;
pub(crate) mod copies;
pub(crate) mod export;
pub(crate) mod fields;
pub(crate) mod ground;
pub(crate) mod inventory;
pub(crate) mod method;
mod naming;
pub(crate) mod relabel;
pub(crate) mod scatter;
mod sections;
pub(crate) mod stitch;
pub(crate) mod survey;
mod window;

pub(crate) use window::{MethodDrive, Progress};

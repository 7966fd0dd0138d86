//! One pass, one file: its units, what they need, what it depends on, what a unit computes, its reduction. `flow` walks
//! the list.

pub(crate) mod export;
pub(crate) mod fields;
pub(crate) mod ground;
pub(crate) mod method;
pub(crate) mod relabel;
pub(crate) mod scatter;
mod sections;
pub(crate) mod stitch;
pub(crate) mod survey;
mod window;

pub(crate) use window::{MethodDrive, Progress};

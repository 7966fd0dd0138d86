//! The end of a run: names, tables, report, and the mark that all outputs are complete.

pub(crate) mod effect;
mod frame;
pub(crate) mod mark;
pub(crate) mod names;
pub(crate) mod outputs;
pub(crate) mod page;
mod refresh;
pub(crate) mod report;
pub(crate) mod tables;

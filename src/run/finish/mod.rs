//! The end of a run: names, tables, report, and the mark that says that everything is there.

pub(crate) mod mark;
pub(crate) mod names;
pub(crate) mod report;
pub(crate) mod tables;

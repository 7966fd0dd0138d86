//! The report of an evaluation: its values, and the formats in which they are written.

mod csv;
mod findings;
mod json;
mod rounding;
mod rows;
mod text;
mod values;

pub use findings::{Behind, Finding, Findings, HooverFindings};
pub use rows::{ObjectRow, ObjectRows, SmallRow, SmallRows};
pub use values::{Provenance, Report};

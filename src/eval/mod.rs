//! Scores a segmentation against reference labels: every metric of the literature that we compare with, and
//! the objects behind each figure.
//!
//! The flow: [`matching`] pairs the labels of points -> sparse contingency [`table`] -> [`metrics`]: objects,
//! segments and their overlaps, one module per metric, figures per class and overall -> [`report`]. If a
//! definition leaves something open, its module settles it and says so at its top.

pub mod classes;
mod error;
pub mod matching;
pub mod metrics;
pub mod report;
pub mod table;

pub use classes::ClassTable;
pub use error::{EvalError, PointSite, Side};
pub use matching::{CompareSettings, Counted, Matching, count};
pub use metrics::{Evaluation, MetricSettings};
pub use report::{Provenance, Report};

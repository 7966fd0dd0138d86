//! Scores a segmentation against reference labels: every metric of the literature we compare with, and the objects
//! behind each figure.
//!
//! The flow: labels of points that [`matching`] brings together -> sparse contingency [`table`] -> [`metrics`]: objects,
//! segments and their overlaps, one module per metric, figures per class and overall -> [`report`]. What a definition
//! leaves open is settled, and said, at the top of its module.

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
pub use report::axis::Axis;
pub use report::{Provenance, Report};

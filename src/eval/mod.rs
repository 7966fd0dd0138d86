//! Scores a segmentation against reference labels: every metric of the literature we compare with, and the objects
//! behind each figure.
//!
//! The flow: labels of matched points -> sparse contingency [`table`] -> [`scene`] of objects, segments and their
//! overlaps -> one module per metric ([`segmentation`], [`hoover`], [`panoptic`], [`rand_index`]) -> [`metrics`] per
//! class and overall -> report. What a definition leaves open is settled, and said, at the top of its module.

pub mod axis;
pub mod classes;
mod error;
pub mod hoover;
pub mod metrics;
pub mod panoptic;
pub mod rand_index;
pub mod report;
pub mod scene;
pub mod segmentation;
pub mod table;

pub use axis::Axis;
pub use classes::ClassTable;
pub use error::{EvalError, PointSite, Side};
pub use metrics::{Evaluation, MetricSettings};
pub use report::{Provenance, Report};

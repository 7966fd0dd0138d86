//! Scores a segmentation against reference labels: every metric of the literature we compare with, and the objects
//! behind each figure.
//!
//! The flow: labels of matched points -> sparse contingency [`table`] -> [`scene`] of objects, segments and their
//! overlaps -> one module per metric ([`segmentation`], [`hoover`], [`panoptic`], [`rand_index`]) -> [`metrics`] per
//! class and overall -> report. What a definition leaves open is settled, and said, at the top of its module.

pub mod axis;
pub mod classes;
pub mod compare;
mod dims;
mod error;
pub mod hoover;
mod join;
mod labels;
pub mod metrics;
mod order;
pub mod panoptic;
mod parts;
pub mod rand_index;
pub mod report;
pub mod scene;
mod scratch;
pub mod segmentation;
mod sides;
pub mod table;

pub use axis::Axis;
pub use classes::ClassTable;
pub use compare::{CompareSettings, Counted, Matching, count};
pub use error::{EvalError, PointSite, Side};
pub use metrics::{Evaluation, MetricSettings};
pub use report::{Provenance, Report};

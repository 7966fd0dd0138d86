//! Survey: one pass over all records finds where the points are, when they were measured, and along which
//! axis the drive runs.

mod axis;
mod error;
mod part;
mod trajectory;

pub use axis::{Axis, AxisSource};
pub use error::SurveyError;
pub use part::{Collector, OutOfRange, Survey, SurveyPart, TIME_BIN_S, TimeBin};
pub use trajectory::read_trajectory;

//! Survey: one streaming pass over all records that learns where the points are, when they were taken, and along which
//! axis the drive runs. Knows records and frames; no files, no tiles.

mod axis;
mod error;
mod part;
mod trajectory;

pub use axis::{Axis, AxisSource};
pub use error::SurveyError;
pub use part::{Collector, OutOfRange, Survey, SurveyPart, TIME_BIN_S, TimeBin};
pub use trajectory::read_trajectory;

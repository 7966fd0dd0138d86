//! Survey: one pass over all records finds where the points are, when they were measured, and along which
//! axis the drive runs.
//!
//! ```
//! use chainage::survey::{Axis, AxisSource};
//!
//! // A track of 100 m to the east.
//! let axis = Axis::from_positions(AxisSource::Trajectory, &[[0.0, 0.0], [100.0, 0.0]]).unwrap();
//! let (chainage_m, offset_m) = axis.locate([25.5, 3.0]);
//! assert!((chainage_m - 25.5).abs() < 1e-9);
//! assert!((offset_m - 3.0).abs() < 1e-9, "positive to the left");
//! ```

mod axis;
mod clock;
mod error;
mod moments;
mod part;
mod recordings;
mod runs;
mod station;
mod straight;
mod time_axis;
mod trajectory;

pub use axis::{Axis, AxisSource};
pub use clock::ClockDoubt;
pub use error::SurveyError;
pub use moments::Moment;
pub use part::{Collector, OutOfRange, Survey, SurveyPart, TIME_BIN_S, TimeBin};
pub use trajectory::read_trajectory;

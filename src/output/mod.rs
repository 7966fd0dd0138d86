//! Output: labelled copies of the input files, the object table, the report.

mod error;
pub mod objects;
pub(crate) mod points;
pub(crate) mod report;
mod save;

pub use crate::config::OutputFormat;
pub use error::OutputError;
pub use points::{LabelOptions, LabelledFile, check_names};
pub use report::{ChartError, chart_svg};
pub use save::save;

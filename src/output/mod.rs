//! Output: labelled copies of the input files, the object table, the report.

mod chart;
pub(crate) mod descriptor;
mod edit;
mod error;
mod labelled;
pub(crate) mod laz_chunk;
pub(crate) mod new_file;
pub mod objects;
mod record;
mod save;
mod tail;

pub use chart::{ChartError, chart_svg};
pub use error::OutputError;
pub use labelled::{LabelOptions, LabelledFile, OutputFormat, check_names};
pub use save::save;

//! Output: labelled copies of the input files, the object table, the report.
//!
//! ```
//! use std::io::Write as _;
//!
//! // A file gets its name when it is complete: what fails leaves nothing behind.
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("result.csv");
//! let failed = chainage::output::save(&path, |_| Err(std::io::Error::other("no result")));
//! assert!(failed.is_err() && !path.exists());
//! chainage::output::save(&path, |file| writeln!(file, "id,class"))?;
//! assert_eq!(std::fs::read_to_string(&path)?, "id,class\n");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod error;
pub mod objects;
mod palette;
pub(crate) mod points;
pub(crate) mod report;
mod save;

pub use crate::config::OutputFormat;
pub use error::OutputError;
pub use points::{LabelOptions, LabelledFile, check_names};
pub use report::{ChartError, Found, PointStream, chart_svg};
pub use save::{check_target, save};

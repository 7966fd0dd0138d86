//! How files are opened.

use serde::{Deserialize, Serialize};

use crate::config::LengthUnit;

/// How files are opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct InputOptions {
    /// Map files instead of reading them: faster, but a file that is cut during the run ends the program.
    pub mmap: bool,
    /// Unit of the coordinates.
    pub unit: LengthUnit,
}

impl Default for InputOptions {
    fn default() -> Self {
        Self { mmap: true, unit: LengthUnit::Auto }
    }
}

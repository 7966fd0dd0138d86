//! The options with which files are opened.

use serde::{Deserialize, Serialize};

use crate::config::LengthUnit;

/// Options for opening files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct InputOptions {
    /// Map files instead of reading them: faster, but if a file is truncated during the run, the program
    /// ends.
    pub mmap: bool,
    /// Unit of the coordinates.
    pub unit: LengthUnit,
}

impl Default for InputOptions {
    fn default() -> Self {
        Self { mmap: true, unit: LengthUnit::Auto }
    }
}

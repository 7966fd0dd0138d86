//! What can be wrong with an input file.

use std::borrow::Cow;
use std::path::PathBuf;

/// An input file that is missing, damaged or not acceptable; names the file and both numbers.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum InputError {
    /// The file cannot be opened or read.
    #[error("cannot read {path}", path = path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
}

impl InputError {
    /// What to do next.
    #[must_use]
    pub fn hint(&self) -> Option<Cow<'static, str>> {
        match self {
            Self::Read { .. } => None,
        }
    }
}

//! What can go wrong with the run directory.

use std::borrow::Cow;
use std::path::PathBuf;

use crate::error::ErrorKind;

/// The run directory is locked, does not match, or is damaged.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// Another process works in the directory.
    #[error("{path} is in use by {holder}", path = path.display())]
    Locked {
        /// The run directory.
        path: PathBuf,
        /// Who holds it, as far as known.
        holder: String,
    },
}

impl StoreError {
    /// The kind of failure, for exit codes.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::Locked { .. } => ErrorKind::Locked,
        }
    }

    /// What to type next.
    #[must_use]
    pub fn hint(&self) -> Option<Cow<'static, str>> {
        match self {
            Self::Locked { .. } => Some("wait for the other run, or choose another output directory".into()),
        }
    }
}

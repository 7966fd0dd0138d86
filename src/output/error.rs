//! What can go wrong while results are written.

use std::borrow::Cow;
use std::path::PathBuf;

/// A result that could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OutputError {
    /// The file system refused.
    #[error("cannot write {path}", path = path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The output folder holds something already.
    #[error("{path} is not empty", path = path.display())]
    NotEmpty {
        /// The folder.
        path: PathBuf,
    },
    /// The LAZ encoder refused.
    #[error("cannot compress points")]
    Compress {
        /// Why.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// Bytes that are no whole number of point records.
    #[error("{bytes} bytes of points are no whole number of records of {record_bytes} bytes")]
    PartialRecord {
        /// Bytes that were to be written.
        bytes: usize,
        /// Bytes of one record.
        record_bytes: u64,
    },
}

impl OutputError {
    /// What to do next.
    #[must_use]
    pub fn hint(&self) -> Option<Cow<'static, str>> {
        match self {
            Self::Write { source, .. } if source.kind() == std::io::ErrorKind::StorageFull => {
                Some("free some space and type the same command again: it resumes".into())
            }
            Self::NotEmpty { .. } => {
                Some("choose another folder, or replace what is there with --force".into())
            }
            Self::Write { .. } | Self::Compress { .. } | Self::PartialRecord { .. } => None,
        }
    }
}

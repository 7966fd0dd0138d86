//! Errors that end a drive before it is complete.

use std::borrow::Cow;
use std::path::PathBuf;

use crate::error::{ErrorKind, Failure};
use crate::output::OutputError;

/// A drive that was not completed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SynthError {
    /// Stopped on request.
    #[error("interrupted after {length_m:.0} m of the drive")]
    Interrupted {
        /// The output folder.
        folder: PathBuf,
        /// Metres driven.
        length_m: f64,
        /// Files that were complete. They stay.
        files: u32,
    },
    /// No space is left for the output.
    #[error("cannot complete the drive in {folder}", folder = folder.display())]
    Full {
        /// The output folder.
        folder: PathBuf,
        /// The cause.
        source: OutputError,
    },
}

impl Failure for SynthError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Interrupted { .. } => ErrorKind::Interrupted,
            Self::Full { .. } => ErrorKind::Output,
        }
    }

    fn hint(&self) -> Option<Cow<'static, str>> {
        Some(match self {
            Self::Interrupted { files: 0, .. } => "the same command starts from the beginning".into(),
            Self::Interrupted { folder, files, .. } => {
                let files = crate::words::counted((*files).into(), "complete file");
                let folder = folder.display();
                format!(
                    "{files} stayed in {folder}: empty it, and the same command starts from the beginning"
                )
                .into()
            }
            Self::Full { folder, .. } => {
                format!("free some space, empty {}, and type the same command again", folder.display()).into()
            }
        })
    }
}

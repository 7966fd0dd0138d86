//! Errors of the run directory.

use std::borrow::Cow;
use std::io;
use std::path::{Path, PathBuf};

use crate::error::{ErrorKind, Failure};

/// The run directory is locked, does not match, or cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// Another process works in the directory.
    #[error("{path} is in use by {holder}", path = path.display())]
    Locked {
        /// The output directory.
        path: PathBuf,
        /// The process that uses it, if known.
        holder: String,
    },
    /// The file system refused to read or write a file of the state.
    #[error("cannot {action} {path}", path = path.display())]
    Io {
        /// `read`, `write`, ...
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The state is on another file system than the outputs, as a link or a mount.
    #[error(
        "{state} is on another file system than {out}: outputs are made there and cannot be renamed to here",
        state = state.display(), out = out.display()
    )]
    Apart {
        /// The output directory.
        out: PathBuf,
        /// The folder of its state.
        state: PathBuf,
    },
    /// The directory has no run.
    #[error("{path} contains no run of chainage", path = path.display())]
    NoRun {
        /// The output directory.
        path: PathBuf,
    },
    /// The state was written by another version, which computes or stores differently.
    #[error("{path} was started by chainage {old} (state version {old_version}), this is {new} (state version {new_version})", path = path.display())]
    Version {
        /// The output directory.
        path: PathBuf,
        /// Program version that started the run.
        old: String,
        /// Its state version.
        old_version: u32,
        /// This program's version.
        new: String,
        /// Its state version.
        new_version: u32,
    },
    /// The input is not the input with which the run was started.
    #[error("{path} was started with other input: {what}", path = path.display())]
    OtherInput {
        /// The output directory.
        path: PathBuf,
        /// The first difference, with both values.
        what: String,
    },
    /// The record of the input was lost, but results of passes were not.
    #[error("{path} is missing, so the input of the results beside it is unknown", path = path.display())]
    NoIdentity {
        /// The record.
        path: PathBuf,
    },
    /// A file of the state was damaged after it was written.
    #[error("{path} is damaged: {what}", path = path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// The record of the files beside the state was damaged. Starting over does not remove this record,
    /// because it says which of these files may be replaced.
    #[error("{path} is damaged: {what}", path = path.display())]
    DamagedRecord {
        /// The record.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// The output directory contains an input file, or a foreign file has the name of an output.
    #[error("{path} would be overwritten", path = path.display())]
    InTheWay {
        /// The file.
        path: PathBuf,
    },
}

impl StoreError {
    /// A [`StoreError::Io`] for use in `map_err`.
    pub(crate) fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { action, path, source }
    }
}

impl Failure for StoreError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Locked { .. } => ErrorKind::Locked,
            Self::Io { .. } | Self::InTheWay { .. } | Self::Apart { .. } => ErrorKind::Output,
            Self::NoRun { .. }
            | Self::Version { .. }
            | Self::OtherInput { .. }
            | Self::NoIdentity { .. }
            | Self::Damaged { .. }
            | Self::DamagedRecord { .. } => ErrorKind::State,
        }
    }

    fn hint(&self) -> Option<Cow<'static, str>> {
        match self {
            Self::Locked { .. } => Some("wait for the other run, or choose another output directory".into()),
            Self::Io { source, .. } if source.kind() == io::ErrorKind::StorageFull => {
                Some("free some space and type the same command again: it resumes".into())
            }
            Self::NoRun { .. } => Some("start one with chainage run FILES... -o OUT".into()),
            Self::Version { .. } | Self::OtherInput { .. } => {
                Some("choose another output directory, or start over here with chainage run --fresh".into())
            }
            Self::DamagedRecord { .. } => {
                Some("remove the file and the outputs of the run, or choose another output directory".into())
            }
            Self::NoIdentity { .. } | Self::Damaged { .. } => {
                Some("start over here with chainage run --fresh".into())
            }
            Self::Apart { .. } => Some(
                "put the whole output directory on one file system: move the state to the place of the link, or \
                 choose another output directory"
                    .into(),
            ),
            Self::Io { action: "create", source, .. } if source.kind() == io::ErrorKind::AlreadyExists => {
                Some("a file is in the place of this folder: move it away and type the same command again".into())
            }
            Self::InTheWay { .. } => Some("choose another output directory".into()),
            Self::Io { .. } => None,
        }
    }

    /// Whether no further writing can succeed.
    fn stops_all(&self) -> bool {
        true
    }
}

//! Errors of learning and of model files.

use std::borrow::Cow;

use crate::error::{ErrorKind, Failure};

/// Nothing can be learned from the samples, or a model cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BoostingError {
    /// Nothing can be learned from the samples.
    #[error("cannot learn from {samples} samples: {why}")]
    Samples {
        /// Number of samples.
        samples: usize,
        /// What is wrong with them.
        why: String,
    },
    /// A setting out of its range.
    #[error("{key} = {value}: must be {expected}")]
    Setting {
        /// Name of the setting.
        key: &'static str,
        /// Its value.
        value: String,
        /// The range.
        expected: &'static str,
    },
    /// The bytes are not a model.
    #[error("{origin} is not a model of chainage")]
    Foreign {
        /// The file.
        origin: String,
    },
    /// The bytes were truncated or changed.
    #[error("{origin} is damaged: {what}")]
    Damaged {
        /// The file.
        origin: String,
        /// What is wrong with it.
        what: String,
    },
    /// The model has another version of the format.
    #[error("{origin} has version {found} of the model format; this program reads version {known}")]
    Version {
        /// The file.
        origin: String,
        /// Its version.
        found: u32,
        /// The version of this program.
        known: u32,
    },
    /// The model is for other features or classes than expected.
    #[error("{origin} does not fit this program: {what}")]
    Unfit {
        /// The file.
        origin: String,
        /// The first difference.
        what: String,
    },
}

impl Failure for BoostingError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Setting { .. } => ErrorKind::Config,
            Self::Samples { .. }
            | Self::Foreign { .. }
            | Self::Damaged { .. }
            | Self::Version { .. }
            | Self::Unfit { .. } => ErrorKind::Input,
        }
    }

    fn hint(&self) -> Option<Cow<'static, str>> {
        match self {
            Self::Foreign { .. } => {
                Some("name a file that chainage train wrote, or leave the model out to use the built-in one".into())
            }
            Self::Damaged { .. } => {
                Some("copy the file again, make it again with chainage train, or leave it out to use the built-in one".into())
            }
            Self::Version { found, known, .. } if found > known => {
                Some("use the version of chainage that made it or a later one, or train the model again".into())
            }
            Self::Version { .. } | Self::Unfit { .. } => {
                Some("train the model again with chainage train, or leave it out to use the built-in one".into())
            }
            Self::Samples { .. } | Self::Setting { .. } => None,
        }
    }

    fn concerns_input(&self) -> bool {
        matches!(
            self,
            Self::Foreign { .. } | Self::Damaged { .. } | Self::Version { .. } | Self::Unfit { .. }
        )
    }
}

//! Errors of settings.

use std::borrow::Cow;
use std::ops::RangeInclusive;
use std::path::PathBuf;

use crate::error::{ErrorKind, Failure};
use crate::words;

/// A setting that cannot be used. The text names the key, the value and the accepted values.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// The configuration file cannot be read.
    #[error("cannot read the configuration {path}", path = path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The text is not TOML.
    #[error("{origin} is not valid TOML")]
    Syntax {
        /// File or option the text came from.
        origin: String,
        /// Where and why.
        source: toml::de::Error,
    },
    /// A key that does not exist.
    #[error("there is no setting {key}{}", suggestion(similar.as_deref(), known))]
    UnknownKey {
        /// The key as written, dotted.
        key: String,
        /// The existing key that it resembles, dotted.
        similar: Option<String>,
        /// The existing keys of this section, or the sections.
        known: Vec<String>,
    },
    /// A key without its section.
    #[error("{key} is a setting of {}: write {}.{key}={value}", listed(sections), sections[0])]
    NoSection {
        /// The key.
        key: String,
        /// The value.
        value: String,
        /// The sections that have this key; at least one.
        sections: Vec<String>,
    },
    /// An old name without its section.
    #[error("{key} is {} now: write {}={value}", listed(settings), settings[0])]
    OldName {
        /// The old name.
        key: String,
        /// The value.
        value: String,
        /// The settings that had this name, dotted, by their new names; at least one.
        settings: Vec<String>,
    },
    /// A preset that does not exist.
    #[error("there is no preset {name}{}", suggestion(words::similar(name, known.iter().map(String::as_str)), known))]
    UnknownPreset {
        /// The name as given.
        name: String,
        /// The existing names.
        known: Vec<String>,
    },
    /// A value of the wrong type or out of range.
    #[error("{key} = {value}: must be {expected}")]
    Value {
        /// The key, dotted.
        key: String,
        /// The value as given.
        value: String,
        /// The accepted values, with unit.
        expected: String,
    },
    /// A ground filter or clustering method that is not registered.
    #[error(
        "there is no {kind} {name}{}",
        suggestion(words::similar(name, known.iter().map(String::as_str)), known)
    )]
    UnknownMethod {
        /// `ground filter` or `clustering method`.
        kind: &'static str,
        /// The name as given.
        name: String,
        /// The registered names.
        known: Vec<String>,
    },
    /// An assignment that is not `section.key=value`.
    #[error("cannot read the assignment {text}, expected section.key=value")]
    Assignment {
        /// The text as given.
        text: String,
    },
}

/// Names in a sentence: a, b and c.
fn listed(names: &[String]) -> String {
    match names {
        [before @ .., last] if !before.is_empty() => format!("{} and {last}", before.join(", ")),
        _ => names.concat(),
    }
}

/// The end of a message about a name that does not exist: the name that was probably meant, or else all
/// names.
fn suggestion(similar: Option<&str>, known: &[String]) -> String {
    match similar {
        Some(similar) => format!(": did you mean {similar}?"),
        None if known.is_empty() => String::new(),
        None => format!("; known: {}", known.join(", ")),
    }
}

impl ConfigError {
    /// A [`ConfigError::Value`].
    pub fn value(key: impl Into<String>, value: impl ToString, expected: impl Into<String>) -> Self {
        Self::Value { key: key.into(), value: words::shortened(value.to_string()), expected: expected.into() }
    }

    /// Refuses the first value outside its range; NaN is outside any range. Each item has key, value, range
    /// and unit, which may be empty. The text of the error is made from the range, so that the two cannot
    /// differ.
    pub(crate) fn outside<'a, T: PartialOrd + std::fmt::Display>(
        values: impl IntoIterator<Item = (&'a str, T, RangeInclusive<T>, &'a str)>,
    ) -> Result<(), Self> {
        let wrong = values.into_iter().find(|(_, value, range, _)| !range.contains(value));
        wrong.map_or(Ok(()), |(key, value, range, unit)| {
            let gap = if unit.is_empty() { "" } else { " " };
            Err(Self::value(key, value, format!("{} to {}{gap}{unit}", range.start(), range.end())))
        })
    }
}

impl Failure for ConfigError {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Config
    }

    fn hint(&self) -> Option<Cow<'static, str>> {
        match self {
            Self::UnknownKey { .. }
            | Self::NoSection { .. }
            | Self::OldName { .. }
            | Self::Assignment { .. } => {
                Some("chainage config prints every setting with its unit and default".into())
            }
            Self::UnknownMethod { .. } => Some("chainage methods describes them".into()),
            Self::UnknownPreset { .. } => Some("chainage config --presets describes them".into()),
            Self::Read { source, .. } if source.kind() == std::io::ErrorKind::NotFound => {
                Some("chainage config > FILE writes a configuration file with every setting".into())
            }
            Self::Read { .. } | Self::Syntax { .. } | Self::Value { .. } => None,
        }
    }
}

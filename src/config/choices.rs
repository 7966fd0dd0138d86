//! Settings whose values are a few words, and the messages about values that are not accepted.

use serde::{Deserialize, Serialize};

/// A foot in metres (international, 1959).
pub(crate) const FOOT: f64 = 0.3048;
/// A US survey foot in metres.
pub(crate) const US_SURVEY_FOOT: f64 = 1200.0 / 3937.0;

/// Unit of the coordinates of the input files, as a setting.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LengthUnit {
    /// The unit that the coordinate reference system of each file states; metres if it states none.
    #[default]
    Auto,
    /// Metres, whatever the files say.
    Metre,
    /// International feet, whatever the files say.
    Foot,
    /// US survey feet, whatever the files say.
    UsSurveyFoot,
}

impl LengthUnit {
    /// The word of the setting.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Metre => "metre",
            Self::Foot => "foot",
            Self::UsSurveyFoot => "us-survey-foot",
        }
    }

    /// Metres of the unit; `None` if the files decide.
    #[must_use]
    pub fn metres(self) -> Option<f64> {
        match self {
            Self::Auto => None,
            Self::Metre => Some(1.0),
            Self::Foot => Some(FOOT),
            Self::UsSurveyFoot => Some(US_SURVEY_FOOT),
        }
    }
}

/// Where the axis comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AxisChoice {
    /// The trajectory if there is one, else GPS time, else the principal axis.
    Auto,
    /// The track of the points' mean position over GPS time.
    GpsTime,
    /// The principal axis of the occupied cells.
    Principal,
}

/// Whether labelled copies are compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OutputFormat {
    /// As the input file is.
    #[default]
    Same,
    /// Never.
    Las,
    /// Always.
    Laz,
}

/// The value that serde expected, in the words of a user: `a number` instead of `f64`.
pub(super) fn expected(message: &str) -> String {
    if let Some(missing) = message.trim().strip_prefix("missing field ") {
        return format!("a table with {}", missing.replace('`', ""));
    }
    let expected = message.trim().rsplit_once("expected ").map_or(message, |(_, expected)| expected);
    match expected {
        "f32" | "f64" => "a number".to_owned(),
        "i8" | "i16" | "i32" | "i64" => "a whole number".to_owned(),
        "u8" | "u16" | "u32" | "u64" | "usize" => "a whole number, at least 0".to_owned(),
        "a boolean" => "true or false".to_owned(),
        "a string" | "path string" => "text".to_owned(),
        other => other.to_owned(),
    }
}

/// The words that serde expected, as in `same, las or laz`; `None` when the message is about something else.
pub(super) fn words(message: &str) -> Option<String> {
    let (_, expected) = message.strip_prefix("unknown variant ")?.split_once(", expected ")?;
    let words: Vec<&str> = expected.split('`').skip(1).step_by(2).collect();
    let (last, others) = words.split_last()?;
    Some(if others.is_empty() { (*last).to_owned() } else { format!("{} or {last}", others.join(", ")) })
}

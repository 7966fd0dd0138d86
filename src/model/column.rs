//! A column of the table of objects and its values. Their meaning is defined where they are computed, their
//! notation in each format.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

/// One column: name, type, unit, and its definition in one line.
///
/// ```
/// use chainage::model::{Column, ColumnType, ColumnUnit, Value};
///
/// let height = Column {
///     name: "height_m",
///     column_type: ColumnType::Decimal { places: 3 },
///     unit: ColumnUnit::Metre,
///     definition: "height of the highest point above the ground",
/// };
/// assert!(height.holds(&Value::Decimal(4.2)) && height.holds(&Value::Missing));
/// assert!(!height.holds(&Value::Count(4)));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Column {
    /// Name in every format: lower-case letters, digits and underscores; it ends with the unit if there is
    /// one.
    pub name: &'static str,
    /// Type of the values.
    pub column_type: ColumnType,
    /// Unit of the values.
    pub unit: ColumnUnit,
    /// What the values are, in one line without a final stop.
    pub definition: &'static str,
}

impl Column {
    /// The definition without the marks of code that the documentation has, for files that show it as plain
    /// text.
    ///
    /// ```
    /// use chainage::model::{Column, ColumnType, ColumnUnit};
    ///
    /// let (column_type, unit) = (ColumnType::Count, ColumnUnit::None);
    /// let column = Column { name: "id", column_type, unit, definition: "as `cluster_id` of the points" };
    /// assert_eq!(column.plain_definition(), "as cluster_id of the points");
    /// ```
    #[must_use]
    pub fn plain_definition(&self) -> String {
        self.definition.replace('`', "")
    }

    /// Whether the column can hold the value. Every column can hold a missing one.
    #[must_use]
    pub fn holds(&self, value: &Value<'_>) -> bool {
        match value {
            Value::Missing => true,
            Value::Count(_) => self.column_type == ColumnType::Count,
            Value::Decimal(_) => matches!(self.column_type, ColumnType::Decimal { .. }),
            Value::Text(_) => self.column_type == ColumnType::Text,
            Value::Texts(_) => self.column_type == ColumnType::Texts,
            Value::Counts(_) => self.column_type == ColumnType::Counts,
            Value::Flag(_) => self.column_type == ColumnType::Flag,
        }
    }
}

/// The value rounded to this many places, without a negative zero; `None` if it is not finite.
pub(crate) fn rounded(value: f64, places: u8) -> Option<f64> {
    // An integer power is exact; `powi` does not promise that.
    let scale = f64::from(10_u32.saturating_pow(places.into()));
    value.is_finite().then(|| (value * scale).round() / scale + 0.0)
}

/// The type of the values of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColumnType {
    /// Whole numbers from 0.
    Count,
    /// Numbers that are rounded to this number of decimal places when they are written.
    Decimal {
        /// Decimal places.
        places: u8,
    },
    /// Texts.
    Text,
    /// Lists of texts.
    Texts,
    /// Lists of whole numbers from 0.
    Counts,
    /// True or false.
    Flag,
}

impl ColumnType {
    /// The name of the type, for the documentation.
    #[must_use]
    pub fn label(self) -> &'static str {
        match self {
            Self::Count => "whole number",
            Self::Decimal { .. } => "number",
            Self::Text => "text",
            Self::Texts => "list of texts",
            Self::Counts => "list of whole numbers",
            Self::Flag => "true or false",
        }
    }
}

/// The unit of the values of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColumnUnit {
    /// No unit: counts and names.
    None,
    /// The coordinate system of the input, in its units.
    Input,
    /// Metres.
    Metre,
    /// Square metres.
    SquareMetre,
    /// Degrees.
    Degree,
}

impl ColumnUnit {
    /// The name of the unit, for the documentation.
    #[must_use]
    pub fn label(self) -> &'static str {
        match self {
            Self::None => "",
            Self::Input => "input",
            Self::Metre => "m",
            Self::SquareMetre => "m²",
            Self::Degree => "degrees",
        }
    }

    /// How the name of a column with this unit ends. Without a suffix the unit is that of the input, or there
    /// is none.
    #[must_use]
    pub fn suffix(self) -> &'static str {
        match self {
            Self::None | Self::Input => "",
            Self::Metre => "_m",
            Self::SquareMetre => "_m2",
            Self::Degree => "_deg",
        }
    }
}

/// One value of a row.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Value<'a> {
    /// Not known for this object.
    Missing,
    /// A whole number.
    Count(u64),
    /// A number. Formats treat a number that is not finite as missing.
    Decimal(f64),
    /// A text.
    Text(Cow<'a, str>),
    /// A list of texts.
    Texts(Vec<Cow<'a, str>>),
    /// A list of whole numbers.
    Counts(Vec<u64>),
    /// True or false.
    Flag(bool),
}

impl From<Option<f64>> for Value<'_> {
    fn from(value: Option<f64>) -> Self {
        value.map_or(Self::Missing, Self::Decimal)
    }
}

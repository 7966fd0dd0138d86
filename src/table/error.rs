//! Errors of tables.

use std::borrow::Cow;
use std::path::PathBuf;

use crate::error::{ErrorKind, Failure};
use crate::words::counted;

/// A table that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TableError {
    /// The file cannot be read, or is not text.
    #[error("cannot read the table {path}", path = path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// No rows.
    #[error("the table {path} has no rows", path = path.display())]
    Empty {
        /// The file.
        path: PathBuf,
        /// The columns of its header.
        names: Vec<String>,
    },
    /// The header consists of numbers only. It is probably the first row of a table without header.
    #[error("the first line of {path} has only numbers, but a header is expected: {found}", path = path.display())]
    NoHeader {
        /// The file.
        path: PathBuf,
        /// The line.
        found: String,
    },
    /// A row whose number of fields differs from that of the first line.
    #[error(
        "line {line} of {path} has {}, but the first line has {expected}",
        counted(*found as u64, "field"),
        path = path.display()
    )]
    Fields {
        /// The file.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
        /// Number of its fields.
        found: usize,
        /// Number of fields of the first line.
        expected: usize,
    },
    /// A quote that is not closed on its line.
    #[error("line {line} of {path} has a quote that is not closed", path = path.display())]
    Quote {
        /// The file.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
    },
    /// Numbers with a decimal comma.
    #[error("line {line} of {path} has a decimal comma, but numbers need a decimal point: {found}", path = path.display())]
    DecimalComma {
        /// The file.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
        /// The line or the field.
        found: String,
    },
    /// A column that does not exist.
    #[error("{path} has no column {column}; its columns are: {known}", path = path.display())]
    Column {
        /// The file.
        path: PathBuf,
        /// The name or number as given.
        column: String,
        /// The existing columns.
        known: String,
    },
    /// A field that is not a finite number.
    #[error("line {line} of {path}, column {column}: {found:?} is not a finite number", path = path.display())]
    Number {
        /// The file.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
        /// Name or number of the column.
        column: String,
        /// The field.
        found: String,
    },
    /// A column with a number in some rows only.
    #[error(
        "line {line} of {path}, column {column}: {found:?} is not a finite number, but other rows have one",
        path = path.display()
    )]
    Mixed {
        /// The file.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
        /// Name or number of the column.
        column: String,
        /// The field.
        found: String,
    },
    /// A name that would be read as something else.
    #[error("a column of {path} cannot have the name {name:?}: it would not be read as one field", path = path.display())]
    Name {
        /// The file.
        path: PathBuf,
        /// The name.
        name: String,
    },
    /// The table already has a column with the name of the new one.
    #[error("{path} already has a column {name}", path = path.display())]
    Taken {
        /// The file.
        path: PathBuf,
        /// The name.
        name: String,
    },
}

impl Failure for TableError {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Input
    }

    fn hint(&self) -> Option<Cow<'static, str>> {
        match self {
            Self::Read { source, .. } if source.kind() == std::io::ErrorKind::NotFound => {
                Some("give a text file with columns of numbers, such as CSV".into())
            }
            Self::NoHeader { .. } => Some("if it is the first row, add --no-header".into()),
            Self::Number { .. } => Some("choose columns of numbers with --columns".into()),
            Self::Mixed { .. } => {
                Some("correct the value, or choose the columns to use with --columns".into())
            }
            Self::DecimalComma { .. } => Some(
                "write decimal points, or leave the column out with --columns; for a table with semicolons: \
                 `tr , . < TABLE > POINTS`"
                    .into(),
            ),
            Self::Name { .. } => Some(
                "choose an --id-column without the separator of the table, quotes, blanks and line breaks"
                    .into(),
            ),
            Self::Taken { .. } => Some("name the new column with --id-column".into()),
            _ => None,
        }
    }
}

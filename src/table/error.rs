//! What can be wrong with a table.

use std::borrow::Cow;
use std::path::PathBuf;

use crate::error::{ErrorKind, Failure};

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
    },
    /// A header that holds only numbers is a row of a table without one.
    #[error("the first line of {path} holds only numbers, a header is expected: {found}", path = path.display())]
    NoHeader {
        /// The file.
        path: PathBuf,
        /// The line.
        found: String,
    },
    /// A row with another number of fields than the first line.
    #[error("line {line} of {path} has {found} fields, the first line has {expected}", path = path.display())]
    Fields {
        /// The file.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
        /// Its fields.
        found: usize,
        /// Fields of the first line.
        expected: usize,
    },
    /// A quote that is not closed in its line.
    #[error("line {line} of {path} has a quote that is not closed", path = path.display())]
    Quote {
        /// The file.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
    },
    /// A column that does not exist.
    #[error("{path} has no column {column}, there is: {known}", path = path.display())]
    Column {
        /// The file.
        path: PathBuf,
        /// The name or number as given.
        column: String,
        /// The columns there are.
        known: String,
    },
    /// A field that is no finite number.
    #[error("line {line} of {path}, column {column}: {found:?} is no finite number", path = path.display())]
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
    /// The table has a column with the name of the one to add.
    #[error("{path} has a column {name} already", path = path.display())]
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
            Self::NoHeader { .. } => Some("if it is the first row, add --no-header".into()),
            Self::Number { .. } => Some("choose columns of numbers with --columns".into()),
            Self::Taken { .. } => Some("name the new column with --id-column".into()),
            _ => None,
        }
    }
}

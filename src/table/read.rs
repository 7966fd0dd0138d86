//! A table read from text: its rows as they are in the file, and columns of numbers.

use std::io::Read;
use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::table::TableError;
use crate::table::split::{Separator, fields, has_decimal_commas, is_decimal_comma};

/// Number of characters of a line that an error message shows.
const SHOWN: usize = 80;

/// A table in memory: its text and the positions of its rows.
#[derive(Debug)]
pub struct Table {
    path: PathBuf,
    text: String,
    pub(super) separator: Separator,
    /// Names of the columns, or their numbers from 1 if there is no header.
    names: Vec<String>,
    pub(super) header: Option<Range<usize>>,
    /// Line number from 1, and the line without its end.
    rows: Vec<(usize, Range<usize>)>,
}

impl Table {
    /// Reads a table; `-` is standard input. The first line decides the separator: commas, semicolons, tabs
    /// or blanks. Empty lines are skipped.
    ///
    /// # Errors
    /// [`TableError`] when the file cannot be read or has no rows, or has no header where one is expected.
    pub fn read(path: &Path, has_header: bool) -> Result<Self, TableError> {
        let text = if path == Path::new("-") {
            let mut text = String::new();
            std::io::stdin().lock().read_to_string(&mut text).map(|_| text)
        } else {
            fs_err::read_to_string(path)
        };
        let text = text.map_err(|source| TableError::Read { path: path.to_owned(), source })?;
        Self::parse(path, text, has_header)
    }

    /// Parses a table from its text; `path` is used in errors.
    ///
    /// # Errors
    /// Those of [`Table::read`].
    pub fn parse(path: &Path, text: String, has_header: bool) -> Result<Self, TableError> {
        let start = text.len() - text.trim_start_matches('\u{feff}').len();
        let mut rows = Vec::new();
        let mut at = start;
        for (line, whole) in (1..).zip(text[start..].split_inclusive('\n')) {
            let content = whole.trim_end_matches(['\n', '\r']);
            if !content.trim().is_empty() {
                rows.push((line, at..at + content.len()));
            }
            at += whole.len();
        }
        let empty = |names| TableError::Empty { path: path.to_owned(), names };
        let (line, first) = rows.first().cloned().ok_or_else(|| empty(Vec::new()))?;
        if has_decimal_commas(&text[first.clone()]) {
            let found = text[first].chars().take(SHOWN).collect();
            return Err(TableError::DecimalComma { path: path.to_owned(), line, found });
        }
        let separator = Separator::of(&text[first.clone()]);
        let found = fields(&text[first.clone()], separator)
            .ok_or_else(|| TableError::Quote { path: path.to_owned(), line })?;
        let mut table =
            Self { path: path.to_owned(), text, separator, names: Vec::new(), header: None, rows };
        if has_header {
            if found.iter().all(|field| number(field).is_some()) {
                let found = table.text[first].chars().take(SHOWN).collect();
                return Err(TableError::NoHeader { path: path.to_owned(), found });
            }
            table.names = found;
            table.header = Some(first);
            table.rows.remove(0);
        } else {
            table.names = (1..=found.len()).map(|column| column.to_string()).collect();
        }
        if table.rows.is_empty() { Err(empty(table.names)) } else { Ok(table) }
    }

    /// The path of the table.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there are no rows. A table that was read has at least one.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Name of a column.
    #[must_use]
    pub fn name(&self, column: usize) -> &str {
        &self.names[column]
    }

    /// Names of the columns, or their numbers from 1 if there is no header.
    #[must_use]
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The text with its byte order mark, and where each row ends in it, without its line end.
    pub(super) fn text_and_row_ends(&self) -> (&str, impl Iterator<Item = usize>) {
        (&self.text, self.rows.iter().map(|(_, range)| range.end))
    }

    /// Checks that a column `name` can be added.
    ///
    /// # Errors
    /// When there is a header, [`TableError::Taken`] if it has this name, and [`TableError::Name`] if the
    /// name would not be one field of it.
    pub fn check_free(&self, name: &str) -> Result<(), TableError> {
        if self.header.is_none() {
            return Ok(());
        }
        let (path, taken) = (self.path.clone(), name.to_owned());
        if self.names.contains(&taken) {
            return Err(TableError::Taken { path, name: taken });
        }
        let is_one_field = fields(name, self.separator).is_some_and(|fields| fields == [name]);
        if !is_one_field || name.contains(['\n', '\r']) {
            return Err(TableError::Name { path, name: taken });
        }
        Ok(())
    }

    /// Indices of columns by name or by number from 1; a name wins over a number.
    ///
    /// # Errors
    /// [`TableError::Column`].
    pub fn columns(&self, wanted: &[String]) -> Result<Vec<usize>, TableError> {
        let find = |column: &String| {
            let by_name = self.names.iter().position(|name| name == column);
            let by_number =
                || column.parse::<usize>().ok()?.checked_sub(1).filter(|&at| at < self.names.len());
            by_name.or_else(by_number).ok_or_else(|| TableError::Column {
                path: self.path.clone(),
                column: column.clone(),
                known: self.names.join(", "),
            })
        };
        wanted.iter().map(find).collect()
    }

    /// Indices of the columns with a finite number in every row. Columns without any number are not among
    /// them.
    ///
    /// # Errors
    /// [`TableError::Mixed`] when a column holds a number in some rows only, and [`TableError::DecimalComma`]
    /// when one has numbers with commas, because leaving it out would change the result silently.
    /// Also when a row has another number of fields than the first line.
    pub fn numeric_columns(&self) -> Result<Vec<usize>, TableError> {
        let mut numbers = vec![0; self.names.len()];
        // The first cell of each column that is not a number.
        let mut other: Vec<Option<(usize, String)>> = vec![None; self.names.len()];
        self.each_row(|line, fields| {
            for (column, field) in fields.iter().enumerate() {
                match number(field) {
                    Some(_) => numbers[column] += 1,
                    None if is_decimal_comma(field) => return Err(self.decimal_comma(line, field)),
                    None if other[column].is_none() => {
                        other[column] = Some((line, field.chars().take(SHOWN).collect()));
                    }
                    None => {}
                }
            }
            Ok(())
        })?;
        let mut numeric = Vec::new();
        for (column, other) in other.into_iter().enumerate() {
            match other {
                None => numeric.push(column),
                Some((line, found)) if numbers[column] > 0 => {
                    let (path, column) = (self.path.clone(), self.names[column].clone());
                    return Err(TableError::Mixed { path, line, column, found });
                }
                Some(_) => {}
            }
        }
        Ok(numeric)
    }

    /// The numbers of some columns, row by row.
    ///
    /// # Errors
    /// [`TableError::Number`] or [`TableError::DecimalComma`], or when a row has other fields than the first
    /// line.
    pub fn values(&self, columns: &[usize]) -> Result<Vec<f64>, TableError> {
        let mut values = Vec::with_capacity(self.rows.len() * columns.len());
        self.each_row(|line, fields| {
            for &column in columns {
                let field = &fields[column];
                values.push(number(field).ok_or_else(|| match is_decimal_comma(field) {
                    true => self.decimal_comma(line, field),
                    false => TableError::Number {
                        path: self.path.clone(),
                        line,
                        column: self.names[column].clone(),
                        found: field.chars().take(SHOWN).collect(),
                    },
                })?);
            }
            Ok(())
        })?;
        Ok(values)
    }

    fn decimal_comma(&self, line: usize, field: &str) -> TableError {
        let found = field.chars().take(SHOWN).collect();
        TableError::DecimalComma { path: self.path.clone(), line, found }
    }

    fn each_row(
        &self,
        mut row: impl FnMut(usize, &[String]) -> Result<(), TableError>,
    ) -> Result<(), TableError> {
        for (line, range) in &self.rows {
            let quote = || TableError::Quote { path: self.path.clone(), line: *line };
            let fields = fields(&self.text[range.clone()], self.separator).ok_or_else(quote)?;
            if fields.len() != self.names.len() {
                return Err(TableError::Fields {
                    path: self.path.clone(),
                    line: *line,
                    found: fields.len(),
                    expected: self.names.len(),
                });
            }
            row(*line, &fields)?;
        }
        Ok(())
    }
}

fn number(field: &str) -> Option<f64> {
    field.parse().ok().filter(|number: &f64| number.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str, has_header: bool) -> Result<Table, String> {
        Table::parse(Path::new("t.csv"), text.to_owned(), has_header).map_err(|error| error.to_string())
    }

    #[test]
    fn columns_are_found_by_name_number_and_content() {
        let table = table("\u{feff}x,name,y\r\n1,a,2\r\n\r\n3,b,4e1\r\n", true).unwrap();
        assert_eq!((table.len(), table.name(2)), (2, "y"));
        assert_eq!(table.numeric_columns().unwrap(), [0, 2]);
        let mixed =
            self::table("x,y\n1,2\n3,?\n5,6", true).unwrap().numeric_columns().unwrap_err().to_string();
        assert_eq!(mixed, "line 3 of t.csv, column y: \"?\" is not a finite number, but other rows have one");
        assert_eq!(table.columns(&["y".to_owned(), "1".to_owned()]).unwrap(), [2, 0]);
        assert_eq!(table.values(&[2, 0]).unwrap(), [2.0, 1.0, 40.0, 3.0]);
        let error = table.columns(&["z".to_owned()]).unwrap_err().to_string();
        assert_eq!(error, "t.csv has no column z; its columns are: x, name, y");
        let error = table.values(&[1]).unwrap_err().to_string();
        assert_eq!(error, "line 2 of t.csv, column name: \"a\" is not a finite number");
    }

    #[test]
    fn a_table_without_a_header_numbers_its_columns() {
        let table = table("1\t2\t3\n4\t5\t6", false).unwrap();
        assert_eq!(
            table.values(&table.columns(&["1".to_owned(), "2".to_owned()]).unwrap()).unwrap(),
            [1.0, 2.0, 4.0, 5.0]
        );
    }

    #[test]
    fn a_column_is_not_added_twice() {
        assert!(table("1,2", false).unwrap().check_free("1").is_ok());
        let table = table("x,cluster_id\n1,2", true).unwrap();
        assert!(table.check_free("y").is_ok());
        let error = table.check_free("cluster_id").unwrap_err().to_string();
        assert_eq!(error, "t.csv already has a column cluster_id");
        let blanks = self::table("x y\n1 2", true).unwrap();
        for (table, name, is_free) in [
            (&table, "a;b", true),
            (&table, "say \"so\"", true),
            (&table, "a,b", false),
            (&table, "\"a\"", false),
            (&table, "a\nb", false),
            (&table, " a", false),
            (&blanks, "a,b", true),
            (&blanks, "a b", false),
            (&blanks, "", false),
        ] {
            assert_eq!(table.check_free(name).is_ok(), is_free, "{name:?}");
        }
    }

    #[test]
    fn decimal_commas_are_refused_by_name() {
        let said = |found: Result<Vec<usize>, TableError>| found.unwrap_err().to_string();
        let expected = |line, found| {
            format!("line {line} of t.csv has a decimal comma, but numbers need a decimal point: {found}")
        };
        assert_eq!(table("10,017;20,041\n1,5;2", false).unwrap_err(), expected(1, "10,017;20,041"));
        assert_eq!(table("10,017;20,041\n1,5;2", true).unwrap_err(), expected(1, "10,017;20,041"));
        let with_header = table("x;y;n\n1;2;a\n3;4,5;b", true).unwrap();
        assert_eq!(said(with_header.numeric_columns()), expected(3, "4,5"));
        assert_eq!(with_header.values(&[1]).unwrap_err().to_string(), expected(3, "4,5"));
        assert_eq!(with_header.values(&[0]).unwrap(), [1.0, 3.0]);
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, header, expected) in [
            ("", true, "the table t.csv has no rows"),
            ("x,y\n", true, "the table t.csv has no rows"),
            ("1,2\n3,4", true, "the first line of t.csv has only numbers, but a header is expected: 1,2"),
            ("x,\"y\n1,2", true, "line 1 of t.csv has a quote that is not closed"),
        ] {
            assert_eq!(table(text, header).unwrap_err(), expected);
        }
        for (text, expected) in [
            ("x,y\n1,2\n3", "line 3 of t.csv has 1 field, but the first line has 2"),
            ("x,y\n1,nan", "line 2 of t.csv, column y: \"nan\" is not a finite number"),
            ("x,y\n1,\"2", "line 2 of t.csv has a quote that is not closed"),
        ] {
            assert_eq!(table(text, true).unwrap().values(&[0, 1]).unwrap_err().to_string(), expected);
        }
    }
}

//! A table of objects as formats see it: columns and rows of typed values, and an outline per row.

use std::io::{self, Write};

use crate::model::{Column, Value};

/// One object.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectRow<'a> {
    /// Vertices of the outline in the units of the input, counter-clockwise; one or two when it has no area. A ring
    /// may be closed or not.
    pub outline: Vec<[f64; 2]>,
    /// One value per column, of the type of the column.
    pub values: Vec<Value<'a>>,
}

/// A table of objects. Rows are made one at a time, so that a table may be larger than memory.
#[derive(Clone, Copy)]
pub struct ObjectTable<'a> {
    /// The columns. The first one is the id.
    pub columns: &'a [Column],
    /// EPSG code of the coordinate system, when known.
    pub epsg: Option<u32>,
    /// Number of rows.
    pub len: usize,
    /// The row at a position below `len`. Rows ascend by id.
    pub row: &'a dyn Fn(usize) -> ObjectRow<'a>,
}

impl std::fmt::Debug for ObjectTable<'_> {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut text = out.debug_struct("ObjectTable");
        text.field("columns", &self.columns).field("epsg", &self.epsg).field("len", &self.len);
        text.finish_non_exhaustive()
    }
}

impl<'a> ObjectTable<'a> {
    /// The rows in their order, each made when it is asked for.
    pub fn rows(&self) -> impl Iterator<Item = ObjectRow<'a>> + use<'a> {
        let row = self.row;
        (0..self.len).map(row)
    }
}

/// A file format of the table of objects.
pub trait ObjectFormat: std::fmt::Debug + Sync {
    /// Writes the whole table, row by row.
    ///
    /// # Errors
    /// Those of `out`.
    fn write(&self, table: &ObjectTable<'_>, out: &mut dyn Write) -> io::Result<()>;
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::model::{ColumnType, ColumnUnit};

    const fn column(name: &'static str, column_type: ColumnType) -> Column {
        Column { name, column_type, unit: ColumnUnit::None, definition: "" }
    }

    /// A column of each type, with numbers of other places.
    pub(crate) const COLUMNS: &[Column] = &[
        column("id", ColumnType::Count),
        column("min_x", ColumnType::Decimal { places: 3 }),
        column("share", ColumnType::Decimal { places: 1 }),
        column("class", ColumnType::Text),
        column("files", ColumnType::Texts),
    ];

    pub(crate) fn car() -> ObjectRow<'static> {
        ObjectRow {
            outline: vec![[530_000.000_4, 3_380_000.0], [530_004.0, 3_380_000.0], [530_004.0, 3_380_002.0]],
            values: vec![
                Value::Count(7),
                Value::Decimal(530_000.123_4),
                Value::Decimal(-0.04),
                Value::Text("car, \"red\"".into()),
                Value::Texts(vec!["a.las".into(), "b, \"c\".laz".into()]),
            ],
        }
    }

    pub(crate) fn stray() -> ObjectRow<'static> {
        ObjectRow {
            outline: vec![[1.0, 2.0]],
            values: vec![
                Value::Count(8),
                Value::Missing,
                Value::Decimal(f64::NAN),
                Value::Text("none".into()),
                Value::Texts(vec!["a.las".into()]),
            ],
        }
    }

    /// What a format writes of these rows.
    pub(crate) fn written(format: &dyn ObjectFormat, rows: &[ObjectRow<'_>], epsg: Option<u32>) -> String {
        let row = |index: usize| rows[index].clone();
        let table = ObjectTable { columns: COLUMNS, epsg, len: rows.len(), row: &row };
        let mut out = Vec::new();
        format.write(&table, &mut out).unwrap();
        String::from_utf8(out).unwrap()
    }

    /// Whether a format reports that a writer refuses after so many bytes.
    pub(crate) fn refuses_after(format: &dyn ObjectFormat, bytes: usize) -> bool {
        let row = |_| car();
        let table = ObjectTable { columns: COLUMNS, epsg: None, len: 1, row: &row };
        let mut space = vec![0; bytes];
        format.write(&table, &mut &mut space[..]).is_err()
    }

    #[test]
    fn rows_have_values_of_their_columns() {
        for row in [car(), stray()] {
            assert!(COLUMNS.iter().zip(&row.values).all(|(column, value)| column.holds(value)));
        }
    }
}

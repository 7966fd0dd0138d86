//! A table of objects as formats see it: columns and rows of typed values, an outline and a base per row, and
//! facts of the whole drive.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use crate::model::{Column, Value};

/// One object.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectRow<'a> {
    /// Vertices of the outline in the units of the input, counter-clockwise; one or two if the outline has no
    /// area. A ring may be closed or not.
    pub outline: Vec<[f64; 2]>,
    /// z of each vertex of the outline, in the units of the input, if the outline is in space; empty if it is
    /// in the plane.
    pub heights: Vec<f64>,
    /// Where the object stands, in the units of the input.
    pub base: [f64; 3],
    /// One value per column, of the type of the column.
    pub values: Vec<Value<'a>>,
}

/// A tile of the run.
#[derive(Debug, Clone, PartialEq)]
pub struct TileShape {
    /// Number of the tile, from 0.
    pub number: u32,
    /// Chainage of its first and last cell in metres.
    pub chainage_m: [f64; 2],
    /// Points that it owns.
    pub points: u64,
    /// Its outline in the units of the input, without holes, counter-clockwise and not closed.
    pub outline: Vec<[f64; 2]>,
}

/// The facts of the whole drive. Formats without room for them leave them out.
#[derive(Debug, Clone)]
pub struct DriveShape<'a> {
    /// EPSG code of the horizontal coordinate system, when known.
    pub epsg: Option<u32>,
    /// The coordinate system as the files describe it, when they do.
    pub wkt: Option<&'a str>,
    /// EPSG code of all that this text describes, when known.
    pub wkt_epsg: Option<u32>,
    /// Metres per unit of x, y and z.
    pub units_m: [f64; 3],
    /// Stretches of the axis: x, y in the units of the input, and chainage in metres.
    pub axis: Vec<Vec<[f64; 3]>>,
    /// The tiles of the run.
    pub tiles: Vec<TileShape>,
}

impl Default for DriveShape<'_> {
    /// A drive in metres of which nothing else is known.
    fn default() -> Self {
        Self { epsg: None, wkt: None, wkt_epsg: None, units_m: [1.0; 3], axis: Vec::new(), tiles: Vec::new() }
    }
}

/// A table of objects. Rows are made one at a time, so that a table may be larger than memory.
#[derive(Clone, Copy)]
pub struct ObjectTable<'a> {
    /// The columns. The first one is the id.
    pub columns: &'a [Column],
    /// The drive.
    pub drive: &'a DriveShape<'a>,
    /// Number of rows.
    pub len: usize,
    /// The row at a position below `len`. Rows ascend by id.
    pub row: &'a dyn Fn(usize) -> io::Result<ObjectRow<'a>>,
}

impl std::fmt::Debug for ObjectTable<'_> {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut text = out.debug_struct("ObjectTable");
        text.field("columns", &self.columns).field("drive", &self.drive).field("len", &self.len);
        text.finish_non_exhaustive()
    }
}

impl<'a> ObjectTable<'a> {
    /// The rows in order, each made on demand.
    pub fn rows(&self) -> impl Iterator<Item = io::Result<ObjectRow<'a>>> + use<'a> {
        let row = self.row;
        (0..self.len).map(row)
    }
}

/// A file format of the table of objects.
pub trait ObjectFormat: std::fmt::Debug + Sync {
    /// Writes the whole table, row by row, to a new file. The caller syncs it and gives it its name.
    ///
    /// # Errors
    /// Errors of the file system, and errors of making a row.
    fn write(&self, table: &ObjectTable<'_>, path: &Path) -> io::Result<()>;
}

/// Creates a file and lets `content` write it from start to end.
pub(super) fn stream(path: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let mut out = BufWriter::new(File::create(path)?);
    content(&mut out)?;
    out.flush()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::model::{ColumnType, ColumnUnit};

    const fn column(name: &'static str, column_type: ColumnType) -> Column {
        Column { name, column_type, unit: ColumnUnit::None, definition: "as `x` of the points" }
    }

    /// A column of each type, and numbers with different places.
    pub(crate) const COLUMNS: &[Column] = &[
        column("id", ColumnType::Count),
        column("min_x", ColumnType::Decimal { places: 3 }),
        column("share", ColumnType::Decimal { places: 1 }),
        column("class", ColumnType::Text),
        column("files", ColumnType::Texts),
    ];

    pub(crate) fn car() -> ObjectRow<'static> {
        ObjectRow {
            base: [530_001.0, 3_380_001.5, 7.25],
            heights: Vec::new(),
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
            base: [1.0, 2.0, 3.0],
            outline: vec![[1.0, 2.0]],
            heights: Vec::new(),
            values: vec![
                Value::Count(8),
                Value::Missing,
                Value::Decimal(f64::NAN),
                Value::Text("none".into()),
                Value::Texts(vec!["a.las".into()]),
            ],
        }
    }

    /// The text that a format writes for these rows.
    pub(crate) fn written(format: &dyn ObjectFormat, rows: &[ObjectRow<'_>], epsg: Option<u32>) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table");
        let row = |index: usize| Ok(rows[index].clone());
        let drive = DriveShape { epsg, ..DriveShape::default() };
        format
            .write(&ObjectTable { columns: COLUMNS, drive: &drive, len: rows.len(), row: &row }, &path)
            .unwrap();
        std::fs::read_to_string(path).unwrap()
    }

    /// Whether a format returns an error if the file cannot be created or a row cannot be made.
    pub(crate) fn reports_errors(format: &dyn ObjectFormat) -> bool {
        let folder = tempfile::tempdir().unwrap();
        let good = |_| Ok(car());
        let bad = |index: usize| if index < 2 { Ok(car()) } else { Err(io::Error::other("no row")) };
        let drive = DriveShape::default();
        let table = |row| ObjectTable { columns: COLUMNS, drive: &drive, len: 3, row };
        format.write(&table(&good), &folder.path().join("good")).is_ok()
            && format
                .write(&table(&bad), &folder.path().join("bad"))
                .is_err_and(|error| error.to_string().contains("no row"))
            && format.write(&table(&good), &folder.path().join("no folder/file")).is_err()
    }

    #[test]
    fn rows_have_values_of_their_columns() {
        for row in [car(), stray()] {
            assert!(COLUMNS.iter().zip(&row.values).all(|(column, value)| column.holds(value)));
        }
    }
}

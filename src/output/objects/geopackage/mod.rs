//! GeoPackage 1.3 (OGC 12-128r18) with the layers `objects` (outlines), `bases` (where objects stand), `axis`
//! and `tiles`, a spatial index for each, and styles for QGIS.
//!
//! The coordinate system is that of the files, with its text unchanged. The bytes depend on the rows only: no
//! time is written. Only this folder uses SQLite.

mod geometry;
mod schema;
mod style;

use std::io;
use std::path::Path;

use rusqlite::types::ToSqlOutput;
use rusqlite::{Connection, Statement, ToSql, params};

use self::geometry::Geometry;
use self::schema::{Layer, Srs};
use self::style::Drawn;
use crate::model::{Column, ColumnType, ColumnUnit, Value};
use crate::output::objects::number::{listed, places, rounded};
use crate::output::objects::table::{DriveShape, ObjectFormat, ObjectTable};

/// The column that determines the colours, if a table has it.
const CLASS: &str = "class";

/// The format.
#[derive(Debug)]
pub(super) struct GeoPackage;

impl ObjectFormat for GeoPackage {
    fn write(&self, table: &ObjectTable<'_>, path: &Path) -> io::Result<()> {
        match std::fs::remove_file(path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        // SQLite says only that it cannot open a file. The system gives the reason.
        drop(std::fs::File::create(path)?);
        let mut database = Connection::open(path).map_err(io::Error::other)?;
        // No rollback is needed: a file that is not complete is never used. The caller syncs it.
        let set_up = "PRAGMA page_size = 4096; PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; PRAGMA locking_mode = EXCLUSIVE;";
        database.execute_batch(set_up).map_err(io::Error::other)?;
        fill(&mut database, table)?;
        database.close().map_err(|(_, error)| io::Error::other(error))
    }
}

fn fill(database: &mut Connection, table: &ObjectTable<'_>) -> io::Result<()> {
    let all = database.transaction().map_err(io::Error::other)?;
    let DriveShape { wkt_epsg, wkt, ref axis, ref tiles, .. } = *table.drive;
    let srs = Srs::of(wkt_epsg, wkt);
    schema::begin(&all, &srs).map_err(io::Error::other)?;
    let class = table.columns.iter().any(|column| column.name == CLASS).then_some(CLASS);
    let id = table.columns.first().map(|column| column.name);
    let objects = Layer { name: "objects", geometry: "POLYGON", z: 0, m: 0, columns: table.columns };
    let bases = Layer { name: "bases", geometry: "POINT", z: 1, m: 0, columns: table.columns };
    let stretches = Layer { name: "axis", geometry: "LINESTRING", z: 0, m: 1, columns: &STRETCH };
    let frames = Layer { name: "tiles", geometry: "POLYGON", z: 0, m: 0, columns: &TILE };
    write_layer(&all, &objects, &srs, Some(style::qml(Drawn::Areas, class, id)), |rows| {
        for row in table.rows() {
            let row = row?;
            rows.add(geometry::polygon(&row.outline, srs.id), &row.values)?;
        }
        Ok(())
    })?;
    write_layer(&all, &bases, &srs, Some(style::qml(Drawn::Points, class, None)), |rows| {
        for row in table.rows() {
            let row = row?;
            rows.add(Some(geometry::point(row.base, srs.id)), &row.values)?;
        }
        Ok(())
    })?;
    write_layer(&all, &stretches, &srs, Some(style::qml(Drawn::Line, None, None)), |rows| {
        for stretch in axis {
            let ends = [stretch.first(), stretch.last()].map(|end| end.map_or(0.0, |place| place[2]));
            rows.add(geometry::line(stretch, srs.id), &ends.map(Value::Decimal))?;
        }
        Ok(())
    })?;
    let label = Some(TILE[0].name);
    write_layer(&all, &frames, &srs, Some(style::qml(Drawn::Frames, None, label)), |rows| {
        for tile in tiles {
            let [from, to] = tile.chainage_m.map(Value::Decimal);
            let values = [Value::Count(tile.number.into()), from, to, Value::Count(tile.points)];
            rows.add(geometry::polygon(&tile.outline, srs.id), &values)?;
        }
        Ok(())
    })?;
    all.commit().map_err(io::Error::other)
}

const fn of_drive(name: &'static str, column_type: ColumnType, unit: ColumnUnit) -> Column {
    Column { name, column_type, unit, definition: "" }
}

const METRES: ColumnType = ColumnType::Decimal { places: 3 };
const STRETCH: [Column; 2] =
    [of_drive("from_m", METRES, ColumnUnit::Metre), of_drive("to_m", METRES, ColumnUnit::Metre)];
const TILE: [Column; 4] = [
    of_drive("tile", ColumnType::Count, ColumnUnit::None),
    of_drive("from_m", METRES, ColumnUnit::Metre),
    of_drive("to_m", METRES, ColumnUnit::Metre),
    of_drive("points", ColumnType::Count, ColumnUnit::None),
];

/// The rows of a layer while they are written.
struct Rows<'a> {
    columns: &'a [Column],
    insert: Statement<'a>,
    index: Statement<'a>,
    last: i64,
    /// Box around all geometries.
    bounds: Option<[f64; 4]>,
}

impl Rows<'_> {
    /// Adds a row. A row without a geometry is not in the index.
    fn add(&mut self, geometry: Option<Geometry>, values: &[Value<'_>]) -> io::Result<()> {
        self.last += 1;
        let bytes = geometry.as_ref().map(|geometry| &geometry.bytes);
        let cells: Vec<Cell> =
            self.columns.iter().zip(values).map(|(column, value)| Cell::of(column, value)).collect();
        let mut all: Vec<&dyn ToSql> = vec![&self.last, &bytes];
        all.extend(cells.iter().map(|cell| cell as &dyn ToSql));
        self.insert.execute(&all[..]).map_err(io::Error::other)?;
        if let Some(Geometry { bounds: [x0, x1, y0, y1], .. }) = geometry {
            self.index.execute(params![self.last, x0, x1, y0, y1]).map_err(io::Error::other)?;
            let [a, b, c, d] = self.bounds.unwrap_or([x0, x1, y0, y1]);
            self.bounds = Some([a.min(x0), b.max(x1), c.min(y0), d.max(y1)]);
        }
        Ok(())
    }
}

fn write_layer(
    database: &Connection,
    layer: &Layer<'_>,
    srs: &Srs<'_>,
    style: Option<String>,
    content: impl FnOnce(&mut Rows<'_>) -> io::Result<()>,
) -> io::Result<()> {
    layer.create(database).map_err(io::Error::other)?;
    let insert = database.prepare(&layer.insert()).map_err(io::Error::other)?;
    let index = database.prepare(&layer.insert_into_index()).map_err(io::Error::other)?;
    let mut rows = Rows { columns: layer.columns, insert, index, last: 0, bounds: None };
    content(&mut rows)?;
    let bounds = rows.bounds;
    drop(rows);
    layer.register(database, srs, bounds, style.as_deref()).map_err(io::Error::other)
}

/// A value as SQLite stores it.
enum Cell {
    Null,
    Integer(i64),
    Real(f64),
    Text(String),
}

impl Cell {
    fn of(column: &Column, value: &Value<'_>) -> Self {
        match value {
            Value::Missing => Self::Null,
            Value::Count(count) => i64::try_from(*count).map_or(Self::Null, Self::Integer),
            Value::Decimal(value) => {
                rounded(*value, places(column.column_type)).map_or(Self::Null, Self::Real)
            }
            Value::Text(text) => Self::Text(text.to_string()),
            Value::Texts(texts) => Self::Text(listed(texts)),
            Value::Counts(counts) => Self::Text(listed(counts)),
            Value::Flag(flag) => Self::Integer((*flag).into()),
        }
    }
}

impl ToSql for Cell {
    fn to_sql(&self) -> rusqlite::Result<ToSqlOutput<'_>> {
        match self {
            Self::Null => rusqlite::types::Null.to_sql().map(|_| ToSqlOutput::from(rusqlite::types::Null)),
            Self::Integer(value) => value.to_sql(),
            Self::Real(value) => value.to_sql(),
            Self::Text(text) => text.to_sql(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::objects::table::tests::{COLUMNS, car, reports_errors, stray};
    use crate::output::objects::table::{ObjectRow, TileShape};

    fn write(rows: &[ObjectRow<'_>], drive: &DriveShape<'_>, path: &Path) {
        let row = |index: usize| Ok(rows[index].clone());
        GeoPackage.write(&ObjectTable { columns: COLUMNS, drive, len: rows.len(), row: &row }, path).unwrap();
    }

    fn drive() -> DriveShape<'static> {
        DriveShape {
            epsg: None,
            wkt: Some("LOCAL_CS[\"a <b> & 'c'\"]"),
            wkt_epsg: None,
            axis: vec![vec![[0.0, 0.0, 0.0], [3.0, 4.0, 5.0]]],
            tiles: vec![TileShape {
                number: 0,
                chainage_m: [0.0, 5.0],
                points: 9,
                outline: vec![[0.0, 0.0], [4.0, 0.0], [4.0, 5.0], [0.0, 5.0]],
            }],
            ..DriveShape::default()
        }
    }

    #[test]
    fn the_same_rows_give_the_same_bytes_and_replace_what_was_there() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("b"), "left over").unwrap();
        for name in ["a", "b"] {
            write(&[car(), stray()], &drive(), &path(name));
        }
        let bytes = std::fs::read(path("a")).unwrap();
        assert!(bytes == std::fs::read(path("b")).unwrap());
        assert!(bytes.starts_with(b"SQLite format 3\0") && bytes[68..72] == *b"GPKG");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "no journal is left");
    }

    #[test]
    fn rows_are_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("objects.gpkg");
        write(&[car(), stray()], &drive(), &path);
        let database = Connection::open(&path).unwrap();
        let text = |query: &str| {
            let mut found = database.prepare(query).unwrap();
            let width = found.column_count();
            let row = |row: &rusqlite::Row<'_>| {
                let cell = |k: usize| format!("{:?}", row.get::<_, rusqlite::types::Value>(k).unwrap());
                Ok((0..width).map(cell).collect::<Vec<_>>().join(" "))
            };
            let rows: Vec<String> = found.query_map([], row).unwrap().map(Result::unwrap).collect();
            rows.join("\n")
        };
        assert_eq!(
            text("SELECT fid, id, min_x, share, class, files FROM objects"),
            "Integer(1) Integer(7) Real(530000.123) Real(0.0) Text(\"car, \\\"red\\\"\") Text(\"a.las;b, \\\"c\\\".laz\")\n\
             Integer(2) Integer(8) Null Null Text(\"none\") Text(\"a.las\")"
        );
        // The second object has no area: no outline, but a base.
        assert_eq!(text("SELECT geom IS NULL FROM objects"), "Integer(0)\nInteger(1)");
        assert_eq!(text("SELECT length(geom) FROM bases"), "Integer(37)\nInteger(37)");
        assert_eq!(text("SELECT id FROM rtree_bases_geom WHERE maxx >= 530000"), "Integer(1)");
        assert_eq!(
            text("SELECT tile, from_m, to_m, points FROM tiles"),
            "Integer(0) Real(0.0) Real(5.0) Integer(9)"
        );
        assert_eq!(text("SELECT from_m, to_m FROM axis"), "Real(0.0) Real(5.0)");
        assert_eq!(
            text("SELECT srs_id, definition FROM gpkg_spatial_ref_sys WHERE srs_id > 10000"),
            "Integer(100000) Text(\"LOCAL_CS[\\\"a <b> & 'c'\\\"]\")"
        );
        let layers =
            "SELECT table_name, geometry_type_name, srs_id, z, m FROM gpkg_geometry_columns ORDER BY rowid";
        assert_eq!(
            text(layers),
            "Text(\"objects\") Text(\"POLYGON\") Integer(100000) Integer(0) Integer(0)\n\
             Text(\"bases\") Text(\"POINT\") Integer(100000) Integer(1) Integer(0)\n\
             Text(\"axis\") Text(\"LINESTRING\") Integer(100000) Integer(0) Integer(1)\n\
             Text(\"tiles\") Text(\"POLYGON\") Integer(100000) Integer(0) Integer(0)"
        );
        // The marks of code are for the documentation.
        assert_eq!(
            text(
                "SELECT description FROM gpkg_data_columns WHERE table_name = 'objects' AND column_name = 'id'"
            ),
            "Text(\"as x of the points\")"
        );
        assert_eq!(text("SELECT count(*) FROM layer_styles WHERE useAsDefault = 1"), "Integer(4)");
        assert_eq!(text("PRAGMA integrity_check"), "Text(\"ok\")");
        assert_eq!(text("PRAGMA foreign_key_check"), "");
    }

    #[test]
    fn a_drive_without_objects_and_without_a_system_is_a_file_too() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("objects.gpkg");
        write(&[], &DriveShape::default(), &path);
        let database = Connection::open(&path).unwrap();
        let srs = "SELECT DISTINCT srs_id FROM gpkg_geometry_columns";
        assert_eq!(database.query_row(srs, [], |row| row.get::<_, i32>(0)).unwrap(), -1);
        let bounds = "SELECT count(*) FROM gpkg_contents WHERE min_x IS NULL";
        assert_eq!(database.query_row(bounds, [], |row| row.get::<_, i32>(0)).unwrap(), 5);
    }

    #[test]
    fn the_row_of_the_system_has_the_code_of_the_whole_text() {
        let folder = tempfile::tempdir().unwrap();
        for (wkt_epsg, expected) in [
            (Some(25_832), ("EPSG:25832", "EPSG", 25_832)),
            (Some(5_555), ("EPSG:5555", "EPSG", 5_555)),
            // A reader that knows the code of x and y would not read the text.
            (None, ("of the point files", "NONE", 100_000)),
        ] {
            let path = folder.path().join(format!("{}.gpkg", expected.2));
            let drive = DriveShape { epsg: Some(25_832), wkt_epsg, ..drive() };
            write(&[car()], &drive, &path);
            let database = Connection::open(&path).unwrap();
            let query = "SELECT DISTINCT srs_name, organization, organization_coordsys_id, s.srs_id
                         FROM gpkg_spatial_ref_sys s JOIN gpkg_geometry_columns USING (srs_id)";
            let row = |row: &rusqlite::Row<'_>| Ok((row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?));
            let found: (String, String, i32, i32) = database.query_row(query, [], row).unwrap();
            let (name, organization, id) = expected;
            assert_eq!(found, (name.to_owned(), organization.to_owned(), id, id));
        }
    }

    #[test]
    fn errors_are_reported() {
        assert!(reports_errors(&GeoPackage));
    }
}

//! The tables of a GeoPackage: the tables that the standard requires, one table per layer, and the spatial
//! index of each layer.

use rusqlite::{Connection, Result, params};

use crate::model::{Column, ColumnType, ColumnUnit};

/// `GPKG`, and version 1.3: readers since 2019 know it.
const MARK: &str = "PRAGMA application_id = 1196444487; PRAGMA user_version = 10300;";
/// The time of the last change, which the standard requires. It is constant, so that the same rows give the
/// same bytes.
const CHANGED: &str = "2000-01-01T00:00:00.000Z";
/// Number of a coordinate system without an EPSG code for the whole of it.
const OWN_SRS: i32 = 100_000;
/// Number of an unknown coordinate system in a plane (clause 1.1.2.1.2).
const UNKNOWN_SRS: i32 = -1;

/// The tables of clauses 1.1 and 2.1, and of the extensions for the spatial index, for well-known text of the
/// second generation (annex F.10) and for descriptions of columns (annex F.9). The table of styles is as QGIS
/// creates it.
const TABLES: &str = "
CREATE TABLE gpkg_spatial_ref_sys (srs_name TEXT NOT NULL, srs_id INTEGER NOT NULL PRIMARY KEY,
  organization TEXT NOT NULL, organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL, description TEXT,
  definition_12_063 TEXT NOT NULL DEFAULT 'undefined');
CREATE TABLE gpkg_contents (table_name TEXT NOT NULL PRIMARY KEY, data_type TEXT NOT NULL, identifier TEXT UNIQUE,
  description TEXT DEFAULT '', last_change DATETIME NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')),
  min_x DOUBLE, min_y DOUBLE, max_x DOUBLE, max_y DOUBLE, srs_id INTEGER,
  CONSTRAINT fk_gc_r_srs_id FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys(srs_id));
CREATE TABLE gpkg_geometry_columns (table_name TEXT NOT NULL, column_name TEXT NOT NULL, geometry_type_name TEXT NOT NULL,
  srs_id INTEGER NOT NULL, z TINYINT NOT NULL, m TINYINT NOT NULL,
  CONSTRAINT pk_geom_cols PRIMARY KEY (table_name, column_name), CONSTRAINT uk_gc_table_name UNIQUE (table_name),
  CONSTRAINT fk_gc_tn FOREIGN KEY (table_name) REFERENCES gpkg_contents(table_name),
  CONSTRAINT fk_gc_srs FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys (srs_id));
CREATE TABLE gpkg_extensions (table_name TEXT, column_name TEXT, extension_name TEXT NOT NULL, definition TEXT NOT NULL,
  scope TEXT NOT NULL, CONSTRAINT ge_tce UNIQUE (table_name, column_name, extension_name));
CREATE TABLE gpkg_data_columns (table_name TEXT NOT NULL, column_name TEXT NOT NULL, name TEXT, title TEXT,
  description TEXT, mime_type TEXT, constraint_name TEXT, CONSTRAINT pk_gdc PRIMARY KEY (table_name, column_name),
  CONSTRAINT gdc_tn UNIQUE (table_name, name));
CREATE TABLE gpkg_data_column_constraints (constraint_name TEXT NOT NULL, constraint_type TEXT NOT NULL, value TEXT,
  min NUMERIC, min_is_inclusive BOOLEAN, max NUMERIC, max_is_inclusive BOOLEAN, description TEXT,
  CONSTRAINT gdcc_ntv UNIQUE (constraint_name, constraint_type, value));
INSERT INTO gpkg_extensions VALUES
  ('gpkg_spatial_ref_sys', 'definition_12_063', 'gpkg_crs_wkt', 'http://www.geopackage.org/spec120/#extension_crs_wkt', 'read-write'),
  ('gpkg_data_columns', NULL, 'gpkg_schema', 'http://www.geopackage.org/spec120/#extension_schema', 'read-write'),
  ('gpkg_data_column_constraints', NULL, 'gpkg_schema', 'http://www.geopackage.org/spec120/#extension_schema', 'read-write');
CREATE TABLE layer_styles (id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, f_table_catalog TEXT(256), f_table_schema TEXT(256),
  f_table_name TEXT(256), f_geometry_column TEXT(256), styleName TEXT(30), styleQML TEXT, styleSLD TEXT,
  useAsDefault BOOLEAN, description TEXT, owner TEXT(30), ui TEXT(30),
  update_time DATETIME DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')));
";

/// The systems that every GeoPackage has (clause 1.1.2.1.2).
const WGS84: &str = r#"GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563,AUTHORITY["EPSG","7030"]],AUTHORITY["EPSG","6326"]],PRIMEM["Greenwich",0,AUTHORITY["EPSG","8901"]],UNIT["degree",0.0174532925199433,AUTHORITY["EPSG","9122"]],AXIS["Latitude",NORTH],AXIS["Longitude",EAST],AUTHORITY["EPSG","4326"]]"#;

/// A coordinate system.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Srs<'a> {
    /// Its number in the file.
    pub(super) id: i32,
    epsg: Option<u32>,
    wkt: Option<&'a str>,
}

impl<'a> Srs<'a> {
    /// The system with this text, and the EPSG code of all that the text describes: readers that know the
    /// code ignore the text.
    pub(super) fn of(epsg: Option<u32>, wkt: Option<&'a str>) -> Self {
        let id = match (epsg.and_then(|epsg| i32::try_from(epsg).ok()), wkt) {
            (Some(epsg), _) => epsg,
            (None, Some(_)) => OWN_SRS,
            (None, None) => UNKNOWN_SRS,
        };
        Self { id, epsg, wkt }
    }
}

/// Creates the tables of a file with one coordinate system.
pub(super) fn begin(database: &Connection, srs: &Srs<'_>) -> Result<()> {
    database.execute_batch(MARK)?;
    database.execute_batch(TABLES)?;
    let mut insert = database.prepare("INSERT INTO gpkg_spatial_ref_sys VALUES (?, ?, ?, ?, ?, ?, ?)")?;
    let nothing = "undefined";
    let (plane, angles) = ("coordinates in a plane", "longitude and latitude");
    insert.execute(params!["Undefined Cartesian SRS", -1, "NONE", -1, nothing, plane, nothing])?;
    insert.execute(params!["Undefined geographic SRS", 0, "NONE", 0, nothing, angles, nothing])?;
    insert.execute(params!["WGS 84 geodetic", 4326, "EPSG", 4326, WGS84, angles, nothing])?;
    if ![UNKNOWN_SRS, 0, 4326].contains(&srs.id) {
        // Only the second generation (ISO 19162) has keywords with this ending.
        let is_new =
            |wkt: &&str| wkt.split('[').next().is_some_and(|keyword| keyword.trim().ends_with("CRS"));
        let new = srs.wkt.filter(is_new).unwrap_or(nothing);
        let old = srs.wkt.filter(|wkt| !is_new(wkt)).unwrap_or(nothing);
        let (name, organization) = match srs.epsg {
            Some(epsg) => (format!("EPSG:{epsg}"), "EPSG"),
            None => ("of the point files".to_owned(), "NONE"),
        };
        let description = "the text of the point files, or that of the EPSG dataset if they have a code only";
        insert.execute(params![name, srs.id, organization, srs.id, old, description, new])?;
    }
    let styles = "INSERT INTO gpkg_contents (table_name, data_type, identifier, last_change) VALUES ('layer_styles', 'attributes', 'layer_styles', ?)";
    database.execute(styles, [CHANGED])?;
    Ok(())
}

/// A layer: a table of features of one kind of geometry.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layer<'a> {
    pub(super) name: &'static str,
    /// Name of the type of its geometries.
    pub(super) geometry: &'static str,
    /// Whether geometries have heights: 0 no, 1 yes.
    pub(super) z: u8,
    /// Whether geometries have measures: 0 no, 1 yes.
    pub(super) m: u8,
    pub(super) columns: &'a [Column],
}

/// The type of the values of a column (clause 1.1.1.1.3).
fn sql_type(column_type: ColumnType) -> &'static str {
    match column_type {
        ColumnType::Count => "INTEGER",
        ColumnType::Decimal { .. } => "DOUBLE",
        ColumnType::Flag => "BOOLEAN",
        ColumnType::Text | ColumnType::Texts | ColumnType::Counts => "TEXT",
    }
}

impl Layer<'_> {
    /// Creates the table and its spatial index.
    pub(super) fn create(&self, database: &Connection) -> Result<()> {
        let Self { name, geometry, columns, .. } = self;
        let columns: String = columns
            .iter()
            .map(|column| format!(", \"{}\" {}", column.name, sql_type(column.column_type)))
            .collect();
        database.execute_batch(&format!(
            "CREATE TABLE \"{name}\" (fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, geom {geometry}{columns});
             CREATE VIRTUAL TABLE \"rtree_{name}_geom\" USING rtree(id, minx, maxx, miny, maxy);"
        ))?;
        let describe =
            "INSERT INTO gpkg_data_columns (table_name, column_name, description) VALUES (?, ?, ?)";
        let mut describe = database.prepare(describe)?;
        for column in self.columns {
            let mut text = column.plain_definition();
            match column.unit {
                ColumnUnit::None => {}
                ColumnUnit::Input => text.push_str(" (unit of the coordinates)"),
                unit => text.push_str(&format!(" ({})", unit.label())),
            }
            describe.execute(params![name, column.name, text])?;
        }
        Ok(())
    }

    /// The statement that adds a row: number, geometry, values.
    pub(super) fn insert(&self) -> String {
        let places = ", ?".repeat(self.columns.len());
        format!("INSERT INTO \"{}\" VALUES (?, ?{places})", self.name)
    }

    /// The statement that adds the box of a row to the index.
    pub(super) fn insert_into_index(&self) -> String {
        format!("INSERT INTO \"rtree_{}_geom\" VALUES (?, ?, ?, ?, ?)", self.name)
    }

    /// Names the layer in the tables of the file, once its rows are written.
    pub(super) fn register(
        &self,
        database: &Connection,
        srs: &Srs<'_>,
        bounds: Option<[f64; 4]>,
        style: Option<&str>,
    ) -> Result<()> {
        let Self { name, geometry, z, m, .. } = self;
        let [x0, x1, y0, y1] = bounds.map_or([None; 4], |bounds| bounds.map(Some));
        database.execute(
            "INSERT INTO gpkg_contents VALUES (?1, 'features', ?1, '', ?2, ?3, ?4, ?5, ?6, ?7)",
            params![name, CHANGED, x0, y0, x1, y1, srs.id],
        )?;
        database.execute(
            "INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', ?, ?, ?, ?)",
            params![name, geometry, srs.id, z, m],
        )?;
        database.execute(
            "INSERT INTO gpkg_extensions VALUES (?, 'geom', 'gpkg_rtree_index', 'http://www.geopackage.org/spec120/#extension_rtree', 'write-only')",
            [name],
        )?;
        // Created after the rows: the triggers call functions of the program that edits the file, and this
        // program does not have them.
        database.execute_batch(&triggers(name))?;
        if let Some(style) = style {
            database.execute(
                "INSERT INTO layer_styles (f_table_catalog, f_table_schema, f_table_name, f_geometry_column, styleName,
                 styleQML, styleSLD, useAsDefault, description, owner, ui, update_time)
                 VALUES ('', '', ?1, 'geom', 'chainage', ?2, '', 1, '', '', NULL, ?3)",
                params![name, style, CHANGED],
            )?;
        }
        Ok(())
    }
}

/// The triggers that keep the index of a layer up to date when other programs edit it (annex F.3).
fn triggers(name: &str) -> String {
    let index = format!("\"rtree_{name}_geom\"");
    let there = "NEW.geom NOTNULL AND NOT ST_IsEmpty(NEW.geom)";
    let gone = "NEW.geom ISNULL OR ST_IsEmpty(NEW.geom)";
    let add = format!(
        "INSERT OR REPLACE INTO {index} VALUES (NEW.fid, ST_MinX(NEW.geom), ST_MaxX(NEW.geom), ST_MinY(NEW.geom), ST_MaxY(NEW.geom));"
    );
    let remove = format!("DELETE FROM {index} WHERE id = OLD.fid;");
    let all = [
        ("insert", "INSERT", format!("({there})"), add.clone()),
        ("update1", "UPDATE OF geom", format!("OLD.fid = NEW.fid AND ({there})"), add.clone()),
        ("update2", "UPDATE OF geom", format!("OLD.fid = NEW.fid AND ({gone})"), remove.clone()),
        ("update3", "UPDATE", format!("OLD.fid != NEW.fid AND ({there})"), format!("{remove} {add}")),
        (
            "update4",
            "UPDATE",
            format!("OLD.fid != NEW.fid AND ({gone})"),
            format!("DELETE FROM {index} WHERE id IN (OLD.fid, NEW.fid);"),
        ),
        ("delete", "DELETE", "OLD.geom NOT NULL".to_owned(), remove.clone()),
    ];
    all.iter()
        .map(|(event, on, when, act)| {
            format!("CREATE TRIGGER \"rtree_{name}_geom_{event}\" AFTER {on} ON \"{name}\" WHEN {when} BEGIN {act} END;\n")
        })
        .collect()
}

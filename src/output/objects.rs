//! The object table as CSV and as GeoJSON; what an object is and where it stands is decided elsewhere.
//!
//! One row per object, in the order given (ascending id). The same columns in both files; GeoJSON has the
//! footprint as geometry beside them. Coordinates are those of the input, in its coordinate system and units;
//! lengths whose name ends in `_m` are metres. Every decimal number is rounded to three places, so that the
//! bytes depend on nothing but the rows.
//!
//! | column | unit | meaning |
//! |---|---|---|
//! | `id` | | object id, from 1, as in the labelled files |
//! | `points` | | number of points |
//! | `min_x` `min_y` `min_z` | input | smallest coordinates |
//! | `max_x` `max_y` `max_z` | input | largest coordinates |
//! | `centroid_x` `centroid_y` `centroid_z` | input | mean of the points |
//! | `ground_z` | input | height of the ground below, empty (null) where none is known nearby |
//! | `height_above_ground_m` | m | highest point above the ground |
//! | `base_above_ground_m` | m | lowest point above the ground |
//! | `area_m2` | m² | area of the footprint, the convex hull in the plane |
//! | `chainage_m` | m | distance along the axis of the drive |
//! | `offset_m` | m | distance from the axis, positive to its left |
//! | `files` | | input files with points of it; in CSV joined by `;` |
//!
//! CSV follows RFC 4180 with lines that end in a line feed. GeoJSON is a feature collection with one feature
//! per line; the geometry is a polygon, or a line or a point where the footprint has no area. RFC 7946 knows
//! geographic coordinates only; ours are projected, so a member `crs` of the older GeoJSON specification (2008,
//! section 3) names the EPSG code when it is known, which QGIS and GDAL honour.

use std::io::{self, Write};

use geojson::{Feature, Geometry, GeometryValue, JsonObject, JsonValue, Position};
use serde_json::json;

use super::OutputError;

/// One object.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectRow {
    /// Object id, from 1.
    pub id: u32,
    /// Number of points.
    pub points: u64,
    /// Smallest coordinates, in the units of the input.
    pub min: [f64; 3],
    /// Largest coordinates, in the units of the input.
    pub max: [f64; 3],
    /// Mean of the points, in the units of the input.
    pub centroid: [f64; 3],
    /// Height of the ground below, in the units of the input.
    pub ground_z: Option<f64>,
    /// Height of the highest point above the ground, in metres.
    pub height_above_ground: Option<f64>,
    /// Height of the lowest point above the ground, in metres.
    pub base_above_ground: Option<f64>,
    /// Vertices of the footprint in the units of the input, counter-clockwise; one or two when it has no area.
    /// A ring may be closed or not.
    pub footprint: Vec<[f64; 2]>,
    /// Area of the footprint in square metres.
    pub area_m2: f64,
    /// Distance along the axis of the drive in metres.
    pub chainage_m: f64,
    /// Distance from the axis in metres, positive to its left.
    pub offset_m: f64,
    /// Names of the input files with points of it.
    pub files: Vec<String>,
}

/// The columns in their order, for both files.
const COLUMNS: [&str; 18] = [
    "id",
    "points",
    "min_x",
    "min_y",
    "min_z",
    "max_x",
    "max_y",
    "max_z",
    "centroid_x",
    "centroid_y",
    "centroid_z",
    "ground_z",
    "height_above_ground_m",
    "base_above_ground_m",
    "area_m2",
    "chainage_m",
    "offset_m",
    "files",
];

/// One value of a row.
enum Value {
    Count(u64),
    Decimal(Option<f64>),
    Names(Vec<String>),
}

impl ObjectRow {
    /// The values of [`COLUMNS`].
    fn values(self) -> [Value; 18] {
        let decimal = |value: f64| Value::Decimal(Some(value));
        [
            Value::Count(self.id.into()),
            Value::Count(self.points),
            decimal(self.min[0]),
            decimal(self.min[1]),
            decimal(self.min[2]),
            decimal(self.max[0]),
            decimal(self.max[1]),
            decimal(self.max[2]),
            decimal(self.centroid[0]),
            decimal(self.centroid[1]),
            decimal(self.centroid[2]),
            Value::Decimal(self.ground_z),
            Value::Decimal(self.height_above_ground),
            Value::Decimal(self.base_above_ground),
            decimal(self.area_m2),
            decimal(self.chainage_m),
            decimal(self.offset_m),
            Value::Names(self.files),
        ]
    }
}

/// Writes the table as CSV, row by row.
///
/// # Errors
/// [`OutputError::Write`] when `out` refuses.
pub fn write_csv(rows: impl IntoIterator<Item = ObjectRow>, out: impl Write) -> Result<(), OutputError> {
    csv(rows, out).map_err(|source| OutputError::Write { path: "objects.csv".into(), source })
}

fn csv(rows: impl IntoIterator<Item = ObjectRow>, mut out: impl Write) -> io::Result<()> {
    writeln!(out, "{}", COLUMNS.join(","))?;
    for row in rows {
        let fields = row.values().map(|value| match value {
            Value::Count(count) => count.to_string(),
            Value::Decimal(value) => {
                value.and_then(rounded).map_or_else(String::new, |value| format!("{value:.3}"))
            }
            Value::Names(names) => quoted(names.join(";")),
        });
        writeln!(out, "{}", fields.join(","))?;
    }
    out.flush()
}

/// A field of RFC 4180, in quotes when it needs them.
fn quoted(field: String) -> String {
    if field.contains(['"', ',', '\r', '\n']) { format!("\"{}\"", field.replace('"', "\"\"")) } else { field }
}

/// Writes the table as GeoJSON, row by row; `epsg` is the code of the coordinate system, when known.
///
/// # Errors
/// [`OutputError::Write`] when `out` refuses.
pub fn write_geojson(
    rows: impl IntoIterator<Item = ObjectRow>,
    epsg: Option<u32>,
    out: impl Write,
) -> Result<(), OutputError> {
    geojson(rows, epsg, out).map_err(|source| OutputError::Write { path: "objects.geojson".into(), source })
}

// The frame is written here and not by geojson's FeatureWriter, which writes a comma too many after a foreign
// member when no feature follows (1.0.0).
fn geojson(
    rows: impl IntoIterator<Item = ObjectRow>,
    epsg: Option<u32>,
    mut out: impl Write,
) -> io::Result<()> {
    writeln!(out, r#"{{"type":"FeatureCollection","#)?;
    if let Some(epsg) = epsg {
        let name = format!("urn:ogc:def:crs:EPSG::{epsg}");
        writeln!(out, r#""crs":{},"#, json!({"type": "name", "properties": {"name": name}}))?;
    }
    write!(out, r#""features":["#)?;
    for (index, row) in rows.into_iter().enumerate() {
        writeln!(out, "{}", if index == 0 { "" } else { "," })?;
        serde_json::to_writer(&mut out, &feature(row))?;
    }
    writeln!(out, "\n]}}")?;
    out.flush()
}

fn feature(mut row: ObjectRow) -> Feature {
    let geometry = geometry(&std::mem::take(&mut row.footprint)).map(Geometry::new);
    let properties: JsonObject = COLUMNS
        .into_iter()
        .zip(row.values())
        .map(|(name, value)| {
            let value = match value {
                Value::Count(count) => count.into(),
                Value::Decimal(value) => value.and_then(rounded).map_or(JsonValue::Null, JsonValue::from),
                Value::Names(names) => names.into(),
            };
            (name.to_owned(), value)
        })
        .collect();
    Feature { bbox: None, geometry, id: None, properties: Some(properties), foreign_members: None }
}

/// The footprint as a polygon, a line or a point, by its number of vertices; none when it has none.
fn geometry(footprint: &[[f64; 2]]) -> Option<GeometryValue> {
    let open = match footprint {
        [first, .., last] if first.map(f64::to_bits) == last.map(f64::to_bits) => {
            &footprint[..footprint.len() - 1]
        }
        _ => footprint,
    };
    let position = |place: &[f64; 2]| Position::from(place.map(|value| rounded(value).unwrap_or(0.0)));
    let mut positions: Vec<Position> = open.iter().map(position).collect();
    Some(match open {
        [] => return None,
        [place] => GeometryValue::Point { coordinates: position(place) },
        [_, _] => GeometryValue::LineString { coordinates: positions },
        [first, ..] => {
            positions.push(position(first));
            GeometryValue::Polygon { coordinates: vec![positions] }
        }
    })
}

/// Rounded to three places, without a negative zero; `None` for what is no number.
fn rounded(value: f64) -> Option<f64> {
    value.is_finite().then(|| (value * 1_000.0).round() / 1_000.0 + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn car() -> ObjectRow {
        ObjectRow {
            id: 7,
            points: 1_234,
            min: [530_000.123_4, 3_380_000.0, 20.5],
            max: [530_004.5, 3_380_002.0, 22.0],
            centroid: [530_002.0, 3_380_001.000_6, 21.0],
            ground_z: Some(20.25),
            height_above_ground: Some(1.75),
            base_above_ground: Some(-0.000_4),
            footprint: vec![[530_000.0, 3_380_000.0], [530_004.0, 3_380_000.0], [530_004.0, 3_380_002.0]],
            area_m2: 4.0,
            chainage_m: 12.5,
            offset_m: -3.25,
            files: vec!["a.las".into(), "b, \"c\".laz".into()],
        }
    }

    fn stray() -> ObjectRow {
        ObjectRow {
            id: 8,
            ground_z: None,
            height_above_ground: None,
            base_above_ground: Some(f64::NAN),
            footprint: vec![[1.0, 2.0]],
            files: vec!["a.las".into()],
            ..car()
        }
    }

    fn csv_text(rows: Vec<ObjectRow>) -> String {
        let mut out = Vec::new();
        write_csv(rows, &mut out).unwrap();
        String::from_utf8(out).unwrap()
    }

    fn geojson_text(rows: Vec<ObjectRow>, epsg: Option<u32>) -> String {
        let mut out = Vec::new();
        write_geojson(rows, epsg, &mut out).unwrap();
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn csv_has_a_header_and_a_line_per_row() {
        let text = csv_text(vec![car(), stray()]);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], COLUMNS.join(","));
        let places =
            "530000.123,3380000.000,20.500,530004.500,3380002.000,22.000,530002.000,3380001.001,21.000";
        let car = r#"20.250,1.750,0.000,4.000,12.500,-3.250,"a.las;b, ""c"".laz""#;
        assert_eq!(lines[1], format!("7,1234,{places},{car}"));
        assert_eq!(lines[2], format!("8,1234,{places},,,,4.000,12.500,-3.250,a.las"));
        assert!(text.ends_with("a.las\n") && lines.len() == 3);
        assert_eq!(csv_text(Vec::new()), COLUMNS.join(",") + "\n");
    }

    #[test]
    fn geojson_has_a_feature_per_line_and_names_the_coordinate_system() {
        let text = geojson_text(vec![car(), stray()], Some(32_632));
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], r#"{"type":"FeatureCollection","#);
        assert_eq!(lines[1], r#""crs":{"type":"name","properties":{"name":"urn:ogc:def:crs:EPSG::32632"}},"#);
        assert_eq!(lines[2], r#""features":["#);
        let places = concat!(
            r#""min_x":530000.123,"min_y":3380000.0,"min_z":20.5,"max_x":530004.5,"max_y":3380002.0,"#,
            r#""max_z":22.0,"centroid_x":530002.0,"centroid_y":3380001.001,"centroid_z":21.0,"#
        );
        let ring = "[[530000.0,3380000.0],[530004.0,3380000.0],[530004.0,3380002.0],[530000.0,3380000.0]]";
        let car = concat!(
            r#""ground_z":20.25,"height_above_ground_m":1.75,"base_above_ground_m":0.0,"area_m2":4.0,"#,
            r#""chainage_m":12.5,"offset_m":-3.25,"files":["a.las","b, \"c\".laz"]}},"#
        );
        assert_eq!(
            lines[3],
            format!(
                r#"{{"type":"Feature","geometry":{{"type":"Polygon","coordinates":[{ring}]}},"properties":{{"id":7,"points":1234,{places}{car}"#
            )
        );
        let stray = concat!(
            r#""ground_z":null,"height_above_ground_m":null,"base_above_ground_m":null,"area_m2":4.0,"#,
            r#""chainage_m":12.5,"offset_m":-3.25,"files":["a.las"]}}"#
        );
        assert_eq!(
            lines[4],
            format!(
                r#"{{"type":"Feature","geometry":{{"type":"Point","coordinates":[1.0,2.0]}},"properties":{{"id":8,"points":1234,{places}{stray}"#
            )
        );
        assert_eq!((lines[5], lines.len()), ("]}", 6));
    }

    #[test]
    fn geojson_can_be_read_back_even_without_rows() {
        for (rows, epsg) in [(Vec::new(), None), (Vec::new(), Some(25_832)), (vec![car(), stray()], None)] {
            let count = rows.len();
            let text = geojson_text(rows, epsg);
            let collection: geojson::FeatureCollection = text.parse().unwrap();
            assert_eq!(collection.features.len(), count, "{text}");
            assert_eq!(text.contains("EPSG::25832"), epsg.is_some());
        }
    }

    #[test]
    fn footprints_become_polygons_lines_and_points() {
        let [a, b, c] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
        let text = |footprint: &[[f64; 2]]| geometry(footprint).map(|value| Geometry::new(value).to_string());
        assert_eq!(text(&[]), None);
        assert_eq!(text(&[a]).unwrap(), r#"{"type":"Point","coordinates":[0.0,0.0]}"#);
        assert_eq!(text(&[a, b]).unwrap(), r#"{"type":"LineString","coordinates":[[0.0,0.0],[1.0,0.0]]}"#);
        let ring = r#"{"type":"Polygon","coordinates":[[[0.0,0.0],[1.0,0.0],[0.0,1.0],[0.0,0.0]]]}"#;
        assert_eq!(text(&[a, b, c]).unwrap(), ring);
        assert_eq!(text(&[a, b, c, a]).unwrap(), ring, "a closed ring stays closed once");
    }

    #[test]
    fn a_refusing_writer_is_an_error_that_names_the_table() {
        let mut full: &mut [u8] = &mut [0; 10];
        let error = write_csv([car()], &mut full).unwrap_err();
        assert_eq!(error.to_string(), "cannot write objects.csv");
        let mut full: &mut [u8] = &mut [0; 100];
        let error = write_geojson([car()], None, &mut full).unwrap_err();
        assert_eq!(error.to_string(), "cannot write objects.geojson");
    }
}

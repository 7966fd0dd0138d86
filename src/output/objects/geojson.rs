//! GeoJSON: a feature collection with one feature per line. The values of a row are the properties, and its
//! outline is the geometry: a polygon, or a line or a point where the outline has no area. The outline of an
//! upright surface is a closed line: seen from above it has no area, and rounded to a millimetre, its polygon
//! would cross itself. Rings of polygons are counter-clockwise (RFC 7946, section 3.1.6).
//!
//! RFC 7946 allows geographic coordinates only, but ours are projected. Therefore a member `crs` of the older
//! GeoJSON specification (2008, section 3) names the EPSG code, which QGIS and GDAL honour. If no code is
//! known, `crs` is null: no system can be assumed. GDAL 3 still assumes longitude and latitude.

use std::borrow::Cow;
use std::io::{self, Write};
use std::path::Path;

use geojson::{Feature, Geometry, GeometryValue, JsonObject, JsonValue, Position};
use serde_json::json;

use crate::model::{Column, Value};
use crate::output::objects::number::{OUTLINE_PLACES, places, rounded};
use crate::output::objects::table::{ObjectFormat, ObjectRow, ObjectTable, stream};

/// A surface is upright if its area seen from above is less than this part of its area, both in square
/// metres: it leans by less than 3 degrees. Chosen: of 369 surfaces of the sample, those of up to 0.01
/// crossed themselves, because their vertices are rounded to a millimetre.
const UPRIGHT: f64 = 0.052_335_956;

/// The format.
#[derive(Debug)]
pub(super) struct GeoJson;

impl ObjectFormat for GeoJson {
    fn write(&self, table: &ObjectTable<'_>, path: &Path) -> io::Result<()> {
        stream(path, |out| collection(table, out))
    }
}

// The frame is written here and not by geojson's FeatureWriter: version 1.0.0 writes a superfluous comma
// after a foreign member if no feature follows.
fn collection(table: &ObjectTable<'_>, out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, r#"{{"type":"FeatureCollection","#)?;
    let crs = table.drive.epsg.map(|epsg| {
        let name = format!("urn:ogc:def:crs:EPSG::{epsg}");
        json!({"type": "name", "properties": {"name": name}})
    });
    writeln!(out, r#""crs":{},"#, json!(crs))?;
    write!(out, r#""features":["#)?;
    // A line is built in memory, so that `out` is called once per row and not once per token.
    let mut line = Vec::new();
    for (index, row) in table.rows().enumerate() {
        line.clear();
        line.extend_from_slice(if index == 0 { b"\n" } else { b",\n" });
        serde_json::to_writer(&mut line, &feature(table, row?))?;
        out.write_all(&line)?;
    }
    writeln!(out, "\n]}}")
}

fn feature(table: &ObjectTable<'_>, row: ObjectRow<'_>) -> Feature {
    let geometry = geometry(&row.outline, &row.heights, table.drive.units_m).map(Geometry::new);
    let properties: JsonObject = table
        .columns
        .iter()
        .zip(row.values)
        .map(|(column, value)| (column.name.to_owned(), property(column, value)))
        .collect();
    Feature { bbox: None, geometry, id: None, properties: Some(properties), foreign_members: None }
}

fn property(column: &Column, value: Value<'_>) -> JsonValue {
    match value {
        Value::Missing => JsonValue::Null,
        Value::Count(count) => count.into(),
        Value::Decimal(value) => {
            rounded(value, places(column.column_type)).map_or(JsonValue::Null, JsonValue::from)
        }
        Value::Text(text) => text.into_owned().into(),
        Value::Texts(texts) => texts.into_iter().map(Cow::into_owned).collect::<Vec<String>>().into(),
        Value::Counts(counts) => counts.into(),
        Value::Flag(flag) => flag.into(),
    }
}

/// The outline as a polygon, a line or a point, by its number of vertices; none when it has none. Positions
/// have a z if there are heights. `units_m`: metres per unit of x, y and z.
fn geometry(outline: &[[f64; 2]], heights: &[f64], units_m: [f64; 3]) -> Option<GeometryValue> {
    let written = |value: f64| rounded(value, OUTLINE_PLACES).unwrap_or(0.0);
    let position = |at: usize| {
        let z = heights.get(at).copied();
        outline[at].into_iter().chain(z).map(written).collect::<Vec<f64>>()
    };
    let bits = |at: usize| (outline[at].map(f64::to_bits), heights.get(at).map(|z| z.to_bits()));
    let closed = outline.len() > 1 && bits(0) == bits(outline.len() - 1);
    let mut positions: Vec<Position> =
        (0..outline.len() - usize::from(closed)).map(|at| Position::from(position(at))).collect();
    Some(match positions.len() {
        0 => return None,
        1 => GeometryValue::Point { coordinates: positions.remove(0) },
        2 => GeometryValue::LineString { coordinates: positions },
        vertices => {
            let [x, y, z] = area_vector(&outline[..vertices], heights);
            if z < 0.0 {
                positions.reverse();
            }
            positions.push(positions[0].clone());
            // In square metres, each is multiplied by the units of the two other axes. All are divided by the
            // units of x and y here, so that a drive in one unit is not rounded.
            let [x, y] = [x * (units_m[2] / units_m[0]), y * (units_m[2] / units_m[1])];
            match z.abs() < UPRIGHT * x.hypot(y).hypot(z) {
                true => GeometryValue::LineString { coordinates: positions },
                false => GeometryValue::Polygon { coordinates: vec![positions] },
            }
        }
    })
}

/// The normal of a ring, as long as the area of the ring: its z is the area seen from above, negative if the
/// ring is clockwise from there.
fn area_vector(ring: &[[f64; 2]], heights: &[f64]) -> [f64; 3] {
    let vertex = |at: usize| {
        let [x, y] = ring[at % ring.len()];
        let height = |at: usize| heights.get(at).copied().unwrap_or(0.0);
        // From the first vertex, because world coordinates are large.
        [x - ring[0][0], y - ring[0][1], height(at % ring.len()) - height(0)]
    };
    let mut sum = [0.0; 3];
    for at in 0..ring.len() {
        let (a, b) = (vertex(at), vertex(at + 1));
        for (axis, sum) in sum.iter_mut().enumerate() {
            let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
            *sum += (a[next] * b[last] - a[last] * b[next]) / 2.0;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{ColumnType, ColumnUnit};
    use crate::output::objects::table::tests::{car, reports_errors, stray, written};

    #[test]
    fn there_is_a_feature_per_line_and_the_coordinate_system_is_named() {
        let text = written(&GeoJson, &[car(), stray()], Some(32_632));
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], r#"{"type":"FeatureCollection","#);
        assert_eq!(lines[1], r#""crs":{"type":"name","properties":{"name":"urn:ogc:def:crs:EPSG::32632"}},"#);
        assert_eq!(lines[2], r#""features":["#);
        let ring = "[[530000.0,3380000.0],[530004.0,3380000.0],[530004.0,3380002.0],[530000.0,3380000.0]]";
        let car = concat!(
            r#"{"id":7,"min_x":530000.123,"share":0.0,"class":"car, \"red\"","#,
            r#""files":["a.las","b, \"c\".laz"]}"#
        );
        assert_eq!(
            lines[3],
            format!(
                r#"{{"type":"Feature","geometry":{{"type":"Polygon","coordinates":[{ring}]}},"properties":{car}}},"#
            )
        );
        let stray = r#"{"id":8,"min_x":null,"share":null,"class":"none","files":["a.las"]}"#;
        assert_eq!(
            lines[4],
            format!(
                r#"{{"type":"Feature","geometry":{{"type":"Point","coordinates":[1.0,2.0]}},"properties":{stray}}}"#
            )
        );
        assert_eq!((lines[5], lines.len()), ("]}", 6));
    }

    #[test]
    fn it_can_be_read_back_even_without_rows() {
        for (rows, epsg) in [(vec![], None), (vec![], Some(25_832)), (vec![car(), stray()], None)] {
            let text = written(&GeoJson, &rows, epsg);
            let collection: geojson::FeatureCollection = text.parse().unwrap();
            assert_eq!(collection.features.len(), rows.len(), "{text}");
            assert_eq!(text.contains("EPSG::25832"), epsg.is_some());
        }
    }

    #[test]
    fn outlines_become_polygons_lines_and_points() {
        let [a, b, c] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
        let text = |outline: &[[f64; 2]]| {
            geometry(outline, &[], [1.0; 3]).map(|value| Geometry::new(value).to_string())
        };
        assert_eq!(text(&[]), None);
        assert_eq!(text(&[a]).unwrap(), r#"{"type":"Point","coordinates":[0.0,0.0]}"#);
        assert_eq!(text(&[a, b]).unwrap(), r#"{"type":"LineString","coordinates":[[0.0,0.0],[1.0,0.0]]}"#);
        let ring = r#"{"type":"Polygon","coordinates":[[[0.0,0.0],[1.0,0.0],[0.0,1.0],[0.0,0.0]]]}"#;
        assert_eq!(text(&[a, b, c]).unwrap(), ring);
        assert_eq!(text(&[a, b, c, a]).unwrap(), ring, "a closed ring stays closed once");
    }

    /// Two vertices of an upright surface are at the same place of the plane, and not in space.
    #[test]
    fn upright_surfaces_become_closed_lines_and_rings_are_counter_clockwise() {
        let [a, b, c] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
        let text = |outline: &[[f64; 2]], heights: &[f64]| {
            Geometry::new(geometry(outline, heights, [1.0; 3]).unwrap()).to_string()
        };
        let wall = "[[0.0,0.0,0.0],[1.0,0.0,0.0],[1.0,0.0,2.0],[0.0,0.0,2.0],[0.0,0.0,0.0]]";
        let line = format!(r#"{{"type":"LineString","coordinates":{wall}}}"#);
        assert_eq!(text(&[a, b, b, a], &[0.0, 0.0, 2.0, 2.0]), line);
        // It leans by 0.04 in 2: a little more than a degree. Then by 0.2 in 2: almost 6 degrees.
        let leaning = |y: f64| text(&[a, b, [1.0, y], [0.0, y]], &[0.0, 0.0, 2.0, 2.0]);
        assert!(leaning(0.04).contains("LineString") && leaning(-0.04).contains("LineString"));
        assert!(leaning(0.2).contains("Polygon") && leaning(-0.2).contains("Polygon"));
        let below = text(&[a, c, b], &[5.0, 5.0, 5.0]);
        let above = "[[1.0,0.0,5.0],[0.0,1.0,5.0],[0.0,0.0,5.0],[1.0,0.0,5.0]]";
        assert_eq!(below, format!(r#"{{"type":"Polygon","coordinates":[{above}]}}"#));
    }

    /// The same wall of 2 m with the heights or the plane in feet: it leans by 2, 4 and 8 degrees.
    #[test]
    fn whether_a_surface_is_upright_does_not_depend_on_the_units() {
        let foot = 0.304_8;
        for (degrees, expected) in [(2.0_f64, "LineString"), (4.0, "Polygon"), (8.0, "Polygon")] {
            let away = 2.0 * degrees.to_radians().tan();
            for units_m in [[1.0; 3], [foot; 3], [1.0, 1.0, foot], [foot, foot, 1.0]] {
                // Along x, and then along y.
                for turn in [|[x, y]: [f64; 2]| [x, y], |[x, y]: [f64; 2]| [y, x]] {
                    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, away], [0.0, away]].map(turn);
                    let outline = corners.map(|[x, y]| [x / units_m[0], y / units_m[1]]);
                    let heights = [0.0, 0.0, 2.0, 2.0].map(|z| z / units_m[2]);
                    let found = Geometry::new(geometry(&outline, &heights, units_m).unwrap()).to_string();
                    assert!(found.contains(expected), "{degrees} {units_m:?}: {found}");
                }
            }
        }
    }

    #[test]
    fn lists_and_flags_are_json() {
        let column =
            Column { name: "x", column_type: ColumnType::Counts, unit: ColumnUnit::None, definition: "" };
        assert_eq!(property(&column, Value::Counts(vec![3, 17])).to_string(), "[3,17]");
        assert_eq!(property(&column, Value::Flag(true)).to_string(), "true");
    }

    #[test]
    fn errors_are_reported() {
        assert!(reports_errors(&GeoJson));
    }
}

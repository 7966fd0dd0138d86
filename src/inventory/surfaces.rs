//! The table of surfaces: the plane of each, its area, and its outline in space.

use crate::inventory::measures::{Face, Polygon};
use crate::inventory::site::Site;
use crate::model::{Column, ColumnType, ColumnUnit, ObjectPart, Plane, Value, rounded};

/// Decimal places of the normal.
const NORMAL_PLACES: u8 = 9;

const fn decimal(name: &'static str, places: u8, unit: ColumnUnit, definition: &'static str) -> Column {
    Column { name, column_type: ColumnType::Decimal { places }, unit, definition }
}

const fn count(name: &'static str, definition: &'static str) -> Column {
    Column { name, column_type: ColumnType::Count, unit: ColumnUnit::None, definition }
}

/// The columns of the table of surfaces.
pub const SURFACE_COLUMNS: &[Column] = &[
    count("id", "number of the surface, as in the points and in the table of objects"),
    count("points", "points of the surface"),
    count(
        "plane_points",
        "points that the plane fits: those that are consistent with the planes of their slices, or with local planes away from edges",
    ),
    decimal(
        "area_m2",
        3,
        ColumnUnit::SquareMetre,
        "area of the outline in the plane: every point is within 0.1 m of it, gaps below 0.4 m and holes are filled, and separate parts are joined by bridges",
    ),
    decimal(
        "normal_x",
        NORMAL_PLACES,
        ColumnUnit::None,
        "unit normal of the plane, in metres along the axes of the input",
    ),
    decimal(
        "normal_y",
        NORMAL_PLACES,
        ColumnUnit::None,
        "the same along y; positive if the plane is upright",
    ),
    decimal("normal_z", NORMAL_PLACES, ColumnUnit::None, "the same along z; never negative"),
    decimal(
        "plane_offset_m",
        3,
        ColumnUnit::Metre,
        "product of the normal and any place of the plane, both in metres also where coordinates are in feet: the signed \
         distance of the plane from the origin of the coordinates",
    ),
    decimal(
        "flatness_m2",
        9,
        ColumnUnit::SquareMetre,
        "smallest eigenvalue of the plane points: their mean squared distance from the plane",
    ),
    decimal(
        "deviation_m",
        4,
        ColumnUnit::Metre,
        "root of the flatness: standard deviation of the plane points from the plane",
    ),
    decimal("centre_x", 3, ColumnUnit::Input, "mean of the plane points, x; the plane goes through it"),
    decimal("centre_y", 3, ColumnUnit::Input, "the same, y"),
    decimal("centre_z", 3, ColumnUnit::Input, "the same, z"),
];

/// A surface as formats see it.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceRow {
    /// Vertices of the outline in space, in the units of the input: counter-clockwise as seen against the
    /// normal, not closed.
    pub outline: Vec<[f64; 3]>,
    /// Mean of its plane points, in the units of the input.
    pub centre: [f64; 3],
    /// One value per column of [`SURFACE_COLUMNS`].
    pub values: Vec<Value<'static>>,
}

impl SurfaceRow {
    /// The row of surface `id`. `part` and `face` contain all its points.
    #[must_use]
    pub fn new(id: u32, part: &ObjectPart, plane: &Plane, face: &Face, site: &Site<'_>) -> Self {
        let lattice = site.lattice;
        let outline = face.outline(part, plane, lattice);
        let area = outline.as_ref().map_or(0.0, Polygon::area_units2) * lattice.step_m().powi(2);
        let in_input = |place: [f64; 3]| {
            [0, 1, 2].map(|axis| place[axis] / f64::from(lattice.units_per_m()) / site.units_m[axis])
        };
        let vertices = outline.iter().flat_map(|outline| &outline.vertices);
        let ring = vertices.map(|place| in_input(plane.lattice_point(*place))).collect();
        let centre = site.input_point(plane.centre);
        let metres = plane.centre.map(|value| lattice.metres(value));
        // As it is written: 5,000 km away from the origin, its last digit moves the plane by millimetres.
        let [x, y, z] = plane.normal.map(|value| rounded(value, NORMAL_PLACES).unwrap_or(value));
        let offset = x * metres[0] + y * metres[1] + z * metres[2];
        let flatness = plane.flatness_units2 * lattice.step_m() * lattice.step_m();
        let mut values = vec![
            Value::Count(u64::from(id)),
            Value::Count(part.points),
            Value::Count(plane.points),
            Value::Decimal(area),
        ];
        let decimals = [x, y, z, offset, flatness, flatness.sqrt()];
        values.extend(decimals.into_iter().chain(centre).map(Value::Decimal));
        Self { outline: ring, centre, values }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inventory::object::tests::{FEET, METRES, as_decimals, site, terrain_at};
    use crate::model::{FileId, Lattice, TileCloud};

    #[test]
    fn a_wall_has_its_plane_and_its_outline_in_the_units_of_the_input() {
        // 2 m long and 1 m high at y = 3.048 m, a point every 20 mm.
        let points: Vec<[i64; 3]> = (0..5_000).map(|k| [k % 100 * 20, 3_048, k / 100 * 20]).collect();
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, &points);
        let objects = vec![7; points.len()];
        let part =
            ObjectPart::collect(&cloud, &vec![1; points.len()], 1, |_| true, |_| FileId::new(0)).remove(0);
        let plane =
            Plane { centre: [990, 3_048, 490], normal: [0.0, 1.0, 0.0], flatness_units2: 4.0, points: 4_900 };
        let face = Face::collect(&cloud, &objects, |_| true, |_| Some((&part, &plane))).remove(0).1;
        let terrain = terrain_at(&[]);
        for (units, unit_m) in [(METRES, 1.0), (FEET, 0.304_8)] {
            let row = SurfaceRow::new(7, &part, &plane, &face, &site(&terrain, units));
            assert_eq!(row.values.len(), SURFACE_COLUMNS.len());
            assert!(SURFACE_COLUMNS.iter().zip(&row.values).all(|(column, value)| column.holds(value)));
            assert_eq!(row.values[..3], [Value::Count(7), Value::Count(5_000), Value::Count(4_900)]);
            let found: Vec<f64> = as_decimals(&row.values[3..]).into_iter().map(Option::unwrap).collect();
            assert!((found[0] - 2.0).abs() < 0.12, "{found:?}");
            let expected = [0.0, 1.0, 0.0, 3.048, 4e-6, 0.002, 0.99 / unit_m, 3.048 / unit_m, 0.49 / unit_m];
            assert!(found[1..].iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
            assert!(row.outline.len() >= 4);
            let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
            for place in &row.outline {
                for axis in 0..3 {
                    low[axis] = low[axis].min(place[axis] * unit_m);
                    high[axis] = high[axis].max(place[axis] * unit_m);
                }
            }
            let near = |a: [f64; 3], b: [f64; 3]| (0..3).all(|axis| (a[axis] - b[axis]).abs() < 0.06);
            assert!(near(low, [0.0, 3.048, 0.0]) && near(high, [1.98, 3.048, 0.98]), "{low:?} {high:?}");
        }
    }

    #[test]
    fn the_plane_as_it_is_written_goes_through_its_centre() {
        let centre = [651_234_567, 5_432_109_876, 481_234];
        // Multiples of the root of 14, whose digits do not end.
        let normal = [2.0, 3.0, 1.0].map(|part: f64| part / 14_f64.sqrt());
        let plane = Plane { centre, normal, flatness_units2: 4.0, points: 400 };
        let points: Vec<[i64; 3]> =
            (0..20).flat_map(|u| (0..20).map(move |v| plane_point(&plane, [u * 20, v * 20]))).collect();
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, &points);
        let objects = vec![1; points.len()];
        let part = ObjectPart::collect(&cloud, &objects, 1, |_| true, |_| FileId::new(0)).remove(0);
        let face = Face::collect(&cloud, &objects, |_| true, |_| Some((&part, &plane))).remove(0).1;
        let terrain = terrain_at(&[]);
        let row = SurfaceRow::new(1, &part, &plane, &face, &site(&terrain, METRES));
        let written = |name: &str| {
            let at = SURFACE_COLUMNS.iter().position(|column| column.name == name).unwrap();
            match (SURFACE_COLUMNS[at].column_type, &row.values[at]) {
                (ColumnType::Decimal { places }, Value::Decimal(value)) => rounded(*value, places).unwrap(),
                other => panic!("{name}: {other:?}"),
            }
        };
        let product: f64 = ["x", "y", "z"]
            .map(|k| written(&format!("normal_{k}")) * written(&format!("centre_{k}")))
            .iter()
            .sum();
        let away = (product - written("plane_offset_m")).abs();
        assert!(away < 0.000_51, "the plane is {away} m away from its centre");
    }

    fn plane_point(plane: &Plane, place: [i64; 2]) -> [i64; 3] {
        #[expect(clippy::cast_possible_truncation, reason = "coordinates of a test")]
        plane.lattice_point(place).map(|value| value.round() as i64)
    }
}

//! Attribute `extent`: the box along the axes of the coordinate system.

use crate::inventory::attributes::attribute::Attribute;
use crate::inventory::object::Object;
use crate::model::{Column, ColumnType, ColumnUnit, Value};

/// The attribute.
#[derive(Debug)]
pub(crate) struct Extent;

const fn coordinate(name: &'static str, definition: &'static str) -> Column {
    let column_type = ColumnType::Decimal { places: 3 };
    Column { name, column_type, unit: ColumnUnit::Input, definition }
}

impl Attribute for Extent {
    fn columns(&self) -> &'static [Column] {
        const {
            &[
                coordinate("min_x", "smallest x of a point"),
                coordinate("min_y", "smallest y of a point"),
                coordinate(
                    "min_z",
                    "smallest z of a point; a few points below a gap do not count, unless a tree or pole can \
                     have them as its stem, nor do points more than 1 m below the ground",
                ),
                coordinate("max_x", "largest x of a point"),
                coordinate("max_y", "largest y of a point"),
                coordinate("max_z", "largest z of a point"),
            ]
        }
    }

    fn finish<'a>(&self, object: &Object<'a>, values: &mut Vec<Value<'a>>) {
        for corner in object.corners() {
            values.extend(object.site.input_point(corner).map(Value::Decimal));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inventory::object::tests::{FEET, METRES, NO_KIND, as_decimals, decimals, near, values_of};
    use crate::model::Kind;

    #[test]
    fn reflections_far_below_the_ground_are_not_in_the_box() {
        let wall = (0..3_000_i64).map(|n| [n % 100 * 100 + 50, 550, n / 100 * 100]);
        let reflections = (0..60).map(|n| [4_050 + n % 3 * 100, 550, -n * 90]);
        let points: Vec<[i64; 3]> = wall.chain(reflections).collect();
        let ground: Vec<([i32; 2], i64)> = (0..10).map(|i| ([i, 0], 0)).collect();
        let found = as_decimals(&values_of(&Extent, &points, NO_KIND, &ground, METRES));
        assert!((-1.0..=0.0).contains(&found[2].unwrap()), "{found:?}");
    }

    #[test]
    fn ground_that_is_a_reflection_does_not_lower_the_box_of_a_building() {
        // The axis is y = 5 m, and the wall at y = 12 m. Behind the panes, reflections far below the street
        // were classified as ground and as parts of the building.
        let wall = (0..6_000_i64).map(|n| [n % 200 * 100 + 50, 12_050, n / 200 * 200]);
        let reflections = (0..300).map(|n| [n % 60 * 100 + 6_050, 14_050 + n % 9 * 200, -1_500 - n * 20]);
        let points: Vec<[i64; 3]> = wall.chain(reflections).collect();
        let street = (0..20).flat_map(|i| (6..12).map(move |j| ([i, j], 0)));
        let inside = (0..20).flat_map(|i| (12..17).map(move |j| ([i, j], -6_500)));
        let ground: Vec<_> = street.chain(inside).collect();
        let found = as_decimals(&values_of(&Extent, &points, Kind::new(5, 255), &ground, METRES));
        assert_eq!(found[2], Some(0.0));
    }

    #[test]
    fn corners_are_in_the_units_of_the_input() {
        assert!(near(&decimals(&Extent, &[], METRES), &[0.0, 0.0, 1.0, 3.048, 6.096, 4.048]));
        assert!(near(&decimals(&Extent, &[], FEET), &[0.0, 0.0, 1.0 / 0.304_8, 10.0, 20.0, 4.048 / 0.304_8]));
        // Heights in metres over coordinates in feet.
        let mixed = [FEET[0], FEET[1], 1.0];
        assert!(near(&decimals(&Extent, &[], mixed), &[0.0, 0.0, 1.0, 10.0, 20.0, 4.048]));
    }
}

//! Attribute `base`: where the object stands.

use crate::inventory::attribute::Attribute;
use crate::inventory::object::Object;
use crate::model::{Column, ColumnType, ColumnUnit, Value};

/// The attribute.
#[derive(Debug)]
pub(super) struct Base;

const fn coordinate(name: &'static str, definition: &'static str) -> Column {
    let column_type = ColumnType::Decimal { places: 3 };
    Column { name, column_type, unit: ColumnUnit::Input, definition }
}

impl Attribute for Base {
    fn columns(&self) -> &'static [Column] {
        const {
            &[
                coordinate(
                    "base_x",
                    "x of the place where it stands: the axis of a tree or pole at the ground, the middle of a tree that is lower than \
                     0.75 of its width, else the middle of the lowest 0.3 m",
                ),
                coordinate("base_y", "y of that place"),
                coordinate(
                    "base_z",
                    "z of the ground at that place, not above the lowest point of the object there; of its lowest point where no ground is \
                     within 10 m",
                ),
            ]
        }
    }

    fn finish<'a>(&self, object: &Object<'a>, values: &mut Vec<Value<'a>>) {
        values.extend(object.base().map(Value::Decimal));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inventory::object::tests::{FEET, METRES, NO_KIND, as_decimals, decimals, near, values_of};
    use crate::model::Kind;

    #[test]
    fn without_a_stem_it_is_the_middle_of_the_lowest_part() {
        // Only the two low corners are in the lowest part. Cells are 0.1 m wide.
        assert!(near(&decimals(&Base, &[([1, 3], 250)], METRES), &[1.55, 3.05, 0.25]));
        assert!(near(&decimals(&Base, &[], FEET), &[1.55 / 0.304_8, 3.05 / 0.304_8, 1.0 / 0.304_8]));
        // On a step, both corners are as high above the ground as each other.
        let step = [([0, 0], 0), ([3, 0], 0), ([3, 6], 3_000)];
        let high = [[50, 50, 200], [3_050, 50, 200], [3_050, 6_050, 3_100]];
        let found = as_decimals(&values_of(&Base, &high, NO_KIND, &step, METRES));
        assert!(near(&found[..2], &[2.05, 2.05]), "{found:?}");
    }

    #[test]
    fn a_plant_with_leaves_down_to_the_ground_stands_in_their_middle() {
        // Leaves that arch to the ground 1.5 m away, and are dense at the side that is seen.
        let mut leaves = Vec::new();
        for step in 0..600_i64 {
            let (angle, along) = ((step % 40) as f64 * 0.157, step / 40);
            let reach = 100 + 100 * along;
            let side = |value: f64| (value * reach as f64).round();
            #[expect(clippy::cast_possible_truncation, reason = "millimetres of a plant")]
            let [x, y] = [side(angle.cos()) as i64, side(angle.sin()) as i64];
            leaves.push([5_000 + x, 3_000 + y, 1_100 - along * along * 5]);
        }
        leaves.extend((0..90).map(|z| [6_500 + z % 3 * 10, 3_000 + z % 5 * 10, z * 10]));
        let base = |height: i64| {
            let points: Vec<[i64; 3]> = leaves.iter().map(|[x, y, z]| [*x, *y, z * height]).collect();
            let kind = Kind { class: 2, confidence: 255 };
            let found = as_decimals(&values_of(&Base, &points, kind, &[([5, 3], 0)], METRES));
            (found[0].unwrap() - 5.0).hypot(found[1].unwrap() - 3.0)
        };
        assert!(base(1) < 0.02, "{}", base(1));
        // Three times as high, a column that stands by itself is a stem.
        assert!(base(3) > 1.4, "{}", base(3));
    }

    #[test]
    fn the_base_of_a_pole_is_its_axis_at_the_ground() {
        // Leaning by 0.1 m per metre towards the east; the ground is at 0.2 m.
        let pole: Vec<[i64; 3]> =
            (30..630).map(|k| [5_000 + k + (k % 7) * 4 - 12, 700 + (k % 5) * 4 - 8, k * 10]).collect();
        let kind = Kind { class: 3, confidence: 255 };
        let found = as_decimals(&values_of(&Base, &pole, kind, &[([5, 0], 200)], METRES));
        let away = [(0, 5.02), (1, 0.7), (2, 0.2)].map(|(k, expected)| (found[k].unwrap() - expected).abs());
        assert!(away[0] < 0.01 && away[1] < 0.01 && away[2] < 1e-9, "{found:?}");
    }
}

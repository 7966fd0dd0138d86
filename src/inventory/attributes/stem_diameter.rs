//! Attribute `stem diameter`: the diameter of the stem of a tree at breast height.

use crate::inventory::attributes::attribute::Attribute;
use crate::inventory::measures::{Circle, TREE};
use crate::inventory::object::Object;
use crate::model::{Column, ColumnType, ColumnUnit, Value};

/// Breast height in metres over the ground: 1.3 m in forestry (IUFRO) and in the guidelines for street trees.
const BREAST_HEIGHT_M: f64 = 1.3;

/// The attribute.
#[derive(Debug)]
pub(crate) struct StemDiameter;

impl Attribute for StemDiameter {
    fn columns(&self) -> &'static [Column] {
        &[
            Column {
                name: "dbh_m",
                column_type: ColumnType::Decimal { places: 3 },
                unit: ColumnUnit::Metre,
                definition: "diameter of the stem 1.3 m above the ground, from a circle fit that is robust \
                             against twigs; trees only; empty if less than 60 degrees of the stem were \
                             seen",
            },
            Column {
                name: "dbh_error_m",
                column_type: ColumnType::Decimal { places: 3 },
                unit: ColumnUnit::Metre,
                definition: "standard error of `dbh_m`, from the residuals of the fit; empty if `dbh_m` is \
                             empty",
            },
        ]
    }

    fn finish<'a>(&self, object: &Object<'a>, values: &mut Vec<Value<'a>>) {
        let circle = if object.kind.class == TREE { circle(object) } else { None };
        values.push(circle.map(|circle| 2.0 * circle.radius).into());
        values.push(circle.map(|circle| 2.0 * circle.radius_error).into());
    }
}

/// The section of the stem at breast height.
fn circle(object: &Object<'_>) -> Option<Circle> {
    let (stem, axis) = object.foot.stem.as_ref()?;
    let corner_m = object.site.lattice.metres(object.frames.stem.corner[2]);
    stem.section(axis, object.foot.ground_m? + BREAST_HEIGHT_M - corner_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inventory::object::tests::{FEET, METRES, NO_KIND, as_decimals, values_of};
    use crate::model::Kind;

    /// A stem of 0.36 m at the ground that is 0.02 m thinner per metre; `seen` degrees of it.
    #[expect(clippy::cast_possible_truncation, reason = "a stem is a few metres high")]
    fn stem(seen: i64) -> Vec<[i64; 3]> {
        let mut points = Vec::new();
        for k in 0..300_i64 {
            for degree in (0..seen).step_by(4) {
                let (sin, cos) = (degree as f64).to_radians().sin_cos();
                let radius = 180.0 - 0.1 * k as f64;
                points.push([
                    5_000 + (radius * cos).round() as i64,
                    5_000 + (radius * sin).round() as i64,
                    k * 10,
                ]);
            }
        }
        points
    }

    #[test]
    fn diameters_are_metres_and_only_of_trees_of_which_enough_was_seen() {
        let kind = Kind::new(2, 255);
        let ground = [([5, 5], -200)];
        for units_m in [METRES, FEET] {
            let found = as_decimals(&values_of(&StemDiameter, &stem(200), kind, &ground, units_m));
            // 1.3 m over the ground is 1.1 m over the lowest point.
            assert!((found[0].unwrap() - 0.338).abs() < 0.003, "{found:?}");
            assert!((0.0..0.005).contains(&found[1].unwrap()), "{found:?}");
        }
        assert_eq!(as_decimals(&values_of(&StemDiameter, &stem(40), kind, &ground, METRES)), [None; 2]);
        assert_eq!(as_decimals(&values_of(&StemDiameter, &stem(200), NO_KIND, &ground, METRES)), [None; 2]);
        assert_eq!(
            as_decimals(&values_of(&StemDiameter, &stem(200), kind, &[], METRES)),
            [None; 2],
            "no ground"
        );
    }
}

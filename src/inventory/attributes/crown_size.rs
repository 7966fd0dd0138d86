//! Attribute `crown size`: extent, area and lower end of the crown of a tree.

use crate::inventory::attributes::attribute::Attribute;
use crate::inventory::measures::{TREE, crown};
use crate::inventory::object::Object;
use crate::model::{Column, ColumnType, ColumnUnit, Value};

/// The attribute.
#[derive(Debug)]
pub(crate) struct CrownSize;

impl Attribute for CrownSize {
    fn columns(&self) -> &'static [Column] {
        &[
            Column {
                name: "crown_diameter_m",
                column_type: ColumnType::Decimal { places: 2 },
                unit: ColumnUnit::Metre,
                definition: "mean of the longest extent of the crown in the plane and its extent across \
                             that; trees only (class 2)",
            },
            Column {
                name: "crown_area_m2",
                column_type: ColumnType::Decimal { places: 2 },
                unit: ColumnUnit::SquareMetre,
                definition: "area of the concave outline of the crown; gaps, holes and separate parts are as \
                             in `area_m2`; trees only",
            },
            Column {
                name: "crown_base_m",
                column_type: ColumnType::Decimal { places: 2 },
                unit: ColumnUnit::Metre,
                definition: "height above the ground where the crown begins: from there up, every layer of \
                             0.2 m has at least 15 % of the area of the largest layer, over 0.6 m; at \
                             least 0; trees only",
            },
        ]
    }

    fn finish<'a>(&self, object: &Object<'a>, values: &mut Vec<Value<'a>>) {
        let lattice = object.site.lattice;
        let found = (object.kind.class == TREE)
            .then(|| crown(object.measures, &object.frames, lattice, object.place_units()))
            .flatten();
        values.push(found.map(|crown| crown.diameter_m).into());
        values.push(found.map(|crown| crown.area_m2).into());
        // On a slope, leaves may hang lower than the ground at the stem.
        let above_m = |crown_m: f64, ground_m: f64| (crown_m - ground_m).max(0.0);
        let base_m = found.zip(object.foot.ground_m).map(|(crown, ground_m)| above_m(crown.base_m, ground_m));
        values.push(base_m.into());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inventory::object::tests::{FEET, METRES, NO_KIND, as_decimals, values_of};
    use crate::model::Kind;

    /// A stem of 2 m, and a block of leaves of 4 m by 2 m by 3 m above it.
    fn tree() -> Vec<[i64; 3]> {
        let stem = (0..400).map(|k| [2_000 + (k % 5) * 40 - 80, 1_000 + (k % 3) * 40 - 40, k * 5]);
        let leaves =
            (0..24_000).map(|k| [k % 40 * 100 + 50, k / 40 % 20 * 100 + 50, 2_000 + k / 800 * 100 + 50]);
        stem.chain(leaves).collect()
    }

    #[test]
    fn crowns_are_metres_and_only_of_trees() {
        let ground = [([2, 1], 100)];
        for units_m in [METRES, FEET] {
            let kind = Kind::new(2, 255);
            let found = as_decimals(&values_of(&CrownSize, &tree(), kind, &ground, units_m));
            // The middles of the outer cells are 3.9 m and 1.9 m apart: the diagonal, and twice the height
            // over it.
            let diagonal = 3.9_f64.hypot(1.9);
            let diameter = f64::midpoint(diagonal, 2.0 * 3.9 * 1.9 / diagonal);
            assert!((found[0].unwrap() - diameter).abs() < 0.01, "{found:?}, expected {diameter}");
            assert!(
                (found[1].unwrap() - 8.0).abs() < 0.1 && (found[2].unwrap() - 1.9).abs() < 0.11,
                "{found:?}"
            );
        }
        assert_eq!(as_decimals(&values_of(&CrownSize, &tree(), NO_KIND, &ground, METRES)), [None; 3]);
        let pole = Kind::new(3, 255);
        assert_eq!(as_decimals(&values_of(&CrownSize, &tree(), pole, &ground, METRES)), [None; 3]);
    }
}

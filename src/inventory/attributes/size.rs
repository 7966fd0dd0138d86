//! Attribute `size`: the box of least area in the plane.

use crate::inventory::attributes::attribute::Attribute;
use crate::inventory::attributes::direction::within_turn;
use crate::inventory::measures::{Rectangle, box_of_body};
use crate::inventory::object::Object;
use crate::model::{Column, ColumnType, ColumnUnit, Value};

/// Decimal places of the direction.
const AZIMUTH_PLACES: u8 = 2;

/// The attribute.
#[derive(Debug)]
pub(crate) struct Size;

impl Attribute for Size {
    fn columns(&self) -> &'static [Column] {
        &[
            Column {
                name: "length_m",
                column_type: ColumnType::Decimal { places: 3 },
                unit: ColumnUnit::Metre,
                definition: "longer side of the box of least area around the object in the plane; of a vehicle, without \
                             single points beside it",
            },
            Column {
                name: "width_m",
                column_type: ColumnType::Decimal { places: 3 },
                unit: ColumnUnit::Metre,
                definition: "shorter side of that box",
            },
            Column {
                name: "azimuth_deg",
                column_type: ColumnType::Decimal { places: AZIMUTH_PLACES },
                unit: ColumnUnit::Degree,
                definition: "direction of the longer side, clockwise from north (the y axis), 0 to 180; \
                             empty if all points have the same x and y",
            },
        ]
    }

    fn finish<'a>(&self, object: &Object<'a>, values: &mut Vec<Value<'a>>) {
        let Object { part, kind, measures, frames, .. } = object;
        let lattice = object.site.lattice;
        let Rectangle { length, width, azimuth_deg, .. } =
            box_of_body(part, *kind, measures, frames, lattice);
        values.extend([length, width].map(|side| Value::Decimal(side * lattice.step_m())));
        values.push(azimuth_deg.map(|degrees| within_turn(degrees, 180.0, AZIMUTH_PLACES)).into());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inventory::object::tests::{FEET, METRES, NO_KIND, as_decimals, decimals, near, values_of};

    #[test]
    fn sides_are_metres_whatever_the_units_of_the_input() {
        for units_m in [METRES, FEET] {
            assert!(near(&decimals(&Size, &[], units_m), &[6.096, 3.048, 0.0]));
        }
        // 20 m to the north, and 1 mm to the west: 179.997 degrees.
        let north = values_of(&Size, &[[1, 0, 0], [0, 20_000, 0]], NO_KIND, &[], METRES);
        assert_eq!(as_decimals(&north)[2], Some(0.0));
        let one = values_of(&Size, &[[5, 5, 5]], NO_KIND, &[], METRES);
        assert_eq!(as_decimals(&one), [Some(0.0), Some(0.0), None]);
    }
}

//! Attribute `inclination`: how far a pole or the stem of a tree leans, and in which direction.

use crate::inventory::attributes::attribute::Attribute;
use crate::inventory::attributes::direction::within_turn;
use crate::inventory::object::Object;
use crate::model::{Column, ColumnType, ColumnUnit, Value};

/// Decimal places of the direction.
const AZIMUTH_PLACES: u8 = 1;

/// The attribute.
#[derive(Debug)]
pub(crate) struct Inclination;

impl Attribute for Inclination {
    fn columns(&self) -> &'static [Column] {
        &[
            Column {
                name: "inclination_deg",
                column_type: ColumnType::Decimal { places: 2 },
                unit: ColumnUnit::Degree,
                definition: "angle between the vertical and the axis of a pole, or of the lowest 4 m of \
                             the stem of a tree; classes 2 and 3 only; empty if less than 1 m of it, or \
                             too little of a stem, was seen",
            },
            Column {
                name: "inclination_azimuth_deg",
                column_type: ColumnType::Decimal { places: AZIMUTH_PLACES },
                unit: ColumnUnit::Degree,
                definition: "direction in which the pole or stem leans, clockwise from north (the y axis), \
                             0 to 360",
            },
        ]
    }

    fn finish<'a>(&self, object: &Object<'a>, values: &mut Vec<Value<'a>>) {
        // Only trees and poles have a stem.
        let axis = object.foot.stem.as_ref().map(|(_, axis)| axis).filter(|axis| axis.has_direction);
        values.push(axis.map(|axis| axis.inclination_deg()).into());
        values.push(axis.map(|axis| within_turn(axis.azimuth_deg(), 360.0, AZIMUTH_PLACES)).into());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inventory::object::tests::{METRES, NO_KIND, as_decimals, values_of};
    use crate::model::Kind;

    #[test]
    fn poles_lean_and_boxes_do_not() {
        // 5 m high, 0.2 m to the south at the top.
        let pole: Vec<[i64; 3]> =
            (0..500).map(|k| [900 + k % 7 * 10, 900 - k * 2 / 5 + k % 5 * 10, k * 10]).collect();
        let found =
            |kind, points: &[[i64; 3]]| as_decimals(&values_of(&Inclination, points, kind, &[], METRES));
        let kind = Kind::new(3, 255);
        let leans = found(kind, &pole);
        assert!((leans[0].unwrap() - 0.04_f64.atan().to_degrees()).abs() < 0.1, "{leans:?}");
        assert!((leans[1].unwrap() - 180.0).abs() < 3.0, "{leans:?}");
        assert_eq!(found(NO_KIND, &pole), [None; 2]);
        assert_eq!(found(kind, &pole[..60]), [None; 2], "0.6 m have no direction");
    }
}

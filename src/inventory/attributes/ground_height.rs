//! Attribute `ground height`: the height of the ground that the object stands on.

use crate::inventory::attributes::attribute::Attribute;
use crate::inventory::object::Object;
use crate::model::{Column, ColumnType, ColumnUnit, Value};

/// The attribute.
#[derive(Debug)]
pub(crate) struct GroundHeight;

impl Attribute for GroundHeight {
    fn columns(&self) -> &'static [Column] {
        &[Column {
            name: "ground_z",
            column_type: ColumnType::Decimal { places: 3 },
            unit: ColumnUnit::Input,
            definition: "mean z of the ground in the cell nearest to the centroid; cells that are raised \
                         above those around them do not count; empty if none is within 10 m",
        }]
    }

    fn finish<'a>(&self, object: &Object<'a>, values: &mut Vec<Value<'a>>) {
        values.push(object.ground_m.map(|ground_m| ground_m / object.site.units_m[2]).into());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inventory::object::tests::{FEET, METRES, decimals, near};

    #[test]
    fn the_ground_is_in_the_units_of_the_input() {
        let ground = [([1, 3], 3_048)];
        assert!(near(&decimals(&GroundHeight, &ground, METRES), &[3.048]));
        assert!(near(&decimals(&GroundHeight, &ground, FEET), &[10.0]));
        assert!(near(&decimals(&GroundHeight, &ground, [FEET[0], FEET[1], 1.0]), &[3.048]));
    }

    #[test]
    fn without_ground_nearby_the_value_is_missing() {
        assert_eq!(decimals(&GroundHeight, &[], METRES), [None]);
        assert_eq!(decimals(&GroundHeight, &[([1, 20], 0)], METRES), [None]);
    }
}

//! Attribute `station`: where the centroid of the object is along the axis of the drive.

use crate::inventory::attribute::Attribute;
use crate::inventory::object::{Object, Station};
use crate::model::{Column, ColumnType, ColumnUnit, Value};

/// The attribute.
#[derive(Debug)]
pub(super) struct StationOnAxis;

impl Attribute for StationOnAxis {
    fn columns(&self) -> &'static [Column] {
        &[
            Column {
                name: "chainage_m",
                column_type: ColumnType::Decimal { places: 3 },
                unit: ColumnUnit::Metre,
                definition: "distance of the centroid along the axis of the drive",
            },
            Column {
                name: "offset_m",
                column_type: ColumnType::Decimal { places: 3 },
                unit: ColumnUnit::Metre,
                definition: "distance of the centroid from the axis, positive to its left",
            },
        ]
    }

    fn finish<'a>(&self, object: &Object<'a>, values: &mut Vec<Value<'a>>) {
        let place = [object.centre[0], object.centre[1]].map(|value| object.site.lattice.metres(value));
        let Station { chainage_m, offset_m } = (object.site.locate)(place);
        values.extend([chainage_m, offset_m].map(Value::Decimal));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inventory::object::tests::{FEET, METRES, decimals, near};

    #[test]
    fn the_axis_is_asked_for_the_centroid_in_metres() {
        for units_m in [METRES, FEET] {
            assert!(near(&decimals(&StationOnAxis, &[], units_m), &[1.524, -1.952]));
        }
    }
}

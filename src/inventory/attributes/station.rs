//! Attribute `station`: where the base of the object is along the axis of the drive.

use crate::inventory::attributes::attribute::Attribute;
use crate::inventory::object::Object;
use crate::inventory::site::Station;
use crate::model::{Column, ColumnType, ColumnUnit, Value};

/// The attribute.
#[derive(Debug)]
pub(crate) struct StationOnAxis;

impl Attribute for StationOnAxis {
    fn columns(&self) -> &'static [Column] {
        &[
            Column {
                name: "chainage_m",
                column_type: ColumnType::Decimal { places: 3 },
                unit: ColumnUnit::Metre,
                definition: "distance of the base along the axis of the drive; negative before its beginning; \
                             a gap in the recording counts as the straight line over it",
            },
            Column {
                name: "offset_m",
                column_type: ColumnType::Decimal { places: 3 },
                unit: ColumnUnit::Metre,
                definition: "distance of the base from the axis; positive to the left of the axis, which \
                             continues straight beyond its ends, and on either side into a gap in the \
                             recording up to half of it",
            },
        ]
    }

    fn finish<'a>(&self, object: &Object<'a>, values: &mut Vec<Value<'a>>) {
        let Station { chainage_m, offset_m } = (object.site.locate)(object.foot.place);
        values.extend([chainage_m, offset_m].map(Value::Decimal));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inventory::object::tests::{FEET, METRES, decimals, near};

    #[test]
    fn the_axis_is_asked_for_the_base_in_metres() {
        // The middle of the cells of the two low corners, (0, 0) and (3.048, 6.096).
        for units_m in [METRES, FEET] {
            assert!(near(&decimals(&StationOnAxis, &[], units_m), &[1.55, -1.95]));
        }
    }
}

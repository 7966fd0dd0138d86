//! Attribute `centroid`: the mean of the points.

use crate::inventory::attributes::attribute::Attribute;
use crate::inventory::object::Object;
use crate::model::{Column, ColumnType, ColumnUnit, Value};

/// The attribute.
#[derive(Debug)]
pub(crate) struct Centroid;

const fn coordinate(name: &'static str, definition: &'static str) -> Column {
    let column_type = ColumnType::Decimal { places: 3 };
    Column { name, column_type, unit: ColumnUnit::Input, definition }
}

impl Attribute for Centroid {
    fn columns(&self) -> &'static [Column] {
        const {
            &[
                coordinate("centroid_x", "mean x of the points"),
                coordinate("centroid_y", "mean y of the points"),
                coordinate("centroid_z", "mean z of the points"),
            ]
        }
    }

    fn finish<'a>(&self, object: &Object<'a>, values: &mut Vec<Value<'a>>) {
        values.extend(object.site.input_point(object.centre).map(Value::Decimal));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inventory::object::tests::{FEET, METRES, decimals, near};

    #[test]
    fn the_mean_is_in_the_units_of_the_input() {
        assert!(near(&decimals(&Centroid, &[], METRES), &[1.524, 3.048, 2.524]));
        assert!(near(&decimals(&Centroid, &[], FEET), &[5.0, 10.0, 2.524 / 0.304_8]));
    }
}

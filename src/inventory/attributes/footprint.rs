//! Attribute `footprint`: the area of the outline in the plane.

use crate::inventory::attributes::attribute::Attribute;
use crate::inventory::measures::Polygon;
use crate::inventory::object::Object;
use crate::model::{Column, ColumnType, ColumnUnit, Value};

/// The attribute.
#[derive(Debug)]
pub(crate) struct Footprint;

impl Attribute for Footprint {
    fn columns(&self) -> &'static [Column] {
        &[Column {
            name: "area_m2",
            column_type: ColumnType::Decimal { places: 3 },
            unit: ColumnUnit::SquareMetre,
            definition: "area of the concave outline in the plane, which is the geometry in GeoJSON and \
                         GeoPackage; every point is within 0.1 m of the outline; gaps below 0.4 m are closed, \
                         holes are filled, and separate parts are joined by bridges, so the area is that of one \
                         polygon without holes",
        }]
    }

    fn finish<'a>(&self, object: &Object<'a>, values: &mut Vec<Value<'a>>) {
        let area = object.outline.as_ref().map_or(0.0, Polygon::area_units2);
        values.push(Value::Decimal(area * object.site.lattice.step_m().powi(2)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inventory::object::tests::{FEET, METRES, NO_KIND, as_decimals, near, values_of};

    #[test]
    fn areas_are_square_metres_whatever_the_units_of_the_input() {
        // 2 m by 1 m, a point in the middle of every cell of 0.1 m. Half a cell is cut off at each corner.
        let points: Vec<[i64; 3]> = (0..200).map(|k| [50 + k % 20 * 100, 50 + k / 20 * 100, 0]).collect();
        for units_m in [METRES, FEET] {
            let values = values_of(&Footprint, &points, NO_KIND, &[], units_m);
            assert!(near(&as_decimals(&values), &[2.0 - 4.0 * 0.05 * 0.05 / 2.0]), "{values:?}");
        }
    }
}

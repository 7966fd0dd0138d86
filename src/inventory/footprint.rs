//! Attribute `footprint`: the area of the convex hull in the plane, and the hull as the outline of the object.

use crate::inventory::attribute::Attribute;
use crate::inventory::object::Object;
use crate::model::{Column, ColumnType, ColumnUnit, Value};

/// The attribute.
#[derive(Debug)]
pub(super) struct Footprint;

impl Attribute for Footprint {
    fn columns(&self) -> &'static [Column] {
        &[Column {
            name: "area_m2",
            column_type: ColumnType::Decimal { places: 3 },
            unit: ColumnUnit::SquareMetre,
            definition: "area of the convex hull in the plane, which is the geometry in GeoJSON",
        }]
    }

    fn finish<'a>(&self, object: &Object<'a>, values: &mut Vec<Value<'a>>) {
        values.push(Value::Decimal(object.part.hull_area_units2() * object.site.lattice.step_m().powi(2)));
    }
}

/// The outline of an object, the geometry of its row: vertices of its convex hull in the units of the input,
/// counter-clockwise and not closed; one or two where it has no area.
#[must_use]
pub fn outline(object: &Object<'_>) -> Vec<[f64; 2]> {
    let vertex = |place: &[i64; 2]| [0, 1].map(|axis| object.site.input_units(axis, place[axis]));
    object.part.hull.iter().map(vertex).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inventory::object::tests::{FEET, METRES, box_part, decimals, near, site, terrain_at};

    #[test]
    fn areas_are_square_metres_whatever_the_units_of_the_input() {
        for units_m in [METRES, FEET] {
            assert!(near(&decimals(&Footprint, &[], units_m), &[3.048 * 6.096]));
        }
    }

    #[test]
    fn outlines_are_in_the_units_of_the_input() {
        let (terrain, part) = (terrain_at(&[]), box_part());
        let found = outline(&Object::new(1, &part, &site(&terrain, FEET)));
        let expected = [[0.0, 0.0], [10.0, 0.0], [10.0, 20.0], [0.0, 20.0]];
        assert!(near(&found.concat().into_iter().map(Some).collect::<Vec<_>>(), &expected.concat()));
    }
}

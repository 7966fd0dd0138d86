//! Attribute `points`: how many points the object has.

use crate::inventory::attributes::attribute::Attribute;
use crate::inventory::object::Object;
use crate::model::{Column, ColumnType, ColumnUnit, Value};

/// The attribute.
#[derive(Debug)]
pub(crate) struct Points;

impl Attribute for Points {
    fn columns(&self) -> &'static [Column] {
        &[Column {
            name: "points",
            column_type: ColumnType::Count,
            unit: ColumnUnit::None,
            definition: "number of points",
        }]
    }

    fn finish<'a>(&self, object: &Object<'a>, values: &mut Vec<Value<'a>>) {
        values.push(Value::Count(object.part.points));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inventory::object::tests::{BOX, METRES, NO_KIND, values_of};

    #[test]
    fn points_are_those_of_all_parts() {
        let twice = [BOX, BOX].concat();
        assert_eq!(values_of(&Points, &twice, NO_KIND, &[], METRES), [Value::Count(8)]);
    }
}

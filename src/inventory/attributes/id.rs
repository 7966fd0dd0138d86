//! Attribute `id`: the number of the object, as in the labelled copies.

use crate::inventory::attributes::attribute::Attribute;
use crate::inventory::object::Object;
use crate::model::{Column, ColumnType, ColumnUnit, Value};

/// The attribute.
#[derive(Debug)]
pub(crate) struct Id;

impl Attribute for Id {
    fn columns(&self) -> &'static [Column] {
        &[Column {
            name: "id",
            column_type: ColumnType::Count,
            unit: ColumnUnit::None,
            definition: "object id, from 1, as `cluster_id` or `surface_id` of the points",
        }]
    }

    fn finish<'a>(&self, object: &Object<'a>, values: &mut Vec<Value<'a>>) {
        values.push(Value::Count(object.id.into()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inventory::object::tests::{BOX, METRES, NO_KIND, values_of};

    #[test]
    fn the_id_is_the_one_given() {
        assert_eq!(values_of(&Id, &BOX, NO_KIND, &[], METRES), [Value::Count(7)]);
    }
}

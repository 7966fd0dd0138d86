//! Attribute `touches`: the objects that the object touches.

use crate::inventory::among::Among;
use crate::inventory::attributes::attribute::Attribute;
use crate::inventory::object::Object;
use crate::model::{Column, ColumnType, ColumnUnit, Value};

/// The attribute.
#[derive(Debug)]
pub(crate) struct Touches;

impl Attribute for Touches {
    fn columns(&self) -> &'static [Column] {
        &[Column {
            name: "touches",
            column_type: ColumnType::Counts,
            unit: ColumnUnit::None,
            definition: "ids of the objects with points in the same voxel of 0.1 m or a neighbouring one, \
                         ascending, joined by `;` in CSV",
        }]
    }

    fn finish<'a>(&self, _object: &Object<'a>, values: &mut Vec<Value<'a>>) {
        values.push(Value::Counts(Vec::new()));
    }

    fn complete(&self, id: u32, among: &Among, values: &mut [Value<'_>]) {
        if let [Value::Counts(counts)] = values {
            counts.extend(among.touched(id).map(u64::from));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_others_are_named_once_they_are_known() {
        let among = Among::new(&[], [(4, 7), (2, 4)]);
        let mut values = [Value::Counts(Vec::new())];
        Touches.complete(4, &among, &mut values);
        assert_eq!(values, [Value::Counts(vec![2, 7])]);
    }
}

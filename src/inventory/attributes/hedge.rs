//! Attribute `hedge`: whether an object of class 6 is a hedge or bush.

use crate::inventory::attributes::attribute::Attribute;
use crate::inventory::measures::FENCE;
use crate::inventory::object::Object;
use crate::model::{self, Column, ColumnType, ColumnUnit, Value};

/// The attribute.
#[derive(Debug)]
pub(crate) struct Hedge;

impl Attribute for Hedge {
    fn columns(&self) -> &'static [Column] {
        &[Column {
            name: "hedge",
            column_type: ColumnType::Flag,
            unit: ColumnUnit::None,
            definition: "true: hedge or bush; false: fence, wall or guard rail; class 6 only; true if the \
                         points in cubes of 1.05 m have, on average, a standard deviation of at least \
                         0.045 m in every direction",
        }]
    }

    fn finish<'a>(&self, object: &Object<'a>, values: &mut Vec<Value<'a>>) {
        let is_hedge = (object.kind.class == FENCE).then(|| object.kind.hedge != model::Hedge::No);
        values.push(is_hedge.map_or(Value::Missing, Value::Flag));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inventory::object::tests::{BOX, METRES, values_of};
    use crate::model::Kind;

    #[test]
    fn only_class_6_has_hedges() {
        let values = |kind| values_of(&Hedge, &BOX, kind, &[], METRES);
        assert_eq!(values(Kind::new(2, 255)), [Value::Missing]);
        assert_eq!(values(Kind::new(6, 255)), [Value::Flag(false)]);
        for hedge in [model::Hedge::Low, model::Hedge::Medium] {
            assert_eq!(values(Kind { hedge, ..Kind::new(6, 255) }), [Value::Flag(true)]);
        }
    }
}

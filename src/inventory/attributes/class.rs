//! Attribute `class`: what the object is, and how certain it is.

use crate::inventory::attributes::attribute::Attribute;
use crate::inventory::object::Object;
use crate::model::{Column, ColumnType, ColumnUnit, Value};

/// The attribute.
#[derive(Debug)]
pub(crate) struct Class;

impl Attribute for Class {
    fn columns(&self) -> &'static [Column] {
        &[
            Column {
                name: "class",
                column_type: ColumnType::Count,
                unit: ColumnUnit::None,
                definition: "2 tree, 3 pole, 4 vehicle, 5 building, 6 fence or hedge, 7 person or small furniture, 8 \
                             wire, 9 other; 0 from methods that do not classify",
            },
            Column {
                name: "confidence",
                column_type: ColumnType::Decimal { places: 2 },
                unit: ColumnUnit::None,
                definition: "probability of the class by the model of objects, 0 to 1; low if a rule \
                             decided against the model; the mean over the points if the model has no \
                             probabilities of objects; empty from methods without probabilities",
            },
        ]
    }

    fn finish<'a>(&self, object: &Object<'a>, values: &mut Vec<Value<'a>>) {
        values.push(Value::Count(object.kind.class.into()));
        let confidence = (object.kind.confidence != 0).then(|| f64::from(object.kind.confidence) / 255.0);
        values.push(confidence.into());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_the_table_of_classes() {
        let definition = Class.columns()[0].definition;
        let names =
            include_str!("../../../config/classes.toml").lines().filter_map(|line| line.split_once(" = \""));
        let objects = names.filter(|(code, _)| code.parse::<u8>().is_ok_and(|code| code > 1));
        let listed: Vec<String> =
            objects.map(|(code, name)| format!("{code} {}", name.trim_end_matches('"'))).collect();
        assert_eq!(definition.split_once(';').unwrap().0, listed.join(", "));
    }
    use crate::inventory::object::tests::{BOX, METRES, NO_KIND, values_of};
    use crate::model::Kind;

    #[test]
    fn objects_without_a_probability_have_no_confidence() {
        let values = |kind| values_of(&Class, &BOX, kind, &[], METRES);
        assert_eq!(values(NO_KIND), [Value::Count(0), Value::Missing]);
        assert_eq!(values(Kind::new(2, 0)), [Value::Count(2), Value::Missing]);
        assert_eq!(values(Kind::new(2, 51)), [Value::Count(2), Value::Decimal(0.2)]);
    }
}

//! Attribute `files`: the input files that contain points of the object.

use std::borrow::Cow;

use crate::inventory::attributes::attribute::Attribute;
use crate::inventory::object::Object;
use crate::model::{Column, ColumnType, ColumnUnit, FileId, Value};

/// The attribute.
#[derive(Debug)]
pub(crate) struct Files;

impl Attribute for Files {
    fn columns(&self) -> &'static [Column] {
        &[Column {
            name: "files",
            column_type: ColumnType::Texts,
            unit: ColumnUnit::None,
            definition: "input files that contain points of the object, joined by `;` in CSV and \
                         GeoPackage (`;` in a name is `%3B`, `%` is `%25`)",
        }]
    }

    fn finish<'a>(&self, object: &Object<'a>, values: &mut Vec<Value<'a>>) {
        let name = |file: &FileId| Cow::Borrowed(object.site.file_names[file.index()]);
        values.push(Value::Texts(object.part.files.iter().map(name).collect()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inventory::object::tests::{BOX, METRES, NO_KIND, values_of};

    #[test]
    fn files_are_named_in_the_order_of_the_input() {
        let values = values_of(&Files, &BOX, NO_KIND, &[], METRES);
        assert_eq!(values, [Value::Texts(vec!["a.las".into(), "c.las".into()])]);
    }
}

//! Attribute `files`: the input files that contain points of the object.

use std::borrow::Cow;

use crate::inventory::attribute::Attribute;
use crate::inventory::object::Object;
use crate::model::{Column, ColumnType, ColumnUnit, FileId, Value};

/// The attribute.
#[derive(Debug)]
pub(super) struct Files;

impl Attribute for Files {
    fn columns(&self) -> &'static [Column] {
        &[Column {
            name: "files",
            column_type: ColumnType::Texts,
            unit: ColumnUnit::None,
            definition: "input files that hold points of it, joined by `;` in CSV",
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
    use crate::inventory::object::tests::{METRES, box_part, site, terrain_at};

    #[test]
    fn files_are_named_in_the_order_of_the_input() {
        let terrain = terrain_at(&[]);
        let site = site(&terrain, METRES);
        let part = box_part();
        let mut values = Vec::new();
        Files.finish(&Object::new(1, &part, &site), &mut values);
        assert_eq!(values, [Value::Texts(vec!["a.las".into(), "c.las".into()])]);
    }
}

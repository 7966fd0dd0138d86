//! Attribute `cut`: whether the object reaches the end of the data.

use crate::inventory::attributes::attribute::Attribute;
use crate::inventory::object::Object;
use crate::model::{Column, ColumnType, ColumnUnit, Value};

/// The attribute.
#[derive(Debug)]
pub(crate) struct Cut;

impl Attribute for Cut {
    fn columns(&self) -> &'static [Column] {
        &[Column {
            name: "cut",
            column_type: ColumnType::Flag,
            unit: ColumnUnit::None,
            definition: "whether the object reaches the end of the data, so that a part of it may be \
                         missing: true if one of its points was measured within 0.02 s of the time when \
                         the drive begins, stops or has a gap, and it reaches, along the axis, to within \
                         10 m plus its offset of the place where the vehicle was then; true within 1.5 cells of the raster of the last profiles, where the \
                         drive begins, stops or has a gap, and within one cell of a straight border of the \
                         occupied cells, as in a scene that was cut out; cells with few points or few \
                         neighbours do not count; if the heads end at different places, only the farthest \
                         end counts; in a section (`--from`, `--to`) also true if the object reaches \
                         beyond the distance to which objects are followed",
        }]
    }

    fn finish<'a>(&self, object: &Object<'a>, values: &mut Vec<Value<'a>>) {
        // The point of an object that is nearest to a straight border is a vertex of its hull.
        let reaches_end = || object.part.hull.iter().any(|vertex| (object.site.at_end)(*vertex));
        values.push(Value::Flag((object.site.is_cut)(object.id, &object.part.hull) || reaches_end()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inventory::object::tests::{BOX, METRES, NO_KIND, site, summaries, terrain_at, values_of};

    #[test]
    fn a_vertex_at_the_end_is_enough() {
        // The data of the tests ends at x = 0.
        assert_eq!(values_of(&Cut, &BOX, NO_KIND, &[], METRES), [Value::Flag(true)]);
        let further = BOX.map(|[x, y, z]| [x + 1, y, z]);
        assert_eq!(values_of(&Cut, &further, NO_KIND, &[], METRES), [Value::Flag(false)]);
    }

    #[test]
    fn an_object_that_the_last_profiles_cut_need_not_have_a_vertex_at_the_end() {
        let terrain = terrain_at(&[]);
        let site = site(&terrain, METRES);
        let (part, measures) = summaries(&BOX.map(|[x, y, z]| [x + 1, y, z]), NO_KIND);
        let cut = |id| {
            let mut values = Vec::new();
            Cut.finish(&Object::new(id, &part, &measures, NO_KIND, &site), &mut values);
            values == [Value::Flag(true)]
        };
        // In the tests, that is object 8.
        assert_eq!([7, 8].map(cut), [false, true]);
    }
}

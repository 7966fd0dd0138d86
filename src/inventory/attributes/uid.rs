//! Attribute `uid`: a name that other runs also give to the object.

use std::fmt::Write;

use crate::inventory::among::{Among, Place};
use crate::inventory::attributes::attribute::Attribute;
use crate::inventory::object::Object;
use crate::model::{Column, ColumnType, ColumnUnit, Value};

/// The attribute.
#[derive(Debug)]
pub(crate) struct Uid;

impl Attribute for Uid {
    fn columns(&self) -> &'static [Column] {
        &[Column {
            name: "uid",
            column_type: ColumnType::Text,
            unit: ColumnUnit::None,
            definition: "name of the object: `CLASS-X-Y`, of its class and its base (of a building, its \
                         centroid) in steps of 0.1 m; `-2`, `-3` and so on are added if several objects \
                         share them; the same whole object has the same `uid` in every run, whatever the \
                         tiles, the other files and their order",
        }]
    }

    fn finish<'a>(&self, object: &Object<'a>, values: &mut Vec<Value<'a>>) {
        let Place { class, decimetres: [x, y], .. } = Place::of(object);
        values.push(Value::Text(format!("{class}-{x}-{y}").into()));
    }

    fn complete(&self, id: u32, among: &Among, values: &mut [Value<'_>]) {
        if let ([Value::Text(text)], number @ 2..) = (values, among.number(id)) {
            // Writing to a text does not fail.
            let _ = write!(text.to_mut(), "-{number}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inventory::object::tests::{
        BOX, FEET, METRES, NO_KIND, site, summaries, terrain_at, values_of,
    };
    use crate::inventory::site::{Site, Station};
    use crate::model::Kind;

    #[test]
    fn class_and_place_are_the_name_in_metres_whatever_the_units() {
        for units_m in [METRES, FEET] {
            let found = values_of(&Uid, &BOX, NO_KIND, &[], units_m);
            assert_eq!(found, [Value::Text("0-16-31".into())]);
        }
        let west: Vec<[i64; 3]> = BOX.iter().map(|[x, y, z]| [x - 20_000, *y, *z]).collect();
        let found = values_of(&Uid, &west, Kind::new(6, 9), &[], METRES);
        assert_eq!(found, [Value::Text("6--185-31".into())]);
    }

    #[test]
    fn the_name_of_a_building_does_not_depend_on_the_axis() {
        // A facade of 30 m with a side of 10 m. The axis of another drive was found 0.6 m further along and
        // rotated.
        let front = (0..3_000).map(|n| [n % 300 * 100, 12_000, n / 300 * 500]);
        let side = (0..1_000).map(|n| [0, 12_000 + n % 100 * 100, n / 100 * 500]);
        let facade: Vec<[i64; 3]> = front.chain(side).collect();
        let ground: Vec<([i32; 2], i64)> = (0..300).map(|k| ([k % 30, k / 30 + 5], 0)).collect();
        let terrain = terrain_at(&ground);
        let kind = Kind::new(5, 255);
        let (part, measures) = summaries(&facade, kind);
        let name = |along: f64, turned: f64| {
            let locate = |[x, y]: [f64; 2]| Station {
                chainage_m: x + along - turned * y,
                offset_m: y - 5.0 + turned * x,
            };
            let site = Site { locate: &locate, ..site(&terrain, METRES) };
            let object = Object::new(1, &part, &measures, kind, &site);
            let mut values = Vec::new();
            Uid.finish(&object, &mut values);
            (object.base(), format!("{:?}", values[0]))
        };
        let (one, other) = (name(0.0, 0.03), name(0.6, -0.03));
        assert!((one.0[0] - other.0[0]).abs() > 0.1, "the front is another: {one:?} {other:?}");
        assert_eq!(one.1, other.1);
    }

    #[test]
    fn the_second_in_a_place_has_a_suffix() {
        let terrain = terrain_at(&[]);
        let site = site(&terrain, METRES);
        let higher = BOX.map(|[x, y, z]| [x, y, z + 500]);
        let [(a, over_a), (b, over_b)] = [&higher, &BOX].map(|points| summaries(points, NO_KIND));
        let objects =
            [Object::new(1, &a, &over_a, NO_KIND, &site), Object::new(2, &b, &over_b, NO_KIND, &site)];
        let among = Among::new(&objects.each_ref().map(|object| Place::of(object)), []);
        let names = objects.each_ref().map(|object| {
            let mut values = Vec::new();
            Uid.finish(object, &mut values);
            Uid.complete(object.id, &among, &mut values);
            values.remove(0)
        });
        assert_eq!(names, [Value::Text("0-16-31-2".into()), Value::Text("0-16-31".into())]);
    }
}

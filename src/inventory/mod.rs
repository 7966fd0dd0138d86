//! The inventory: the attributes of each object in the table of objects.
//!
//! An attribute is one file in `attributes` and one line in [`REGISTRY`]. It sees the summary of a whole
//! object, the terrain, the axis and the frame of the input; no files, no paths, no threads, no clock. Every
//! format of the table writes every column. The table of columns in README.md is generated from the registry.

mod among;
mod attributes;
mod measures;
mod object;
mod site;
mod surfaces;
mod terrain;
mod touching;

use crate::model::{Column, Value};

pub use among::{Among, Place};
pub use attributes::REGISTRY;
pub use attributes::attribute::Attribute;
pub use measures::{Face, Measures, around_cells};
pub use object::Object;
pub use site::{Site, Station};
pub use surfaces::{SURFACE_COLUMNS, SurfaceRow};
pub use terrain::{Terrain, TerrainSums};
pub use touching::{reach as touching_reach, touching};

/// Raised when an attribute has other values for the same objects, so that a run computes its rows again.
pub const EPOCH: u32 = 13;

/// The columns of all attributes.
///
/// ```
/// let names: Vec<&str> = chainage::inventory::columns().iter().map(|column| column.name).collect();
/// assert_eq!(names[..3], ["id", "uid", "class"]);
/// ```
#[must_use]
pub fn columns() -> Vec<Column> {
    REGISTRY.iter().flat_map(|attribute| attribute.columns()).copied().collect()
}

/// The values of an object, one per column of [`columns`], as far as they do not depend on other objects.
#[must_use]
pub fn values<'a>(object: &Object<'a>) -> Vec<Value<'a>> {
    let mut values = Vec::with_capacity(REGISTRY.iter().map(|attribute| attribute.columns().len()).sum());
    for attribute in REGISTRY {
        attribute.finish(object, &mut values);
    }
    values
}

/// Completes the values of object `id` from the other objects.
pub fn complete(id: u32, among: &Among, values: &mut [Value<'_>]) {
    let mut rest = values;
    for attribute in REGISTRY {
        let (own, others) = rest.split_at_mut(attribute.columns().len().min(rest.len()));
        attribute.complete(id, among, own);
        rest = others;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inventory::object::tests::{BOX, FEET, NO_KIND, site, summaries, terrain_at};
    use crate::model::Kind;

    #[test]
    fn every_attribute_gives_a_value_of_its_type_per_column() {
        let terrain = terrain_at(&[]);
        let site = site(&terrain, FEET);
        for class in 0..10 {
            for points in [&BOX[..], &BOX[..1]] {
                let kind = Kind { class, ..NO_KIND };
                let (part, measures) = summaries(points, kind);
                let object = Object::new(1, &part, &measures, kind, &site);
                for attribute in REGISTRY {
                    let mut values = Vec::new();
                    attribute.finish(&object, &mut values);
                    let columns = attribute.columns();
                    assert_eq!(values.len(), columns.len(), "{attribute:?}");
                    for (column, value) in columns.iter().zip(&values) {
                        assert!(column.holds(value), "{}: {value:?}", column.name);
                    }
                }
                assert_eq!(values(&object).len(), columns().len());
            }
        }
    }

    #[test]
    fn completed_values_are_those_of_their_attribute() {
        let terrain = terrain_at(&[]);
        let site = site(&terrain, FEET);
        let (part, measures) = summaries(&BOX, NO_KIND);
        let object = Object::new(1, &part, &measures, NO_KIND, &site);
        let place = Place::of(&object);
        let mut found = values(&object);
        complete(1, &Among::new(&[place, place], [(1, 2)]), &mut found);
        let before = values(&object);
        let changed: Vec<&str> = columns()
            .iter()
            .zip(found.iter().zip(&before))
            .filter(|(_, (a, b))| a != b)
            .map(|(column, _)| column.name)
            .collect();
        assert_eq!(changed, ["touches"], "the first in a place keeps its name");
    }
}

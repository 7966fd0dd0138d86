//! The inventory: the attributes of each object in the table of objects.
//!
//! An attribute is one file here and one line in [`REGISTRY`]. It sees the summary of a whole object, the terrain,
//! the axis and the frame of the input; no files, no paths, no threads, no clock. Every format of the table writes
//! every column. The table of columns in README.md is generated from the registry.

mod attribute;
mod centroid;
mod class;
mod extent;
mod files;
mod footprint;
mod ground_height;
mod height;
mod id;
mod object;
mod points;
mod station;
mod terrain;

use crate::model::{Column, Value};

pub use attribute::Attribute;
pub use footprint::outline;
pub use object::{Object, Site, Station};
pub use terrain::{Terrain, TerrainSums};

/// Every attribute, in the order of its columns.
pub static REGISTRY: &[&dyn Attribute] = &[
    &id::Id,
    &class::Class,
    &points::Points,
    &extent::Extent,
    &centroid::Centroid,
    &ground_height::GroundHeight,
    &height::Height,
    &footprint::Footprint,
    &station::StationOnAxis,
    &files::Files,
];

/// The columns of all attributes.
///
/// ```
/// let names: Vec<&str> = chainage::inventory::columns().iter().map(|column| column.name).collect();
/// assert_eq!(names[..2], ["id", "class"]);
/// ```
#[must_use]
pub fn columns() -> Vec<Column> {
    REGISTRY.iter().flat_map(|attribute| attribute.columns()).copied().collect()
}

/// The values of an object, one per column of [`columns`].
#[must_use]
pub fn values<'a>(object: &Object<'a>) -> Vec<Value<'a>> {
    let mut values = Vec::with_capacity(REGISTRY.iter().map(|attribute| attribute.columns().len()).sum());
    for attribute in REGISTRY {
        attribute.finish(object, &mut values);
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inventory::object::tests::{FEET, box_part, site, terrain_at};
    use crate::model::ObjectPart;

    #[test]
    fn every_attribute_gives_a_value_of_its_type_per_column() {
        let terrain = terrain_at(&[]);
        let site = site(&terrain, FEET);
        for part in [box_part(), ObjectPart::empty()] {
            let object = Object::new(1, &part, &site);
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

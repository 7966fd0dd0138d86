//! What an attribute of objects is.

use crate::inventory::object::Object;
use crate::model::{Column, Value};

/// An attribute of objects: one or more columns of the table of objects.
///
/// Tiles cut objects, so an attribute is computed from what merges exactly in any order. Today that is
/// [`ObjectPart`](crate::model::ObjectPart), which all attributes share: a tile collects it
/// ([`ObjectPart::collect`](crate::model::ObjectPart::collect)), stitching merges it
/// ([`ObjectPart::merge`](crate::model::ObjectPart::merge)), and [`Self::finish`] reads the whole. An attribute that needs
/// more than that of the points of an object (the outline of a crown, the diameter of a stem) gets an accumulator of its
/// own with the same two steps, `part` for a tile and `merge`, beside `columns` and `finish`.
pub trait Attribute: std::fmt::Debug + Sync {
    /// The columns, in their order.
    fn columns(&self) -> &'static [Column];

    /// Appends the values of a whole object, one per column.
    fn finish<'a>(&self, object: &Object<'a>, values: &mut Vec<Value<'a>>);
}

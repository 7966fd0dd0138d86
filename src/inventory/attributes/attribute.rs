//! What an attribute of objects is.

use crate::inventory::among::Among;
use crate::inventory::object::Object;
use crate::model::{Column, Value};

/// An attribute of objects: one or more columns of the table of objects.
///
/// Tiles cut objects, so an attribute is computed from values that merge exactly in any order. These are
/// [`ObjectPart`](crate::model::ObjectPart) and [`Measures`](crate::inventory::Measures), which all
/// attributes share. Tiles collect them (`collect`), they are merged (`merge`), and [`Self::finish`] reads
/// the whole. An attribute that depends on other objects is completed once all of them are known
/// ([`Self::complete`]).
pub trait Attribute: std::fmt::Debug + Sync {
    /// The columns, in their order.
    fn columns(&self) -> &'static [Column];

    /// Appends the values of a whole object, one per column.
    fn finish<'a>(&self, object: &Object<'a>, values: &mut Vec<Value<'a>>);

    /// Completes the values of object `id`, one per column, from the other objects.
    fn complete(&self, _id: u32, _among: &Among, _values: &mut [Value<'_>]) {}
}

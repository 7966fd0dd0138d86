//! Stitching: if local labels of different tiles contain a common point, they are one object. This module
//! knows labels, point ids and the objects of tiles, but no files and no methods.
//!
//! Every link between two points has one end in some core, and the halo of that tile contains the other end.
//! So a tile keeps the labels that have a point in its core. A label without a halo point is *closed*: no
//! point outside of the core can be linked to it. Every other label is *open*. At each of its halo points, it
//! is united with the label that the owner of the point gave to this point.

mod assemble;
mod local;

pub use assemble::{Stitched, Stitcher};
pub use local::{LocalLabels, LocalObject, SeamPoint};

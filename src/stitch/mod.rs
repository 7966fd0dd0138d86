//! Stitching: local labels of different tiles that hold a common point are one object. Knows labels, point ids and
//! what tiles know of their objects; no files and no methods.
//!
//! Every link between two points has one end in some core, and that tile's halo holds the other end. So a tile keeps
//! the labels that have a point in its core; a label without a halo point is *closed*, nothing outside can be linked
//! to it; an *open* one is united, at each of its halo points, with the label that the owner of the point gave it.

mod assemble;
mod local;

pub use assemble::{Stitched, Stitcher};
pub use local::{LocalLabels, LocalObject, SeamPoint};

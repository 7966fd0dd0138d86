//! Stitching: if local labels of different tiles contain a common point, they are one object. This module
//! knows labels, point ids and the objects of tiles, but no files and no methods.
//!
//! Every link between two points has one end in some core, and the halo of that tile contains the other end.
//! So a tile keeps the labels that have a point in its core. A label without a halo point is *closed*: no
//! point outside the core can be linked to it. Every other label is *open*. At each of its halo points, it is
//! united with the label that the owner of the point gave to this point.
//!
//! ```
//! use chainage::model::{ObjectPart, PointId, TileId};
//! use chainage::stitch::{LocalObject, Stitcher};
//!
//! // Two tiles. Each has one open object with one point in its core.
//! let part = |id| ObjectPart { points: 1, first_id: PointId::new(id), ..ObjectPart::empty() };
//! let mut stitcher = Stitcher::default();
//! stitcher.tile(vec![LocalObject { open: true, part: part(7) }]);
//! stitcher.tile(vec![LocalObject { open: true, part: part(3) }]);
//!
//! // Label 1 of both tiles contains the same point, so the two labels are one object.
//! assert!(stitcher.link((TileId::new(0), 1), (TileId::new(1), 1)));
//! let stitched = stitcher.finish(&(1..=u64::MAX));
//! assert_eq!(stitched.ids, [[1], [1]]);
//! assert_eq!(stitched.objects[0].points, 2);
//! ```

mod assemble;
mod local;

pub use assemble::{Stitched, Stitcher};
pub use local::{LocalLabels, LocalObject, SeamPoint};

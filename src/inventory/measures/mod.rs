//! What the inventory measures on the points of an object: sketches that tiles collect and merge exactly, and
//! the geometry that is derived from the sketches of a whole object. No columns, no files, no tiles.

mod body;
mod circle;
mod classes;
mod crest;
mod crown;
mod face;
mod foot;
mod grid;
mod outline;
mod parts;
mod profile;
mod rectangle;
mod sketch;
mod stem;
mod stem_axis;
mod tree_foot;

pub(super) use body::box_of_body;
pub(super) use circle::Circle;
pub(super) use classes::{BUILDING, FENCE, POLE, SMALL, TREE, VEHICLE, WIRE};
pub(super) use crest::crest_m;
pub(super) use crown::{crown, crown_base_m};
pub use face::Face;
pub(super) use foot::{Foot, lowest_before_front, lowest_of};
pub use outline::around_cells;
pub(super) use outline::{Polygon, outline};
pub(super) use parts::Frames;
pub use parts::Measures;
pub(super) use profile::Ends;
pub(super) use rectangle::Rectangle;

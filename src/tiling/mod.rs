//! Tiling: the cells that a tile owns, the cells around them that it must see, and its points. Pure functions
//! of the survey.

mod gather;
mod plan;

pub use gather::{Gathered, Gatherer, HeightOutOfRange, Wanted};
pub use plan::{Place, Plan, PlanRequest, Region, Tile, TileSize};

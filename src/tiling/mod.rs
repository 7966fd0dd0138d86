//! Tiling: which cells a tile owns, what it must see around them, and the points it gets. Pure functions of the
//! survey; knows no files and no methods.

mod gather;
mod plan;

pub use gather::{Gathered, Gatherer, HeightOutOfRange, Wanted};
pub use plan::{Place, Plan, PlanRequest, Region, Tile, TileSize};

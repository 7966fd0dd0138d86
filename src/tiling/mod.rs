//! Tiling: the cells that a tile owns, the cells around them that it must see, and its points. Pure functions
//! of the survey.
//!
//! ```
//! use std::sync::Arc;
//!
//! use chainage::spatial::{CellGrid, CellMap, PackedCells};
//! use chainage::tiling::{Plan, PlanRequest, TileSize};
//!
//! // A street along x: 100 cells of 1 m with 50 points each. Every cell is a strip of its own.
//! let mut points = CellMap::default();
//! let mut strips = CellMap::default();
//! for i in 0..100 {
//!     *points.entry([i, 0]) = 50;
//!     *strips.entry([i, 0]) = u32::try_from(i).unwrap() + 1;
//! }
//! let plan = Plan::new(&PlanRequest {
//!     cells: &Arc::new(PackedCells::from(points)),
//!     strips: &PackedCells::from(strips),
//!     chainage_m: &(0..100).map(f64::from).collect::<Vec<_>>(),
//!     grid: CellGrid::new(1_000),
//!     size: &TileSize::Metres(25.0),
//!     inside: None,
//! });
//! assert_eq!(plan.tiles.len(), 4);
//! // With a reach of 2 m, a tile at the end of the street reads its 25 cells and a halo of 3.
//! assert_eq!(plan.region_points(0, 2_000), 28 * 50);
//! ```

mod gather;
mod plan;
mod region;

pub use gather::{Gathered, Gatherer, HeightOutOfRange, Wanted};
pub use plan::{Place, Plan, PlanRequest, Tile, TileSize};
pub use region::Region;

//! The plan: the length of tiles for the available memory.

mod budget;
mod drawing;
mod fit;
mod needs;
mod time;

pub(crate) use budget::Budget;
pub(crate) use drawing::svg;
pub(crate) use fit::{STRIPS, is_stored_name, over_budget, settle};
pub(crate) use needs::tile_bytes;
pub(crate) use time::Work;

//! The plan: how long tiles may be for the memory that there is.

mod budget;
mod drawing;
mod fit;
mod needs;

pub(crate) use budget::Budget;
pub(crate) use drawing::svg;
pub(crate) use fit::settle;
pub(crate) use needs::tile_bytes;

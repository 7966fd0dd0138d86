//! Vehicles that touch each other, side by side and one behind another, and trails of moving ones.

pub(crate) mod lanes;
pub(crate) mod rows;
pub(crate) mod stripes;
pub(crate) mod trails;

//! Step `chains`: upright chains near the ground, each a trunk or a pole.

pub(crate) mod axis;
pub(crate) mod piece;
pub(crate) mod stage_chains;
pub(crate) mod verdict;

//! Step `cores`: the parts of the drive that are certainly one object each.

pub(crate) mod arms;
pub(crate) mod beside;
pub(crate) mod chained;
pub(crate) mod cuts;
pub(crate) mod facades;
pub(crate) mod footprint;
pub(crate) mod joining;
pub(crate) mod nearby;
pub(crate) mod part;
pub(crate) mod parts;
pub(crate) mod remaining;
pub(crate) mod rules;
pub(crate) mod stage_cores;
pub(crate) mod supports;
pub(crate) mod trees;
pub(crate) mod uniting;
pub(crate) mod vehicles;

//! Steps `classes` and `context`: the class probabilities of each voxel.

pub(crate) mod classified;
pub(crate) mod features;
pub(crate) mod stage_classes;
pub(crate) mod stage_context;

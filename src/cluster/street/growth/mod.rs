//! Steps `edges` and `growth`: which voxels are neighbours, and which core each voxel belongs to.

pub(crate) mod costs;
pub(crate) mod graph;
pub(crate) mod paths;
pub(crate) mod stage_edges;
pub(crate) mod stage_growth;

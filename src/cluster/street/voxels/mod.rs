//! Step `voxels`: the voxels of the points, the height of the ground, and what their counts say about the
//! whole drive.

pub(crate) mod canopy;
pub(crate) mod plane;
pub(crate) mod sparse;
pub(crate) mod stage_voxels;
pub(crate) mod stored;
pub(crate) mod suits;
pub(crate) mod terrain;

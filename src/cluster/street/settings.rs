//! Fixed values of `street`: lengths, classes, and the numbers of its first steps.

use crate::model::Lattice;

/// Name of the method and of its section.
pub(super) const NAME: &str = "street";

/// Numbers of the steps, in their order.
pub(super) const STEP_VOXELS: usize = 0;
pub(super) const STEP_CLASSES: usize = 1;

/// Edge of a voxel in metres. Not a setting: the model was trained with it. The thinnest objects (signs,
/// stems, rails) are about 0.1 m, and the spacing of points is mostly below 0.1 m.
pub(crate) const EDGE_M: f64 = 0.15;

/// Number of classes. The code of a class is its index plus one: ground (none of the others), tree, pole,
/// vehicle, building, fence or hedge, small, wire.
pub(crate) const CLASSES: usize = 8;

/// Edge of a voxel in lattice units.
pub(super) fn edge(lattice: Lattice) -> u32 {
    u32::try_from(lattice.units(EDGE_M)).unwrap_or(u32::MAX)
}

//! A piece of an upright chain: what a tile knows about one component of a height slice.

use serde::{Deserialize, Serialize};

use super::axis::Axis;
use crate::cluster::columns::Voxel;

/// Height of a level in metres. Occupied levels are counted.
pub(crate) const LEVEL_M: f64 = 0.3;

/// An upright, narrow piece in one slice.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Piece {
    pub(crate) slice: u8,
    /// Its first voxel in the order (i, j, k).
    pub(crate) first: Voxel,
    /// Its centre in the plane, in lattice units.
    pub(crate) centre: [i64; 2],
    /// Radius around the centre that contains its voxels, in lattice units.
    pub(crate) radius: i64,
    /// Lowest and highest height above ground, in lattice units.
    pub(crate) height: (i32, i32),
    pub(crate) voxels: u32,
    /// Sums of the shares of its voxels.
    pub(crate) pole: u32,
    pub(crate) tree: u32,
    /// The line through its voxels.
    pub(crate) axis: Axis,
    /// Bits of the levels above the slices that have a pole voxel near the axis, and of those that have any
    /// tree or pole voxel there.
    pub(crate) pole_above: u64,
    pub(crate) any_above: u64,
    /// Bits of all levels that have any tree or pole voxel near the axis.
    pub(crate) any_levels: u64,
    /// Tree voxels in the ring around the axis.
    pub(crate) crown: u32,
    /// Tree voxels on each of the eight sides of the axis, above the height of trunks.
    pub(crate) sides: [u32; 8],
    /// Pieces that are linked to it: slice and first voxel.
    pub(crate) links: Vec<(u8, Voxel)>,
}

impl Piece {
    /// Orders the pieces of a chain by how high they reach.
    pub(crate) fn reach(&self) -> (i32, u8, Voxel) {
        (self.height.1, self.slice, self.first)
    }
}

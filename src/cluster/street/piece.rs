//! A piece of an upright chain: what a tile finds out about one component of a slice of height.

use serde::{Deserialize, Serialize};

use super::axis::Axis;
use crate::cluster::columns::Voxel;

/// Height of a level in metres. Occupied levels are counted.
pub(super) const LEVEL_M: f64 = 0.3;

/// An upright, narrow piece in one slice.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Piece {
    pub(super) slice: u8,
    /// Its first voxel in the order (i, j, k).
    pub(super) first: Voxel,
    /// Its centre in the plane, in lattice units.
    pub(super) centre: [i64; 2],
    /// Radius around the centre that contains its voxels, in lattice units.
    pub(super) radius: i64,
    /// Lowest and highest height above ground, in lattice units.
    pub(super) height: (i32, i32),
    pub(super) voxels: u32,
    /// Sums of the shares of its voxels.
    pub(super) pole: u32,
    pub(super) tree: u32,
    /// The line through its voxels.
    pub(super) axis: Axis,
    /// Levels above the slices with pole voxels near the axis, and with any tree or pole voxel.
    pub(super) pole_above: u64,
    pub(super) any_above: u64,
    /// Levels with any tree or pole voxel near the axis.
    pub(super) any_levels: u64,
    /// Tree voxels in the ring around the axis.
    pub(super) crown: u32,
    /// Tree voxels on each of the eight sides of the axis, above the height of trunks.
    pub(super) sides: [u32; 8],
    /// Pieces that are linked to it: slice and first voxel.
    pub(super) links: Vec<(u8, Voxel)>,
}

impl Piece {
    /// Orders the pieces of a chain by how high they reach.
    pub(super) fn reach(&self) -> (i32, u8, Voxel) {
        (self.height.1, self.slice, self.first)
    }
}

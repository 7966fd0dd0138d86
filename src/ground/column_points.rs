//! The points of a tile by column of voxels, from the lowest voxel up.

use super::lowest::NONE;
use crate::model::Lattice;
use crate::spatial::VoxelIndex;

/// The points of a tile by column.
pub(super) struct Tile<'a> {
    pub(super) lattice: Lattice,
    pub(super) index: &'a VoxelIndex,
    pub(super) z: &'a [i32],
    /// z of the drive that is the local z 0.
    pub(super) bottom: i64,
}

impl Tile<'_> {
    /// Points of a voxel, as (point, local z).
    fn points(&self, voxel: usize) -> impl Iterator<Item = (usize, u32)> {
        self.index.voxel_points(voxel).flatten().map(|point| (point, self.z[point].unsigned_abs()))
    }

    /// The lowest point of each column.
    pub(super) fn lowest(&self) -> Vec<u32> {
        let lowest_of = |column| {
            let mut voxels = self.index.column_voxels(column);
            voxels.find_map(|voxel| self.points(voxel).map(|(_, z)| z).min()).unwrap_or(NONE)
        };
        (0..self.index.columns().len()).map(lowest_of).collect()
    }

    /// The `rank`-th lowest point of a column that is not below `floor`, or its highest where it has fewer.
    /// `found` is a buffer.
    pub(super) fn low_above(&self, column: usize, floor: i64, rank: usize, found: &mut Vec<u32>) -> u32 {
        found.clear();
        for voxel in self.index.column_voxels(column) {
            found.extend(self.points(voxel).map(|(_, z)| z).filter(|&z| i64::from(z) >= floor));
            if found.len() >= rank {
                return *found.select_nth_unstable(rank - 1).1;
            }
        }
        found.iter().max().copied().unwrap_or(NONE)
    }

    /// Where a voxel begins, as a local z.
    fn begin(&self, voxel: usize) -> i64 {
        let grid = self.index.grid();
        (grid.base[2] + i64::from(self.index.heights()[voxel])) * i64::from(grid.edge) - self.bottom
    }

    /// Where the highest voxel of a column begins, as a local z.
    pub(super) fn top(&self, column: usize) -> i64 {
        self.index.column_voxels(column).next_back().map_or(0, |voxel| self.begin(voxel))
    }

    /// The points of a column in voxels that begin less than `top` above its surface, as (point, height above
    /// it).
    pub(super) fn near(&self, column: usize, surface: u32, top: i64, near: &mut Vec<(usize, i64)>) {
        let surface = i64::from(surface);
        let voxels = self.index.column_voxels(column).take_while(|&voxel| self.begin(voxel) < surface + top);
        near.clear();
        near.extend(voxels.flat_map(|voxel| self.points(voxel)).map(|(at, z)| (at, i64::from(z) - surface)));
    }
}

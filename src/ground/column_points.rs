//! The points of a tile by column of voxels, from the lowest voxel up.
#![expect(clippy::cast_possible_truncation, reason = "numbers of points of a tile fit u32, see VoxelIndex")]

use super::lowest::NONE;
use crate::model::{Lattice, TileCloud};
use crate::spatial::VoxelIndex;

/// A layer of a column has more than one in this many of the points of the column, or more than [`MOST`]
/// points. Fewer points are multipath or stray returns (chosen by the study in benches/results/ground.md).
const SHARE: u32 = 16;
/// More points than this are always a layer, however many points the column has (chosen by the same study).
const MOST: u32 = 8;

/// The points of a tile by column.
pub(super) struct Tile<'a> {
    pub(super) lattice: Lattice,
    pub(super) index: &'a VoxelIndex,
    pub(super) z: &'a [i32],
    /// z of the drive that is the local z 0.
    pub(super) bottom: i64,
    /// Number of points of each voxel.
    counts: Vec<u32>,
}

impl<'a> Tile<'a> {
    /// The points of a cloud, by the columns of its index.
    pub(super) fn new(cloud: &'a TileCloud, index: &'a VoxelIndex) -> Self {
        let mut counts = vec![0; index.len()];
        for (points, voxel) in index.streaks() {
            counts[voxel] += points.len() as u32;
        }
        Self { lattice: cloud.lattice, index, z: &cloud.z, bottom: cloud.origin[2], counts }
    }

    /// Points of a voxel, as (point, local z).
    fn points(&self, voxel: usize) -> impl Iterator<Item = (usize, u32)> {
        self.index.voxel_points(voxel).flatten().map(|point| (point, self.z[point].unsigned_abs()))
    }

    /// The lowest point of the lowest layer of each column. A layer is a voxel and the voxel above it, if
    /// they contain more than one in `SHARE` of the points of the column, or more than `MOST` points. A
    /// column without any layer begins with its lowest point.
    pub(super) fn lowest_layers(&self) -> Vec<u32> {
        let lowest_of = |column| {
            let voxels = self.index.column_voxels(column);
            let all = self.counts[voxels.clone()].iter().sum::<u32>();
            let least = (all / SHARE).min(MOST);
            let is_layer = |&voxel: &usize| self.layer(voxel, voxels.end) > least;
            let layer = voxels.clone().find(is_layer).or(voxels.clone().next());
            layer.and_then(|voxel| self.points(voxel).map(|(_, z)| z).min()).unwrap_or(NONE)
        };
        (0..self.index.columns().len()).map(lowest_of).collect()
    }

    /// Number of points of a voxel and of the voxel directly above it, if that is occupied and before `end`.
    fn layer(&self, voxel: usize, end: usize) -> u32 {
        let heights = self.index.heights();
        let above =
            (voxel + 1 < end && heights[voxel + 1] == heights[voxel] + 1).then(|| self.counts[voxel + 1]);
        self.counts[voxel] + above.unwrap_or(0)
    }

    /// The `rank`-th lowest point of a column among its points not below `floor`, or the highest if there are
    /// fewer. `found` is a buffer.
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

//! Cubes of several voxels: the coarser scales of the features. A cube counts once and has one position,
//! however many of its voxels are occupied. So a densely scanned wall weighs as much as a sparsely scanned
//! one.
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    reason = "voxels of a tile fit u32 (VoxelIndex)"
)]

use crate::cluster::columns::Columns;
use crate::cluster::street::voxels::stored::Voxels;

/// Occupied cubes in ascending order of their keys.
#[derive(Debug, Default)]
pub(crate) struct Cells {
    pub(crate) columns: Columns,
    /// Mean of the centres of the voxels in lattice units, rounded down.
    pub(crate) centre: Vec<[i64; 3]>,
    /// The voxel with the smallest key.
    pub(crate) first: Vec<u32>,
    /// Number of voxels.
    pub(crate) voxels: Vec<u32>,
    /// Cube of each voxel.
    pub(crate) of_voxel: Vec<u32>,
}

impl Cells {
    /// Cubes of `edge` voxels, at multiples of `edge` on the global lattice.
    pub(crate) fn of(voxels: &Voxels, edge: i32) -> Self {
        let mut order: Vec<([i32; 2], u32)> = voxels
            .columns
            .cells()
            .iter()
            .zip(0_u32..)
            .map(|(cell, column)| (cell.map(|index| index.div_euclid(edge)), column))
            .collect();
        order.sort_unstable();
        let mut cells = Self { of_voxel: vec![0; voxels.len()], ..Self::default() };
        let mut keys = Vec::new();
        let mut inside: Vec<(i32, u32)> = Vec::new();
        for group in order.chunk_by(|a, b| a.0 == b.0) {
            inside.clear();
            for (_, column) in group {
                let range = voxels.columns.voxels(*column as usize);
                inside.extend(range.map(|voxel| (voxels.key[voxel][2].div_euclid(edge), voxel as u32)));
            }
            inside.sort_unstable();
            for cube in inside.chunk_by(|a, b| a.0 == b.0) {
                let mut sum = [0_i64; 3];
                for (_, voxel) in cube {
                    cells.of_voxel[*voxel as usize] = keys.len() as u32;
                    (0..3).for_each(|axis| sum[axis] += voxels.centre[*voxel as usize][axis]);
                }
                let [i, j] = group[0].0;
                keys.push([i, j, cube[0].0]);
                cells.centre.push(sum.map(|sum| sum.div_euclid(cube.len() as i64)));
                cells.first.push(cube[0].1);
                cells.voxels.push(cube.len() as u32);
            }
        }
        cells.columns = Columns::new(keys.into_iter());
        cells
    }

    /// Number of cubes.
    pub(crate) fn len(&self) -> usize {
        self.centre.len()
    }
}

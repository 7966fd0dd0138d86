//! Stage `voxels`: the voxels of a tile, the ground below them, and their connected components. Its reduction
//! computes the largest count and the components over the drive. It computes no densities.
//!
//! A tile owns whole columns: the owner of the first occupied cell that a column meets owns the column. A
//! tile reads points far enough around itself to have all points of its columns and of the columns beside
//! them.
#![expect(
    clippy::cast_possible_truncation,
    reason = "counts of a tile fit u32 and edges are at most 2 m (VoxelIndex, validated settings)"
)]

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::settings::{NAME, STAGE_VOXELS};
use crate::cluster::columns::{Border, Columns, Voxel, global_indices, join};
use crate::cluster::sliced;
use crate::cluster::{DriveWindow, Mapped, TileWindow};
use crate::codec;
use crate::error::Result;
use crate::model::TileId;
use crate::spatial::{Cell, VoxelIndex};

/// A voxel of one column.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(super) struct StoredVoxel {
    pub(super) k: i32,
    /// Number of its points that are neither ground nor noise.
    pub(super) points: u32,
    /// Its component in the tile.
    pub(super) component: u32,
}

/// The payload of a tile.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct VoxelPayload {
    /// Columns with voxels of objects, ascending, and the number of these voxels.
    columns: Vec<(Cell, u32)>,
    /// The voxels of objects, column by column from the lowest up.
    pub(super) stored: Vec<StoredVoxel>,
    /// Lowest ground voxel of each column that has one, ascending.
    pub(super) ground: Vec<(Cell, i32)>,
    /// Points in all voxels, ground included.
    pub(super) points: u64,
    /// All voxels, ground included.
    pub(super) voxels: u64,
    border: Border,
}

impl VoxelPayload {
    /// Columns with voxels of objects, ascending, and the range of these voxels in `stored`.
    pub(super) fn columns(&self) -> impl Iterator<Item = (Cell, Range<usize>)> + '_ {
        let mut end = 0;
        self.columns.iter().map(move |&(cell, count)| {
            let start = end;
            end += count as usize;
            (cell, start..end)
        })
    }
}

/// Largest number of points of objects in one voxel of the drive, from the global of this stage.
pub(super) fn most(global: &[u8]) -> Result<u32> {
    sliced::head(global)
}

/// Component over the drive of each component of a tile, from the global of this stage.
pub(super) fn components(global: &[u8], tile: TileId) -> Result<Vec<u32>> {
    sliced::slice(global, tile)
}

/// Distance around a tile that contains all points of its columns and of the columns beside them: two edges
/// per axis.
pub(super) fn reach(edge: u32) -> i64 {
    (f64::from(edge) * 2.0 * std::f64::consts::SQRT_2).ceil() as i64
}

/// Computes the payload of a tile.
pub(super) fn map(tile: &dyn TileWindow, edge: u32) -> Result<Mapped> {
    let points = tile.points(reach(edge), false)?;
    let index = VoxelIndex::build(NAME, &points.cloud, edge)?;
    let mut objects = vec![0_u32; index.len()];
    let mut ground = vec![false; index.len()];
    for (range, voxel) in index.streaks() {
        for point in range {
            objects[voxel] += u32::from(!points.ground[point]);
            ground[voxel] |= points.ground[point];
        }
    }
    drop(points);
    let units = i64::from(edge);
    let mine = |[i, j]: Cell| {
        let lo = [i64::from(i) * units, i64::from(j) * units];
        tile.owner(lo, lo.map(|value| value + units - 1)) == Some(tile.tile())
    };

    let mut payload = VoxelPayload::default();
    let mut last = (None, false);
    for (voxel @ [i, j, k], local) in global_indices(NAME, &index, |_| true)? {
        if last.0 != Some([i, j]) {
            last = (Some([i, j]), mine([i, j]));
        }
        if last.1 {
            payload.voxels += 1;
            payload.points += u64::from(index.counts()[local as usize]);
            if ground[local as usize]
                && payload.ground.last().is_none_or(|column| column.0 != [voxel[0], voxel[1]])
            {
                payload.ground.push(([i, j], k));
            }
        }
    }

    let voxels = global_indices(NAME, &index, |voxel| objects[voxel] > 0)?;
    let columns = Columns::new(voxels.iter().map(|entry| entry.0));
    let mut own = vec![false; columns.len()];
    for (column, &cell) in columns.cells().iter().enumerate() {
        if mine(cell) {
            own[columns.voxels(column)].fill(true);
        }
    }
    let foreign: Vec<bool> = own.iter().map(|own| !own).collect();
    let shared = columns.shared(&own, &foreign);
    let (component, border) = number(&columns, &columns.components(|_| true), &own, &shared);
    payload.border = border;
    for (column, &cell) in columns.cells().iter().enumerate() {
        let range = columns.voxels(column);
        if own[range.start] {
            payload.columns.push((cell, range.len() as u32));
            payload.stored.extend(range.map(|voxel| StoredVoxel {
                k: columns.heights()[voxel],
                points: objects[voxels[voxel].1 as usize],
                component: component[voxel],
            }));
        }
    }
    Ok(Mapped::payload(codec::encode(&payload)?))
}

/// Numbers the components that a tile needs, from 0: those with voxels in `wanted` or in `shared`. `roots`
/// names a component by its smallest voxel. Voxels of other components get the number `u32::MAX`.
pub(super) fn number(
    columns: &Columns,
    roots: &[u32],
    wanted: &[bool],
    shared: &[usize],
) -> (Vec<u32>, Border) {
    let mut numbers = vec![u32::MAX; roots.len()];
    let mut needed: Vec<u32> = shared.iter().map(|&voxel| roots[voxel]).collect();
    needed.extend(roots.iter().zip(wanted).filter(|(_, wanted)| **wanted).map(|(root, _)| *root));
    needed.sort_unstable();
    needed.dedup();
    for (number, &root) in (0_u32..).zip(&needed) {
        numbers[root as usize] = number;
    }
    let of_voxel: Vec<u32> = roots.iter().map(|&root| numbers[root as usize]).collect();
    let indices: Vec<Voxel> = columns.indices().collect();
    let shared = shared.iter().map(|&voxel| (indices[voxel], of_voxel[voxel])).collect();
    (of_voxel, Border { count: needed.len() as u32, shared })
}

/// The largest count and the components over the drive.
pub(super) fn reduce(drive: &dyn DriveWindow) -> Result<Vec<u8>> {
    let mut most = 0;
    let mut borders = Vec::new();
    for tile in TileId::first(drive.tiles()) {
        let payload: VoxelPayload = load(drive, tile)?;
        most = payload.stored.iter().map(|voxel| voxel.points).max().unwrap_or(0).max(most);
        borders.push(payload.border);
    }
    sliced::encode(&most, &join(&borders))
}

/// The payload of a tile, decoded.
pub(super) fn load(drive: &dyn DriveWindow, tile: TileId) -> Result<VoxelPayload> {
    codec::decode(&drive.payload(STAGE_VOXELS, tile)?)
}

//! Step `voxels`: the voxels of the points of a tile that are neither ground nor noise, and the ground
//! raster. It is the only step before the labels that reads points.
//!
//! A tile owns whole columns of voxels and whole cells of the ground raster: the owner of the first occupied
//! raster cell that meets a column owns the column. A tile reads the points around it as well, so that it has
//! all points of the columns and cells that it owns.
#![expect(clippy::cast_possible_truncation, reason = "counts of a tile fit u32, edges are 0.15 m and 0.5 m")]

use super::canopy::{COVERED_M, Cover};
use super::sparse::Stacked;
use super::stored::{StoredVoxels, Storing};
use super::terrain::{CELL_M, StoredGround, layers};
use crate::cluster::columns::global_indices;
use crate::cluster::street::settings::{NAME, edge};
use crate::cluster::{Mapped, TilePoints, TileWindow};
use crate::codec;
use crate::error::Result;
use crate::model::Lattice;
use crate::spatial::VoxelIndex;

/// The points around a tile and the voxels that the tile owns.
#[derive(Debug)]
pub(crate) struct Cut {
    /// Points of the tile and around it, ground included.
    pub(crate) points: TilePoints,
    /// Number of the owned voxel of each point, in the order of `stored`. `u32::MAX` for ground, and for
    /// points in columns of other tiles.
    pub(crate) voxel: Vec<u32>,
    /// The voxels that the tile owns.
    pub(crate) stored: StoredVoxels,
    ground: StoredGround,
    cover: Cover,
}

impl Cut {
    /// The payload of the step.
    pub(crate) fn payload(&self) -> Result<Vec<u8>> {
        let stacked = Stacked::count(&self.stored);
        let sections = [
            codec::encode(&self.stored)?,
            codec::encode(&self.ground)?,
            codec::encode(&(stacked, self.cover))?,
        ];
        Ok(codec::pack(&sections))
    }
}

/// Distance around a tile that contains all points of its columns and cells: two edges per axis.
fn reach(units: i64) -> i64 {
    3 * units
}

/// Whether the tile owns the column with edges of `units` lattice units.
fn owns(tile: &dyn TileWindow, column: [i32; 2], units: i64) -> bool {
    let lo = column.map(|index| i64::from(index) * units);
    tile.owner(lo, lo.map(|value| value + units - 1)) == Some(tile.tile())
}

/// Computes the payload of a tile.
pub(crate) fn map(tile: &dyn TileWindow) -> Result<Mapped> {
    Ok(Mapped::payload(cut(tile)?.payload()?))
}

/// Reads the points of a tile and computes its voxels and its ground raster.
pub(crate) fn cut(tile: &dyn TileWindow) -> Result<Cut> {
    cut_of(tile, tile.points(points_reach(tile.lattice()), false)?)
}

/// Distance around a tile within which points are read, in lattice units.
pub(crate) fn points_reach(lattice: Lattice) -> i64 {
    reach(lattice.units(CELL_M))
}

/// The voxels and the ground raster of points within [`points_reach`] of a tile, or of some of them.
pub(crate) fn cut_of(tile: &dyn TileWindow, points: TilePoints) -> Result<Cut> {
    let cell = tile.lattice().units(CELL_M);
    let (voxel, stored) = voxels(tile, &points)?;
    let (ground, cover) = ground(tile, &points, cell.unsigned_abs() as u32)?;
    Ok(Cut { points, voxel, stored, ground, cover })
}

fn voxels(tile: &dyn TileWindow, points: &TilePoints) -> Result<(Vec<u32>, StoredVoxels)> {
    let edge = edge(tile.lattice());
    let cloud = &points.cloud;
    let index = VoxelIndex::build(NAME, cloud, edge)?;
    let mut sums = vec![(0_u32, [0_u64; 3]); index.len()];
    let base = index.grid().base.map(|base| base * i64::from(edge));
    for (range, voxel) in index.streaks() {
        let (count, sum) = &mut sums[voxel];
        for point in range.filter(|&point| !points.ground[point]) {
            let at = cloud.lattice_point(point);
            *count += 1;
            (0..3).for_each(|axis| sum[axis] += at[axis].abs_diff(base[axis]));
        }
    }
    let mut storing = Storing::default();
    let mut number = vec![u32::MAX; index.len()];
    let mut stored = 0;
    let mut last = (None, false);
    for (key, local) in global_indices(NAME, &index, |voxel| sums[voxel].0 > 0)? {
        let column = [key[0], key[1]];
        if last.0 != Some(column) {
            last = (Some(column), owns(tile, column, i64::from(edge)));
        }
        if last.1 {
            let (count, sum) = sums[local as usize];
            // From the base of the grid to the corner of the voxel.
            let corner = [0, 1, 2].map(|axis| (i64::from(key[axis]) * i64::from(edge)).abs_diff(base[axis]));
            storing.push(key, count, [0, 1, 2].map(|axis| sum[axis] - u64::from(count) * corner[axis]));
            number[local as usize] = stored;
            stored += 1;
        }
    }
    drop(sums);
    let mut voxel = vec![u32::MAX; cloud.len()];
    for (range, local) in index.streaks() {
        for point in range.filter(|&point| !points.ground[point]) {
            voxel[point] = number[local];
        }
    }
    Ok((voxel, storing.finish()))
}

/// The ground raster, and how many of its cells are covered.
fn ground(tile: &dyn TileWindow, points: &TilePoints, cell: u32) -> Result<(StoredGround, Cover)> {
    let index = VoxelIndex::build(NAME, &points.cloud, cell)?;
    let bottom = points.cloud.origin[2];
    let gap = tile.lattice().units(super::terrain::LAYER_GAP_M) as i32;
    let covered = tile.lattice().units(COVERED_M) / i64::from(cell);
    let mut ground = StoredGround::default();
    let mut cover = Cover::default();
    let mut heights: Vec<i32> = Vec::new();
    for (column, at) in index.columns().iter().enumerate() {
        let base = index.grid().base;
        let global = |axis: usize| i32::try_from(base[axis] + i64::from(at[axis]));
        // Beyond 2^31 cells from the origin there are no voxels either: `voxels` has refused them.
        let (Ok(i), Ok(j)) = (global(0), global(1)) else { continue };
        if !owns(tile, [i, j], i64::from(cell)) {
            continue;
        }
        let levels = index.column_voxels(column).map(|voxel| i64::from(index.heights()[voxel]));
        let extent = levels.clone().max().unwrap_or(0) - levels.min().unwrap_or(0);
        cover.add(Cover { cells: 1, covered: u64::from(extent >= covered) });
        heights.clear();
        for voxel in index.column_voxels(column) {
            let inside = index.voxel_points(voxel).flatten().filter(|&point| points.ground[point]);
            heights.extend(inside.map(|point| points.cloud.z[point]));
        }
        if let Some(found) = layers(&mut heights, gap) {
            ground.push([i, j], found.map(|height| bottom + i64::from(height)));
        }
    }
    Ok((ground, cover))
}

//! The points around a tile with the clusters of their voxels. Finds the voxels near voxels of other
//! clusters.
#![expect(
    clippy::cast_possible_truncation,
    reason = "points of a tile fit u32 and local coordinates i32, see TileCloud and VoxelIndex"
)]

use std::ops::Range;

use super::settings::{NAME, STAGE_PEAKS};
use super::stage_peaks;
use super::stage_voxels;
use crate::cluster::columns::{Columns, global_indices};
use crate::cluster::{TilePoints, TileWindow};
use crate::error::{Error, Result};
use crate::model::TileId;
use crate::spatial::{Cell, VoxelIndex};

/// Distance from a point within which all cells of the raster that its voxel meets lie, in lattice units.
fn owner_reach(tile: &dyn TileWindow, edge: u32) -> i64 {
    2 * tile.grid().edge() + 2 * i64::from(edge)
}

/// Points around a tile with their voxels and clusters.
pub(super) struct Surroundings {
    pub(super) points: TilePoints,
    /// Voxel of each point, as an index into `voxels`.
    pub(super) voxel: Vec<u32>,
    /// The voxels of the points.
    pub(super) voxels: Columns,
    /// Cluster of each voxel, from 1; 0 without one.
    pub(super) cluster: Vec<u32>,
    /// Voxels that the tile owns, as indices into `voxels`.
    pub(super) owned: Vec<u32>,
}

impl Surroundings {
    /// Reads the points of objects within `reach` of a tile, and finds their clusters.
    pub(super) fn load(tile: &dyn TileWindow, edge: u32, reach: i64) -> Result<Self> {
        let points = tile.points(reach, true)?;
        // Points are read by whole cells, and the owner of their voxel may own another cell: at most two
        // edges of each away.
        let near = tile.near(reach + owner_reach(tile, edge));
        Self::of(tile, edge, points, &near)
    }

    /// Finds the clusters of the given points of objects in some cells.
    pub(super) fn of_cells(
        tile: &dyn TileWindow,
        edge: u32,
        points: TilePoints,
        cells: &[Cell],
    ) -> Result<Self> {
        let near = tile.near_cells(cells, owner_reach(tile, edge));
        Self::of(tile, edge, points, &near)
    }

    /// The same. `near` are all tiles that may own a voxel of the points.
    fn of(tile: &dyn TileWindow, edge: u32, points: TilePoints, near: &[TileId]) -> Result<Self> {
        let index = VoxelIndex::build(NAME, &points.cloud, edge)?;
        // Every voxel of the index has a point, so the order and the numbers of voxels are the same in
        // `voxels`.
        let indices = global_indices(NAME, &index, |_| true)?;
        let voxels = Columns::new(indices.iter().map(|entry| entry.0));
        let mut voxel = vec![0; points.cloud.len()];
        for (range, number) in index.streaks() {
            voxel[range].fill(number as u32);
        }
        drop(index);
        let mut cluster = vec![u32::MAX; voxels.len()];
        let mut owned = Vec::new();
        let mut finder = voxels.finder();
        for &near in near {
            let payload = stage_voxels::load(tile, near)?;
            let ends = stage_peaks::load(tile, near)?.ends;
            let clusters = stage_peaks::ends(tile.global(STAGE_PEAKS), near)?;
            for (cell, stored) in payload.columns() {
                let range = finder.column(cell);
                let mut at = range.start;
                for (stored, &end) in payload.stored[stored.clone()].iter().zip(&ends[stored]) {
                    while at < range.end && voxels.heights()[at] < stored.k {
                        at += 1;
                    }
                    if at < range.end && voxels.heights()[at] == stored.k {
                        cluster[at] = (end as usize).checked_sub(1).map_or(0, |end| clusters[end]);
                        if near == tile.tile() {
                            owned.push(at as u32);
                        }
                    }
                }
            }
        }
        if let Some(lost) = cluster.iter().position(|&cluster| cluster == u32::MAX) {
            return Err(Error::bug(format!("voxel {:?} has points and no tile", voxels.indices().nth(lost))));
        }
        Ok(Self { points, voxel, voxels, cluster, owned })
    }

    /// The cluster of a point.
    pub(super) fn cluster_of(&self, point: usize) -> u32 {
        self.cluster[self.voxel[point] as usize]
    }

    /// For each voxel, whether its cluster is `wanted` and a voxel within `steps` indices on every axis has a
    /// cluster that is a `partner` of it.
    pub(super) fn near(
        &self,
        steps: i32,
        wanted: impl Fn(u32) -> bool,
        partner: impl Fn(u32, u32) -> bool,
    ) -> Vec<bool> {
        let mut finder = self.voxels.finder();
        let heights = self.voxels.heights();
        let mut near = vec![false; self.voxels.len()];
        let mut around: Vec<Range<usize>> = Vec::new();
        for (column, &[i, j]) in self.voxels.cells().iter().enumerate() {
            let voxels = self.voxels.voxels(column);
            if !self.cluster[voxels.clone()].iter().any(|&cluster| wanted(cluster)) {
                continue;
            }
            around.clear();
            let cells = (-steps..=steps).flat_map(|di| (-steps..=steps).map(move |dj| [i + di, j + dj]));
            around.extend(cells.map(|cell| finder.column(cell)).filter(|range| !range.is_empty()));
            // Inside an object all columns around have the same cluster.
            let first = self.cluster[voxels.start];
            let uniform =
                |range: &Range<usize>| self.cluster[range.clone()].iter().all(|&other| other == first);
            if !partner(first, first) && around.iter().all(uniform) {
                continue;
            }
            for voxel in voxels.filter(|&voxel| wanted(self.cluster[voxel])) {
                let cluster = self.cluster[voxel];
                let k = heights[voxel];
                near[voxel] = around.iter().any(|range| {
                    let start =
                        range.start + heights[range.clone()].partition_point(|&other| other < k - steps);
                    (start..range.end)
                        .take_while(|&other| heights[other] <= k + steps)
                        .any(|other| partner(cluster, self.cluster[other]))
                });
            }
        }
        near
    }
}

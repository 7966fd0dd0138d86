//! The labelled points around a tile: which cluster each point is in, representatives of small cells, and nearest
//! neighbours. Searches only; what is done with them is not known here.
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "points of a tile fit u32 and local coordinates i32, see TileCloud and VoxelIndex"
)]

use super::columns::{Columns, Finder, Voxel, disc};
use super::peaks::{self, PeaksGlobal};
use super::voxelise::{self, global_indices};
use super::{NAME, STAGE_PEAKS};
use crate::cluster::{TilePoints, TileSource};
use crate::codec;
use crate::error::{Error, Result};
use crate::model::{TileCloud, VoxelIndex};

/// Edge of the cells of representatives in metres (chosen: the spacing of points near the scanner is a few
/// centimetres, and the pairs of two borders grow with the square of their points).
pub(super) const REPRESENTATIVE_M: f64 = 0.1;

/// Points around a tile with their voxels and clusters.
pub(super) struct Surroundings {
    pub(super) points: TilePoints,
    /// Voxel of each point, by position in `voxels`.
    pub(super) voxel: Vec<u32>,
    /// The voxels that hold any of the points.
    pub(super) voxels: Columns,
    /// Cluster of each voxel, from 1; 0 without one.
    pub(super) cluster: Vec<u32>,
    /// Voxels that the tile owns, by position in `voxels`.
    pub(super) owned: Vec<u32>,
}

impl Surroundings {
    /// Reads the points of objects within `reach` of a tile, and looks their clusters up.
    pub(super) fn load(tile: &dyn TileSource, edge: u32, reach: i64) -> Result<Self> {
        let points = tile.points(reach, true)?;
        let index = VoxelIndex::build(NAME, &points.cloud, edge)?;
        // Every voxel has a point, and so the same order and number as here.
        let indices = global_indices(&index, |_| true)?;
        let voxels = Columns::new(indices.iter().map(|entry| entry.0));
        let mut voxel = vec![0; points.cloud.len()];
        for (range, number) in index.streaks() {
            voxel[range].fill(number as u32);
        }
        drop(index);
        let global: PeaksGlobal = codec::decode(tile.global(STAGE_PEAKS))?;
        let mut cluster = vec![u32::MAX; voxels.len()];
        let mut owned = Vec::new();
        let mut finder = voxels.finder();
        // Points come by whole cells, and the owner of their voxel may be a cell further: at most two edges of each.
        for near in tile.near(reach + 2 * tile.cell_edge() + 2 * i64::from(edge)) {
            let payload = voxelise::load(tile, near)?;
            let mut ends = peaks::load(tile, near)?.ends.into_iter();
            let clusters = &global.ends[near as usize];
            for (cell, stored) in payload.columns {
                let range = finder.column(cell);
                let mut at = range.start;
                for (stored, end) in stored.iter().zip(&mut ends) {
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
            return Err(Error::Bug(format!("voxel {:?} has points and no tile", voxels.indices().nth(lost))));
        }
        Ok(Self { points, voxel, voxels, cluster, owned })
    }

    /// The cluster of a point.
    pub(super) fn cluster_of(&self, point: usize) -> u32 {
        self.cluster[self.voxel[point] as usize]
    }

    /// Voxels that are `wanted` and have one that is `partner`-like to them within `steps` indices on every axis.
    pub(super) fn near(
        &self,
        steps: i32,
        wanted: impl Fn(usize) -> bool,
        partner: impl Fn(usize, usize) -> bool,
    ) -> Vec<bool> {
        let mut finder = self.voxels.finder();
        let heights = self.voxels.heights();
        let mut near = vec![false; self.voxels.len()];
        for (column, &[i, j]) in self.voxels.cells().iter().enumerate() {
            if !self.voxels.voxels(column).any(&wanted) {
                continue;
            }
            let around: Vec<_> = (-steps..=steps)
                .flat_map(|di| (-steps..=steps).map(move |dj| [i + di, j + dj]))
                .map(|cell| finder.column(cell))
                .filter(|range| !range.is_empty())
                .collect();
            for voxel in self.voxels.voxels(column).filter(|&voxel| wanted(voxel)) {
                let k = heights[voxel];
                near[voxel] = around.iter().any(|range| {
                    let start =
                        range.start + heights[range.clone()].partition_point(|&other| other < k - steps);
                    (start..range.end)
                        .take_while(|&other| heights[other] <= k + steps)
                        .any(|other| partner(voxel, other))
                });
            }
        }
        near
    }
}

/// The points of clusters, in cells of [`REPRESENTATIVE_M`].
pub(super) struct FineGrid {
    cloud: TileCloud,
    /// Position of each point among the surroundings.
    pub(super) source: Vec<u32>,
    index: VoxelIndex,
    cells: Columns,
    /// Lower bounds of the squared distance of the points of two columns, and the step between them.
    steps: Vec<(i64, [i32; 2])>,
    edge: i64,
    /// Squared distance up to which those steps find every point.
    certain: i64,
}

/// A neighbour: squared distance, id, position in the grid's cloud.
pub(super) type Neighbour = (i64, u64, u32);

impl FineGrid {
    /// The points of clusters of `around`; [`Self::nearest`] will be asked for distances of up to `search` lattice
    /// units.
    pub(super) fn new(around: &Surroundings, search: i64) -> Result<Self> {
        let all = &around.points.cloud;
        let source: Vec<u32> =
            (0..all.len()).filter(|&point| around.cluster_of(point) != 0).map(|point| point as u32).collect();
        let pick = |column: &[i32]| source.iter().map(|&point| column[point as usize]).collect();
        let cloud = TileCloud {
            lattice: all.lattice,
            origin: all.origin,
            x: pick(&all.x),
            y: pick(&all.y),
            z: pick(&all.z),
            id: source.iter().map(|&point| all.id[point as usize]).collect(),
            fields: Vec::new(),
        };
        let edge = all.lattice.units(REPRESENTATIVE_M);
        let index = VoxelIndex::build(NAME, &cloud, edge as u32)?;
        let cells = Columns::new(global_indices(&index, |_| true)?.into_iter().map(|entry| entry.0));
        let search = (search + edge - 1) / edge;
        let gap = |d: i32| if d == 0 { 0 } else { (i64::from(d.abs()) - 1) * edge + 1 };
        let mut steps: Vec<(i64, [i32; 2])> = disc(2 * search.pow(2))
            .into_iter()
            .filter(|(_, step)| step.iter().all(|d| i64::from(d.abs()) <= search))
            .map(|(_, [di, dj])| (gap(di).pow(2) + gap(dj).pow(2), [di, dj]))
            .collect();
        steps.sort_unstable();
        Ok(Self { cloud, source, index, cells, steps, edge, certain: (search * edge).pow(2) })
    }

    /// Place of a point of the grid relative to a lattice place.
    pub(super) fn relative(&self, point: u32, to: [i64; 3]) -> [i64; 3] {
        let place = self.cloud.lattice_point(point as usize);
        [0, 1, 2].map(|axis| place[axis] - to[axis])
    }

    pub(super) fn finder(&self) -> Finder<'_> {
        self.cells.finder()
    }

    /// Edge of a cell in lattice units.
    pub(super) fn edge(&self) -> i64 {
        self.edge
    }

    /// Cell of a lattice place.
    pub(super) fn cell_of(&self, place: [i64; 3]) -> Voxel {
        place.map(|value| value.div_euclid(self.edge) as i32)
    }

    /// The points of a cell.
    fn members(&self, cell: usize) -> impl Iterator<Item = u32> + '_ {
        self.index.voxel_points(cell).flatten().map(|point| point as u32)
    }

    /// The smallest id of each cell and cluster, as positions among the surroundings, cell by cell.
    pub(super) fn representatives(&self, around: &Surroundings) -> Vec<(Voxel, u32)> {
        let mut representatives = Vec::new();
        let mut of_cell: Vec<(u32, u64, u32)> = Vec::new();
        for (cell, at) in self.cells.indices().enumerate() {
            of_cell.clear();
            of_cell.extend(self.members(cell).map(|point| {
                let source = self.source[point as usize];
                (around.cluster_of(source as usize), self.cloud.id[point as usize], source)
            }));
            of_cell.sort_unstable();
            of_cell.dedup_by_key(|entry| entry.0);
            representatives.extend(of_cell.iter().map(|entry| (at, entry.2)));
        }
        representatives
    }

    /// The `most` nearest points to a lattice place at a squared distance of at most `limit`, sorted by distance and
    /// id.
    pub(super) fn nearest(
        &self,
        finder: &mut Finder<'_>,
        place: [i64; 3],
        most: usize,
        limit: i64,
        found: &mut Vec<Neighbour>,
    ) {
        found.clear();
        let [i, j, k] = self.cell_of(place);
        let mut worst = limit.min(self.certain);
        for &(bound, [di, dj]) in &self.steps {
            if bound > worst {
                break;
            }
            let range = finder.column([i + di, j + dj]);
            if range.is_empty() {
                continue;
            }
            let up = ((worst - bound).isqrt() / self.edge + 1) as i32;
            let heights = self.cells.heights();
            let start = range.start + heights[range.clone()].partition_point(|&other| other < k - up);
            for cell in (start..range.end).take_while(|&cell| heights[cell] <= k + up) {
                for point in self.members(cell) {
                    let [x, y, z] = self.relative(point, place);
                    let candidate = (x * x + y * y + z * z, self.cloud.id[point as usize], point);
                    if candidate.0 > worst
                        || (found.len() == most && found.last().is_some_and(|last| candidate >= *last))
                    {
                        continue;
                    }
                    if found.len() == most {
                        found.pop();
                    }
                    let at = found.partition_point(|other| *other < candidate);
                    found.insert(at, candidate);
                    if found.len() == most {
                        worst = worst.min(found.last().map_or(worst, |last| last.0));
                    }
                }
            }
        }
    }

    /// The same from all points, without any limit but `limit`.
    pub(super) fn nearest_of_all(&self, place: [i64; 3], most: usize, limit: i64) -> Vec<Neighbour> {
        let distance = |point: u32| self.relative(point, place).iter().map(|d| d * d).sum::<i64>();
        let mut all: Vec<Neighbour> = (0..self.cloud.len() as u32)
            .map(|point| (distance(point), self.cloud.id[point as usize], point))
            .filter(|neighbour| neighbour.0 <= limit)
            .collect();
        all.sort_unstable();
        all.truncate(most);
        all
    }
}

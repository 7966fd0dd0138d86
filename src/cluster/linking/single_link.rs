//! Single-link clusters of the points of a tile: two points are joined if they are within a distance d.
//!
//! The search works on cells, not breadth first over a kd-tree. The side s of a cell is the largest (in
//! lattice units) that has 3 (s - 1)^2 <= d^2. So points of one cell are within d of each other by
//! construction. Cells are the nodes, and two cells are joined if some pair of their points is within d.
//! Nearest cells come first, and cells that are already united are skipped, so most pairs of cells are never
//! compared. Distances are compared as squares of lattice units in i64, which is exact for any d.
//!
//! Cost: O(points + 62 cells) plus the points of neighbouring cells that are *not* of one cluster (see
//! `closeness`). Memory: 12 bytes per point, 12 per streak of consecutive points in a cell and 24 more during
//! sorting, 68 per cell. If points are far apart, every point is a streak and a cell: 92 bytes at worst. The
//! bench is `benches/kernels.rs`.

use super::closeness::{Bounds, Point, any_within};
use super::numbering::number_sets;
use crate::model::{AlgorithmError, PointId, TileCloud};
use crate::spatial::{DisjointSets, Linker, VoxelIndex};

/// Labels the points with their single-link cluster at a distance of `reach` lattice units, inclusive.
/// Returns the number of clusters.
pub(crate) fn single_link(
    method: &'static str,
    cloud: &TileCloud,
    reach: i64,
    labels: &mut [u32],
) -> Result<u32, AlgorithmError> {
    let index = VoxelIndex::build(method, cloud, cell_side(reach))?;
    let cells = Cells::gather(&index, cloud);
    let touch = |a: u32, b: u32| cells.touch(a as usize, b as usize, reach.pow(2));
    let mut sets = link_cells(&index, reach, touch);
    let (cell_labels, clusters) = number_by_smallest_id(&index, cloud, &mut sets);
    for (points, cell) in index.streaks() {
        labels[points].fill(cell_labels[cell]);
    }
    Ok(clusters)
}

/// Sets of cells. Two cells are united if they can contain points within `reach` of each other and `touch`
/// accepts them.
pub(crate) fn link_cells(
    index: &VoxelIndex,
    reach: i64,
    touch: impl Fn(u32, u32) -> bool + Copy,
) -> DisjointSets {
    let mut linker = Linker::new(index);
    for layer in layers(reach) {
        for step in layer {
            if step.offset == [0, 0] {
                linker.link_column(step.dk, touch);
            } else {
                linker.link_beside(step.offset, &step.dk, touch);
            }
        }
        linker.find_spans();
    }
    linker.into_sets()
}

/// The largest side s of a cell, in lattice units, with 3 (s - 1)^2 <= reach^2. The coordinates of points of
/// one cell differ by s - 1 at most on each axis.
pub(crate) fn cell_side(reach: i64) -> u32 {
    u32::try_from((reach.pow(2) / 3).isqrt() + 1).unwrap_or(u32::MAX)
}

/// Cells at one column offset, with the range of vertical offsets.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct LayerStep {
    pub(crate) offset: [i64; 2],
    pub(crate) dk: std::ops::RangeInclusive<i64>,
}

/// Half of the neighbours of a cell that can contain a point within `reach` of one of its points. For the
/// other half, the cell is among the neighbours here. The order is: its own column, then touching columns,
/// then columns further out. A cell further than 2 away on an axis is beyond reach, because its gap is more
/// than 2 s, and s > reach / sqrt(3).
pub(crate) fn layers(reach: i64) -> [Vec<LayerStep>; 3] {
    let side = i64::from(cell_side(reach));
    let gap_squared = |d: i64| if d == 0 { 0 } else { ((d.abs() - 1) * side + 1).pow(2) };
    let mut layers = [const { Vec::new() }; 3];
    for di in 0..=2_i64 {
        for dj in -2..=2_i64 {
            let in_reach = |dk: &i64| gap_squared(di) + gap_squared(dj) + gap_squared(*dk) <= reach.pow(2);
            let Some(outermost) = (0..=2).rev().find(in_reach).filter(|_| [di, dj] >= [0, 0]) else {
                continue;
            };
            let lowest = if [di, dj] == [0, 0] { 1 } else { -outermost };
            let layer = if di.max(dj.abs()) == 2 { 2 } else { usize::from([di, dj] != [0, 0]) };
            layers[layer].push(LayerStep { offset: [di, dj], dk: lowest..=outermost });
        }
    }
    layers
}

/// The coordinates of the points, cell by cell.
struct Cells {
    points: Vec<Point>,
    first: Vec<u32>,
    bounds: Vec<Bounds>,
}

impl Cells {
    fn gather(index: &VoxelIndex, cloud: &TileCloud) -> Self {
        let mut cells = Self {
            points: Vec::with_capacity(cloud.len()),
            first: Vec::with_capacity(index.len() + 1),
            bounds: Vec::with_capacity(index.len()),
        };
        for cell in 0..index.len() {
            let first = cells.points.len();
            for range in index.voxel_points(cell) {
                cells.points.extend(range.map(|point| [cloud.x[point], cloud.y[point], cloud.z[point]]));
            }
            cells.first.push(as_u32(first));
            cells.bounds.push(Bounds::of(&cells.points[first..]));
        }
        cells.first.push(as_u32(cloud.len()));
        cells
    }

    fn points(&self, cell: usize) -> (&[Point], &Bounds) {
        let range = self.first[cell] as usize..self.first[cell + 1] as usize;
        (&self.points[range], &self.bounds[cell])
    }

    /// Whether some points of the two cells are at a squared distance of at most `limit`.
    fn touch(&self, a: usize, b: usize, limit: i64) -> bool {
        any_within(self.points(a), self.points(b), limit)
    }
}

/// The label of every cell, and the number of labels.
fn number_by_smallest_id(index: &VoxelIndex, cloud: &TileCloud, sets: &mut DisjointSets) -> (Vec<u32>, u32) {
    let roots: Vec<u32> = (0..as_u32(index.len())).map(|cell| sets.find(cell)).collect();
    let mut smallest = vec![PointId::BEYOND_ALL; index.len()];
    for (points, cell) in index.streaks() {
        let slot = &mut smallest[roots[cell] as usize];
        *slot = cloud.id[points].iter().fold(*slot, |smallest, &id| smallest.min(id));
    }
    let (label_of_root, count) = number_sets(smallest);
    (roots.into_iter().map(|root| label_of_root[root as usize]).collect(), count)
}

/// A count of cells or points; `VoxelIndex::build` has checked that they fit.
#[expect(
    clippy::cast_possible_truncation,
    reason = "at most as many cells as points, checked by VoxelIndex::build"
)]
fn as_u32(count: usize) -> u32 {
    count as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_is_as_large_as_it_may_be() {
        for reach in [1, 2, 3, 17, 150, 300, 301, 9_999] {
            let side = i64::from(cell_side(reach));
            assert!(3 * (side - 1).pow(2) <= reach.pow(2), "{reach}");
            assert!(3 * side.pow(2) > reach.pow(2), "{reach}");
        }
        assert_eq!(cell_side(300), 174);
    }

    #[test]
    fn layers_hold_every_neighbour_in_reach_once() {
        for reach in [1, 2, 3, 17, 300] {
            let side = i64::from(cell_side(reach));
            let mut steps: Vec<[i64; 3]> = layers(reach)
                .into_iter()
                .flatten()
                .flat_map(|LayerStep { offset: [di, dj], dk }| dk.map(move |dk| [di, dj, dk]))
                .collect();
            steps.sort_unstable();
            // The smallest distance between points of cells 0 and d on an axis, found by brute force.
            let gap = |d: i64| {
                (d * side..(d + 1) * side).flat_map(|q| [0, side - 1].map(|p| (q - p).abs())).min().unwrap()
            };
            let gap = |d: i64| if d == 0 { 0 } else { gap(d) };
            let mut expected = Vec::new();
            for di in -4..=4 {
                for dj in -4..=4 {
                    for dk in -4..=4 {
                        let squared = gap(di).pow(2) + gap(dj).pow(2) + gap(dk).pow(2);
                        if squared <= reach.pow(2) && [di, dj, dk] > [0, 0, 0] {
                            expected.push([di, dj, dk]);
                        }
                    }
                }
            }
            assert_eq!(steps, expected, "{reach}");
        }
    }
}

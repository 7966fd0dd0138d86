//! The kernel of the variant `core` of `dbscan`. It finds the core points, their connected components, and
//! the nearest core point of each border point. It knows no settings.
//!
//! Points of one cell are within epsilon of each other by construction (see `euclidean`). Therefore every
//! point of a cell with enough points is a core point, and the core points of a cell are connected. Only
//! cells with few points are compared point by point. This takes O(124 cells x `min_points`) comparisons per
//! point at worst. Distances are squares of lattice units in i64. Memory: 32 bytes per point in addition to
//! the index of `euclidean`.

use std::ops::Range;

use crate::cluster::linking::closeness::{Bounds, Point, any_within, squared_distance};
use crate::cluster::linking::numbering::number_sets;
use crate::cluster::linking::{LayerStep, cell_side, layers, link_cells};
use crate::model::{AlgorithmError, PointId, TileCloud};
use crate::spatial::VoxelIndex;

/// Labels the points with 1..=n and returns n. The label is 0 for noise, and for border points that the tile
/// does not own (`own` is false).
pub(super) fn cluster(
    method: &'static str,
    cloud: &TileCloud,
    own: &[bool],
    reach: i64,
    min_points: u32,
    labels: &mut [u32],
) -> Result<u32, AlgorithmError> {
    let index = VoxelIndex::build(method, cloud, cell_side(reach))?;
    let limit = reach.pow(2);
    let mut cells = Cells::gather(&index, cloud);
    let counts = cells.count_neighbours(&index, reach, min_points);
    cells.put_core_points_first(&counts, min_points);
    let mut sets = link_cells(&index, reach, |a, b| cells.touch(a as usize, b as usize, limit));
    let roots: Vec<usize> = (0..index.len()).map(|cell| sets.find(as_u32(cell)) as usize).collect();
    let (label_of_root, clusters) = cells.number(&roots, cloud);
    labels.fill(0);
    for cell in 0..index.len() {
        for at in cells.core(cell) {
            labels[cells.order[at] as usize] = label_of_root[roots[cell]];
        }
    }
    cells.label_border(&index, reach, own, |cell| label_of_root[roots[cell]], labels);
    Ok(clusters)
}

/// The points in the order of their cells. Once the core points are known, they come first in each cell.
struct Cells {
    points: Vec<Point>,
    /// Index in the cloud of each point.
    order: Vec<u32>,
    /// First point of each cell, and the end.
    first: Vec<usize>,
    /// End of the core points of each cell.
    core_end: Vec<usize>,
    /// Bounding box of each cell: of all its points at first, later of its core points only.
    bounds: Vec<Bounds>,
}

impl Cells {
    fn gather(index: &VoxelIndex, cloud: &TileCloud) -> Self {
        let mut order = Vec::with_capacity(cloud.len());
        let mut first = Vec::with_capacity(index.len() + 1);
        for cell in 0..index.len() {
            first.push(order.len());
            index.voxel_points(cell).for_each(|points| order.extend(points.map(as_u32)));
        }
        first.push(order.len());
        let point = |&at: &u32| [cloud.x[at as usize], cloud.y[at as usize], cloud.z[at as usize]];
        let points: Vec<Point> = order.iter().map(point).collect();
        let bounds = first.windows(2).map(|ends| Bounds::of(&points[ends[0]..ends[1]])).collect();
        Self { points, order, core_end: first[..index.len()].to_vec(), first, bounds }
    }

    fn all(&self, cell: usize) -> Range<usize> {
        self.first[cell]..self.first[cell + 1]
    }

    fn core(&self, cell: usize) -> Range<usize> {
        self.first[cell]..self.core_end[cell]
    }

    /// Number of points within `reach` of each point, the point itself included. Counting stops at `enough`.
    fn count_neighbours(&self, index: &VoxelIndex, reach: i64, enough: u32) -> Vec<u32> {
        let mut counts = vec![0; self.points.len()];
        for cell in 0..index.len() {
            let all = self.all(cell);
            counts[all.clone()].fill(as_u32(all.len()));
        }
        let mut add = |cell: usize, other: usize| {
            for (count, at) in counts[self.all(cell)].iter_mut().zip(self.all(cell)) {
                if *count < enough {
                    *count += self.count_near(&self.points[at], other, reach.pow(2), enough - *count);
                }
            }
        };
        each_pair(index, reach, |a, b| {
            add(a, b);
            add(b, a);
        });
        counts
    }

    /// Number of points of a cell within `limit` (squared) of a point. Counting stops at `enough`.
    fn count_near(&self, point: &Point, cell: usize, limit: i64, enough: u32) -> u32 {
        let bounds = &self.bounds[cell];
        if bounds.nearest_to(point) > limit {
            return 0;
        }
        let others = &self.points[self.all(cell)];
        if bounds.farthest_from(point) <= limit {
            return as_u32(others.len());
        }
        let near = others.iter().filter(|other| squared_distance(point, other) <= limit);
        as_u32(near.take(enough as usize).count())
    }

    /// Moves the core points of every cell to its front, and computes the bounding box of the core points.
    fn put_core_points_first(&mut self, counts: &[u32], enough: u32) {
        for cell in 0..self.core_end.len() {
            let mut end = self.first[cell];
            for at in self.all(cell) {
                if counts[at] >= enough {
                    // Points between the front and this one have been visited, so their counts are no longer
                    // needed.
                    self.points.swap(at, end);
                    self.order.swap(at, end);
                    end += 1;
                }
            }
            self.core_end[cell] = end;
            self.bounds[cell] = Bounds::of(&self.points[self.first[cell]..end]);
        }
    }

    /// Whether core points of two cells are within `limit` (squared) of each other.
    fn touch(&self, a: usize, b: usize, limit: i64) -> bool {
        let one = self.core(a);
        let other = self.core(b);
        !one.is_empty()
            && !other.is_empty()
            && any_within((&self.points[one], &self.bounds[a]), (&self.points[other], &self.bounds[b]), limit)
    }

    /// Labels of the sets with core points, and the number of these sets. Labels follow the smallest point id
    /// of a set.
    fn number(&self, roots: &[usize], cloud: &TileCloud) -> (Vec<u32>, u32) {
        let mut smallest = vec![PointId::BEYOND_ALL; roots.len()];
        for (cell, &root) in roots.iter().enumerate() {
            for at in self.core(cell) {
                smallest[root] = smallest[root].min(cloud.id[self.order[at] as usize]);
            }
        }
        number_sets(smallest)
    }

    /// Gives border points that the tile owns the label of their nearest core point; ties go to the first by
    /// x, then y, then z. Core points in one place have one label.
    fn label_border(
        &self,
        index: &VoxelIndex,
        reach: i64,
        own: &[bool],
        label: impl Fn(usize) -> u32,
        labels: &mut [u32],
    ) {
        let limit = reach.pow(2);
        // Squared distance and place of the nearest core point so far, for points that are not core points.
        let mut nearest = vec![(limit, [i32::MAX; 3]); self.points.len()];
        let mut look = |cell: usize, other: usize| {
            if self.core(other).is_empty() {
                return;
            }
            for at in self.core_end[cell]..self.first[cell + 1] {
                let point = &self.points[at];
                if !own[self.order[at] as usize] || self.bounds[other].nearest_to(point) > nearest[at].0 {
                    continue;
                }
                for core in self.core(other) {
                    let squared = squared_distance(point, &self.points[core]);
                    let candidate = (squared, self.points[core]);
                    if candidate < nearest[at] {
                        nearest[at] = candidate;
                        labels[self.order[at] as usize] = label(other);
                    }
                }
            }
        };
        (0..index.len()).for_each(|cell| look(cell, cell));
        each_pair(index, reach, |a, b| {
            look(a, b);
            look(b, a);
        });
    }
}

/// Visits every pair of cells that can contain points within `reach` of each other, once. Near pairs come
/// first.
fn each_pair(index: &VoxelIndex, reach: i64, mut visit: impl FnMut(usize, usize)) {
    for LayerStep { offset, dk } in layers(reach).into_iter().flatten() {
        let heights = index.heights();
        let k = |cell: usize| i64::from(heights[cell]);
        let mut columns = |column: usize, other: usize| {
            let others = index.column_voxels(other);
            let mut start = others.start;
            for cell in index.column_voxels(column) {
                while start < others.end && k(start) < k(cell) + dk.start() {
                    start += 1;
                }
                let reachable = (start..others.end).take_while(|&other| k(other) <= k(cell) + dk.end());
                reachable.for_each(|other| visit(cell, other));
            }
        };
        if offset == [0, 0] {
            (0..index.columns().len()).for_each(|column| columns(column, column));
        } else {
            index.column_pairs(offset, columns);
        }
    }
}

/// A count of points or cells; `VoxelIndex::build` has checked that they fit.
#[expect(clippy::cast_possible_truncation, reason = "checked by VoxelIndex::build")]
fn as_u32(count: usize) -> u32 {
    count as u32
}

//! The axis of a drive without a clock: the principal axis of its occupied cells, which is straight.

use std::collections::BTreeSet;

use nalgebra::{Matrix2, SymmetricEigen, Vector2};

use super::axis::{Axis, AxisSource, LONGEST_AXIS_M, VERTEX_SPACING_M, resample};
use super::runs::distance;
use crate::model::Lattice;
use crate::spatial::{Cell, CellGrid, PackedCells};

/// Length of the blocks of a straight axis, in metres. A block far from all points has no vertices. Chosen: a
/// multiple of the width of any street, so that the axis of a usual drive has vertices everywhere.
const BLOCK_M: f64 = 1_000.0;

impl Axis {
    /// The principal axis of the occupied cells. All cells have the same weight, so that dense spots do not
    /// rotate it.
    #[must_use]
    pub fn principal(cells: &PackedCells, grid: CellGrid, lattice: Lattice) -> Self {
        let edge_m = lattice.metres(grid.edge());
        let centre = |cell: Cell| Vector2::new(f64::from(cell[0]) + 0.5, f64::from(cell[1]) + 0.5) * edge_m;
        Self::straight(|| cells.iter().map(|(cell, _)| centre(cell)))
    }

    /// The principal axis of places in metres. Chainage 0 is at the first place along the axis.
    #[must_use]
    pub fn principal_of(places: &[[f64; 2]]) -> Self {
        Self::straight(|| places.iter().map(|place| Vector2::from(*place)))
    }

    fn straight<I: Iterator<Item = Vector2<f64>>>(places: impl Fn() -> I) -> Self {
        let share = 1.0 / places().count().max(1) as f64;
        let mean = places().sum::<Vector2<f64>>() * share;
        let mut covariance = Matrix2::zeros();
        for place in places() {
            let arm = place - mean;
            covariance += arm * arm.transpose();
        }
        let eigen = SymmetricEigen::new(covariance);
        let mut direction = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
        // Chainage grows to the east, or to the north if the axis runs north-south.
        if direction.x < -1e-9 || (direction.x.abs() <= 1e-9 && direction.y < 0.0) {
            direction = -direction;
        }
        let along = |place: Vector2<f64>| (place - mean).dot(&direction);
        let first = places().map(along).fold(0.0, f64::min);
        let last = places().map(along).fold(0.0, f64::max);
        let place = |at: f64| [mean.x + direction.x * at, mean.y + direction.y * at];
        let blocks: BTreeSet<i64> = places().map(|place| block(along(place))).collect();
        let sampled = near_blocks([place(first), place(last + VERTEX_SPACING_M)], first, &blocks);
        let vertices = sampled.unwrap_or_else(|| {
            let limit = LONGEST_AXIS_M / 2.0;
            let ends = [place(first.max(-limit)), place(last.min(limit) + VERTEX_SPACING_M)];
            resample(&ends).unwrap_or_else(|| ends.to_vec())
        });
        let chainage = (0..vertices.len()).map(|k| distance(vertices[0], vertices[k])).collect();
        let joined = vec![true; vertices.len()];
        Self::assemble(AxisSource::Principal, vertices, chainage, joined)
    }
}

/// The block of a straight axis that contains the distance `along` it, in metres.
fn block(along: f64) -> i64 {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "cells are at most 10 m long, and their numbers are i32"
    )]
    let block = (along / BLOCK_M).floor() as i64;
    block
}

/// The vertices that [`resample`] gives between two ends, but only in these blocks and their neighbours. A
/// straight axis needs no vertices in an empty stretch; between two files far apart there would be millions
/// of them. `first` is the distance along the axis at which it begins. `None` if there are too many.
fn near_blocks(ends: [[f64; 2]; 2], first: f64, blocks: &BTreeSet<i64>) -> Option<Vec<[f64; 2]>> {
    let length = distance(ends[0], ends[1]);
    let steps = (length / VERTEX_SPACING_M).floor() + 1.0;
    let step_at = |block: i64| ((block as f64 * BLOCK_M - first) / VERTEX_SPACING_M).ceil().clamp(0.0, steps);
    let mut taken = i64::MIN;
    let mut ranges: Vec<(f64, f64)> = Vec::new();
    for &block in blocks {
        let range = (step_at(taken.max(block - 1)), step_at(block + 2));
        taken = block + 2;
        ranges.push(range);
    }
    if ranges.iter().map(|(from, to)| to - from).sum::<f64>() * VERTEX_SPACING_M > LONGEST_AXIS_M {
        return None;
    }
    let mut vertices = Vec::new();
    for (from, to) in ranges {
        let mut step = from;
        while step < to {
            let share = step * VERTEX_SPACING_M / length;
            vertices.push([0, 1].map(|k| ends[0][k] + share * (ends[1][k] - ends[0][k])));
            step += 1.0;
        }
    }
    if vertices.last().is_none_or(|last| distance(*last, ends[1]) > 0.0) {
        vertices.push(ends[1]);
    }
    Some(vertices)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spatial::CellMap;

    fn principal(cells: Vec<(Cell, u32)>) -> Axis {
        let mut map = CellMap::default();
        cells.iter().for_each(|(cell, points)| *map.entry(*cell) = *points);
        Axis::principal(&PackedCells::from(map), CellGrid::new(1_000), Lattice::MILLIMETRE)
    }

    #[test]
    fn the_principal_axis_runs_along_the_cells() {
        let axis = principal((0..100).flat_map(|i| [([i, 2 * i], 1), ([i, 2 * i + 1], 9)]).collect());
        assert!((axis.length_m() - 224.0).abs() < 3.0, "{}", axis.length_m());
        assert!(axis.nearest([1.0, 1.0]) < axis.nearest([90.0, 180.0]));
        let one = principal(vec![([5, 5], 1)]);
        assert!(one.length_m() <= 2.0);
        // The axis has vertices everywhere, because the gap of 1.9 km is shorter than the blocks and their
        // neighbours.
        let gap =
            principal((0..2_000).filter(|i| !(50..1_950).contains(i)).map(|i| ([i, i / 3], 1)).collect());
        let ends = [gap.vertices()[0], gap.vertices()[gap.vertices().len() - 1]];
        assert_eq!(gap.vertices(), resample(&ends).unwrap());
    }

    #[test]
    fn chainage_begins_at_the_first_place_and_grows_to_the_east() {
        let places = [[30.0, -43.0], [0.0, -3.0], [15.0, -23.0]];
        let axis = Axis::principal_of(&places);
        for (place, expected) in [([0.0, -3.0], 0.0), ([15.0, -23.0], 25.0), ([30.0, -43.0], 50.0)] {
            assert!((axis.locate(place).0 - expected).abs() < 1e-9, "{place:?}");
        }
        assert!(Axis::principal_of(&[[7.0, 7.0]]).locate([7.0, 7.0]).0.abs() < 1e-9);
        assert!(Axis::principal_of(&[]).locate([1.0, 0.0]).0.is_finite());
    }

    #[test]
    fn a_straight_axis_has_no_vertices_in_an_empty_stretch() {
        let far = 6_000_000;
        let cells = [0, far].into_iter().flat_map(|start| (0..300).map(move |i| ([start + i, i % 7], 1)));
        let axis = principal(cells.collect());
        assert!(axis.vertices().len() < 6_000, "{}", axis.vertices().len());
        assert_eq!(axis.stretches().count(), 1);
        assert!((axis.length_m() - 6_000_300.0).abs() < 2.0, "{}", axis.length_m());
        for x in [0.5, 150.0, 299.5, 6_000_000.5, 6_000_299.5] {
            let (chainage, offset) = axis.locate([x, 3.0]);
            assert!((chainage - x).abs() < 1.0 && offset.abs() < 7.0, "{x}: {chainage} {offset}");
            let vertex = axis.vertices()[axis.nearest([x, 3.0])];
            assert!((vertex[0] - x).abs() <= 1.0, "{x}: {vertex:?}");
        }
    }
}

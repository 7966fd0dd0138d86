//! Objects that touch each other: points of both lie in neighbouring voxels.

use std::collections::BTreeSet;

use rustc_hash::FxHashSet;

use crate::model::{Lattice, TileCloud, VoxelGrid};

/// Edge of the voxels in metres. Objects up to 0.1 m apart touch; objects 0.35 m apart (twice the diagonal of
/// a voxel) do not.
const EDGE_M: f64 = 0.1;
/// Edge of the blocks that are compared first, in voxels. Blocks of 2, 4 and 8 take the same time.
const BLOCK: u32 = 4;

/// Indices of a voxel or a block along x, y and z, from 1.
type Voxel = [u32; 3];

/// Largest distance from a tile of points that decide which objects its objects touch, in lattice units.
#[must_use]
pub fn reach(lattice: Lattice) -> i64 {
    2 * edge(lattice)
}

fn edge(lattice: Lattice) -> i64 {
    lattice.units(EDGE_M).max(1)
}

/// The pairs of objects, the smaller number first, with points in the same voxel or in two voxels that share
/// at least a corner. `objects` has the object of each point, 0 for none. Voxels are the same in every tile.
///
/// Most points are far from other objects. So blocks of voxels are compared first, and only blocks that
/// contain or adjoin another object are compared voxel by voxel.
#[must_use]
pub fn touching(cloud: &TileCloud, objects: &[u32]) -> BTreeSet<(u32, u32)> {
    let blocks = cells(cloud, objects, BLOCK, |_| true);
    let mut near = FxHashSet::default();
    for_neighbours(&blocks, |one, other| {
        if one.1 != other.1 {
            near.extend([*one, *other]);
        }
    });
    let voxels = cells(cloud, objects, 1, |(voxel, object)| {
        near.contains(&(voxel.map(|index| (index - 1) / BLOCK + 1), object))
    });
    let mut pairs = BTreeSet::new();
    for_neighbours(&voxels, |&(_, a), &(_, b)| {
        if a != b {
            pairs.insert((a.min(b), a.max(b)));
        }
    });
    pairs
}

/// The cells of `voxels` voxels along each axis that have points, each with an object in it, sorted. Indices
/// begin at 1, so that a neighbour is never below 0. `counts` says which cells of an object count.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "edges are 100 or 1,000 units")]
fn cells(
    cloud: &TileCloud,
    objects: &[u32],
    voxels: u32,
    counts: impl Fn((Voxel, u32)) -> bool,
) -> Vec<(Voxel, u32)> {
    let grid = VoxelGrid::new(cloud.origin, edge(cloud.lattice) as u32);
    let mut cells: Vec<(Voxel, u32)> = Vec::new();
    // Consecutive points are mostly in one cell.
    let mut last = None;
    for (point, &object) in objects.iter().enumerate().filter(|(_, object)| **object != 0) {
        let index = |axis: usize, local: i32| grid.index(axis, local) / voxels + 1;
        let cell = ([index(0, cloud.x[point]), index(1, cloud.y[point]), index(2, cloud.z[point])], object);
        if last.replace(cell) != Some(cell) && counts(cell) {
            cells.push(cell);
        }
    }
    cells.sort_unstable();
    cells.dedup();
    cells
}

/// Calls `see` for every pair of entries in one cell or in neighbouring ones. Sorted cells that are shifted
/// by a fixed step stay sorted, so each step needs one walk along both lists.
fn for_neighbours(cells: &[(Voxel, u32)], mut see: impl FnMut(&(Voxel, u32), &(Voxel, u32))) {
    for step in 0..27_u32 {
        let by = [step / 9, step / 3 % 3, step % 3];
        // Half of the neighbours, and the cell itself.
        if by < [1, 1, 1] {
            continue;
        }
        let mut first = 0;
        for one in cells {
            let wanted = [0, 1, 2].map(|k| one.0[k] + by[k] - 1);
            while first < cells.len() && cells[first].0 < wanted {
                first += 1;
            }
            for other in cells[first..].iter().take_while(|(cell, _)| *cell == wanted) {
                see(one, other);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn neighbours_touch_and_others_do_not() {
        let points = [[0, 0, 0], [190, 0, 0], [50, 50, 250], [1_000, 0, 0], [1_050, 0, 0], [1_060, 0, 0]];
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, &points);
        // The last point belongs to no object.
        let found = touching(&cloud, &[1, 2, 3, 4, 4, 0]);
        assert_eq!(found.into_iter().collect::<Vec<_>>(), [(1, 2)]);
    }

    proptest! {
        #[test]
        fn pairs_are_those_of_all_pairs_of_points(
            points in prop::collection::vec(([-400..400_i64, -400..400_i64, -400..400_i64], 0..5_u32), 1..60),
        ) {
            let places: Vec<[i64; 3]> = points.iter().map(|(place, _)| *place).collect();
            let objects: Vec<u32> = points.iter().map(|(_, object)| *object).collect();
            let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, &places);
            let mut expected = BTreeSet::new();
            for (p, a) in &points {
                for (q, b) in points.iter().filter(|(_, b)| *a != 0 && a < b) {
                    if (0..3).all(|k| (p[k].div_euclid(100) - q[k].div_euclid(100)).abs() <= 1) {
                        expected.insert((*a, *b));
                    }
                }
            }
            prop_assert_eq!(touching(&cloud, &objects), expected);
        }
    }
}

//! The thickness of the surface of an object. It distinguishes hedges and bushes from fences, walls and guard
//! rails, which have the same class.
//!
//! In a cube of a metre, the points of a fence lie near a plane or a line, but the points of leaves do not.
//! The least standard deviation of the points of an object in a cube, in any direction, is its thickness
//! there. Cubes lie on the global lattice. The sums of an object are integer sums over voxels, so the sums of
//! all tiles add up.
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a thickness is at most a cube wide"
)]

use std::collections::BTreeMap;

use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

use super::stage_leftovers::Whole;
use crate::cluster::eigen::eigen;
use crate::cluster::street::settings::edge;
use crate::model::{Hedge, Lattice};

/// Edge of a cube in voxels: 1.05 m. In cubes of 0.45 and 0.75 m, hedges and fences differ less, because the
/// leaves that a scanner sees are a surface too (`benches/results/street.md`, "Hedges").
const CUBE: i32 = 7;
/// Smallest number of voxels of an object in a cube that counts.
const LEAST: u32 = 6;
/// Smallest thickness of a hedge or bush, averaged over its points, in metres.
const LEAVES_M: f64 = 0.045;
/// Largest height of low vegetation above ground, in metres.
const LOW_M: f64 = 0.5;

/// Moments of the points of an object in a cube, in lattice units from its corner. All points of a voxel
/// count at their mean position.
#[derive(Debug, Default)]
struct Cube {
    voxels: u32,
    points: i128,
    sums: [i128; 3],
    /// Sums of x x, x y, x z, y y, y z and z z.
    products: [i128; 6],
}

impl Cube {
    fn add(&mut self, points: u32, place: [i64; 3]) {
        let (points, [x, y, z]) = (i128::from(points), place.map(i128::from));
        self.voxels += 1;
        self.points += points;
        for (sum, value) in self.sums.iter_mut().zip([x, y, z]) {
            *sum += points * value;
        }
        for (sum, product) in self.products.iter_mut().zip([x * x, x * y, x * z, y * y, y * z, z * z]) {
            *sum += points * product;
        }
    }

    /// The least standard deviation in any direction, in whole lattice units; `None` if there are too few
    /// voxels.
    fn thickness(&self) -> Option<u64> {
        if self.voxels < LEAST {
            return None;
        }
        let [x, y, z] = self.sums;
        let [xx, xy, xz, yy, yz, zz] = self.products;
        let moments = [(xx, x, x), (xy, x, y), (xz, x, z), (yy, y, y), (yz, y, z), (zz, z, z)];
        // Exact up to the division.
        let count = self.points as f64 * self.points as f64;
        let matrix = moments.map(|(sum, one, other)| (self.points * sum - one * other) as f64 / count);
        let [_, _, (least, _)] = eigen(matrix);
        Some(least.max(0.0).sqrt().round() as u64)
    }
}

/// For each voxel, the thickness of its object in its cube, in lattice units. `None` for voxels without an
/// object, and if the object has too few voxels in the cube. Labels must be right for all voxels of a cube
/// with an owned voxel.
pub(crate) fn thickness(whole: &Whole) -> Vec<Option<u64>> {
    let voxels = &whole.grown.cored.around.voxels;
    let corner = i64::from(edge(voxels.lattice)) * i64::from(CUBE);
    // Consecutive voxels are mostly in the same cube.
    let mut numbers = FxHashMap::<_, usize>::default();
    let mut cubes: Vec<Cube> = Vec::new();
    let mut last = None;
    let mut place = vec![usize::MAX; voxels.len()];
    for (voxel, &label) in whole.grown.label.iter().enumerate().filter(|(_, label)| **label != 0) {
        let key = (label, voxels.key[voxel].map(|value| value.div_euclid(CUBE)));
        let number = match last {
            Some((other, number)) if other == key => number,
            _ => *numbers.entry(key).or_insert(cubes.len()),
        };
        last = Some((key, number));
        if number == cubes.len() {
            cubes.push(Cube::default());
        }
        let [x, y, z] = voxels.centre[voxel];
        let [i, j, k] = key.1.map(|value| i64::from(value) * corner);
        cubes[number].add(voxels.points[voxel], [x - i, y - j, z - k]);
        place[voxel] = number;
    }
    let thick: Vec<Option<u64>> = cubes.iter().map(Cube::thickness).collect();
    place.into_iter().map(|number| thick.get(number).copied().flatten()).collect()
}

/// Sums over the voxels of an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(crate) struct Leaves {
    /// Points of the voxels whose thickness is known, and the sum of the thickness over these points.
    points: u64,
    thickness: u64,
    /// Greatest height of a voxel above ground, in lattice units.
    highest: i32,
}

impl Leaves {
    /// Adds the voxels of another part of the object.
    pub(crate) fn merge(&mut self, other: &Self) {
        self.points += other.points;
        self.thickness += other.thickness;
        self.highest = self.highest.max(other.highest);
    }

    /// Whether the object is a hedge or bush, if it has their class.
    pub(crate) fn hedge(&self, lattice: Lattice) -> Hedge {
        let metre = lattice.units(1.0) as f64;
        if self.points == 0 || (self.thickness as f64) < LEAVES_M * metre * self.points as f64 {
            return Hedge::No;
        }
        if f64::from(self.highest) <= LOW_M * metre { Hedge::Low } else { Hedge::Medium }
    }
}

/// The sums of each object over the voxels that the tile owns, from the thickness of the voxels.
pub(crate) fn find(whole: &Whole, thickness: &[Option<u64>]) -> BTreeMap<u32, Leaves> {
    let around = &whole.grown.cored.around;
    let mut found = BTreeMap::<u32, Leaves>::new();
    for (voxel, &label) in whole.grown.label.iter().enumerate() {
        if label == 0 || !around.voxels.owned[voxel] {
            continue;
        }
        let leaves = found.entry(label).or_default();
        leaves.highest = leaves.highest.max(around.height[voxel]);
        if let Some(thickness) = thickness[voxel] {
            let points = u64::from(around.voxels.points[voxel]);
            leaves.points += points;
            leaves.thickness += points * thickness;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::street::shares::FENCE;

    fn hedges(whole: &Whole) -> BTreeMap<u32, Hedge> {
        let found = find(whole, &thickness(whole));
        found.into_iter().map(|(label, leaves)| (label, leaves.hedge(Lattice::MILLIMETRE))).collect()
    }

    #[test]
    fn what_is_thick_is_a_hedge_and_what_is_thin_or_small_is_none() {
        let blocks = [
            ([0, 0, 2], [60, 1, 15], Hedge::No),
            ([0, 20, 2], [60, 8, 15], Hedge::Medium),
            ([0, 40, 1], [60, 8, 4], Hedge::Low),
            // One voxel high and wide: a guard rail.
            ([0, 60, 6], [60, 1, 1], Hedge::No),
            // Four voxels.
            ([0, 80, 3], [2, 2, 1], Hedge::No),
        ];
        let whole = Whole::of_blocks(&blocks.map(|(from, size, _)| (FENCE, from, size)));
        let expected: BTreeMap<u32, Hedge> = (1..).zip(blocks.map(|block| block.2)).collect();
        assert_eq!(hedges(&whole), expected);
    }

    #[test]
    fn the_thickness_is_the_least_standard_deviation_of_the_points_of_the_object() {
        // Both stand in the same cubes. Each layer of the slab has the same points.
        let whole = Whole::of_blocks(&[(FENCE, [0, 0, 0], [9, 3, 9]), (FENCE, [0, 6, 0], [9, 1, 9])]);
        let (label, found) = (&whole.grown.label, thickness(&whole));
        let voxels = &whole.grown.cored.around.voxels;
        let of_slab = (0..voxels.len()).filter(|&voxel| label[voxel] == 1);
        let (mut points, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for voxel in of_slab.clone() {
            let (count, y) = (f64::from(voxels.points[voxel]), voxels.centre[voxel][1] as f64);
            (points, sum, squares) = (points + count, sum + count * y, squares + count * y * y);
        }
        let expected = (squares / points - (sum / points) * (sum / points)).sqrt();
        assert!(expected > 40.0, "{expected}");
        for voxel in of_slab {
            let found = found[voxel].unwrap();
            assert!((found as f64 - expected).abs() <= 0.5, "{found} and {expected}");
        }
        assert!((0..voxels.len()).filter(|&voxel| label[voxel] == 2).all(|voxel| found[voxel] == Some(0)));
    }

    #[test]
    fn tiles_add_up_also_within_a_cube() {
        let mut whole =
            Whole::of_blocks(&[(FENCE, [-7, 3, 0], [40, 7, 12]), (FENCE, [3, 12, 0], [30, 2, 12])]);
        let thick = thickness(&whole);
        let untiled = find(&whole, &thick);
        let keys = whole.grown.cored.around.voxels.key.clone();
        let mut sum = BTreeMap::<u32, Leaves>::new();
        for tile in 0..3 {
            let owner = |key: &[i32; 3]| usize::from(key[0] >= 4) + usize::from(key[1] >= 5);
            whole.grown.cored.around.voxels.owned = keys.iter().map(|key| owner(key) == tile).collect();
            for (label, part) in find(&whole, &thick) {
                sum.entry(label).or_default().merge(&part);
            }
        }
        assert_eq!(sum, untiled);
        assert_eq!(untiled.len(), 2);
    }
}

//! Fixtures: small objects on a wall. They are a part of the building.
//!
//! Balconies, gutters, signs on brackets and what grows on a wall look like poles, fences or crowns, voxel by voxel. But an
//! object that stands on its own does not lie along a wall with nearly all of its voxels. On nine labelled drives, seven of
//! seven poles and seven of seven trees that do were pieces of something else. Small things are left out: bins and
//! passers-by do stand at walls.

use std::collections::BTreeMap;

use rustc_hash::FxHashMap;

use super::leftovers::Whole;
use super::settings::EDGE_M;
use super::shares::{BUILDING, FENCE, POLE, TREE, VEHICLE};
use super::window::Window;

/// A voxel within so many voxels of a building, in the plane and in levels, lies on it: 0.6 m.
const ON_WALL: i32 = 4;
/// Share of the voxels of an object that lie on a building, in percent, from which it is a fixture, by class.
const SHARES: [(u8, usize); 4] = [(POLE, 70), (TREE, 85), (FENCE, 85), (VEHICLE, 85)];
/// Longest side of a fixture in the plane, in metres. Its pieces are at most 3 m apart, so a tile that reads
/// [`super::islands::REACH_M`] around a voxel sees all of it, or enough to see that it is longer.
const SIDE_M: f64 = 2.7;

/// The labels of fixtures, with the label of the building that most of their voxels lie on. Of two such labels the smaller
/// counts. This is right for the labels of voxels around which `whole` has those within [`super::islands::REACH_M`].
pub(super) fn find(whole: &Whole) -> BTreeMap<u32, u32> {
    let voxels = &whole.grown.cored.around.voxels;
    let label = &whole.grown.label;
    let class = |label: u32| whole.class.get(&label).copied();
    let share = |label: u32| SHARES.iter().find(|(of, _)| class(label) == Some(*of)).map(|(_, share)| *share);
    let window = Window::new(ON_WALL, ON_WALL);
    let mut finder = voxels.columns.finder();
    let mut fixtures = BTreeMap::new();
    for (object, of_object) in small(whole, |label| share(label).is_some()) {
        let Some(share) = share(object) else { continue };
        // Number of its voxels on each building.
        let mut on = BTreeMap::<u32, usize>::new();
        for &voxel in &of_object {
            let [i, j, k] = voxels.key[voxel];
            let mut building = u32::MAX;
            window.visit(&voxels.columns, &mut finder, [i, j], k, |other| {
                if label[other] < building && class(label[other]) == Some(BUILDING) {
                    building = label[other];
                }
            });
            if building != u32::MAX {
                *on.entry(building).or_default() += 1;
            }
        }
        let enough = on.values().sum::<usize>() * 100 >= share * of_object.len();
        if let Some((building, _)) = on.iter().rev().max_by_key(|(_, voxels)| **voxels).filter(|_| enough) {
            fixtures.insert(object, *building);
        }
    }
    fixtures
}

/// The voxels of each of these objects that is no longer than [`SIDE_M`].
fn small(whole: &Whole, wanted: impl Fn(u32) -> bool) -> BTreeMap<u32, Vec<usize>> {
    let key = &whole.grown.cored.around.voxels.key;
    let labels = || whole.grown.label.iter().enumerate().filter(|(_, label)| wanted(**label));
    let mut corners = FxHashMap::<u32, [[i32; 2]; 2]>::default();
    for (voxel, label) in labels() {
        let [i, j, _] = key[voxel];
        let [low, high] = corners.entry(*label).or_insert([[i, j]; 2]);
        *low = [low[0].min(i), low[1].min(j)];
        *high = [high[0].max(i), high[1].max(j)];
    }
    let short = |[low, high]: &[[i32; 2]; 2]| {
        (0..2).all(|axis| f64::from(high[axis] - low[axis] + 1) * EDGE_M <= SIDE_M)
    };
    corners.retain(|_, corners| short(corners));
    let mut objects = BTreeMap::<u32, Vec<usize>>::new();
    for (voxel, label) in labels().filter(|(_, label)| corners.contains_key(label)) {
        objects.entry(*label).or_default().push(voxel);
    }
    objects
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::street::classified::Classified;
    use crate::cluster::street::cores::Cored;
    use crate::cluster::street::growth::Grown;
    use crate::cluster::street::shares::SMALL;
    use crate::cluster::street::voxels::Voxels;
    use crate::model::Lattice;

    /// An object of a class: a block of points 0.1 m apart, from a corner, in decimetres.
    type Block = (u8, [i64; 3], [i64; 3]);

    /// The objects with labels from 1 in their order.
    fn fixtures(blocks: &[Block]) -> BTreeMap<u32, u32> {
        let points = |(_, from, size): &Block| {
            let (from, [x, y, z]) = (*from, *size);
            let steps = (0..x).flat_map(move |i| (0..y).flat_map(move |j| (0..z).map(move |k| [i, j, k])));
            steps.map(move |step| [0, 1, 2].map(|axis| 100 * (from[axis] + step[axis]))).collect::<Vec<_>>()
        };
        let all: Vec<[i64; 3]> = blocks.iter().flat_map(points).collect();
        let voxels = Voxels::of_points(Lattice::MILLIMETRE, &all);
        let mut label = vec![0; voxels.len()];
        for (number, block) in (1..).zip(blocks) {
            for point in points(block) {
                let key = point.map(|value| i32::try_from(value.div_euclid(150)).unwrap());
                label[voxels.find(key).unwrap()] = number;
            }
        }
        let count = voxels.len();
        let around = Classified { voxels, height: vec![0; count], shares: vec![[0; 8]; count] };
        let cored = Cored { around, class: vec![0; count], label: vec![0; count], cores: BTreeMap::new() };
        let class = (1..).zip(blocks.iter().map(|block| block.0)).collect();
        find(&Whole { grown: Grown { cored, label }, class })
    }

    #[test]
    fn what_lies_along_a_wall_is_a_part_of_the_building() {
        let wall = (BUILDING, [0, 0, 0], [100, 2, 60]);
        let gutter = (POLE, [30, 3, 0], [2, 2, 50]);
        let lamp = (POLE, [30, 25, 0], [2, 2, 50]);
        let balcony = (FENCE, [50, 3, 30], [20, 4, 10]);
        let bin = (SMALL, [80, 3, 0], [4, 4, 10]);
        assert_eq!(fixtures(&[wall, gutter, lamp, balcony, bin]), BTreeMap::from([(2, 1), (4, 1)]));
    }

    #[test]
    fn what_is_long_or_mostly_away_from_the_wall_is_not() {
        let wall = (BUILDING, [0, 0, 0], [100, 2, 60]);
        let railing = (FENCE, [0, 3, 0], [60, 2, 10]);
        let tree = (TREE, [70, 3, 0], [20, 24, 40]);
        assert_eq!(fixtures(&[wall, railing, tree]), BTreeMap::new());
        assert_eq!(fixtures(&[(POLE, [0; 3], [2, 2, 50])]), BTreeMap::new());
    }
}

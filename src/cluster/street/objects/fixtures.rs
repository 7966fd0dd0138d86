//! Fixtures: small objects on a wall. They are a part of the building.
//!
//! The voxels of balconies, gutters, signs on brackets and plants on a wall look like poles, fences or
//! crowns. But an object that stands on its own does not have nearly all of its voxels along a wall. On nine
//! labelled drives, seven of seven poles and seven of seven trees that do were pieces of something else.
//! Objects of the class small are exempt: bins and passers-by do stand at walls. But an object along a wall
//! with much of the building above it is inside the building, seen through a window.

use std::collections::BTreeMap;

use rustc_hash::FxHashMap;

use super::stage_leftovers::Whole;
use crate::cluster::street::settings::EDGE_M;
use crate::cluster::street::shares::{BUILDING, FENCE, POLE, SMALL, TREE, VEHICLE};
use crate::cluster::street::window::Window;

/// Largest distance of a voxel to a building that it lies on, in voxels in the plane and in levels: 0.6 m.
const ON_WALL: i32 = 4;
/// Share of voxels on a building, in percent, from which an object is a fixture, by class. More than 100
/// means that this share alone does not make it one.
const SHARES: [(u8, usize); 5] = [(POLE, 50), (TREE, 85), (FENCE, 85), (VEHICLE, 85), (SMALL, 101)];
/// The same share for any of these classes if a building is above many of the voxels, and the smallest
/// percentage of such voxels. With 50 instead of 65, three passers-by below the balconies of a narrow street
/// are lost.
const INSIDE: usize = 65;
const BELOW: usize = 40;
/// Smallest number of levels by which a building voxel is higher than a voxel below the building. The
/// building voxel is in the same column or in one beside it.
const ROOF_LEVELS: i32 = 3;
/// Half of the number of levels above that are searched: buildings are lower than 300 m.
const ABOVE: i32 = 1000;
/// Longest side of a fixture in the plane, in metres. Its pieces are at most 3 m apart, so a tile that reads
/// [`super::islands::REACH_M`] around a voxel sees all of it, or enough to see that it is longer.
const SIDE_M: f64 = 3.3;

/// The labels of fixtures, with the label of the building that most of their voxels lie on. Of two such
/// buildings, the smaller label wins. The result is right for the labels of voxels if `whole` has all voxels
/// within [`super::islands::REACH_M`] of these.
pub(crate) fn find(whole: &Whole) -> BTreeMap<u32, u32> {
    let voxels = &whole.grown.cored.around.voxels;
    let label = &whole.grown.label;
    let class = |label: u32| whole.class.get(&label).copied();
    let share = |label: u32| SHARES.iter().find(|(of, _)| class(label) == Some(*of)).map(|(_, share)| *share);
    let mut wall = Window::new(ON_WALL, ON_WALL).over(&voxels.columns);
    let mut roof = Window::new(1, ABOVE).over(&voxels.columns);
    let mut fixtures = BTreeMap::new();
    for (object, of_object) in small(whole, |label| share(label).is_some()) {
        let Some(share) = share(object) else { continue };
        // Number of its voxels on each building.
        let mut on = BTreeMap::<u32, usize>::new();
        let mut below = 0;
        for &voxel in &of_object {
            let [i, j, k] = voxels.key[voxel];
            let mut building = u32::MAX;
            wall.visit([i, j], k, |other| {
                if label[other] < building && class(label[other]) == Some(BUILDING) {
                    building = label[other];
                }
            });
            if building != u32::MAX {
                *on.entry(building).or_default() += 1;
            }
            let mut is_below = false;
            roof.visit([i, j], k + ROOF_LEVELS + ABOVE, |other| {
                is_below |= class(label[other]) == Some(BUILDING);
            });
            below += usize::from(is_below);
        }
        let percent = |of: usize, share: usize| of * 100 >= share * of_object.len();
        let on_wall = on.values().sum::<usize>();
        let enough = percent(on_wall, share) || (percent(on_wall, INSIDE) && percent(below, BELOW));
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

    /// The fixtures among these blocks. Each is a class, a corner and a size, in decimetres.
    fn fixtures(blocks: &[(u8, [i64; 3], [i64; 3])]) -> BTreeMap<u32, u32> {
        find(&Whole::of_blocks(blocks))
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
    fn what_stands_at_a_wall_below_a_building_is_a_part_of_it() {
        let wall = (BUILDING, [0, 0, 0], [100, 2, 60]);
        let box_of_shop = (SMALL, [30, 3, 0], [4, 3, 10]);
        let ceiling = (BUILDING, [20, 2, 25], [40, 8, 1]);
        let passer_by = (SMALL, [45, 9, 0], [4, 4, 17]);
        assert_eq!(fixtures(&[wall, box_of_shop]), BTreeMap::new());
        assert_eq!(fixtures(&[wall, box_of_shop, ceiling, passer_by]), BTreeMap::from([(2, 1)]));
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

//! Islands: compact groups of voxels with free space around them. All voxels of an island belong to one
//! object.
//!
//! The earlier steps decide class by class. So a car whose door looks like a wall to the classifier becomes
//! two objects, although nothing else stands near it. If a group of voxels is not larger than a car, the gaps
//! around it are better evidence than the classes inside it: the group belongs to the object that has most of
//! its points.
#![expect(clippy::cast_possible_truncation, reason = "voxels of a tile fit u32")]

use std::collections::BTreeMap;

use super::stage_leftovers::Whole;
use crate::cluster::street::settings::EDGE_M;
use crate::cluster::street::shares::GROUND;
use crate::cluster::street::spans::Spans;
use crate::cluster::street::voxels::stored::Voxels;
use crate::cluster::street::window::Window;
use crate::model::Lattice;
use crate::spatial::DisjointSets;

/// Largest distance between neighbouring voxels of an island, in voxels in the plane and in levels.
const GAP: i32 = 2;
/// Largest length and width of the box around an island in the plane, and its largest height, in metres: a
/// large car, a shrub, a group of bins.
const LENGTH_M: f64 = 5.5;
const WIDTH_M: f64 = 3.0;
const HEIGHT_M: f64 = 3.0;
/// Distance around a voxel within which others decide whether it is in an island, in metres: the diagonal of
/// the box plus a gap. A group that reaches further is not an island.
pub(crate) const REACH_M: f64 = 7.0;

/// Gives the voxels of each island the label that most of its points have. Of two such labels, the smaller
/// wins. Voxels without a label stay without. The result is right for voxels if `whole` has all voxels within
/// [`REACH_M`] of them.
pub(crate) fn settle(whole: &mut Whole, lattice: Lattice) {
    let around = &whole.grown.cored.around;
    let group = groups(&around.voxels, |voxel| around.shares[voxel][usize::from(GROUND)] <= 127);
    let label = &mut whole.grown.label;
    for island in islands(&around.voxels, &group, lattice) {
        let mut points = BTreeMap::<u32, u64>::new();
        let labelled: Vec<usize> = island.into_iter().filter(|&voxel| label[voxel] != 0).collect();
        for &voxel in &labelled {
            *points.entry(label[voxel]).or_default() += u64::from(around.voxels.points[voxel]);
        }
        let most = points.iter().rev().max_by_key(|(_, points)| **points);
        let Some((&most, _)) = most.filter(|_| points.len() > 1) else { continue };
        for voxel in labelled {
            label[voxel] = most;
        }
    }
}

/// The group of each voxel, named by the first voxel of the group. A voxel that is not `open` has none.
fn groups(voxels: &Voxels, open: impl Fn(usize) -> bool) -> Vec<Option<u32>> {
    let count = voxels.len();
    let mut sets = DisjointSets::new(count as u32);
    let mut near = Window::new(GAP, GAP).over(&voxels.columns);
    for voxel in (0..count).filter(|&voxel| open(voxel)) {
        let [i, j, k] = voxels.key[voxel];
        near.visit([i, j], k, |other| {
            if other > voxel && open(other) {
                sets.union(voxel as u32, other as u32);
            }
        });
    }
    (0..count).map(|voxel| open(voxel).then(|| sets.find(voxel as u32))).collect()
}

/// The voxels of each group that is an island.
fn islands(voxels: &Voxels, group: &[Option<u32>], lattice: Lattice) -> Vec<Vec<usize>> {
    let count = voxels.len();
    // A group that is longer than the diagonal of the box on an axis of the lattice is not an island. This
    // test costs little.
    let most = (LENGTH_M.hypot(WIDTH_M) / EDGE_M) as i32 + 1;
    let levels = (HEIGHT_M / EDGE_M) as i32;
    let mut corners = vec![([i32::MAX; 3], [i32::MIN; 3]); count];
    for (voxel, group) in group.iter().enumerate() {
        let Some(group) = group.map(|group| group as usize) else { continue };
        let (low, high) = &mut corners[group];
        for axis in 0..3 {
            low[axis] = low[axis].min(voxels.key[voxel][axis]);
            high[axis] = high[axis].max(voxels.key[voxel][axis]);
        }
    }
    let compact = |group: usize| {
        let (low, high) = corners[group];
        let size = |axis: usize| high[axis] - low[axis] + 1;
        size(0) <= most && size(1) <= most && size(2) <= levels
    };
    let mut members = BTreeMap::<u32, Vec<usize>>::new();
    for (voxel, group) in group.iter().enumerate() {
        if let Some(group) = group.filter(|&group| compact(group as usize)) {
            members.entry(group).or_default().push(voxel);
        }
    }
    let fits = |island: &Vec<usize>| {
        let place = |&voxel: &usize| [voxels.centre[voxel][0], voxels.centre[voxel][1]];
        let spans = island.iter().map(|voxel| Spans::of_place(place(voxel)));
        let merged = spans.reduce(|mut one, other| {
            one.merge(&other);
            one
        });
        let around = merged.map(|spans| spans.narrowest());
        around.is_some_and(|around| {
            around.length <= lattice.units(LENGTH_M) && around.width <= lattice.units(WIDTH_M)
        })
    };
    members.into_values().filter(fits).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A block of points 0.1 m apart, from a corner, in metres.
    fn block(from: [f64; 3], size: [f64; 3]) -> Vec<[i64; 3]> {
        let steps = size.map(|side| (side / 0.1).round() as i64);
        let corner = from.map(|value| Lattice::MILLIMETRE.units(value));
        let points = (0..steps[0])
            .flat_map(|i| (0..steps[1]).flat_map(move |j| (0..steps[2]).map(move |k| [i, j, k])));
        points.map(|step| [0, 1, 2].map(|axis| corner[axis] + 100 * step[axis])).collect()
    }

    fn sizes(points: &[[i64; 3]]) -> Vec<usize> {
        let voxels = Voxels::of_points(Lattice::MILLIMETRE, points);
        let group = groups(&voxels, |_| true);
        let mut sizes: Vec<usize> =
            islands(&voxels, &group, Lattice::MILLIMETRE).iter().map(Vec::len).collect();
        sizes.sort_unstable();
        sizes
    }

    #[test]
    fn a_car_with_a_gap_around_is_an_island() {
        let car = block([0.0, 0.0, 0.2], [4.5, 1.8, 1.4]);
        let alone = sizes(&car);
        assert_eq!(alone.len(), 1);
        let wall = block([0.0, 2.6, 0.0], [20.0, 0.2, 4.0]);
        assert_eq!(sizes(&[car.clone(), wall].concat()), alone, "a wall 0.8 m beside it is none");
        let near = block([0.0, 1.9, 0.0], [20.0, 0.2, 4.0]);
        assert_eq!(sizes(&[car, near].concat()), [0; 0], "with a wall that touches, it is none");
    }

    #[test]
    fn what_is_high_or_wide_is_no_island() {
        assert_eq!(sizes(&block([0.0; 3], [0.4, 0.4, 3.4])).len(), 0);
        assert_eq!(sizes(&block([0.0; 3], [3.6, 3.6, 1.0])).len(), 0);
        assert_eq!(sizes(&block([0.0; 3], [6.0, 1.0, 1.0])).len(), 0);
        assert_eq!(sizes(&block([0.0; 3], [2.8, 2.8, 2.8])).len(), 1);
    }
}

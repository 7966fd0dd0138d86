//! A sketch: the occupied voxels of an object, each with a value. Its size is bounded, and parts merge
//! exactly in any order.
//!
//! Voxels of level 0 have an edge that is the same for all objects. Voxels of level k have 2^k times that
//! edge and consist of whole voxels of the previous level. A sketch with more voxels than its limit goes to
//! the next level. So its level is the smallest at which its points occupy few enough voxels. A part of an
//! object never needs a higher level than the whole, so the order in which parts are merged does not matter.

use serde::{Deserialize, Serialize};

/// A value of a voxel. Merging is associative, commutative and exact.
pub(crate) trait Patch: Copy {
    /// Adds the value of other points in the same voxel.
    fn merge(&mut self, other: &Self);
}

/// Index of a voxel, counted from the voxel that contains the lowest corner of the whole object.
pub(crate) type Key = [u32; 3];

/// Where the voxels of an object are: the edge of level 0, and the corner from which keys are counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Frame {
    /// Edge of a voxel of level 0, in lattice units.
    pub(crate) edge: i64,
    /// Lattice coordinates of the lower corner of voxel (0, 0, 0): multiples of the edge.
    pub(crate) corner: [i64; 3],
    /// The lowest level at which keys fit 32 bits.
    first_level: u8,
}

impl Frame {
    /// The frame of an object that extends from `lo` to `hi`, in lattice units.
    pub(crate) fn new(edge: i64, lo: [i64; 3], hi: [i64; 3]) -> Self {
        let corner = lo.map(|value| value.div_euclid(edge) * edge);
        let fits = |level: &u8| (0..3).all(|k| (hi[k].wrapping_sub(corner[k]) / edge) >> level < 1 << 32);
        let first_level = (0..63).find(fits).unwrap_or(63);
        Self { edge, corner, first_level }
    }

    /// Edge of a voxel of a level, in lattice units.
    pub(crate) fn edge_at(&self, level: u8) -> i64 {
        self.edge << level
    }

    /// The voxel of a point of the object at the lowest level of the frame.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "points are not below the corner, and the level was chosen so that keys fit"
    )]
    pub(crate) fn key(&self, point: [i64; 3]) -> Key {
        [0, 1, 2].map(|k| (((point[k] - self.corner[k]) / self.edge) >> self.first_level) as u32)
    }

    /// The voxel of a point of the object at a level, which is not below the lowest of the frame.
    pub(crate) fn key_at(&self, level: u8, point: [i64; 3]) -> Key {
        self.key(point).map(|index| index >> (level - self.first_level))
    }

    /// Lattice coordinate of the middle of a voxel along an axis, doubled, so that it is an integer.
    pub(crate) fn doubled_middle(&self, level: u8, axis: usize, index: u32) -> i64 {
        2 * self.corner[axis] + (2 * i64::from(index) + 1) * self.edge_at(level)
    }
}

/// The occupied voxels of an object, or of a part of one.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Sketch<V> {
    /// Level of its voxels.
    pub(crate) level: u8,
    /// The voxels in ascending order.
    pub(crate) voxels: Vec<(Key, V)>,
}

impl<V: Patch> Sketch<V> {
    /// A sketch of no points.
    pub(crate) fn empty(frame: &Frame) -> Self {
        Self { level: frame.first_level, voxels: Vec::new() }
    }

    /// The sketch of points. Each entry has the voxel of a point by [`Frame::key`], and its value. At most
    /// `most` voxels remain.
    pub(crate) fn of(frame: &Frame, voxels: Vec<(Key, V)>, most: usize) -> Self {
        let mut sketch = Self { level: frame.first_level, voxels };
        sketch.unite();
        sketch.limit(most);
        sketch
    }

    /// Adds another part of the same object.
    pub(crate) fn merge(&mut self, mut other: Self, most: usize) {
        while self.level < other.level {
            self.coarsen();
        }
        while other.level < self.level {
            other.coarsen();
        }
        self.voxels.append(&mut other.voxels);
        self.unite();
        self.limit(most);
    }

    fn limit(&mut self, most: usize) {
        while self.voxels.len() > most.max(1) {
            self.coarsen();
        }
    }

    /// Goes to the next level.
    pub(crate) fn coarsen(&mut self) {
        self.level += 1;
        for (key, _) in &mut self.voxels {
            *key = key.map(|index| index >> 1);
        }
        self.unite();
    }

    /// Sorts the voxels and merges equal ones.
    fn unite(&mut self) {
        self.voxels.sort_unstable_by_key(|(key, _)| *key);
        self.voxels.dedup_by(|next, kept| {
            let same = next.0 == kept.0;
            if same {
                kept.1.merge(&next.1);
            }
            same
        });
    }
}

/// The points of objects that are in `core`, as (object, point), ascending. `objects` has the object of each
/// point, 0 for none.
#[expect(clippy::cast_possible_truncation, reason = "positions of points of a tile fit u32")]
pub(super) fn by_object(objects: &[u32], core: impl Fn(usize) -> bool) -> Vec<(u32, u32)> {
    let mut members: Vec<(u32, u32)> = (0..objects.len())
        .filter(|&point| objects[point] != 0 && core(point))
        .map(|point| (objects[point], point as u32))
        .collect();
    members.sort_unstable();
    members
}

/// Lowest and highest lattice z of the points in a voxel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Heights {
    pub(crate) lowest: i64,
    pub(crate) highest: i64,
}

impl Patch for Heights {
    fn merge(&mut self, other: &Self) {
        self.lowest = self.lowest.min(other.lowest);
        self.highest = self.highest.max(other.highest);
    }
}

/// Number of points in a voxel and the sums of their coordinates, counted from the corner of the frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Sums {
    pub(crate) points: u64,
    pub(crate) sum: [i64; 3],
}

impl Patch for Sums {
    fn merge(&mut self, other: &Self) {
        self.points += other.points;
        for axis in 0..3 {
            self.sum[axis] += other.sum[axis];
        }
    }
}

/// Number of points in a cell of the plane, and the points that are furthest along the axes: of the smallest
/// and largest x, and of the smallest and largest y.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Extremes {
    pub(crate) points: u64,
    pub(crate) ends: [[i64; 2]; 4],
}

impl Extremes {
    /// Those of one point.
    pub(crate) fn of([x, y, _]: [i64; 3]) -> Self {
        Self { points: 1, ends: [[x, y]; 4] }
    }
}

impl Patch for Extremes {
    fn merge(&mut self, other: &Self) {
        let turned = |[x, y]: [i64; 2]| [y, x];
        self.points += other.points;
        let [left, right, low, high] = &mut self.ends;
        *left = (*left).min(other.ends[0]);
        *right = (*right).max(other.ends[1]);
        *low = turned(turned(*low).min(turned(other.ends[2])));
        *high = turned(turned(*high).max(turned(other.ends[3])));
    }
}

/// No value: the voxel has points.
impl Patch for () {
    fn merge(&mut self, _other: &Self) {}
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;

    fn sketch(frame: &Frame, points: &[[i64; 3]], most: usize) -> Sketch<Sums> {
        let one = |point: &[i64; 3]| {
            let sum = [0, 1, 2].map(|k| point[k] - frame.corner[k]);
            (frame.key(*point), Sums { points: 1, sum })
        };
        Sketch::of(frame, points.iter().map(one).collect(), most)
    }

    #[test]
    fn objects_of_any_size_have_keys() {
        let far = 1_i64 << 50;
        let frame = Frame::new(10, [-far; 3], [far; 3]);
        assert!(frame.first_level > 0 && frame.corner[0] <= -far && frame.corner[0] % 10 == 0);
        let last = frame.key([far; 3]);
        assert!(last[0] > u32::MAX / 4, "{last:?}");
        assert_eq!(frame.key([-far; 3]), [0; 3]);
    }

    #[test]
    fn extremes_do_not_depend_on_the_order() {
        let points = [[5, 9, 1], [5, 2, 2], [3, 7, 0], [8, 2, 0], [8, 9, 4]];
        let merged = |order: [usize; 5]| {
            let parts = order.map(|point| Extremes::of(points[point]));
            parts.into_iter().reduce(|mut one, other| {
                one.merge(&other);
                one
            })
        };
        let expected = Extremes { points: 5, ends: [[3, 7], [8, 9], [5, 2], [8, 9]] };
        assert_eq!(merged([0, 1, 2, 3, 4]), Some(expected));
        assert_eq!(merged([4, 2, 0, 3, 1]), Some(expected));
    }

    proptest! {
        /// The level is the smallest at which few enough voxels are occupied, found by counting sets.
        #[test]
        fn parts_in_any_order_are_the_whole(
            points in prop::collection::vec(([-300..300_i64, -300..300_i64, -300..300_i64], 0..4_usize), 1..120),
            most in 1..40_usize,
            order in Just([0_usize, 1, 2, 3]).prop_shuffle(),
        ) {
            let all: Vec<[i64; 3]> = points.iter().map(|(point, _)| *point).collect();
            let corner = |pick: fn(i64, i64) -> i64| [0, 1, 2].map(|k| all.iter().map(|p| p[k]).reduce(pick).unwrap());
            let frame = Frame::new(20, corner(i64::min), corner(i64::max));
            let whole = sketch(&frame, &all, most);
            let mut merged = Sketch::empty(&frame);
            for part in order {
                let mine: Vec<[i64; 3]> = points.iter().filter(|(_, of)| *of == part).map(|(p, _)| *p).collect();
                merged.merge(sketch(&frame, &mine, most), most);
            }
            prop_assert_eq!(&merged, &whole);
            let occupied = |level: u8| {
                let edge = 20 << level;
                all.iter().map(|p| [0, 1, 2].map(|k| (p[k] - frame.corner[k]) / edge)).collect::<BTreeSet<_>>().len()
            };
            let level = (0..).find(|level| occupied(*level) <= most).unwrap();
            prop_assert_eq!((whole.level, whole.voxels.len()), (level, occupied(level)));
            prop_assert_eq!(whole.voxels.iter().map(|(_, sums)| sums.points).sum::<u64>(), all.len() as u64);
        }
    }
}

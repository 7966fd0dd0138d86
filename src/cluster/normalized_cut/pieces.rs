//! The stored voxels of the objects of a tile, and the voxels of one object gathered from many tiles, on a
//! coarser grid if there are too many.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::cluster::columns::Voxel;
use crate::model::in_u32;

/// Voxels of each label of a tile, sorted by label and key. Keys are differences to the previous voxel, which
/// take few bytes when encoded.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Pieces {
    /// End of the voxels of each label.
    ends: Vec<u32>,
    keys: Vec<Voxel>,
    /// Points of each voxel.
    points: Vec<u32>,
    /// Sums over the points of their offsets from the lowest corner of the voxel, in lattice units.
    sums: Vec<[u64; 3]>,
}

/// Builds the stored form from voxels in ascending order of label and key.
#[derive(Debug, Default)]
pub(super) struct Storing {
    pieces: Pieces,
    last: Voxel,
}

impl Storing {
    /// Adds a voxel of a label.
    pub(super) fn push(&mut self, label: u32, key: Voxel, points: u32, sums: [u64; 3]) {
        let end = in_u32(self.pieces.keys.len(), "voxels of an object");
        self.pieces.ends.resize(label as usize, end);
        self.pieces.keys.push([0, 1, 2].map(|axis| key[axis].wrapping_sub(self.last[axis])));
        self.pieces.points.push(points);
        self.pieces.sums.push(sums);
        self.last = key;
    }

    /// The stored form.
    pub(super) fn finish(mut self) -> Pieces {
        self.pieces.ends.push(in_u32(self.pieces.keys.len(), "voxels of an object"));
        self.pieces
    }
}

impl Pieces {
    /// Restores the keys from their differences.
    pub(super) fn unpacked(mut self) -> Self {
        let mut last = [0_i32; 3];
        for key in &mut self.keys {
            last = [0, 1, 2].map(|axis| last[axis].wrapping_add(key[axis]));
            *key = last;
        }
        self
    }

    /// The voxels of a label. Empty for a label without voxels.
    fn of_label(&self, label: u32) -> Range<usize> {
        let label = label as usize;
        let start = label.checked_sub(1).map_or(Some(0), |before| self.ends.get(before).copied());
        match (start, self.ends.get(label)) {
            (Some(start), Some(&end)) => start as usize..end as usize,
            _ => 0..0,
        }
    }
}

/// The voxels of an object, sorted by key.
#[derive(Debug, Clone, Default)]
pub(super) struct Voxels {
    /// Number of doublings of the edge.
    pub(super) doublings: u32,
    /// Edge of a voxel in lattice units.
    pub(super) edge: i64,
    pub(super) key: Vec<Voxel>,
    pub(super) points: Vec<u64>,
    /// Sum of the coordinates of the points, in lattice units.
    pub(super) sums: Vec<[i64; 3]>,
}

impl Voxels {
    /// An object without voxels.
    pub(super) fn new(edge: i64) -> Self {
        Self { edge, ..Self::default() }
    }

    /// Number of voxels.
    pub(super) fn len(&self) -> usize {
        self.key.len()
    }

    /// Adds the voxels of a label of a tile. The edge is doubled while there are more than `most` voxels. The
    /// result does not depend on the order of tiles, because larger edges never give more voxels, and a part
    /// of an object never has more voxels than the whole.
    pub(super) fn add(&mut self, pieces: &Pieces, label: u32, most: usize) {
        let fine = self.edge >> self.doublings;
        for piece in pieces.of_label(label) {
            let key = pieces.keys[piece];
            let points = pieces.points[piece];
            let corner = key.map(|index| i64::from(index) * fine);
            self.key.push(key.map(|index| index >> self.doublings));
            self.points.push(u64::from(points));
            let sum = |axis: usize| {
                corner[axis] * i64::from(points) + i64::try_from(pieces.sums[piece][axis]).unwrap_or(i64::MAX)
            };
            self.sums.push([0, 1, 2].map(sum));
        }
        self.merge();
        while self.len() > most {
            self.doublings += 1;
            self.edge *= 2;
            // An arithmetic shift rounds down, so voxels of twice the edge are anchored at multiples of their
            // edge, too.
            self.key.iter_mut().for_each(|key| *key = key.map(|index| index >> 1));
            self.merge();
        }
    }

    /// Sorts the voxels, and adds up voxels with equal keys.
    fn merge(&mut self) {
        let mut order: Vec<usize> = (0..self.len()).collect();
        order.sort_by_key(|&voxel| self.key[voxel]);
        let mut merged = Self { doublings: self.doublings, edge: self.edge, ..Self::default() };
        for voxel in order {
            if merged.key.last() != Some(&self.key[voxel]) {
                merged.key.push(self.key[voxel]);
                merged.points.push(0);
                merged.sums.push([0; 3]);
            }
            let last = merged.key.len() - 1;
            merged.points[last] += self.points[voxel];
            (0..3).for_each(|axis| merged.sums[last][axis] += self.sums[voxel][axis]);
        }
        *self = merged;
    }

    /// The smallest number of doublings after which the voxels `members` become at most `most`.
    pub(super) fn doublings_for(&self, members: &[u32], most: usize) -> u32 {
        let mut doublings = 0;
        let mut keys: Vec<Voxel> = members.iter().map(|&member| self.key[member as usize]).collect();
        while keys.len() > most {
            doublings += 1;
            keys.iter_mut().for_each(|key| *key = key.map(|index| index >> 1));
            keys.sort_unstable();
            keys.dedup();
        }
        doublings
    }

    /// The voxels `members` with edges doubled `doublings` times, and for each member the number of its new
    /// voxel.
    pub(super) fn coarser(&self, members: &[u32], doublings: u32) -> (Self, Vec<u32>) {
        let mut coarse = Self {
            doublings: self.doublings + doublings,
            edge: self.edge << doublings,
            key: members
                .iter()
                .map(|&voxel| self.key[voxel as usize].map(|index| index >> doublings))
                .collect(),
            points: members.iter().map(|&voxel| self.points[voxel as usize]).collect(),
            sums: members.iter().map(|&voxel| self.sums[voxel as usize]).collect(),
        };
        let keys = coarse.key.clone();
        coarse.merge();
        let number =
            |key: &Voxel| in_u32(coarse.key.partition_point(|other| other < key), "voxels of an object");
        let numbers = keys.iter().map(number).collect();
        (coarse, numbers)
    }

    /// Centroids in metres from the lowest corner of all voxels (equation 2 of the paper).
    pub(super) fn centroids_m(&self, units_per_m: u32) -> Vec<[f64; 3]> {
        let lowest = |axis: usize| self.key.iter().map(|key| i64::from(key[axis])).min().unwrap_or(0);
        let origin = [0, 1, 2].map(|axis| lowest(axis) * self.edge);
        let per_m = f64::from(units_per_m);
        let centroid = |(sums, &points): (&[i64; 3], &u64)| {
            let count = i64::try_from(points).unwrap_or(i64::MAX);
            [0, 1, 2].map(|axis| (sums[axis] - origin[axis] * count) as f64 / points as f64 / per_m)
        };
        self.sums.iter().zip(&self.points).map(centroid).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pieces(of: &[(u32, Voxel, u32, [u64; 3])]) -> Pieces {
        let mut storing = Storing::default();
        of.iter().for_each(|&(label, key, points, sums)| storing.push(label, key, points, sums));
        storing.finish().unpacked()
    }

    #[test]
    fn parts_of_a_voxel_add_up_in_any_order() {
        let one = pieces(&[(0, [-1, 4, 2], 3, [3, 6, 9]), (2, [-1, 4, 2], 1, [1, 1, 1])]);
        let other = pieces(&[(1, [-1, 4, 2], 2, [10, 0, 1]), (1, [5, 4, 2], 1, [0, 0, 0])]);
        let gather = |parts: [(&Pieces, u32); 2]| {
            let mut voxels = Voxels::new(100);
            parts.iter().for_each(|(pieces, label)| voxels.add(pieces, *label, 10));
            (voxels.key, voxels.points, voxels.sums)
        };
        let expected = (
            vec![[-1, 4, 2], [5, 4, 2]],
            vec![5, 1],
            vec![[-500 + 13, 2_000 + 6, 1_000 + 10], [500, 400, 200]],
        );
        assert_eq!(gather([(&one, 0), (&other, 1)]), expected);
        assert_eq!(gather([(&other, 1), (&one, 0)]), expected);
        assert_eq!(one.of_label(1), 1..1);
        assert_eq!(one.of_label(9), 0..0);
    }

    #[test]
    fn too_many_voxels_become_coarser_ones_whatever_the_order() {
        let row = |range: Range<i32>| {
            let voxels: Vec<_> = range.map(|i| (0, [i, -i, 0], 1, [1, 2, 3])).collect();
            pieces(&voxels)
        };
        let [left, right] = [row(-50..0), row(0..50)];
        let gather = |parts: [&Pieces; 2]| {
            let mut voxels = Voxels::new(8);
            parts.iter().for_each(|pieces| voxels.add(pieces, 0, 30));
            voxels
        };
        let found = gather([&left, &right]);
        let other = gather([&right, &left]);
        // A diagonal has 100, 100 and 50 voxels at 1, 2 and 4 edges, and 26 at 8 edges.
        assert_eq!((&found.key, &found.points, &found.sums), (&other.key, &other.points, &other.sums));
        assert_eq!((found.doublings, other.doublings), (3, 3));
        assert!(found.len() <= 30 && found.len() > 10, "{}", found.len());
        assert_eq!(found.points.iter().sum::<u64>(), 100);
        let mut whole = Voxels::new(8);
        whole.add(&left, 0, 1_000);
        whole.add(&right, 0, 1_000);
        assert_eq!(
            whole.sums.iter().map(|sum| sum[1]).sum::<i64>(),
            found.sums.iter().map(|sum| sum[1]).sum::<i64>()
        );
    }
}

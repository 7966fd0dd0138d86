//! The measurements of an object, or of the part of an object inside one tile. Parts merge exactly, in any
//! order.
//!
//! Every number is an integer on the lattice. Every field is a sum, a minimum, a maximum, a set or a convex
//! hull, so the result does not depend on the cut into tiles. There are no names, no ground and no world
//! coordinates here.
#![expect(
    clippy::cast_possible_truncation,
    reason = "indices of points fit u32 (checked by collect's caller)"
)]

use serde::{Deserialize, Serialize};

use super::hull::{convex_hull, without_inner_points};
use crate::model::{FileId, PointId, TileCloud};

/// Number of points above which inner points are dropped before the hull is computed. With fewer, sorting all
/// is as fast.
const MANY_POINTS: usize = 64;

/// An object, or a part of one.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ObjectPart {
    /// Number of points.
    pub points: u64,
    /// Smallest id of a point.
    pub first_id: PointId,
    /// Smallest lattice coordinates.
    pub lo: [i64; 3],
    /// Largest lattice coordinates.
    pub hi: [i64; 3],
    /// Sums of lattice coordinates.
    pub sum: [i128; 3],
    /// Convex hull of the points in the plane, in lattice coordinates: counter-clockwise from the smallest
    /// (x, y), not closed, no three vertices on a line. One or two vertices when all points are in one place
    /// or on one line.
    pub hull: Vec<[i64; 2]>,
    /// Files with points of the object, ascending, without repetition.
    pub files: Vec<FileId>,
}

impl ObjectPart {
    /// A part without points. Merging it changes nothing.
    #[must_use]
    pub fn empty() -> Self {
        Self {
            points: 0,
            first_id: PointId::BEYOND_ALL,
            lo: [i64::MAX; 3],
            hi: [i64::MIN; 3],
            sum: [0; 3],
            hull: Vec::new(),
            files: Vec::new(),
        }
    }

    /// The parts with the labels 1 to `count`, from the points for which `core` (by position) is true. A
    /// label without points gives [`Self::empty`]. `file` maps a point id to its file and must not decrease
    /// with the id ([`TileCloud`]). O(points), and O(m log m) for the few points that may be on a hull.
    #[must_use]
    pub fn collect(
        cloud: &TileCloud,
        labels: &[u32],
        count: u32,
        core: impl Fn(usize) -> bool,
        file: impl Fn(PointId) -> FileId,
    ) -> Vec<Self> {
        let wanted = |point: &usize| labels[*point] != 0 && core(*point);
        // Positions of the points, grouped by label: after the loop, first[l] is the end of label l.
        let mut first = vec![0_u32; count as usize + 2];
        for point in (0..labels.len()).filter(wanted) {
            first[labels[point] as usize + 1] += 1;
        }
        let mut total = 0;
        for slot in &mut first {
            total += *slot;
            *slot = total;
        }
        let mut members = vec![0_u32; total as usize];
        for point in (0..labels.len()).filter(wanted) {
            let slot = &mut first[labels[point] as usize];
            members[*slot as usize] = point as u32;
            *slot += 1;
        }
        let mut plane = Vec::new();
        let mut begin = 0;
        let part_of = |&end: &u32| {
            let part = Self::of_members(cloud, &members[begin..end as usize], &file, &mut plane);
            begin = end as usize;
            part
        };
        first[1..=count as usize].iter().map(part_of).collect()
    }

    /// The part of the points at these positions; `plane` is a buffer that is reused.
    fn of_members(
        cloud: &TileCloud,
        members: &[u32],
        file: impl Fn(PointId) -> FileId,
        plane: &mut Vec<[i64; 2]>,
    ) -> Self {
        let mut part = Self::empty();
        if members.is_empty() {
            return part;
        }
        part.points = members.len() as u64;
        plane.clear();
        // Local sums: 2^32 points times 2^31 units fit i64.
        let mut sum = [0_i64; 3];
        let mut last_id = PointId::default();
        for &point in members {
            let point = point as usize;
            let place = [cloud.x[point], cloud.y[point], cloud.z[point]].map(i64::from);
            for axis in 0..3 {
                part.lo[axis] = part.lo[axis].min(place[axis]);
                part.hi[axis] = part.hi[axis].max(place[axis]);
                sum[axis] += place[axis];
            }
            part.first_id = part.first_id.min(cloud.id[point]);
            last_id = last_id.max(cloud.id[point]);
            plane.push([place[0], place[1]]);
        }
        if plane.len() > MANY_POINTS {
            without_inner_points(plane);
        }
        part.hull = convex_hull(plane);
        for vertex in &mut part.hull {
            *vertex = [vertex[0] + cloud.origin[0], vertex[1] + cloud.origin[1]];
        }
        for (axis, &origin) in cloud.origin.iter().enumerate() {
            part.lo[axis] += origin;
            part.hi[axis] += origin;
            part.sum[axis] = i128::from(sum[axis]) + i128::from(origin) * i128::from(part.points);
        }
        part.files = vec![file(part.first_id)];
        if file(last_id) != part.files[0] {
            part.files = members.iter().map(|&point| file(cloud.id[point as usize])).collect();
            part.files.sort_unstable();
            part.files.dedup();
        }
        part
    }

    /// Adds another part of the same object. The two parts have no point in common.
    pub fn merge(&mut self, other: &Self) {
        self.points += other.points;
        self.first_id = self.first_id.min(other.first_id);
        for axis in 0..3 {
            self.lo[axis] = self.lo[axis].min(other.lo[axis]);
            self.hi[axis] = self.hi[axis].max(other.hi[axis]);
            self.sum[axis] += other.sum[axis];
        }
        self.hull.extend(&other.hull);
        self.hull = convex_hull(&mut self.hull);
        self.files.extend(&other.files);
        self.files.sort_unstable();
        self.files.dedup();
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::model::{Lattice, in_u32};

    fn cloud(points: &[[i64; 3]]) -> TileCloud {
        TileCloud::from_lattice_points(Lattice::MILLIMETRE, points)
    }

    /// The file of a point, where every file has `points`.
    fn file_of(id: PointId, points: u64) -> FileId {
        FileId::new(in_u32(id.number() / points, "files"))
    }

    #[test]
    fn parts_sum_up_their_points() {
        let points = [[-5, 0, 7], [1, 1, 1], [3, 0, 9], [8, 8, 8], [-1, 4, 2], [0, 1, 5]];
        let labels = [2, 0, 2, 1, 2, 2];
        // The last point of label 2 is in the halo, label 3 has no points. Each file has three points.
        let parts = ObjectPart::collect(&cloud(&points), &labels, 3, |point| point != 5, |id| file_of(id, 3));
        assert_eq!(parts.len(), 3);
        assert_eq!(
            parts[1],
            ObjectPart {
                points: 3,
                first_id: PointId::new(0),
                lo: [-5, 0, 2],
                hi: [3, 4, 9],
                sum: [-3, 4, 18],
                hull: vec![[-5, 0], [3, 0], [-1, 4]],
                files: vec![FileId::new(0), FileId::new(1)],
            }
        );
        assert_eq!((parts[0].points, parts[0].first_id, &parts[0].hull), (1, PointId::new(3), &vec![[8, 8]]));
        assert_eq!(parts[2], ObjectPart::empty());
    }

    #[test]
    fn no_points_and_no_labels_make_no_parts() {
        assert_eq!(ObjectPart::collect(&cloud(&[]), &[], 0, |_| true, |_| FileId::new(0)), []);
    }

    proptest! {
        #[test]
        fn merged_in_any_order_parts_are_the_whole(
            points in prop::collection::vec(([-40..40_i64, -40..40_i64, -40..40_i64], 0..4_usize), 1..200),
            shift in prop::array::uniform3(-(1_i64 << 49)..1 << 49),
            order in Just([0_usize, 1, 2, 3]).prop_shuffle(),
        ) {
            let places: Vec<[i64; 3]> =
                points.iter().map(|(p, _)| [p[0] + shift[0], p[1] + shift[1], p[2] + shift[2]]).collect();
            let cloud = cloud(&places);
            let labels = vec![1; points.len()];
            let collect = |core: &dyn Fn(usize) -> bool| {
                ObjectPart::collect(&cloud, &labels, 1, core, |id| file_of(id, 7)).remove(0)
            };
            let mut merged = ObjectPart::empty();
            for tile in order {
                merged.merge(&collect(&|point| points[point].1 == tile));
            }
            prop_assert_eq!(merged, collect(&|_| true));
        }
    }
}

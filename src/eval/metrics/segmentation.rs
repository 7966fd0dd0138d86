//! Under- and over-segmentation of single objects (Li et al. 2017, section 4.4). The rates are counts over
//! objects, made elsewhere.
//!
//! S(o) is the segment that contains most points of object o (ties: the smaller id).
//! * o is *under-segmented* if S(o) is also S(o') of another evaluated object, or contains at least 20 % of
//!   one.
//! * o is *over-segmented* if a second segment contains at least 10 % and at least 30 points of it.
//! * OA = 1 - (USR + OSR) / 2.
//!
//! An object without a point in any segment is neither: the definition has no third case, so an empty
//! prediction has OA 1. Such objects are counted beside OA (`without_segment`). The other metrics count them
//! as missed.

use crate::eval::metrics::overlaps::{Overlap, Scene};

/// Share of another object in S(o) from which on o is under-segmented, in percent (Li et al. 2017, section
/// 4.4).
const SHARED_PERCENT: u64 = 20;
/// Share of an object in a second segment from which on it is over-segmented, in percent (Li et al. 2017,
/// section 4.4).
const SECOND_PERCENT: u64 = 10;
/// Number of points of an object in a second segment from which on it is over-segmented (Li et al. 2017,
/// section 4.4).
const SECOND_POINTS: u64 = 30;

/// Outcome of one object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Segmentation {
    /// The other object that makes it under-segmented, as index, and the number of its points in S(o).
    pub shared_with: Option<Overlap>,
    /// The second segment that makes it over-segmented, and the number of points of the object in it.
    pub second: Option<Overlap>,
}

impl Segmentation {
    /// Whether the segment of the object is also S(o') of another object, or contains much of another object.
    #[must_use]
    pub fn is_under(&self) -> bool {
        self.shared_with.is_some()
    }

    /// Whether a second segment contains much of the object.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.second.is_some()
    }
}

/// Judges every object of the scene, in its order.
#[must_use]
pub fn judge(scene: &Scene) -> Vec<Segmentation> {
    let claims = claims(scene);
    let judge_one = |(index, object): (usize, &crate::eval::metrics::overlaps::Object)| {
        let shared_with = object
            .main()
            .and_then(|main| claims[main.index].into_iter().flatten().find(|claim| claim.index != index));
        let second = object.overlaps.get(1).copied().filter(|second| {
            100 * second.points >= SECOND_PERCENT * object.points && second.points >= SECOND_POINTS
        });
        Segmentation { shared_with, second }
    };
    scene.objects.iter().enumerate().map(judge_one).collect()
}

/// Per segment: the first two objects, largest overlap first, for which it is S(o) or of which it contains
/// much. Two are enough: an object is under-segmented if one of them is another object.
fn claims(scene: &Scene) -> Vec<[Option<Overlap>; 2]> {
    let claims_of = |(index, segment): (usize, &crate::eval::metrics::overlaps::Segment)| {
        let mut claims = segment.overlaps.iter().copied().filter(|overlap| {
            let object = &scene.objects[overlap.index];
            let is_main = object.main().is_some_and(|main| main.index == index);
            is_main || 100 * overlap.points >= SHARED_PERCENT * object.points
        });
        [claims.next(), claims.next()]
    };
    scene.segments.iter().enumerate().map(claims_of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eval::metrics::overlaps::tests::scene_of;

    /// `(under, over)` of every object.
    fn flags(parts: &[(i64, i64, u64)]) -> Vec<(bool, bool)> {
        judge(&scene_of(parts, |_| 2)).iter().map(|o| (o.is_under(), o.is_over())).collect()
    }

    #[test]
    fn hand_made_cases() {
        for (what, parts, expected) in [
            ("perfect", vec![(1, 1, 50), (2, 2, 50)], vec![(false, false); 2]),
            ("merged", vec![(1, 1, 50), (2, 1, 50)], vec![(true, false); 2]),
            ("split", vec![(1, 1, 60), (1, 2, 40)], vec![(false, true)]),
            ("swapped", vec![(1, 2, 50), (2, 1, 50)], vec![(false, false); 2]),
            ("empty", vec![(1, 0, 50), (2, 0, 50)], vec![(false, false); 2]),
            // 29 points are too few, though 29 of 100 is more than 10 %.
            ("29 points aside", vec![(1, 1, 71), (1, 2, 29)], vec![(false, false)]),
            ("30 points aside", vec![(1, 1, 70), (1, 2, 30)], vec![(false, true)]),
            // 30 of 301 is less than 10 %, 30 of 300 is not.
            ("30 of 301", vec![(1, 1, 271), (1, 2, 30)], vec![(false, false)]),
            ("30 of 300", vec![(1, 1, 270), (1, 2, 30)], vec![(false, true)]),
            // S(1) = 1 contains 20 % of object 2, whose own segment is 2: only object 1 is under-segmented.
            (
                "20 % of another",
                vec![(1, 1, 50), (2, 1, 20), (2, 2, 80)],
                vec![(true, false), (false, false)],
            ),
            ("19 % of another", vec![(1, 1, 50), (2, 1, 19), (2, 2, 81)], vec![(false, false); 2]),
            // S(2) = 1 with 15 %, because the rest of object 2 has no segment.
            ("main with 15 %", vec![(1, 1, 50), (2, 1, 15), (2, 0, 85)], vec![(true, false); 2]),
            // An object too small to be evaluated does not make another one under-segmented.
            ("small neighbour", vec![(1, 1, 50), (2, 1, 29)], vec![(false, false)]),
            ("ground neighbour", vec![(1, 1, 50), (0, 1, 500)], vec![(false, false)]),
        ] {
            assert_eq!(flags(&parts), expected, "{what}");
        }
    }

    #[test]
    fn the_other_object_is_named() {
        let scene = scene_of(&[(1, 7, 50), (2, 7, 40), (3, 7, 60)], |_| 2);
        let judged = judge(&scene);
        // Largest overlap first: object 3 (60 points); for object 3 itself, object 1 (50 points).
        assert_eq!(judged[0].shared_with, Some(Overlap { index: 2, points: 60 }));
        assert_eq!(judged[2].shared_with, Some(Overlap { index: 0, points: 50 }));
    }
}

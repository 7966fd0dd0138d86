//! Panoptic quality (Kirillov et al. 2019, doi:10.1109/CVPR.2019.00963): matches segments and objects at IoU
//! > 0.5.
//!
//! The specification of the metrics leaves four points open. They are settled here:
//! * Segments of fewer than `min_points` (30) points are ignored, even as matches. The same applies to such
//!   objects.
//! * A segment does not count as false if more than half of it belongs to no evaluated object (the void rule
//!   of Kirillov et al., section 4.2, threshold 0.5). It cannot match: its IoU with any object is below 0.5.
//! * Points of a segment outside objects count in its IoU. The paper removes void there. But void in the
//!   paper is unlabelled by the annotators. Our unlabelled points are mostly ground, which is known not to
//!   belong to the object.
//! * The mean best IoU is taken over all segments, including small ones.

use crate::eval::metrics::overlaps::{Object, Overlap, Scene};

/// The overlap of an object and a segment: number of points in the intersection and in the union.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Iou {
    /// Index of the segment.
    pub segment: usize,
    /// Points of both.
    pub intersection: u64,
    /// Points of either.
    pub union: u64,
}

impl Iou {
    fn of(scene: &Scene, object: &Object, overlap: &Overlap) -> Self {
        let union = object.points + scene.segments[overlap.index].points - overlap.points;
        Self { segment: overlap.index, intersection: overlap.points, union }
    }

    /// Intersection over union.
    #[must_use]
    pub fn value(self) -> f64 {
        self.intersection as f64 / self.union as f64
    }

    /// Whether the two match. An object matches at most one segment, and a segment at most one object.
    #[must_use]
    pub fn is_match(self) -> bool {
        2 * self.intersection > self.union
    }

    /// Whether this IoU is larger than the other, compared exactly.
    fn exceeds(self, other: Self) -> bool {
        u128::from(self.intersection) * u128::from(other.union)
            > u128::from(other.intersection) * u128::from(self.union)
    }
}

/// Outcome of a segment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SegmentRole {
    /// It matches an object.
    Matched,
    /// It matches no object and counts against its class.
    FalsePositive,
    /// It has too few points to count.
    Small,
    /// Most of its points belong to no object.
    Unlabelled,
}

impl SegmentRole {
    /// One word for tables.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Matched => "matched",
            Self::FalsePositive => "false positive",
            Self::Small => "small",
            Self::Unlabelled => "unlabelled",
        }
    }
}

/// The matches of a scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Panoptic {
    /// Per object: the segment with the largest IoU, whatever its size (ties: more points in common, then
    /// smaller id).
    pub best: Vec<Option<Iou>>,
    /// Per object: whether it is matched with that segment.
    pub matched: Vec<bool>,
    /// Per segment.
    pub segments: Vec<SegmentRole>,
}

/// Matches the objects and segments of a scene; segments need `min_points` points.
#[must_use]
pub fn judge(scene: &Scene, min_points: u64) -> Panoptic {
    let best: Vec<Option<Iou>> = scene.objects.iter().map(|object| best_iou(scene, object)).collect();
    let counts = |iou: &Iou| iou.is_match() && scene.segments[iou.segment].points >= min_points;
    let matched: Vec<bool> = best.iter().map(|iou| iou.as_ref().is_some_and(counts)).collect();
    let mut segments: Vec<SegmentRole> = scene
        .segments
        .iter()
        .map(|segment| match segment {
            small if small.points < min_points => SegmentRole::Small,
            other if other.mostly_unlabelled() => SegmentRole::Unlabelled,
            _ => SegmentRole::FalsePositive,
        })
        .collect();
    for iou in best.iter().flatten().filter(|iou| counts(iou)) {
        segments[iou.segment] = SegmentRole::Matched;
    }
    Panoptic { best, matched, segments }
}

fn best_iou(scene: &Scene, object: &Object) -> Option<Iou> {
    let candidates = object.overlaps.iter().map(|overlap| Iou::of(scene, object, overlap));
    candidates.reduce(|best, next| if next.exceeds(best) { next } else { best })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eval::metrics::overlaps::tests::scene_of;

    fn judged(parts: &[(i64, i64, u64)]) -> (Vec<bool>, Vec<&'static str>) {
        let panoptic = judge(&scene_of(parts, |_| 2), 30);
        let words = panoptic.segments.iter().map(|role| role.word()).collect();
        (panoptic.matched, words)
    }

    #[test]
    fn hand_made_cases() {
        for (what, parts, matched, roles) in [
            ("perfect", vec![(1, 1, 50), (2, 2, 50)], vec![true; 2], vec!["matched"; 2]),
            ("swapped", vec![(1, 2, 50), (2, 1, 50)], vec![true; 2], vec!["matched"; 2]),
            ("empty", vec![(1, 0, 50)], vec![false], vec![]),
            // IoU 60 / 100, then exactly 0.5 twice.
            ("split", vec![(1, 1, 60), (1, 2, 40)], vec![true], vec!["matched", "false positive"]),
            ("halves", vec![(1, 1, 50), (1, 2, 50)], vec![false], vec!["false positive"; 2]),
            ("merged", vec![(1, 1, 50), (2, 1, 50)], vec![false; 2], vec!["false positive"]),
            ("noise", vec![(1, 1, 50), (0, 2, 50)], vec![true], vec!["matched", "unlabelled"]),
            // A segment that is exactly half ground is not mostly unlabelled.
            ("half on ground", vec![(1, 1, 50), (0, 1, 50)], vec![false], vec!["false positive"]),
            ("small segment", vec![(1, 1, 29), (1, 0, 1)], vec![false], vec!["small"]),
            ("30 points", vec![(1, 1, 30)], vec![true], vec!["matched"]),
        ] {
            assert_eq!(judged(&parts), (matched, roles), "{what}");
        }
    }

    #[test]
    fn the_best_iou_is_not_always_that_of_the_main_segment() {
        // S(1) = 1 with 60 of 100 points, but segment 1 has 500 points: IoU 60 / 540, segment 2 has 40 / 100.
        let panoptic = judge(&scene_of(&[(1, 1, 60), (0, 1, 440), (1, 2, 40)], |_| 2), 30);
        assert_eq!(panoptic.best[0], Some(Iou { segment: 1, intersection: 40, union: 100 }));
    }
}

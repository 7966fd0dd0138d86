//! The border of two adjacent slices: how far its points are from the plane of the other slice.
//!
//! This is not in the paper. Equation 11 compares only normals. So a road and a pavement, which are parallel,
//! become one surface: neighbourhoods reach across the kerb, and the two points of a mutual pair may lie on
//! different sides of it. Each point of such a pair is far from the plane of the other slice, compared with
//! the deviation of the points of either slice. If two slices are parts of one plane or of one bent surface,
//! it is about as far from that plane as the points of the other slice.

use serde::{Deserialize, Serialize};

use super::slice::SlicePlane;

/// Number of steps of a distance per lattice unit. Sums of steps are integers, so their order does not
/// matter.
const STEPS: f64 = 1024.0;
/// Smallest deviation in lattice units. Smaller deviations are raised to it, because coordinates are rounded
/// to whole lattice units.
pub(super) const LEAST_DEVIATION: f64 = 1.0;

/// Mutual pairs of consistent points of two slices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(super) struct Border {
    /// Number of pairs. Each pair has two distances: each point from the plane of the other slice.
    pairs: u64,
    /// Sum of the distances in steps.
    steps: u64,
}

impl Border {
    /// Adds a pair: for each slice its plane and its lattice point.
    #[inline]
    pub(super) fn add(&mut self, a: (&SlicePlane, [i64; 3]), b: (&SlicePlane, [i64; 3])) {
        self.pairs += 1;
        self.steps += steps(a.0.distance(b.1)) + steps(b.0.distance(a.1));
    }

    /// Adds other pairs of the same slices.
    pub(super) fn merge(&mut self, other: &Self) {
        self.pairs += other.pairs;
        self.steps += other.steps;
    }

    /// Mean distance in lattice units; 0 without pairs.
    pub(super) fn mean(&self) -> f64 {
        self.steps as f64 / (STEPS * 2.0 * self.pairs.max(1) as f64)
    }

    /// Whether the mean distance is below `score` times the larger deviation of both slices, in lattice
    /// units.
    pub(super) fn agrees(&self, score: f64, deviation: f64) -> bool {
        self.mean() < score * deviation.max(LEAST_DEVIATION)
    }
}

/// A distance in steps.
#[inline]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "not negative, below 2^40 steps")]
pub(super) fn steps(distance: f64) -> u64 {
    (distance * STEPS + 0.5) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level(z: i64, deviation: f64) -> SlicePlane {
        SlicePlane { normal: [0.0, 0.0, 1.0], origin: [0, 0, z], through: 0.0, deviation }
    }

    #[test]
    fn a_step_does_not_agree_and_one_plane_does_in_any_order() {
        let (road, pavement, same) = (level(0, 10.0), level(120, 9.0), level(4, 11.0));
        let mut step = Border::default();
        step.add((&road, [3, 4, 6]), (&pavement, [5, 4, 110]));
        assert!((step.mean() - 112.0).abs() < 1e-9, "{step:?}");
        assert!(!step.agrees(2.5, 10.0) && step.agrees(12.0, 10.0));
        let (mut one, mut other) = (Border::default(), Border::default());
        one.add((&road, [0, 0, -8]), (&same, [1, 0, 10]));
        other.add((&same, [1, 0, -3]), (&road, [0, 0, 20]));
        let mut all = one;
        all.merge(&other);
        other.merge(&one);
        assert_eq!(all, other);
        assert!((all.mean() - (12.0 + 10.0 + 3.0 + 16.0) / 4.0).abs() < 1e-9 && all.agrees(2.5, 11.0));
        // Without noise there is no deviation, and the smallest deviation decides.
        assert!(Border::default().agrees(2.5, 0.0));
    }
}

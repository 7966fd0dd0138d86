//! The extent of a set of places in 32 directions of the plane. The extremes of two sets give the extremes of
//! their union, so the parts of a component in all tiles can be merged.

use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

/// Directions in half a turn. A box is turned in steps of 5.6 degrees, so a fence of 20 m appears at most 1 m
/// wider than it is.
const DIRECTIONS: usize = 32;
/// Length of [`VECTORS`], a power of two.
const SCALE: f64 = 1024.0;
/// The same as an integer.
pub(crate) const SCALE_UNITS: i64 = 1024;

/// The smallest and the largest coordinate in each direction, in lattice units times [`SCALE`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Spans([(i64, i64); DIRECTIONS]);

/// A box around a set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Extent {
    /// Its shorter and its longer side, in lattice units.
    pub(crate) width: i64,
    pub(crate) length: i64,
    /// Number of the direction of the shorter side.
    across: usize,
}

/// Vectors of the directions. The sines are rounded to integers once, so that every sum is exact.
#[expect(clippy::cast_possible_truncation, reason = "at most SCALE")]
static VECTORS: LazyLock<[[i64; 2]; DIRECTIONS]> = LazyLock::new(|| {
    std::array::from_fn(|number| {
        let (sin, cos) = (number as f64 * std::f64::consts::PI / DIRECTIONS as f64).sin_cos();
        [(cos * SCALE).round() as i64, (sin * SCALE).round() as i64]
    })
});

/// Coordinate of a place in a direction, in lattice units times [`SCALE`].
pub(crate) fn position([x, y]: [i64; 2], number: usize) -> i64 {
    let [u, v] = VECTORS[number];
    x * u + y * v
}

impl Extent {
    /// Number of the direction of the longer side.
    pub(crate) fn along(&self) -> usize {
        (self.across + DIRECTIONS / 2) % DIRECTIONS
    }

    /// Number of the direction of the shorter side.
    pub(crate) fn across(&self) -> usize {
        self.across
    }

    /// Whether the longer sides of two boxes have an angle of at most 45 degrees.
    pub(crate) fn is_parallel(&self, other: &Self) -> bool {
        let apart = self.across.abs_diff(other.across);
        apart.min(DIRECTIONS - apart) <= DIRECTIONS / 4
    }
}

impl Spans {
    pub(crate) fn of_place(place: [i64; 2]) -> Self {
        Self(std::array::from_fn(|number| {
            let along = position(place, number);
            (along, along)
        }))
    }

    /// The smallest coordinate in a direction, as [`position`] gives it.
    pub(crate) fn from(&self, number: usize) -> i64 {
        self.0[number].0
    }

    /// The largest coordinate in a direction.
    pub(crate) fn to(&self, number: usize) -> i64 {
        self.0[number].1
    }

    /// The length in a direction, in lattice units.
    pub(crate) fn length(&self, number: usize) -> i64 {
        (self.0[number].1 - self.0[number].0) / SCALE_UNITS
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        for (one, other) in self.0.iter_mut().zip(&other.0) {
            *one = (one.0.min(other.0), one.1.max(other.1));
        }
    }

    /// The spans of the union of both sets.
    pub(crate) fn union(&self, other: &Self) -> Self {
        let mut union = self.clone();
        union.merge(other);
        union
    }

    /// The box with the shortest shorter side. Of equal boxes, the first direction wins.
    pub(crate) fn narrowest(&self) -> Extent {
        let around = (0..DIRECTIONS).map(|across| Extent {
            width: self.length(across),
            length: self.length((across + DIRECTIONS / 2) % DIRECTIONS),
            across,
        });
        around.min().unwrap_or(Extent { width: 0, length: 0, across: 0 })
    }

    /// The gap between two sets along the longer side of a box around both, in lattice units; negative where
    /// they overlap.
    pub(crate) fn gap(&self, other: &Self, around: Extent) -> i64 {
        let along = around.along();
        let (one, other) = (self.0[along], other.0[along]);
        (one.0.max(other.0) - one.1.min(other.1)) / SCALE_UNITS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(from: i64, to: i64, slope: i64) -> Spans {
        let places = (from..=to).map(|x| Spans::of_place([1000 * x, 1000 * x * slope]));
        places.reduce(|one, other| one.union(&other)).unwrap()
    }

    #[test]
    fn a_line_is_narrow_and_its_pieces_have_a_gap() {
        for slope in [0, 1, -1] {
            let (one, other) = (line(0, 10, slope), line(13, 20, slope));
            let around = one.union(&other).narrowest();
            let long = if slope == 0 { 20_000 } else { 28_284 };
            assert!(around.width < 30 && (around.length - long).abs() < 30, "{around:?}");
            let gap = if slope == 0 { 3_000 } else { 4_243 };
            assert!((one.gap(&other, around) - gap).abs() < 10, "{}", one.gap(&other, around));
        }
        assert!(line(0, 10, 0).union(&line(0, 10, 1)).narrowest().width > 3_000);
    }
}

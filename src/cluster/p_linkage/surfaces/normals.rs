//! Normal, flatness and consistent set of every point (section 3, normal estimation).
//!
//! The plane of a point fits the nearer half of its K nearest neighbours, itself included. Its consistent set
//! are those of all K whose distances from this plane are consistent. A point with fewer than 6 neighbours
//! within reach, or whose nearer half lies on one line or in one place, has no normal. It is linked to
//! nothing.
//!
//! Coordinates are integers relative to the point, so every figure is the same in every tile, to the last
//! bit.

use std::ops::Range;

use super::around::{Around, Zone};
use super::planes::{Consistent, Moments, Scratch, likeness};
use crate::spatial::{self, KNearest, nearest_first, number_of};

/// Fewest neighbours, the point itself included: half of them span a plane.
const FEWEST: usize = 6;
/// No point.
pub(super) const NONE: u32 = u32::MAX;

/// Flatness lambda0 in square lattice units, infinite without a normal, and the normal.
#[derive(Debug, Clone, Copy)]
struct Facts {
    flatness: f64,
    normal: [f64; 3],
}

/// What is known of the points around a tile.
#[derive(Debug)]
pub(super) struct Normals {
    facts: Vec<Facts>,
    /// Where the consistent set of each point is in `members`. Only of points whose link must be known.
    sets: Vec<Range<usize>>,
    members: Vec<u32>,
    /// Points with a consistent set, so that what follows each other is near each other, and mostly in the
    /// cache.
    order: Vec<u32>,
}

impl Normals {
    /// Of `neighbours` points within `reach` lattice units of each point.
    pub(super) fn of(around: &Around, neighbours: usize, reach: i64) -> Self {
        let mut found = Self {
            facts: vec![Facts { flatness: f64::INFINITY, normal: [0.0; 3] }; around.len()],
            sets: vec![0..0; around.len()],
            members: Vec::new(),
            order: Vec::new(),
        };
        let index = KNearest::new(&around.places, neighbours);
        let mut by: Vec<[i32; 3]> = Vec::new();
        let mut distances: Vec<f32> = Vec::new();
        let mut scratch = Scratch::default();
        let mut of_near = spatial::Scratch::default();
        let wanted = |point: u32| around.zone[point as usize] <= Zone::Flat;
        index.each(reach, wanted, |number, near| {
            if near.len() < FEWEST {
                return;
            }
            let point = number as usize;
            let half = near.len() / 2;
            nearest_first(near, half, &mut of_near);
            let [x, y, z] = around.places[point];
            by.clear();
            by.extend(near.iter().map(|near| {
                let [a, b, c] = around.places[number_of(*near) as usize];
                [a - x, b - y, c - z]
            }));
            let Some(fit) = Moments::of_near(by[..half].iter().copied()).fit() else { return };
            found.facts[point] = Facts { flatness: fit.flatness, normal: fit.normal };
            if around.zone[point] > Zone::Linked {
                return;
            }
            distances.clear();
            distances.extend(by.iter().map(|by| fit.rounded_distance(by.map(f64::from))));
            let consistent = Consistent::of(&distances, &mut scratch);
            let start = found.members.len();
            // All are written, and those that are not consistent are overwritten: a branch could not be
            // predicted.
            found.members.resize(start + near.len(), NONE);
            let mut end = start;
            for (near, distance) in near.iter().zip(&distances) {
                found.members[end] = number_of(*near);
                end += usize::from(consistent.holds(*distance));
            }
            found.members.truncate(end);
            found.sets[point] = start..end;
            found.order.push(number);
        });
        found
    }

    /// Points with a consistent set, those near each other after each other.
    pub(super) fn order(&self) -> &[u32] {
        &self.order
    }

    /// Whether a point has a normal.
    pub(super) fn has(&self, point: usize) -> bool {
        self.facts[point].flatness.is_finite()
    }

    /// Flatness of a point in square lattice units; infinite without a normal.
    pub(super) fn flatness(&self, point: usize) -> f64 {
        self.facts[point].flatness
    }

    /// The consistent set of a point.
    pub(super) fn consistent(&self, point: usize) -> &[u32] {
        &self.members[self.sets[point].clone()]
    }

    /// The point to which a point is linked: of the flatter points in its consistent set the one whose normal
    /// deviates least. Ties go to the nearer one, then to the smaller id. [`NONE`] if there is none.
    pub(super) fn link(&self, around: &Around, point: usize) -> u32 {
        let own = &self.facts[point];
        // Likeness, squared distance and number of the best.
        let mut best = (-1.0, u64::MAX, NONE);
        for &other in self.consistent(point) {
            let at = other as usize;
            let there = &self.facts[at];
            // Of two equally flat points, the one with the smaller id is the flatter. Both conditions are
            // computed, because a branch could not be predicted.
            let flatter = (there.flatness < own.flatness)
                | ((there.flatness.to_bits() == own.flatness.to_bits()) & (at < point));
            let alike = if flatter { likeness(own.normal, there.normal) } else { -2.0 };
            if alike < best.0 {
                continue;
            }
            let squared = squared_distance(around.places[point], around.places[at]);
            if alike > best.0 || (squared, other) < (best.1, best.2) {
                best = (alike, squared, other);
            }
        }
        best.2
    }

    /// Whether each of two points is in the consistent set of the other (equation 10). `b` is in that of `a`.
    pub(super) fn is_mutual(&self, a: usize, b: usize) -> bool {
        // All are compared, without a branch: a loop with an exit is slower.
        self.consistent(b).iter().fold(false, |found, &other| found | (other as usize == a))
    }
}

fn squared_distance(a: [i32; 3], b: [i32; 3]) -> u64 {
    (0..3).map(|axis| u64::from(a[axis].abs_diff(b[axis])).pow(2)).sum()
}

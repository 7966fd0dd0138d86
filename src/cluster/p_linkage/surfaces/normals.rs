//! Normal, flatness and consistent set of every point (section 3, normal estimation).
//!
//! The plane of a point is fitted to the nearer half of its K nearest neighbours, itself included. Its
//! consistent set consists of those of all K neighbours whose distances from this plane are consistent. A
//! point has no normal if it has fewer than 6 neighbours within reach, or if their nearer half lies on one
//! line or in one place. Such a point has no link.
//!
//! Coordinates are integers relative to the point, so every result is the same in every tile, to the last
//! bit.

use std::ops::Range;

use super::around::{Around, Zone};
use super::planes::{Consistent, Fit, Scratch, likeness, squared_distance};
use crate::spatial::{Block, Boxes, Columns, KNearest, Look, Loops, NO_POINT, Work, run};

/// Smallest number of neighbours, the point itself included: half of them span a plane.
const FEWEST: usize = 6;
/// No point.
pub(super) const NONE: u32 = u32::MAX;

/// Flatness lambda0 in square lattice units (infinite without a normal), and the normal.
#[derive(Debug, Clone, Copy)]
struct Facts {
    flatness: f64,
    normal: [f64; 3],
}

/// Normals, flatness and consistent sets of the points around a tile. In addition to its position in
/// `around`, a point has a slot in the index of neighbours. Consecutive slots are near each other in space,
/// so neighbours are mostly in the cache.
#[derive(Debug)]
pub(super) struct Normals {
    index: KNearest,
    facts: Vec<Facts>,
    /// Range in `members` of the consistent set of each slot. Empty for points whose link need not be known.
    sets: Vec<Range<usize>>,
    members: Vec<u32>,
    /// Flatness by positions.
    flatness: Vec<f64>,
}

/// The search for neighbours.
struct Search<'a> {
    index: &'a KNearest,
    reach: i64,
    /// Zone of each slot.
    zones: Vec<Zone>,
}

/// Results for each slot.
struct Found {
    facts: Vec<Facts>,
    sets: Vec<Range<usize>>,
    members: Vec<u32>,
}

impl Work for Search<'_> {
    type Output = Found;

    #[inline(always)]
    fn with<L, K>(self, loops: &Loops<L, K>) -> Found
    where
        L: Fn(&[Block], &Boxes, Look, &mut Columns) -> usize,
        K: Fn(&mut Columns, f32),
    {
        let Self { index, reach, zones } = self;
        let mut found = Found {
            facts: vec![Facts { flatness: f64::INFINITY, normal: [0.0; 3] }; zones.len()],
            sets: vec![0..0; zones.len()],
            members: Vec::new(),
        };
        let mut distances: Vec<f32> = Vec::new();
        let mut scratch = Scratch::default();
        let wanted = |slot: usize| zones[slot] <= Zone::Flat;
        index.each_by(loops, reach, wanted, |slot, near| {
            if near.len() < FEWEST {
                return;
            }
            let half = near.len() / 2;
            let limit = near.separate(half, index.numbers());
            let Some(fit) = Fit::of_nearest(near, limit, half) else { return };
            found.facts[slot] = Facts { flatness: fit.flatness, normal: fit.normal };
            if zones[slot] > Zone::Linked {
                return;
            }
            fit.rounded_distances(near.by(), &mut distances);
            distances[near.len()..].fill(f32::INFINITY);
            let consistent = Consistent::of(&distances, near.len(), &mut scratch);
            near.value_by(scratch.deviations());
            (loops.keep)(near, consistent.largest_deviation());
            let start = found.members.len();
            found.members.extend_from_slice(near.at());
            found.sets[slot] = start..found.members.len();
        });
        found
    }
}

impl Normals {
    /// Computes them from up to `neighbours` points within `reach` lattice units of each point.
    pub(super) fn of(around: &Around, neighbours: usize, reach: i64) -> Self {
        let index = KNearest::new(&around.places, neighbours);
        // For slots without a point, no neighbours are searched.
        let zone_of = |point: &u32| around.zone.get(*point as usize).copied().unwrap_or(Zone::Place);
        let zones = index.numbers().iter().map(zone_of).collect();
        let Found { facts, sets, members } = run(Search { index: &index, reach, zones });
        let mut flatness = vec![f64::INFINITY; around.len()];
        for (&point, facts) in index.numbers().iter().zip(&facts).filter(|(point, _)| **point != NO_POINT) {
            flatness[point as usize] = facts.flatness;
        }
        Self { index, facts, sets, members, flatness }
    }

    /// Slots with a consistent set.
    pub(super) fn slots(&self) -> impl Iterator<Item = usize> {
        (0..self.sets.len()).filter(|&slot| !self.sets[slot].is_empty())
    }

    /// The position in `around` of the point in each slot.
    pub(super) fn points(&self) -> &[u32] {
        self.index.numbers()
    }

    /// Whether a point has a normal.
    pub(super) fn has(&self, point: usize) -> bool {
        self.flatness[point].is_finite()
    }

    /// Flatness of a point in square lattice units; infinite without a normal.
    pub(super) fn flatness(&self, point: usize) -> f64 {
        self.flatness[point]
    }

    /// The slots of the consistent set of a slot.
    pub(super) fn consistent(&self, slot: usize) -> &[u32] {
        &self.members[self.sets[slot].clone()]
    }

    /// The slot to which a slot is linked: of the flatter points in its consistent set, the one whose normal
    /// deviates least. Ties go to the nearer one, then to the first in the order of places. `None` if there
    /// is none.
    pub(super) fn link(&self, slot: usize) -> Option<usize> {
        let own = &self.facts[slot];
        let points = self.points();
        let apart = |other: usize| squared_distance(self.index.place(slot), self.index.place(other));
        // Likeness and slot of the best.
        let mut best: (f64, Option<usize>) = (-1.0, None);
        for other in self.consistent(slot).iter().map(|&other| other as usize) {
            let there = &self.facts[other];
            // Of two equally flat points, the first in the order of places counts as flatter.
            let flatter = there.flatness < own.flatness
                || (there.flatness.to_bits() == own.flatness.to_bits() && points[other] < points[slot]);
            // A branch could not be predicted.
            let alike = if flatter { likeness(own.normal, there.normal) } else { -2.0 };
            if alike < best.0 {
                continue;
            }
            let is_nearer = |best: usize| (apart(other), points[other]) < (apart(best), points[best]);
            if alike > best.0 || best.1.is_none_or(is_nearer) {
                best = (alike, Some(other));
            }
        }
        best.1
    }

    /// Whether each of two slots is in the consistent set of the other (equation 10). The caller knows that
    /// `b` is in the set of `a`.
    pub(super) fn is_mutual(&self, a: usize, b: usize) -> bool {
        // All are compared, without a branch: a loop with an exit is slower.
        self.consistent(b).iter().fold(false, |found, &other| found | (other as usize == a))
    }
}

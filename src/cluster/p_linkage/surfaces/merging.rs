//! Merges touching surfaces after a contest, if they agree at their border and share a plane.
//!
//! Agreement at the border is not enough. The two sides of a roof touch at its ridge, and a small surface on
//! the ridge agrees with both. So pairs are merged one after the other, the longest border first. A pair is
//! merged only if the points of the smaller surface are as near to the plane of the larger one as its own
//! points. If borders are equally long, sums over the points decide the order, because the numbers of
//! surfaces depend on the tiles.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use super::border::LEAST_DEVIATION;
use super::contest::Touching;
use super::contested::OnPlane;
use super::cubes::LOCAL_POINTS;
use super::planes::{Fit, LARGEST_SCORE, Moments};
use crate::spatial::DisjointSets;

/// Moments of the points of a surface.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Known {
    /// Of the points that are consistent with local planes after the contest.
    pub(super) now: OnPlane,
    /// Of the points that are consistent with the planes of its slices.
    pub(super) of_slices: Moments,
}

/// Orders surfaces by their points, independently of their numbers.
type Rank = [(u64, [i128; 3]); 3];
/// Two touching surfaces, ordered as they are merged: the length of their border, their ranks, and their
/// numbers.
type Candidate = (Reverse<u64>, (Rank, Rank), (u32, u32));

impl Known {
    fn rank(&self) -> Rank {
        [self.now.amid, self.now.at_edges, self.of_slices].map(|moments| (moments.points, moments.sums))
    }

    pub(super) fn merge(&mut self, other: &Self) {
        self.now.merge(&other.now);
        self.of_slices.merge(&other.of_slices);
    }

    /// The points to which the plane of the surface is fitted, and the plane. `None` if no points have a
    /// plane.
    ///
    /// The plane is fitted to the points that are consistent with local planes and away from edges. At an
    /// edge, some points of the other plane are nearer to this one by chance, always on the same side, so a
    /// narrow plane would lean by degrees. If too few points are away from edges, all consistent points
    /// count. But local planes include parts that stand out slightly from a facade, which slices leave out.
    /// So the points of the slices count instead if they are flatter and at least half as many.
    pub(super) fn plane(&self) -> Option<(Moments, Fit)> {
        let of = |moments: Moments| moments.fit().map(|fit| (moments, fit));
        let many = |moments: Moments| if moments.points >= LOCAL_POINTS { of(moments) } else { None };
        let all = self.now.all();
        let now = many(self.now.amid).or_else(|| many(all));
        let of_slices = of(self.of_slices);
        match (now, of_slices) {
            (Some(now), Some(of_slices)) => {
                let flatter = of_slices.1.flatness < now.1.flatness;
                let enough = 2 * of_slices.0.points >= all.points;
                Some(if flatter && enough { of_slices } else { now })
            }
            (now, of_slices) => now.or(of_slices),
        }
    }
}

/// Merges surfaces in `sets`, and their moments in `known`, which has them by the number of their set.
/// Returns the number of merged pairs.
pub(super) fn merge(
    touching: &BTreeMap<(u32, u32), Touching>,
    sets: &mut DisjointSets,
    known: &mut BTreeMap<u32, Known>,
) -> u64 {
    let rank = |surface: u32| known.get(&surface).copied().unwrap_or_default().rank();
    let ranks = |(a, b): (u32, u32)| (rank(a).min(rank(b)), rank(a).max(rank(b)));
    let mut pairs: Vec<Candidate> =
        touching.iter().map(|(pair, touching)| (Reverse(touching.pairs()), ranks(*pair), *pair)).collect();
    pairs.sort_unstable();
    let mut merged = 0;
    for (.., (a, b)) in pairs {
        let [a, b] = [a, b].map(|surface| sets.find(surface));
        if a == b {
            continue;
        }
        let [of_a, of_b] = [a, b].map(|surface| known.get(&surface).copied().unwrap_or_default());
        if !on_one_plane(&of_a, &of_b) {
            continue;
        }
        sets.union(a, b);
        let mut both = of_a;
        both.merge(&of_b);
        known.remove(&a);
        known.remove(&b);
        known.insert(sets.find(a), both);
        merged += 1;
    }
    merged
}

/// Whether the points of the smaller surface are near enough to the plane of the larger one: the root of
/// their mean squared distance is below 2.5 deviations (equation 7). The deviation is the larger one of both
/// planes.
fn on_one_plane(a: &Known, b: &Known) -> bool {
    let (Some(a), Some(b)) = (a.plane(), b.plane()) else { return false };
    let rank = |of: &(Moments, Fit)| (of.0.points, of.0.sums);
    let (small, large) = if rank(&a) < rank(&b) { (a, b) } else { (b, a) };
    let flatness = small.1.flatness.max(large.1.flatness).max(LEAST_DEVIATION.powi(2));
    small.0.off_plane(&large.1) < LARGEST_SCORE.powi(2) * flatness
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A surface of points every 20 mm on a rectangle of `along` by `across` mm from a corner, off it by
    /// up to 5 mm.
    fn surface(corner: [i64; 3], along: [i64; 3], across: [i64; 3], size: [i64; 2]) -> Known {
        let mut now = OnPlane::default();
        let mut number = 0;
        for u in 0..size[0] / 20 {
            for v in 0..size[1] / 20 {
                number += 1;
                let off = number * 7_919 % 11 - 5;
                // The vectors `along` and `across` are in thousandths.
                let at = |axis: usize| corner[axis] + (along[axis] * u * 20 + across[axis] * v * 20) / 1_000;
                now.amid.add([at(0), at(1), at(2) + off]);
            }
        }
        Known { now, of_slices: Moments::default() }
    }

    fn touching(pairs: u64) -> Touching {
        let mut touching = Touching::default();
        (0..pairs).for_each(|_| touching.merge(&Touching::one()));
        touching
    }

    /// Merges surfaces 1, 2, ... by pairs with the length of their border. Returns the set of each.
    fn merged(surfaces: &[Known], pairs: &[((u32, u32), u64)]) -> Vec<u32> {
        let mut known: BTreeMap<u32, Known> = (1..).zip(surfaces.iter().copied()).collect();
        let touching = pairs.iter().map(|(pair, border)| (*pair, touching(*border))).collect();
        let count = u32::try_from(surfaces.len()).unwrap();
        let mut sets = DisjointSets::new(count + 1);
        let merges = merge(&touching, &mut sets, &mut known);
        assert_eq!(known.len() as u64 + merges, u64::from(count));
        (1..=count).map(|surface| sets.find(surface)).collect()
    }

    #[test]
    fn a_surface_on_the_ridge_joins_one_side_of_a_roof() {
        // Slopes of 0.1 on both sides: 11 degrees between the sides, 6 degrees between each side and the
        // ridge.
        let west = surface([0, 0, 0], [995, 0, 100], [0, 1_000, 0], [3_000, 4_000]);
        let ridge = surface([2_985, 0, 300], [1_000, 0, 0], [0, 1_000, 0], [60, 4_000]);
        let east = surface([3_045, 0, 300], [995, 0, -100], [0, 1_000, 0], [3_000, 3_900]);
        let sets = merged(&[west, ridge, east], &[((1, 2), 50), ((2, 3), 40)]);
        assert_eq!(sets[0], sets[1]);
        assert_ne!(sets[0], sets[2]);
        let sets = merged(&[west, ridge, east], &[((1, 2), 40), ((2, 3), 50)]);
        assert_eq!(sets[1], sets[2], "the longer border comes first");
        assert_ne!(sets[0], sets[1]);
    }

    #[test]
    fn numbers_of_surfaces_do_not_decide_between_equally_long_borders() {
        let west = surface([0, 0, 0], [995, 0, 100], [0, 1_000, 0], [3_000, 4_000]);
        let ridge = surface([2_985, 0, 300], [1_000, 0, 0], [0, 1_000, 0], [60, 4_000]);
        let east = surface([3_045, 0, 300], [995, 0, -100], [0, 1_000, 0], [3_000, 4_000]);
        let joins_west = |sets: [u32; 3]| {
            assert!((sets[0] == sets[1]) != (sets[1] == sets[2]), "{sets:?}");
            sets[0] == sets[1]
        };
        let [w, r, e] = merged(&[west, ridge, east], &[((1, 2), 50), ((2, 3), 50)])[..] else { panic!() };
        let first = joins_west([w, r, e]);
        let [e, r, w] = merged(&[east, ridge, west], &[((1, 2), 50), ((2, 3), 50)])[..] else { panic!() };
        assert_eq!(joins_west([w, r, e]), first);
    }

    #[test]
    fn pieces_of_a_kerb_are_one_surface_and_a_step_beside_it_is_not() {
        let piece = |x: i64, y: i64| surface([x, y, 0], [0, 0, 1_000], [1_000, 0, 0], [120, 2_000]);
        let sets = merged(&[piece(0, 0), piece(2_000, 0), piece(4_000, 60)], &[((1, 2), 9), ((2, 3), 9)]);
        assert_eq!(sets, [1, 1, 3]);
    }

    #[test]
    fn what_stands_out_of_a_facade_does_not_count_if_the_slices_leave_it_out() {
        let facade = surface([0, 0, 0], [1_000, 0, 0], [0, 1_000, 0], [3_000, 3_000]);
        let frame = surface([0, 0, 60], [1_000, 0, 0], [0, 1_000, 0], [600, 600]);
        let mut known = facade;
        known.merge(&frame);
        let alone = |known: &Known| known.plane().unwrap().1.flatness.sqrt();
        assert!(alone(&known) > 10.0 && alone(&facade) < 4.0);
        known.of_slices = facade.now.all();
        assert_eq!(alone(&known).to_bits(), alone(&facade).to_bits());
        // Slices with less than half of the points may lean, so they do not count.
        known.of_slices = frame.now.all();
        assert!(alone(&known) > 10.0);
    }

    #[test]
    fn surfaces_without_planes_stay_apart() {
        let point = Known::default();
        assert_eq!(merged(&[point, point], &[((1, 2), 9)]), [1, 2]);
    }
}

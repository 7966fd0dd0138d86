//! The heights of an object: how many points are in each slice, and between which heights the object extends.
//! A few points that a gap separates from the rest do not belong to it, for example reflections below the
//! ground, or leaves above a sign.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::classes::{BUILDING, POLE, TREE, WIRE};
use super::sketch::{Patch, Sketch};
use crate::model::Lattice;

/// Shortest gap that can detach points, in metres. Measured on three drives of `synth` and one labelled
/// scene: at 0.25 m, the top of a tree was lost; at 0.4 m, leaves stayed on hedges.
const SHORTEST_GAP_M: f64 = 0.3;
/// Smallest ratio of a gap below the object to the longest gap in the lowest part of the object, and the
/// height of this part in metres (both chosen).
const TIMES_BESIDE: i64 = 2;
const BESIDE_M: f64 = 2.0;
/// Smallest ratio of a gap above the object to the longest gap in it. The rings of a spinning head are half a
/// metre apart on a tree or lamp, and farther apart the higher they are; few points of a far lamp are at its
/// top. Measured on 29 drives and scenes (`benches/results/attributes.md`): the tops of 214 of 2,451 trees
/// and 68 of 727 poles are wrong by more than 0.3 m. With twice the longest gap within 2 m, 275 and 111 were
/// wrong.
const TIMES_BELOW: i64 = 6;
/// Shortest gap that detaches a single point above a building, in metres. Everything else above a roof
/// belongs to the building. Measured in the same study: a single point above this gap did not belong to the
/// building in three of three cases; more points, or points above a shorter gap, did in 32 of 33.
const ABOVE_ROOF_M: f64 = 1.0;
/// Largest share of the points that a gap can detach, per metre of the gap. Measured in the same study:
/// points that did not belong to the object were up to 0.17 of its points per metre, and no object lost a
/// part.
const SHARE_PER_M: f64 = 1.0 / 6.0;
/// Largest share of the points that a gap of any length can detach: half of a lamp may be hidden behind a
/// crown. Measured in the same study: 0.18 of the points of a sign were leaves 4 m above it.
const LARGEST_SHARE: f64 = 0.2;

/// Depth below the ground from which points are reflections, in metres (chosen: the ground model is wrong by
/// this much where a hedge hides the ground). They are at most [`LARGEST_SHARE`] of the points: if there are
/// more, the model is wrong.
const DEEPEST_M: f64 = 1.0;

/// Depth below the ground down to which the lowest points of a tree or pole are parts of its stem, in metres
/// (chosen: the ground below a crown is wrong by this much on a slope). Of a far stem few points are seen,
/// with gaps of metres among them.
const STEM_BELOW_M: f64 = 0.3;

/// One point of a wire in this many is dropped from its top: the highest points are leaves or the top of a
/// pole. Measured on the six wires of `synth suburb` with seed 7 that are found: with all points, their tops
/// are 0.14 m too high (RMSE); with this rule, 0.04 m.
const OVER_WIRE: u64 = 200;

/// The points of a horizontal slice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Slice {
    pub(crate) points: u64,
    /// Smallest lattice z of a point.
    pub(crate) lowest: i64,
    /// Largest lattice z of a point.
    pub(crate) highest: i64,
}

impl Patch for Slice {
    fn merge(&mut self, other: &Self) {
        self.points += other.points;
        self.lowest = self.lowest.min(other.lowest);
        self.highest = self.highest.max(other.highest);
    }
}

/// The heights between which an object extends, in lattice z, without detached points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Ends {
    pub(crate) bottom: i64,
    pub(crate) top: i64,
}

impl Ends {
    /// The ends of an object of a class with this profile; `None` without points. `ground` is the lattice z
    /// of the ground below the object, if it is known.
    pub(crate) fn new(
        profile: &Sketch<Slice>,
        class: u8,
        ground: Option<i64>,
        lattice: Lattice,
    ) -> Option<Self> {
        let mut ends = Self::of(profile, class, lattice)?;
        if let Some(ground) = ground.filter(|_| matches!(class, TREE | POLE)) {
            let of_stem = |slice: &Slice| slice.lowest >= ground - lattice.units(STEM_BELOW_M);
            let lowest = profile.voxels.iter().map(|(_, slice)| *slice).find(of_stem);
            ends.bottom = lowest.map_or(ends.bottom, |slice| slice.lowest.min(ends.bottom));
        }
        if class == WIRE {
            let slices = || profile.voxels.iter().map(|(_, slice)| slice);
            let most = slices().map(|slice| slice.points).sum::<u64>() / OVER_WIRE;
            let mut above = 0;
            let top = slices().rev().find(|slice| {
                above += slice.points;
                above > most
            });
            ends.top = top.map_or(ends.top, |slice| slice.highest.min(ends.top));
        }
        Some(ends)
    }

    /// Whether the object reaches far below ground of this lattice z.
    pub(crate) fn is_far_below(self, ground: i64, lattice: Lattice) -> bool {
        self.bottom < ground - lattice.units(DEEPEST_M)
    }

    /// The same ends without a few points far below the ground. `lowest` is the lattice z of the lowest
    /// ground below the object. Reflections of a facade need this rule, because no gap separates them from
    /// the facade.
    pub(crate) fn above_ground(mut self, profile: &Sketch<Slice>, lowest: i64, lattice: Lattice) -> Self {
        let deepest = lowest - lattice.units(DEEPEST_M);
        let slices = || profile.voxels.iter().map(|(_, slice)| slice);
        let (mut all, mut below) = (0, 0);
        for slice in slices() {
            all += slice.points;
            below += if slice.lowest < deepest { slice.points } else { 0 };
        }
        let first = slices().find(|slice| slice.lowest >= deepest);
        if let Some(first) = first.filter(|_| below as f64 <= LARGEST_SHARE * all as f64) {
            self.bottom = self.bottom.max(first.lowest).min(self.top);
        }
        self
    }

    fn of(profile: &Sketch<Slice>, class: u8, lattice: Lattice) -> Option<Self> {
        let slices: Vec<Slice> = profile.voxels.iter().map(|(_, slice)| *slice).collect();
        let gaps: Vec<i64> = slices.windows(2).map(|pair| pair[1].lowest - pair[0].highest).collect();
        let near = lattice.units(BESIDE_M);
        // The longest gap that begins at most `near` above a place.
        let longest_above = |number: usize, place: i64| {
            let reached = (number..gaps.len()).take_while(|&gap| slices[gap].highest - place <= near);
            reached.map(|gap| gaps[gap]).max().unwrap_or(0)
        };
        let longest = |of: Range<usize>| gaps[of].iter().copied().max().unwrap_or(0);
        let all = slices.iter().map(|slice| slice.points).sum::<u64>();
        let (first, last) = (slices.first()?, slices.last()?);
        let mut ends = Self { bottom: first.lowest, top: last.highest };
        let mut below = 0;
        // The first slice above all gaps that detach points below.
        let mut lowest = 0;
        let mut top_found = false;
        for (number, pair) in slices.windows(2).enumerate() {
            below += pair[0].points;
            let gap = gaps[number];
            let gap_m = lattice.metres(gap);
            if gap_m < SHORTEST_GAP_M {
                continue;
            }
            let most = all as f64 * (gap_m * SHARE_PER_M).min(LARGEST_SHARE);
            // The bottom is above the highest gap with few points below it, the top is below the lowest gap
            // with few points above it. Both shares are below a half, so these gaps differ.
            if below as f64 <= most {
                if gap >= TIMES_BESIDE * longest_above(number + 1, pair[1].lowest) {
                    ends.bottom = pair[1].lowest;
                    lowest = number + 1;
                }
                continue;
            }
            let above = all - below;
            let is_detached = match class {
                BUILDING => above == 1 && gap_m >= ABOVE_ROOF_M,
                _ => above as f64 <= most && gap >= TIMES_BELOW * longest(lowest..number),
            };
            if is_detached && !top_found {
                ends.top = pair[0].highest;
                top_found = true;
            }
        }
        Some(ends)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inventory::measures::sketch::Frame;

    /// The ends of an object with points in these runs: from, to and step, in millimetres.
    fn ends(runs: &[(i64, i64, usize)]) -> Ends {
        ends_of(3, runs)
    }

    fn ends_of(class: u8, runs: &[(i64, i64, usize)]) -> Ends {
        ends_above(None, class, runs)
    }

    fn ends_above(ground: Option<i64>, class: u8, runs: &[(i64, i64, usize)]) -> Ends {
        let heights: Vec<i64> = runs.iter().flat_map(|&(from, to, step)| (from..=to).step_by(step)).collect();
        let corners = [heights.iter().min().unwrap(), heights.iter().max().unwrap()].map(|z| [0, 0, *z]);
        let frame = Frame::new(100, corners[0], corners[1]);
        let slice = |&z: &i64| (frame.key([0, 0, z]), Slice { points: 1, lowest: z, highest: z });
        let profile = Sketch::of(&frame, heights.iter().map(slice).collect(), 1 << 10);
        Ends::new(&profile, class, ground, Lattice::MILLIMETRE).unwrap()
    }

    #[test]
    fn the_highest_ring_of_a_tree_is_its_top() {
        // Rings of a spinning head: the gaps grow with the height, and few points are in the highest ring.
        let rings = [(400, 460, 1), (900, 960, 1), (1_480, 1_540, 1), (2_120, 2_180, 1), (2_900, 2_910, 1)];
        assert_eq!(ends(&rings), Ends { bottom: 400, top: 2_910 });
        // Points far above the rings belong to something else.
        let above = |gap: i64| ends(&[&rings[..], &[(2_910 + gap, 2_920 + gap, 1)]].concat()).top;
        assert_eq!([4_300, 4_400].map(above), [2_910 + 4_300 + 10, 2_910]);
    }

    #[test]
    fn the_few_points_at_the_top_of_a_far_lamp_are_of_it() {
        // 35 points of the pole in rings, 5 of its head.
        let lamp =
            [(300, 340, 10), (900, 980, 10), (1_500, 1_580, 10), (2_000, 2_110, 10), (3_400, 3_440, 10)];
        assert_eq!(ends(&lamp), Ends { bottom: 300, top: 3_440 });
        // As many points above a post without gaps are leaves.
        assert_eq!(ends(&[(300, 2_110, 50), (3_400, 3_440, 10)]).top, 2_100);
    }

    #[test]
    fn what_stands_on_a_roof_is_of_the_building_and_a_single_point_is_not() {
        let walls = (0, 9_000, 10);
        assert_eq!(ends_of(BUILDING, &[walls, (10_500, 10_501, 1)]).top, 10_501);
        assert_eq!(ends_of(BUILDING, &[walls, (10_500, 10_500, 1)]).top, 9_000);
        assert_eq!(ends_of(BUILDING, &[walls, (9_600, 9_600, 1)]).top, 9_600);
    }

    #[test]
    fn a_few_reflections_below_the_ground_are_not_the_bottom() {
        // 300 points of a post; 10 points from -2 m to -0.5 m, with gaps among them.
        let post = (40, 3_030, 10);
        assert_eq!(
            ends(&[(-2_000, -1_750, 50), (-1_300, -1_200, 50), (-500, -500, 1), post]),
            Ends { bottom: 40, top: 3_030 }
        );
        // Without a gap, or with many of them, they may be the foot of the post.
        assert_eq!(ends(&[(-200, -200, 1), post]).bottom, -200);
        assert_eq!(ends(&[(-800, -500, 5), post]).bottom, -800);
    }

    #[test]
    fn the_few_points_of_a_far_stem_are_of_its_tree() {
        // Four points of a stem below a crown, and a reflection below the ground.
        let tree =
            [(-900, -900, 1), (150, 150, 1), (1_300, 1_340, 20), (2_000, 2_000, 1), (4_000, 9_000, 10)];
        for class in [2, 3] {
            assert_eq!(ends_above(Some(100), class, &tree).bottom, 150);
            assert_eq!(ends_above(None, class, &tree).bottom, 4_000, "anything may be below it");
        }
        // Below a vehicle, they are of something else.
        assert_eq!(ends_above(Some(100), 4, &tree).bottom, 4_000);
    }

    #[test]
    fn a_few_reflections_far_below_the_ground_are_not_the_bottom_even_without_a_gap() {
        let frame = Frame::new(100, [0, 0, -12_000], [0, 0, 9_000]);
        let bottom = |reflections: i64| {
            let heights = (0..3_000).step_by(10).chain((0..reflections).map(|n| -n * 100));
            let slices = heights.map(|z| (frame.key([0, 0, z]), Slice { points: 1, lowest: z, highest: z }));
            let profile = Sketch::of(&frame, slices.collect(), 1 << 10);
            let ends = Ends::new(&profile, 3, Some(0), Lattice::MILLIMETRE).unwrap();
            ends.above_ground(&profile, 0, Lattice::MILLIMETRE).bottom
        };
        assert_eq!(bottom(40), -1_000, "1 m may be the ground model");
        assert_eq!(bottom(100), -9_900, "many points may be the object");
    }

    #[test]
    fn leaves_above_a_sign_are_not_its_top() {
        let sign = (0, 2_700, 10);
        assert_eq!(ends(&[sign, (4_500, 5_500, 50), (6_000, 6_500, 50)]), Ends { bottom: 0, top: 2_700 });
        // A short gap detaches only a few points.
        assert_eq!(ends(&[sign, (3_030, 3_480, 30)]).top, 3_480);
        assert_eq!(ends(&[sign, (3_030, 3_080, 30)]).top, 2_700);
        assert_eq!(ends(&[sign, (2_950, 2_950, 1)]).top, 2_950);
        // The upper half of a lamp behind a crown stays.
        assert_eq!(ends(&[(0, 3_000, 10), (7_000, 8_000, 10)]).top, 8_000);
    }

    #[test]
    fn both_ends_of_an_object_may_have_detached_points() {
        let found = ends(&[(-900, -900, 1), (0, 5_000, 10), (6_000, 6_000, 1)]);
        assert_eq!(found, Ends { bottom: 0, top: 5_000 });
        assert_eq!(ends(&[(7, 7, 1)]), Ends { bottom: 7, top: 7 });
    }

    #[test]
    fn the_highest_points_of_a_wire_are_not_its_top() {
        // 600 points of a wire, and 3 of the top of its pole.
        let wire = [(7_000, 7_199, 1), (7_200, 7_599, 1), (7_700, 7_900, 100)];
        assert_eq!(ends_of(WIRE, &wire).top, 7_599);
        assert_eq!(ends_of(3, &wire).top, 7_900);
        assert_eq!(
            ends_of(WIRE, &[(7_000, 7_599, 1), (7_700, 8_000, 100)]).top,
            7_700,
            "a fourth is the wire's"
        );
    }
}

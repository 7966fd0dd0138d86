//! Which components are one object although they do not touch: the pieces of a vehicle, of a fence or hedge
//! with gaps, and of the wires between two poles.
//!
//! Two pieces are one vehicle if both fit into a box of the size of a passenger car. Two pieces are one fence
//! if both lie on one line, end at about the same height, and the gap between them is short. Two pieces are
//! one span of wires if both lie along one line, and no pole that reaches their height stands between them.
//! Pairs are decided one after another, and pieces that were united before count as one piece. Their order
//! does not depend on tiles.

use std::collections::{BTreeMap, BTreeSet};

use super::nearby;
use super::part::Part;
use crate::cluster::columns::Voxel;
use crate::cluster::street::shares::{FENCE, POLE, VEHICLE, WIRE, unites};
use crate::cluster::street::spans::{self, Extent};
use crate::model::Lattice;
use crate::spatial::DisjointSets;

/// Largest length and width of the box around a united vehicle, in metres, and the longest gap between its
/// pieces. The box fits an estate car with its mirrors, turned by at most 2.8 degrees. Lorries do not fall
/// into pieces: they are large, so their pieces touch.
const VEHICLE_M: (f64, f64) = (5.2, 2.3);
const VEHICLE_GAP_M: f64 = 0.6;
/// Largest width of the box around a fence, in metres: for a short fence, and in addition for each metre of
/// length. Real fences are up to 0.8 m wide, and they bend.
const FENCE_M: f64 = 1.2;
const FENCE_BEND: f64 = 0.03;
/// Longest gap between two pieces of a fence, in metres. Cars and stems hide 2 m of what is behind them. With
/// 1.5 m, 13 pieces of ten rails behind small trees stay apart; with 2.5 m and with 4 m, 5 of them do.
const FENCE_GAP_M: f64 = 2.5;
/// Largest difference of the heights at which two pieces of a fence end, in metres.
const FENCE_TOP_M: f64 = 0.5;
/// Largest width of the box around the wires of a span, in metres: a cross-arm of 2.4 m, and in addition for
/// each metre of length, because a box is turned in steps of 5.6 degrees.
const WIRE_M: f64 = 2.5;
const WIRE_TURN: f64 = 0.05;
/// Longest gap between two pieces of a span, in metres: objects in front of the wires hide this much.
const WIRE_GAP_M: f64 = 8.0;
/// Largest difference in height between the pieces of a span, in metres.
const WIRE_RISE_M: f64 = 1.0;
/// Smallest piece of a wire that is united: number of voxels, and extent in metres. Smaller ones are twigs.
const WIRE_VOXELS: u32 = 6;
const WIRE_EXTENT_M: f64 = 0.9;
/// Largest distance of a pole from the box around two pieces at which it still stands between them, in
/// metres, as in [`super::supports`].
const BETWEEN_M: f64 = 0.7;

/// Unites components. `parts` then has one entry for each united component, under the name of one of its
/// components. The result maps the other names to this one. `keeps` says whether a component is a core.
pub(crate) fn unite(
    parts: &mut BTreeMap<u32, Part>,
    keeps: impl Fn(&Part) -> bool,
    lattice: Lattice,
) -> BTreeMap<u32, u32> {
    let poles = &Poles::of(parts.values().filter(|part| part.class == POLE && keeps(part)));
    let cost = |one: &Part, other: &Part| cost(one, other, poles, lattice);
    near(parts, |_, part| unites(part.class), |class| reach(class, lattice), cost, lattice)
}

/// Unites pairs of the components that `counts` selects, if they are within the reach of their class, in
/// lattice units, and `cost` gives a cost. `parts` and the result are as for [`unite`].
pub(crate) fn near(
    parts: &mut BTreeMap<u32, Part>,
    counts: impl Fn(u32, &Part) -> bool,
    reach: impl Fn(u8) -> i64,
    cost: impl Fn(&Part, &Part) -> Option<i64>,
    lattice: Lattice,
) -> BTreeMap<u32, u32> {
    let pieces = parts.iter().filter(|(name, part)| counts(**name, part));
    let (names, pieces): (Vec<u32>, Vec<&Part>) = pieces.map(|(&name, part)| (name, part)).unzip();
    let pair = |(one, other): (u32, u32)| {
        let (one, other) = (one as usize, other as usize);
        Some((cost(pieces[one], pieces[other])?, names[one], names[other]))
    };
    let pairs: Vec<(i64, u32, u32)> = nearby::pairs(&pieces, reach, lattice).filter_map(pair).collect();
    one_by_one(parts, pairs.into_iter(), |one, other| cost(one, other).is_some())
}

/// Unites pairs of components, one after another, if `fits` accepts the united components that the two belong
/// to by then. A pair is a cost and two names. Cheaper pairs are decided first; of equal costs, the pair with
/// the first voxels. `parts` and the result are as for [`unite`].
pub(crate) fn one_by_one(
    parts: &mut BTreeMap<u32, Part>,
    pairs: impl Iterator<Item = (i64, u32, u32)>,
    fits: impl Fn(&Part, &Part) -> bool,
) -> BTreeMap<u32, u32> {
    let ordered = |(cost, one, other): (i64, u32, u32)| {
        let (a, b) = (parts.get(&one)?.first, parts.get(&other)?.first);
        Some((cost, a.min(b), a.max(b), one, other))
    };
    let mut pairs: Vec<(i64, Voxel, Voxel, u32, u32)> = pairs.filter_map(ordered).collect();
    pairs.sort_unstable();
    let names: BTreeSet<u32> = pairs.iter().flat_map(|&(.., one, other)| [one, other]).collect();
    let names: Vec<u32> = names.into_iter().collect();
    #[expect(clippy::cast_possible_truncation, reason = "components of a drive fit u32")]
    let mut sets = DisjointSets::new(names.len() as u32);
    #[expect(clippy::cast_possible_truncation, reason = "components of a drive fit u32")]
    let number = |name: u32| names.partition_point(|&other| other < name) as u32;
    for (.., one, other) in pairs {
        let (one, other) = (sets.find(number(one)), sets.find(number(other)));
        let (root, leaf) = (names[one.min(other) as usize], names[one.max(other) as usize]);
        if root == leaf || !fits(&parts[&root], &parts[&leaf]) {
            continue;
        }
        if let Some(piece) = parts.remove(&leaf)
            && let Some(whole) = parts.get_mut(&root)
        {
            whole.merge(&piece);
            sets.union(one, other);
        }
    }
    let roots = (0_u32..).zip(&names).map(|(number, &name)| (name, names[sets.find(number) as usize]));
    roots.filter(|(name, root)| name != root).collect()
}

/// The name of a component in the parts. `united` has the new names of the components that became a part of
/// another.
pub(crate) fn by_name(united: &BTreeMap<u32, u32>, component: u32) -> u32 {
    *united.get(&component).unwrap_or(&component)
}

/// Adds the result of a later step, which united components under the names that were left.
pub(crate) fn go_on(united: &mut BTreeMap<u32, u32>, later: BTreeMap<u32, u32>) {
    united.values_mut().for_each(|name| *name = by_name(&later, *name));
    united.extend(later);
}

/// Longest gap between two pieces of a class, in lattice units.
fn reach(class: u8, lattice: Lattice) -> i64 {
    lattice.units(match class {
        WIRE => WIRE_GAP_M,
        FENCE => FENCE_GAP_M,
        _ => VEHICLE_GAP_M,
    })
}

/// The cost of uniting two pieces; `None` if they are two objects. Cheaper pairs are united first.
fn cost(one: &Part, other: &Part, poles: &Poles, lattice: Lattice) -> Option<i64> {
    let (spans, others) = (one.spans.as_ref()?, other.spans.as_ref()?);
    let around = spans.union(others).narrowest();
    let units = |metres: f64| lattice.units(metres);
    let gap = spans.gap(others, around);
    let fits = match one.class {
        VEHICLE => {
            around.length <= units(VEHICLE_M.0)
                && around.width <= units(VEHICLE_M.1)
                && gap <= units(VEHICLE_GAP_M)
        }
        FENCE => {
            #[expect(clippy::cast_possible_truncation, reason = "a part of a length in lattice units")]
            let bend = (FENCE_BEND * around.length as f64) as i64;
            around.width <= units(FENCE_M) + bend
                && gap <= units(FENCE_GAP_M)
                && i64::from(one.height.1.abs_diff(other.height.1)) <= units(FENCE_TOP_M)
        }
        WIRE => {
            #[expect(clippy::cast_possible_truncation, reason = "a part of a length in lattice units")]
            let turn = (WIRE_TURN * around.length as f64) as i64;
            let rise = one.height.0.max(other.height.0) - one.height.1.min(other.height.1);
            let is_piece = |part: &Part| part.voxels >= WIRE_VOXELS && part.extent() >= units(WIRE_EXTENT_M);
            is_piece(one)
                && is_piece(other)
                && around.width <= units(WIRE_M) + turn
                && gap <= units(WIRE_GAP_M)
                && i64::from(rise) <= units(WIRE_RISE_M)
                && !poles.any_between([one, other], around, lattice)
        }
        _ => false,
    };
    fits.then_some(if one.class == VEHICLE { around.length } else { gap })
}

/// The middles of poles in the plane, in the order of x, with their lowest and highest height above ground.
struct Poles(Vec<([i64; 2], (i32, i32))>);

impl Poles {
    fn of<'a>(poles: impl Iterator<Item = &'a Part>) -> Self {
        let mut poles: Vec<_> = poles.map(|pole| (pole.centre(), pole.height)).collect();
        poles.sort_unstable();
        Self(poles)
    }

    /// Whether a pole that reaches the height of two pieces of wires stands in the gap between them. `around`
    /// is the box of both.
    fn any_between(&self, [one, other]: [&Part; 2], around: Extent, lattice: Lattice) -> bool {
        let (Some(a), Some(b)) = (&one.spans, &other.spans) else { return false };
        let (along, aside) = (around.along(), around.across());
        let beside = lattice.units(BETWEEN_M);
        let gap = [a.to(along).min(b.to(along)), a.from(along).max(b.from(along))];
        let sides = [a.from(aside).min(b.from(aside)), a.to(aside).max(b.to(aside))];
        let sides = [sides[0] - beside * spans::SCALE_UNITS, sides[1] + beside * spans::SCALE_UNITS];
        let lowest = one.height.0.min(other.height.0);
        let west = one.min[0].min(other.min[0]) - beside;
        let east = one.max[0].max(other.max[0]) + beside;
        let from = self.0.partition_point(|(place, _)| place[0] < west);
        let near = self.0[from..].iter().take_while(|(place, _)| place[0] <= east);
        let stands_between = |&(place, (low, high)): &([i64; 2], (i32, i32))| {
            let reaches = low < lowest && i64::from(lowest - high) <= lattice.units(WIRE_RISE_M);
            let [on, off] = [along, aside].map(|number| spans::position(place, number));
            reaches && (gap[0]..=gap[1]).contains(&on) && (sides[0]..=sides[1]).contains(&off)
        };
        near.into_iter().any(stands_between)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::street::cores::part::NO_BAND;

    fn lattice() -> Lattice {
        Lattice::MILLIMETRE
    }

    /// A piece with voxels of 0.15 m along a line, in metres.
    fn piece(class: u8, from: [f64; 2], to: [f64; 2], top_m: f64) -> Part {
        let lattice = lattice();
        let steps = 20;
        let place = |step: i32| {
            let share = f64::from(step) / f64::from(steps);
            let at = |axis: usize| lattice.units(from[axis] + (to[axis] - from[axis]) * share);
            [at(0), at(1), 0]
        };
        let height = i32::try_from(lattice.units(top_m)).unwrap();
        let voxel = |step: i32| Part::of_voxel(class, NO_BAND, [step, 0, 0], height, place(step));
        (1..=steps).fold(voxel(0), |mut part, step| {
            part.merge(&voxel(step));
            part
        })
    }

    fn united(pieces: Vec<Part>) -> usize {
        let mut parts: BTreeMap<u32, Part> = (0..).zip(pieces).collect();
        let before = parts.len();
        let united = unite(&mut parts, |_| true, lattice());
        assert_eq!(parts.len() + united.len(), before);
        assert!(united.values().all(|name| parts.contains_key(name)));
        parts.len()
    }

    #[test]
    fn pieces_of_a_car_are_one_and_two_cars_are_two() {
        let front = || piece(VEHICLE, [0.0, 0.0], [2.0, 1.8], 1.4);
        let rear = || piece(VEHICLE, [2.4, 0.0], [4.5, 1.8], 1.5);
        let next = || piece(VEHICLE, [5.0, 0.0], [9.4, 1.8], 1.5);
        assert_eq!(united(vec![front(), rear()]), 1);
        assert_eq!(united(vec![front(), rear(), next()]), 2);
        assert_eq!(united(vec![next(), piece(VEHICLE, [5.0, 2.6], [9.4, 4.4], 1.5)]), 2);
    }

    #[test]
    fn fences_go_on_over_a_short_gap_on_their_line_and_at_their_height() {
        let fence = |from, to, top| piece(FENCE, from, to, top);
        let first = || fence([0.0, 0.0], [6.0, 6.0], 1.2);
        assert_eq!(united(vec![first(), fence([7.5, 7.5], [12.0, 12.0], 1.3)]), 1);
        assert_eq!(united(vec![first(), fence([9.0, 9.0], [12.0, 12.0], 1.3)]), 2);
        assert_eq!(united(vec![first(), fence([7.5, 7.5], [12.0, 12.0], 2.0)]), 2);
        assert_eq!(united(vec![first(), fence([7.0, 6.0], [7.0, 1.0], 1.2)]), 2);
    }
    #[test]
    fn wires_are_one_span_up_to_a_pole() {
        let wire = |from, to| piece(WIRE, from, to, 7.8);
        let pole = |x, y, top| {
            let mut pole = piece(POLE, [x, y], [x, y], top);
            pole.merge(&piece(POLE, [x, y], [x, y], 0.1));
            pole
        };
        let gap = || vec![wire([0.0, 0.0], [10.0, 1.0]), wire([14.0, 1.5], [24.0, 2.5])];
        let with = |pole: Part| {
            let mut parts = gap();
            parts.push(pole);
            united(parts)
        };
        assert_eq!(united(gap()), 1);
        assert_eq!(with(pole(12.0, 1.3, 8.6)), 3, "a pole carries the wires");
        assert_eq!(with(pole(12.0, 2.9, 8.6)), 2, "a lamp beside them");
        assert_eq!(with(pole(12.0, 1.3, 6.7)), 2, "a signal below them");
        assert_eq!(with(pole(5.0, 0.5, 8.6)), 2, "a lamp that they pass");
        // Wires of one cross-arm are one object. Wires on the other side of the street are another.
        assert_eq!(united(vec![wire([0.0, 0.0], [30.0, 0.0]), wire([2.0, 1.5], [28.0, 1.5])]), 1);
        assert_eq!(united(vec![wire([0.0, 0.0], [30.0, 0.0]), wire([2.0, 6.0], [28.0, 6.0])]), 2);
        assert_eq!(united(vec![wire([0.0, 0.0], [10.0, 0.0]), wire([18.5, 0.0], [30.0, 0.0])]), 2);
        assert_eq!(
            united(vec![wire([0.0, 0.0], [10.0, 0.0]), piece(WIRE, [12.0, 0.0], [30.0, 0.0], 9.0)]),
            2
        );
    }
}

//! Which components are one object although they do not touch: the pieces of a vehicle, and of a fence or
//! hedge with gaps.
//!
//! Two pieces are one vehicle if both fit into a box of the size of a passenger car. Two pieces are one fence
//! if both lie on one line, end at about the same height, and the gap between them is short. Pairs are
//! decided one after another, and what was united before counts as one piece. Their order does not depend on
//! tiles.

use std::collections::{BTreeMap, BTreeSet};

use super::part::Part;
use super::shares::{FENCE, VEHICLE, unites};
use crate::cluster::columns::Voxel;
use crate::model::Lattice;
use crate::spatial::DisjointSets;

/// Longest and widest box of a vehicle that is united, in metres, and the longest gap between its pieces. A
/// box of an estate car with its mirrors, turned by at most 2.8 degrees. Lorries are not cut: they are large,
/// so their pieces touch.
const VEHICLE_M: (f64, f64) = (5.2, 2.3);
const VEHICLE_GAP_M: f64 = 0.6;
/// Widest box of a fence, in metres: of a short one, and for each metre of length. Real ones are up to 0.8 m
/// wide and bend.
const FENCE_M: f64 = 1.2;
const FENCE_BEND: f64 = 0.03;
/// Longest gap between two pieces of a fence, in metres. Cars and stems hide 2 m of what is behind them. With
/// 1.5 m, 13 pieces of ten rails behind small trees stay apart, with 2.5 m and with 4 m 5 of them.
const FENCE_GAP_M: f64 = 2.5;
/// Largest difference of the heights at which two pieces of a fence end, in metres.
const FENCE_TOP_M: f64 = 0.5;

/// Unites components. `parts` has one entry for each united component then, under the name of one of its
/// components. Returns this name for all others.
pub(super) fn unite(parts: &mut BTreeMap<u32, Part>, lattice: Lattice) -> BTreeMap<u32, u32> {
    let names: Vec<u32> =
        parts.iter().filter(|(_, part)| unites(part.class)).map(|(&component, _)| component).collect();
    let mut pieces: Vec<Part> = names.iter().filter_map(|name| parts.remove(name)).collect();
    let mut pairs: Vec<(i64, Voxel, Voxel, u32, u32)> = Vec::new();
    for (one, other) in near(&pieces, lattice) {
        let (a, b) = (&pieces[one as usize], &pieces[other as usize]);
        if let Some(cost) = cost(a, b, lattice) {
            let (first, second) = (a.first.min(b.first), a.first.max(b.first));
            pairs.push((cost, first, second, one, other));
        }
    }
    pairs.sort_unstable();
    #[expect(clippy::cast_possible_truncation, reason = "components of a drive fit u32")]
    let mut sets = DisjointSets::new(pieces.len() as u32);
    for (.., one, other) in pairs {
        let (one, other) = (sets.find(one), sets.find(other));
        let (root, leaf) = (one.min(other), one.max(other));
        if root == leaf || cost(&pieces[root as usize], &pieces[leaf as usize], lattice).is_none() {
            continue;
        }
        let leaf_part = pieces[leaf as usize].clone();
        pieces[root as usize].merge(&leaf_part);
        sets.union(root, leaf);
    }
    let mut united = BTreeMap::new();
    for ((number, &name), piece) in (0_u32..).zip(&names).zip(pieces) {
        let root = sets.find(number);
        if root == number {
            parts.insert(name, piece);
        } else {
            united.insert(name, names[root as usize]);
        }
    }
    united
}

/// Pairs of pieces of the same class that may be near enough, each once.
fn near(pieces: &[Part], lattice: Lattice) -> BTreeSet<(u32, u32)> {
    let reach = lattice.units(FENCE_GAP_M.max(VEHICLE_GAP_M));
    let mut by_x: Vec<u32> = (0_u32..).zip(pieces).map(|(number, _)| number).collect();
    by_x.sort_unstable_by_key(|&number| pieces[number as usize].min[0]);
    let longest = pieces.iter().map(|part| part.max[0] - part.min[0]).max().unwrap_or(0);
    let mut pairs = BTreeSet::new();
    for (at, &one) in by_x.iter().enumerate() {
        let part = &pieces[one as usize];
        for &other in by_x[at + 1..].iter() {
            let next = &pieces[other as usize];
            if next.min[0] > part.min[0] + longest + reach {
                break;
            }
            let apart = |axis: usize| part.min[axis].max(next.min[axis]) - part.max[axis].min(next.max[axis]);
            if part.class == next.class && apart(0) <= reach && apart(1) <= reach {
                pairs.insert((one.min(other), one.max(other)));
            }
        }
    }
    pairs
}

/// What it costs to call two pieces one object; `None` if they are two. Cheaper pairs are united first.
fn cost(one: &Part, other: &Part, lattice: Lattice) -> Option<i64> {
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
        _ => false,
    };
    fits.then_some(if one.class == VEHICLE { around.length } else { gap })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::street::part::NO_BAND;

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
        let united = unite(&mut parts, lattice());
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
}

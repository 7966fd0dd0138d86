//! Hanging parts of poles: arms, lamps and signals whose support is hidden by leaves.
//!
//! A hanging piece is certainly a part of a pole if nearly all of its voxels are certainly pole. It belongs
//! to the pole that is nearest in the plane and ends at about the same height.

use std::collections::BTreeMap;

use super::part::Part;
use crate::cluster::street::shares::POLE;
use crate::model::Lattice;

/// Smallest number of voxels of a piece, and smallest share of them that are certainly pole. On fourteen
/// drives, 37 of 44 such hanging pieces are parts of a pole. With the limits below, 24 get a pole, and 23 of
/// these the right one. Less certain pieces are mostly branches (`benches/results/street.md`, "Wires, arms
/// and dense fences").
const VOXELS: u32 = 25;
const SURE: f64 = 0.8;
/// Height above ground from which a piece hangs, in metres. A lower piece that is not a core is a pipe of a
/// facade or a stem among leaves.
const HANGS_M: f64 = 1.6;
/// Smallest pole share of a voxel that is certainly pole, in steps of 1/255.
pub(crate) const SURE_SHARE: u8 = 230;
/// Longest gap between a piece and its pole in the plane, in metres. Leaves hide 2.8 m of a mast arm.
const GAP_M: f64 = 4.0;
/// Largest distance by which the pole may end below its piece, and above it, in metres. Leaves may hide the
/// top of the pole; a taller lamp has an arm of its own.
const BELOW_M: f64 = 2.2;
const ABOVE_M: f64 = 1.5;
/// Cost of a metre of height difference, in metres of the gap.
const HEIGHT: i64 = 3;

/// Whether a component is certainly a part of a pole.
pub(crate) fn is_sure(part: &Part) -> bool {
    part.class == POLE && part.voxels >= VOXELS && f64::from(part.sure_pole) >= SURE * f64::from(part.voxels)
}

/// Whether a component hangs and is certainly a part of a pole.
pub(crate) fn may_be_arm(part: &Part, lattice: Lattice) -> bool {
    is_sure(part) && i64::from(part.height.0) >= lattice.units(HANGS_M)
}

/// The pole of each hanging component that is a part of one. `keeps` says whether a component is a core.
pub(crate) fn join(
    parts: &BTreeMap<u32, Part>,
    keeps: impl Fn(&Part) -> bool,
    lattice: Lattice,
) -> BTreeMap<u32, u32> {
    let (mut poles, mut hanging) = (Vec::new(), Vec::new());
    for (&name, part) in parts.iter().filter(|(_, part)| part.class == POLE) {
        if keeps(part) {
            poles.push((part.min[0], part.first, name, part));
        } else if may_be_arm(part, lattice) {
            hanging.push((name, part));
        }
    }
    poles.sort_unstable_by_key(|&(west, first, ..)| (west, first));
    let widest = poles.iter().map(|(.., pole)| pole.extent()).max().unwrap_or(0);
    let reach = lattice.units(GAP_M);
    let of = |(name, piece): (u32, &Part)| {
        let from = poles.partition_point(|pole| pole.0 < piece.min[0] - reach - widest);
        let near = poles[from..].iter().take_while(|pole| pole.0 <= piece.max[0] + reach);
        let costs =
            near.filter_map(|&(_, first, pole, part)| Some((cost(piece, part, lattice)?, first, pole)));
        Some((name, costs.min()?.2))
    };
    hanging.into_iter().filter_map(of).collect()
}

/// The cost of joining a piece to a pole; `None` if it is not a part of that pole.
fn cost(piece: &Part, pole: &Part, lattice: Lattice) -> Option<i64> {
    let apart = [0, 1].map(|k| (piece.min[k].max(pole.min[k]) - piece.max[k].min(pole.max[k])).max(0));
    let gap = (apart[0].pow(2) + apart[1].pow(2)).isqrt();
    let higher = i64::from(pole.height.1 - piece.height.1);
    let ends_near = (-lattice.units(BELOW_M)..=lattice.units(ABOVE_M)).contains(&higher);
    (gap <= lattice.units(GAP_M) && ends_near).then_some(gap + HEIGHT * higher.abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::street::cores::part::NO_BAND;

    /// A piece of `count` voxels in a row along x from a place, at these heights in metres.
    fn piece(place_m: [f64; 2], (low_m, high_m): (f64, f64), count: i32, sure: u32) -> Part {
        let lattice = Lattice::MILLIMETRE;
        let [x, y] = place_m.map(|metres| lattice.units(metres));
        let height = |metres: f64| i32::try_from(lattice.units(metres)).unwrap();
        let voxel = |step: i32| {
            let at = if step == 0 { low_m } else { high_m };
            Part::of_voxel(
                POLE,
                NO_BAND,
                [step, 0, height(at) / 150],
                height(at),
                [x + 10 * i64::from(step), y, 0],
            )
        };
        let mut whole = voxel(0);
        (1..count).for_each(|step| whole.merge(&voxel(step)));
        whole.sure_pole = sure;
        whole
    }

    fn joined(pieces: &[Part]) -> BTreeMap<u32, u32> {
        let parts = (0..).zip(pieces.iter().cloned()).collect();
        join(&parts, |part| part.height.0 < 800, Lattice::MILLIMETRE)
    }

    #[test]
    fn a_signal_is_a_part_of_the_pole_that_ends_at_its_height() {
        let mast = piece([0.0, 0.0], (0.1, 6.7), 40, 40);
        let lamp = piece([2.0, 1.0], (0.1, 9.0), 40, 40);
        let signal = piece([3.0, 0.0], (5.4, 6.7), 40, 38);
        assert_eq!(joined(&[mast.clone(), lamp.clone(), signal.clone()]), BTreeMap::from([(2, 0)]));
        assert_eq!(joined(&[lamp, signal]), BTreeMap::new(), "the lamp is 2.3 m taller");
        let head = piece([1.0, 0.0], (8.6, 8.8), 30, 30);
        assert_eq!(joined(&[mast, head]), BTreeMap::from([(1, 0)]), "the top of the mast is hidden");
    }

    #[test]
    fn branches_pipes_and_what_is_far_away_are_no_part_of_a_pole() {
        let mast = || piece([0.0, 0.0], (0.1, 6.7), 40, 40);
        let pipe = piece([3.0, 0.0], (1.5, 6.7), 40, 40);
        for other in [
            pipe,
            piece([3.0, 0.0], (5.4, 6.7), 40, 31),
            piece([3.0, 0.0], (5.4, 6.7), 24, 24),
            piece([4.5, 0.0], (5.4, 6.7), 40, 40),
            piece([3.0, 0.0], (8.0, 9.0), 40, 40),
        ] {
            assert_eq!(joined(&[mast(), other]), BTreeMap::new());
        }
    }
}

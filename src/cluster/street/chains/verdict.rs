//! Whether an upright chain is a trunk or a pole.
//!
//! The classifier confuses single voxels of the two, above all in crowns. The chain as a whole is clearer:
//! most of its voxels look like one of the two; poles stand upright, stems lean; a pole continues above as a
//! pole; a stem has its crown on all sides. A logistic regression weighs this evidence. It was learned from
//! the chains of synthetic drives, see `benches/results/street.md`.
//!
//! A crown needs a trunk. So a chain inside a crown is a trunk if its score is narrowly that of a pole and no
//! other trunk is near.

use super::piece::{LEVEL_M, Piece};
use crate::model::Lattice;

/// Weights of the evidence for a pole: the share of pole in tree and pole together, the slope of the axis,
/// the share of pole levels in the occupied levels above, the sides that a crown covers, and the size of the
/// crown. The last value is the sum that a pole must exceed. Learned from 1,221 chains (449 of them poles) of
/// 14 synthetic drives from which no classifier learned. There, 17 trunks are taken for poles and 15 poles
/// for trunks. Of 511 chains on six other scenes, 5 and 16; with the rules that these weights replaced, 4 and
/// 25.
const OF_POLE: f64 = 9.48;
const OF_SLOPE: f64 = -26.2;
const OF_ABOVE: f64 = 1.61;
const OF_SIDES: f64 = -4.91;
const OF_CROWN: f64 = 3.32;
const LEAST: f64 = 4.16;
/// Largest slope (in metres per metre) and largest crown (in voxels) that the score distinguishes. Larger
/// values count as these. Chains of few voxels lean by chance.
const MOST_SLOPE: f64 = 0.12;
const MOST_CROWN: u32 = 500;
/// Constant added to the shares of pole and of tree, because they are weak evidence where both are small.
const DOUBT: f64 = 0.1;
/// Smallest share of tree and pole together in a chain. Below it, a chain under a crown is a passer-by or a
/// bollard: none of 34 such chains was a trunk.
const EITHER: f64 = 0.08;
/// The same for a chain that needs no crown.
const MOSTLY: f64 = 0.5;
/// Highest slice in which a chain may begin. A chain that begins there is a trunk or nothing: signs and lamps
/// hang there, and undergrowth hides the feet of trunks. Of 22 such chains in two forests, 18 are trunks; of
/// six on six streets, three are.
const HIGHEST: u32 = 3;
/// Smallest number of voxels of a crown, and smallest height in metres that a trunk in it reaches without a
/// gap of more than two levels. Signs end lower.
const CROWN_VOXELS: u32 = 140;
const TRUNK_TOP_M: f64 = 3.0;
/// Limits for a chain that may carry the crown around it although its score says pole. Its score above the
/// threshold and its share of pole levels above must be below the first two. The covered sides, the voxels of
/// the crown, and the height in metres without a gap must be at least the last three.
const NARROW: f64 = 2.5;
const NARROW_ABOVE: f64 = 0.88;
const CARRIES_SIDES: usize = 5;
const CARRIES_VOXELS: u32 = 200;
const CARRIES_TOP_M: f64 = 4.5;
/// A crown is over a chain if it covers at least this number of sides and has at least this number of voxels.
/// A chain with a larger slope than this, in metres per metre, is a branch of the crown. The score minus the
/// threshold of a pole must be at most the last value.
const UNDER_SIDES: usize = 6;
const UNDER_VOXELS: u32 = 50;
const UNDER_SLOPE: f64 = 0.25;
const UNDER_SCORE: f64 = -1.0;
/// Largest radius of a stub in metres. A stub is a chain of the lowest slice alone: objects in front hide the
/// rest of the trunk. A stub within this radius and under a crown is a trunk: 341 of 346 on ten scenes
/// (`benches/results/street.md`, "Stubs").
const STUB_M: f64 = 0.3;
/// Largest distance in metres at which another trunk carries the crown instead. On seven scenes, 8 such
/// chains have no trunk within it, and all 8 are trunks; 11 have one, and 10 of these are poles. On 17
/// synthetic drives, 3 of 3 are trunks and 14 of 14 are poles.
pub(crate) const OTHER_TRUNK_M: f64 = 3.3;
/// Smallest number of tree voxels on a side that a crown covers, and their smallest share in the tree voxels
/// on all sides.
const SIDE_VOXELS: u32 = 3;
const SIDE_SHARE: f64 = 0.03;

/// What a chain is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Trunk,
    Pole,
    /// A pole inside a crown, if a trunk within [`OTHER_TRUNK_M`] carries the crown. Otherwise a trunk.
    PoleBesideTrunk,
}

/// What a chain is. `None` if the pieces are not an upright chain.
pub(crate) fn decide(chain: &[&Piece], lattice: Lattice) -> Option<Kind> {
    let slices = chain.iter().fold(0_u8, |slices, piece| slices | 1 << piece.slice);
    let lowest = chain.iter().min_by_key(|piece| (piece.height.0, piece.slice, piece.first))?;
    let highest = chain.iter().max_by_key(|piece| piece.reach())?;
    let begins = slices.trailing_zeros();
    let stub = slices == 1;
    let low = begins <= HIGHEST && lattice.metres(lowest.height.0.into()) <= 2.2;
    if !stub && (slices.count_ones() < 2 || !low) {
        return None;
    }
    let rise = lattice.metres((highest.height.1 - lowest.height.0).into());
    let [x, y] = highest.centre;
    let drift = lattice.metres(((lowest.centre[0] - x).pow(2) + (lowest.centre[1] - y).pow(2)).isqrt());
    if drift > 0.6 * (rise - 0.6).max(0.3) {
        return None;
    }
    let sum = |of: fn(&Piece) -> u32| chain.iter().map(|piece| f64::from(of(piece))).sum::<f64>();
    let levels =
        |of: fn(&Piece) -> u64| chain.iter().fold(0, |levels, piece| levels | of(piece)).count_ones();
    let voxels = 255.0 * sum(|piece| piece.voxels);
    let (pole, tree) = (sum(|piece| piece.pole) / voxels, sum(|piece| piece.tree) / voxels);
    let of_above =
        f64::from(levels(|piece| piece.pole_above)) / f64::from(levels(|piece| piece.any_above).max(1));
    let sides = |side: usize| chain.iter().map(|piece| piece.sides[side]).max().unwrap_or(0);
    let covered = covered(&std::array::from_fn(sides));
    let mut axis = chain[0].axis.clone();
    chain[1..].iter().for_each(|piece| axis.merge(&piece.axis));
    let crown = chain.iter().map(|piece| piece.crown).max().unwrap_or(0);
    let score = OF_POLE * (pole + DOUBT) / (pole + tree + 2.0 * DOUBT)
        + OF_SLOPE * axis.slope().min(MOST_SLOPE)
        + OF_ABOVE * of_above
        + OF_SIDES * covered as f64 / 8.0
        + OF_CROWN * f64::from(crown.min(MOST_CROWN)) / f64::from(MOST_CROWN);
    let over = score - LEAST;
    let above = chain.iter().fold(0, |levels, piece| levels | piece.any_levels);
    let own = chain.iter().fold(0, |levels, piece| levels | levels_of(piece.height, lattice));
    if pole + tree < EITHER {
        return None;
    }
    let under_crown =
        covered >= UNDER_SIDES && crown >= UNDER_VOXELS && axis.slope() <= UNDER_SLOPE && over <= UNDER_SCORE;
    if stub {
        let narrow = chain.iter().all(|piece| lattice.metres(piece.radius) <= STUB_M);
        return (under_crown && narrow).then_some(Kind::Trunk);
    }
    if begins == HIGHEST {
        return (tree >= MOSTLY && over <= 0.0).then_some(Kind::Trunk);
    }
    if pole + tree < MOSTLY {
        // The chain mostly looks like a hedge or something small. It is a trunk only under a crown.
        let rises_into_crown = crown >= CROWN_VOXELS && top_m(above) >= TRUNK_TOP_M;
        return ((rises_into_crown && over <= 0.0) || under_crown).then_some(Kind::Trunk);
    }
    let carries = covered >= CARRIES_SIDES && crown >= CARRIES_VOXELS && top_m(above | own) >= CARRIES_TOP_M;
    Some(match over {
        ..=0.0 => Kind::Trunk,
        ..NARROW if carries && of_above < NARROW_ABOVE => Kind::PoleBesideTrunk,
        _ => Kind::Pole,
    })
}

/// Bits of the levels between two heights above ground, which are in lattice units.
fn levels_of((low, high): (i32, i32), lattice: Lattice) -> u64 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "it is clamped to 0..=62")]
    let level = |height: i32| (lattice.metres(height.into()) / LEVEL_M).clamp(0.0, 62.0) as u32;
    (1 << (level(high) + 1)) - (1 << level(low))
}

/// Height in metres up to which levels are occupied, from the lowest one upwards without a gap of more than
/// two.
fn top_m(levels: u64) -> f64 {
    f64::from(top(levels)) * LEVEL_M
}

/// Height in levels up to which levels are occupied, from the lowest one upwards without a gap of more than
/// two.
fn top(levels: u64) -> u32 {
    if levels == 0 {
        return 0;
    }
    let mut top = levels.trailing_zeros();
    while top < u64::BITS {
        let above = levels.checked_shr(top + 1).unwrap_or(0);
        if above.trailing_zeros() > 2 {
            break;
        }
        top += above.trailing_zeros() + 1;
    }
    top + 1
}

/// How many sides a crown covers.
fn covered(sides: &[u32; 8]) -> usize {
    let share = SIDE_SHARE * f64::from(sides.iter().sum::<u32>());
    sides.iter().filter(|&&voxels| voxels >= SIDE_VOXELS && f64::from(voxels) >= share).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::street::chains::axis::Axis;

    /// A piece of an upright chain in a slice, in the middle of the plane, with these shares of poles and
    /// trees in percent.
    fn piece(slice: u8, [pole, tree]: [u32; 2]) -> Piece {
        let low = 150 + 500 * i32::from(slice);
        let mut axis = Axis::new([0, 0, low.into()]);
        [low, low + 350, low + 700].into_iter().for_each(|z| axis.add([0, 0, z.into()]));
        Piece {
            slice,
            first: [0, 0, low / 150],
            centre: [0, 0],
            radius: 200,
            height: (low, low + 700),
            voxels: 20,
            pole: 20 * 255 * pole / 100,
            tree: 20 * 255 * tree / 100,
            axis,
            pole_above: 0,
            any_above: u64::MAX,
            any_levels: u64::MAX,
            crown: 0,
            sides: [0; 8],
            links: Vec::new(),
        }
    }

    #[test]
    fn a_chain_above_undergrowth_is_a_trunk_or_nothing() {
        let decided = |slices: &[u8], shares| {
            let pieces: Vec<Piece> = slices.iter().map(|&slice| piece(slice, shares)).collect();
            decide(&pieces.iter().collect::<Vec<_>>(), Lattice::MILLIMETRE)
        };
        let (tree, pole) = ([0, 95], [95, 0]);
        assert_eq!(decided(&[2, 3], tree), Some(Kind::Trunk));
        assert_eq!(decided(&[3, 4], tree), Some(Kind::Trunk));
        assert_eq!(decided(&[3, 4], [0, 40]), None, "hedge or something small for the most part");
        assert_eq!(decided(&[2, 3], pole), Some(Kind::Pole));
        assert_eq!(decided(&[3, 4], pole), None, "a lamp that hangs");
        assert_eq!(decided(&[4], tree), None);
    }

    #[test]
    fn a_stub_is_a_trunk_if_it_is_narrow_and_a_crown_stands_over_it() {
        let stub = Piece { crown: 60, sides: [10; 8], any_above: 0, any_levels: 0b110, ..piece(0, [2, 40]) };
        let decided = |stub: &Piece| decide(&[stub], Lattice::MILLIMETRE);
        assert_eq!(decided(&stub), Some(Kind::Trunk));
        assert_eq!(decided(&Piece { radius: 301, ..stub.clone() }), None, "a bush");
        assert_eq!(decided(&Piece { crown: 49, ..stub.clone() }), None, "a bollard beside a crown");
        let sides = [10, 10, 10, 10, 10, 0, 0, 0];
        assert_eq!(decided(&Piece { sides, ..stub.clone() }), None, "at the edge of a crown");
        assert_eq!(decided(&Piece { pole: 20 * 255, tree: 0, ..stub.clone() }), None, "a post");
        assert_eq!(decided(&Piece { slice: 1, ..stub.clone() }), None, "a branch");
    }

    #[test]
    fn what_looks_like_a_hedge_is_a_trunk_under_a_crown() {
        let low = |crown, sides| {
            let hidden = Piece { crown, sides, any_above: 0, any_levels: 0b110, ..piece(0, [2, 20]) };
            let pieces = [hidden.clone(), Piece { slice: 1, ..hidden }];
            decide(&pieces.iter().collect::<Vec<_>>(), Lattice::MILLIMETRE)
        };
        assert_eq!(low(60, [10; 8]), Some(Kind::Trunk));
        assert_eq!(low(60, [30, 30, 0, 0, 0, 0, 0, 0]), None);
        assert_eq!(low(0, [0; 8]), None);
    }

    #[test]
    fn a_side_is_covered_by_a_share_of_the_crown() {
        assert_eq!(covered(&[100, 2, 0, 0, 0, 0, 0, 0]), 1);
        assert_eq!(covered(&[100, 4, 3, 0, 0, 0, 0, 90]), 2);
        assert_eq!(covered(&[10; 8]), 8);
    }

    #[test]
    fn the_top_is_below_the_first_gap_of_three_levels() {
        assert_eq!(top(0), 0, "nothing is above");
        assert_eq!(top(0b1), 1);
        assert_eq!(top(0b1100), 4);
        assert_eq!(top(0b1001), 4);
        assert_eq!(top(0b1_0001), 1);
        assert_eq!(top(u64::MAX), 64);
    }

    #[test]
    fn the_levels_of_a_piece_are_0_3_m_high() {
        assert_eq!(levels_of((0, 299), Lattice::MILLIMETRE), 0b1);
        assert_eq!(levels_of((650, 1_250), Lattice::MILLIMETRE), 0b1_1100);
        assert_eq!(levels_of((100_000, 200_000), Lattice::MILLIMETRE), 1 << 62);
    }
}

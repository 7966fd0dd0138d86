//! Gives the voxels of chains the class of their chain: the voxels of its pieces, and those along its axis.
//!
//! The classifier confuses branches above a sign with poles, but is less sure than for a real pole. Without
//! this rule, a sign below a crown took these branches and grew to up to four times its size. So above its
//! pieces, a pole takes only voxels that are surely pole or close to its axis. Other voxels around it that
//! look like a pole, but not surely, are branches. `benches/results/street.md` has the study ("Branches above
//! signs").
#![expect(
    clippy::cast_possible_truncation,
    reason = "heights above ground in lattice units and indices of voxels fit i32"
)]

use rustc_hash::FxHashMap;

use crate::cluster::columns::Voxel;
use crate::cluster::street::chains::piece::Piece;
use crate::cluster::street::chains::stage_chains::{self, Verdict};
use crate::cluster::street::classes::classified::{Classified, Shares};
use crate::cluster::street::settings::EDGE_M;
use crate::cluster::street::shares::{self, POLE, TREE};
use crate::cluster::street::window::Window;
use crate::model::Lattice;
use crate::spatial::Cell;

/// Distance from the centre of a piece within which its chain takes voxels above and below it, in metres.
const AXIS_M: f64 = 0.45;
/// The same for voxels above [`LOW_M`] that are not surely pole: one and a half voxels.
const THIN_M: f64 = 0.225;
/// Distance from a pole within which other voxels that look like a pole may be a branch, in metres. Farther
/// away they may be a pole that is not a chain.
const BESIDE_M: f64 = 1.8;
/// Pole share from which a voxel is surely pole, and tree share above which any other voxel may be tree, in
/// steps of 1/255: 0.8 and 0.15.
const SURE: u8 = 204;
const MAYBE_TREE: u8 = 38;
/// Distance within which a piece may change the class of a voxel, in metres. A piece belongs to the tile of
/// its first voxel, which is at most 1.1 m from its centre.
pub(crate) const REACH_M: f64 = BESIDE_M + 1.1;
/// Height in metres up to which every voxel that looks like a pole is one. Crowns begin above.
const LOW_M: f64 = 2.4;
/// Height up to which a trunk takes the voxels around its axis, in metres.
const TRUNK_M: f64 = 4.0;
/// Distance from the centre of the highest piece within which the voxels above it are in the core of the
/// trunk, in metres. So where a trunk is hidden below its crown, its growth begins in the crown too.
const STEM_M: f64 = 0.34;

/// These lengths in lattice units.
struct Units {
    axis: i64,
    thin: i64,
    beside: i64,
    edge: i64,
    stem: i64,
    low: i32,
    trunk: i32,
}

impl Units {
    fn new(lattice: Lattice) -> Self {
        Self {
            axis: lattice.units(AXIS_M),
            thin: lattice.units(THIN_M),
            beside: lattice.units(BESIDE_M),
            edge: lattice.units(EDGE_M),
            stem: lattice.units(STEM_M),
            low: lattice.units(LOW_M) as i32,
            trunk: lattice.units(TRUNK_M) as i32,
        }
    }

    /// The column of voxels in which the centre of a piece lies.
    fn cell(&self, piece: &Piece) -> Cell {
        piece.centre.map(|value| value.div_euclid(self.edge) as i32)
    }

    /// Whether a chain takes a voxel along its axis. `distance` is squared.
    fn along(&self, verdict: &Verdict, class: u8, shares: &Shares, distance: i64, height: i32) -> bool {
        if distance > self.axis.pow(2) {
            return false;
        }
        if !verdict.pole {
            return height < self.trunk && (class == TREE || class == POLE);
        }
        let thin = height <= self.low || distance <= self.thin.pow(2);
        class == POLE && (thin || shares[usize::from(POLE)] >= SURE)
    }

    /// Whether a voxel beside a pole is more likely a branch, although it looks like a pole. No chain takes
    /// it.
    fn is_branch(&self, class: u8, shares: &Shares, height: i32) -> bool {
        let [pole, tree] = [POLE, TREE].map(|class| shares[usize::from(class)]);
        class == POLE && pole < SURE && tree > MAYBE_TREE && height > self.low
    }
}

/// Gives the voxels of chains the class of their chain. Returns for each voxel whether its class was decided
/// here, and the chain if the voxel is in the core of a trunk (otherwise 0).
pub(crate) fn take(
    around: &mut Classified,
    class: &mut [u8],
    pieces: &[(Piece, Verdict)],
    lattice: Lattice,
) -> Vec<(bool, u32)> {
    let units = Units::new(lattice);
    let taken = taken(around, class, pieces, &units);
    let tops: FxHashMap<u32, &Piece> = pieces
        .iter()
        .filter(|(_, verdict)| verdict.top)
        .map(|(piece, verdict)| (verdict.chain, piece))
        .collect();
    let beside = beside_poles(around, pieces, &units);
    let mut trunk = vec![(false, 0); class.len()];
    for (voxel, found) in taken.into_iter().enumerate() {
        let height = around.height[voxel];
        let Some((distance, .., number)) = found else {
            if beside[voxel] && units.is_branch(class[voxel], &around.shares[voxel], height) {
                class[voxel] = TREE;
                around.shares[voxel] = shares::decided(&around.shares[voxel], TREE);
                trunk[voxel] = (true, 0);
            }
            continue;
        };
        let (piece, verdict) = &pieces[number];
        class[voxel] = if verdict.pole { POLE } else { TREE };
        around.shares[voxel] = shares::decided(&around.shares[voxel], class[voxel]);
        let above = tops.get(&verdict.chain).is_some_and(|top: &&Piece| {
            height > top.height.1 && squared(top, around.voxels.centre[voxel]) <= units.stem.pow(2)
        });
        let inside = is_inside(piece, distance, height);
        trunk[voxel] = (true, if (inside || above) && !verdict.pole { verdict.chain } else { 0 });
    }
    trunk
}

/// For each voxel, the nearest piece whose chain takes the voxel: squared distance, slice, first voxel,
/// number.
fn taken(
    around: &Classified,
    class: &[u8],
    pieces: &[(Piece, Verdict)],
    units: &Units,
) -> Vec<Option<(i64, u8, Voxel, usize)>> {
    let mut taken: Vec<Option<(i64, u8, Voxel, usize)>> = vec![None; class.len()];
    let mut near = Window::new(4, i32::MAX / 4).over(&around.voxels.columns);
    for (number, (piece, verdict)) in pieces.iter().enumerate() {
        near.visit(units.cell(piece), 0, |voxel| {
            let of = class[voxel];
            if !stage_chains::may_be_upright(of) {
                return;
            }
            let distance = squared(piece, around.voxels.centre[voxel]);
            let height = around.height[voxel];
            if is_inside(piece, distance, height)
                || units.along(verdict, of, &around.shares[voxel], distance, height)
            {
                let found = (distance, piece.slice, piece.first, number);
                taken[voxel] = Some(taken[voxel].map_or(found, |best| best.min(found)));
            }
        });
    }
    taken
}

/// Which voxels are near a pole.
fn beside_poles(around: &Classified, pieces: &[(Piece, Verdict)], units: &Units) -> Vec<bool> {
    let mut beside = vec![false; around.height.len()];
    let mut near =
        Window::new((units.beside / units.edge) as i32 + 1, i32::MAX / 4).over(&around.voxels.columns);
    for (piece, _) in pieces.iter().filter(|(_, verdict)| verdict.pole) {
        near.visit(units.cell(piece), 0, |voxel| {
            beside[voxel] |= squared(piece, around.voxels.centre[voxel]) <= units.beside.pow(2);
        });
    }
    beside
}

/// Whether a voxel at this squared distance from the centre of a piece is in the cylinder around it.
fn is_inside(piece: &Piece, distance: i64, height: i32) -> bool {
    distance <= piece.radius.pow(2) && height >= piece.height.0 && height <= piece.height.1
}

/// Squared distance in the plane from the centre of a piece.
fn squared(piece: &Piece, [x, y, _]: [i64; 3]) -> i64 {
    (x - piece.centre[0]).pow(2) + (y - piece.centre[1]).pow(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn units() -> Units {
        Units::new(Lattice::MILLIMETRE)
    }

    /// Shares of a pole and a tree in percent.
    fn shares([pole, tree]: [u32; 2]) -> Shares {
        let share = |percent: u32| (percent * 255 / 100) as u8;
        let mut shares = Shares::default();
        shares[usize::from(POLE)] = share(pole);
        shares[usize::from(TREE)] = share(tree);
        shares
    }

    #[test]
    fn above_its_pieces_a_pole_takes_what_is_thin_or_sure() {
        let sign = Verdict { chain: 1, pole: true, top: true };
        let takes = |distance: i64, height, shares: &Shares| {
            units().along(&sign, POLE, shares, distance.pow(2), height)
        };
        let [unsure, sure] = [shares([70, 30]), shares([90, 10])];
        assert!(takes(400, 2_400, &unsure) && !takes(400, 2_401, &unsure), "beside the axis");
        assert!(takes(400, 3_000, &sure) && !takes(460, 3_000, &sure));
        assert!(takes(220, 3_000, &unsure) && !takes(230, 3_000, &unsure));
        assert!(!units().along(&sign, TREE, &unsure, 0, 2_000));
    }

    #[test]
    fn a_trunk_takes_both_classes_up_to_its_height() {
        let trunk = Verdict { chain: 1, pole: false, top: true };
        let takes = |class, height| units().along(&trunk, class, &shares([50, 50]), 400_i64.pow(2), height);
        assert!(takes(TREE, 3_900) && takes(POLE, 3_900) && !takes(TREE, 4_000));
    }

    #[test]
    fn what_looks_like_a_pole_less_surely_and_next_like_a_tree_is_a_branch() {
        let branch = |class, of, height| units().is_branch(class, &shares(of), height);
        assert!(branch(POLE, [70, 30], 2_401));
        assert!(!branch(POLE, [70, 30], 2_400), "below crowns");
        assert!(!branch(POLE, [90, 10], 2_500), "surely a pole");
        assert!(!branch(POLE, [70, 10], 2_500), "next like something else");
        assert!(!branch(TREE, [30, 70], 2_500));
    }
}

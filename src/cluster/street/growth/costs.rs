//! The cost of a step of growth, and which voxels are closed to a class, see [`super::stage_growth`].
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "costs of an edge are positive and below 2^24"
)]

use crate::cluster::street::classes::classified::Shares;
use crate::cluster::street::settings::{CLASSES, EDGE_M};
use crate::cluster::street::shares::{GROUND, POLE, TREE};
use crate::model::Lattice;

/// Smallest share of a class that opens a voxel to it, by class.
const OPEN: [u8; CLASSES] = [255, 5, 127, 25, 13, 51, 51, 26];
/// Extra cost of an edge to a voxel that is entirely of other classes, as a multiple of its cost.
const OTHER_CLASS: f64 = 8.0;
/// Extra cost of an edge that leads straight down, as a multiple of its cost, for trees.
const DOWN: f64 = 3.0;
/// Cost of one voxel length of additional distance from the stem in the plane, for trees.
const AWAY: f64 = 0.5;
/// Cost of an increase of the square of this distance by one square metre. Between two crowns that touch, it
/// moves the boundary towards the middle between their stems, however much denser one of them was scanned.
const AWAY_SQUARE: f64 = 10.0;
/// Cost of an edge of the length of a voxel.
const UNIT: f64 = 256.0;

/// Whether a voxel can belong to an object.
pub(crate) fn is_open(shares: &Shares) -> bool {
    shares[usize::from(GROUND)] <= 127
}

/// The share of a class in a voxel for growth; `None` if the voxel is closed to the class. A tree may also
/// grow over voxels that look like poles: most of them are trunks and branches, and poles are cores.
pub(crate) fn share(shares: &Shares, class: u8) -> Option<u8> {
    let of = |class: u8| shares[usize::from(class)];
    let share = if class == TREE { of(TREE).saturating_add(of(POLE)) } else { of(class) };
    (share >= OPEN[usize::from(class)] && is_open(shares)).then_some(share)
}

/// Costs of edges in lattice units of one drive.
pub(crate) struct Costs {
    edge: f64,
    metre: f64,
}

impl Costs {
    pub(crate) fn new(lattice: Lattice) -> Self {
        Self { edge: lattice.units(EDGE_M) as f64, metre: lattice.units(1.0) as f64 }
    }

    /// Cost of the edge from one voxel to another for a core of a class that stands at `place`.
    pub(crate) fn edge(&self, from: [i32; 3], to: [i32; 3], class: u8, place: [i64; 2], share: u8) -> u32 {
        let [dx, dy, dz] = [0, 1, 2].map(|axis| f64::from(to[axis] - from[axis]));
        let length = (dx * dx + dy * dy + dz * dz).sqrt();
        let ratio = length / self.edge;
        let mut cost = ratio * ratio.sqrt();
        if class == TREE {
            if dz < 0.0 {
                cost *= 1.0 - DOWN * dz / length;
            }
            let from_stem = |at: [i32; 3]| {
                let ([x, y], [u, v]) = ([i64::from(at[0]), i64::from(at[1])], place);
                (((x - u) * (x - u) + (y - v) * (y - v)) as f64).sqrt()
            };
            let (start, end) = (from_stem(from), from_stem(to));
            if end > start {
                let square_m2 = (end * end - start * start) / (self.metre * self.metre);
                cost += AWAY * (end - start) / self.edge + AWAY_SQUARE * square_m2;
            }
        }
        let other = 1.0 - f64::from(share) / 255.0;
        (UNIT * cost * (1.0 + OTHER_CLASS * other) + 0.5).max(1.0) as u32
    }
}

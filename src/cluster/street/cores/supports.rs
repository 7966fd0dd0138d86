//! Poles that carry wires. The wires of two spans touch at the pole between them, but they are two objects.
//!
//! A voxel of a wire is carried if voxels of a pole are beside it and below it. Wires are cut around such
//! voxels: the wire voxels there are in no component, and growth gives them to a span.

use crate::cluster::street::classes::classified::Classified;
use crate::cluster::street::settings::EDGE_M;
use crate::cluster::street::shares::{POLE, WIRE};
use crate::cluster::street::window::Window;
use crate::model::Lattice;

/// Largest distance in the plane of a carried wire to the pole, in metres. Measured on three drives of
/// `synth suburb`: at 25 of 26 poles, the wire nearest to the axis of the pole is at most 0.4 m from it; the
/// wire nearest to a lamp is at least 0.96 m from the axis of the lamp.
const BESIDE_M: f64 = 0.7;
/// Smallest number of levels with pole voxels, and the number of levels that are examined. A level is two
/// voxels high, and the highest one is at the wire.
const LEVELS: (u32, i32) = (6, 8);
/// Distance from a carried voxel within which wires are cut, in metres: the other wires of the cross-arm are
/// 0.75 m away. Voxels of wires that are at most 0.66 m apart are joined.
const CUT_M: f64 = 1.0;

/// For each voxel whether it is a wire at a pole that carries it.
pub(crate) fn cut(around: &Classified, class: &[u8], lattice: Lattice) -> Vec<bool> {
    let columns = &around.voxels.columns;
    let steps =
        |metres: f64| i32::try_from(lattice.units(metres) / lattice.units(EDGE_M)).unwrap_or(i32::MAX);
    let mut beside = Window::new(steps(BESIDE_M), 2 * LEVELS.1).over(columns);
    let mut around_carried = Window::new(steps(CUT_M), steps(CUT_M)).over(columns);
    let mut cut = vec![false; class.len()];
    for wire in (0..class.len()).filter(|&voxel| class[voxel] == WIRE) {
        let [i, j, k] = around.voxels.key[wire];
        let mut levels = 0_u32;
        beside.visit([i, j], k, |voxel| {
            let below = (k + 1 - around.voxels.key[voxel][2]).div_euclid(2);
            if class[voxel] == POLE && (0..LEVELS.1).contains(&below) {
                levels |= 1 << below;
            }
        });
        if levels.count_ones() >= LEVELS.0 {
            around_carried.visit([i, j], k, |voxel| cut[voxel] |= class[voxel] == WIRE);
        }
    }
    cut
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::street::voxels::stored::Voxels;

    /// Cuts a wire along x at a height of 7.5 m. A pole at x = 10 m is `beside` decimetres away from the wire
    /// and `top` decimetres high. Returns the places along the wire, in voxels, at which it is cut.
    fn cut_at(beside: i64, top: i64) -> Vec<i32> {
        let wire = (0..200).map(|x| [100 * x, 20, 7_520]);
        let pole = (0..=top).map(|z| [10_020, 100 * beside + 20, 100 * z]);
        let points: Vec<[i64; 3]> = wire.chain(pole).collect();
        let voxels = Voxels::of_points(Lattice::MILLIMETRE, &points);
        let of = |key: &[i32; 3]| if key[1] == 0 { WIRE } else { POLE };
        let class: Vec<u8> = voxels.key.iter().map(of).collect();
        let count = voxels.len();
        let around = Classified { voxels, height: vec![0; count], shares: vec![[0; 8]; count] };
        let cut = cut(&around, &class, Lattice::MILLIMETRE);
        assert!((0..count).all(|voxel| !cut[voxel] || class[voxel] == WIRE));
        let mut places: Vec<i32> =
            (0..count).filter(|&voxel| cut[voxel]).map(|voxel| around.voxels.key[voxel][0]).collect();
        places.sort_unstable();
        places
    }

    #[test]
    fn wires_are_cut_at_the_pole_that_carries_them() {
        let places = cut_at(3, 80);
        assert!(places.len() > 14, "more than twice 0.66 m: {places:?}");
        assert_eq!((places[0] + places[places.len() - 1]) / 2, 66, "{places:?}");
        assert!(cut_at(9, 80).is_empty(), "a lamp beside them");
        assert!(cut_at(3, 60).is_empty(), "a signal below them");
    }
}

//! Which components are cores: they are large enough, stand on the ground (not buildings and wires) and do
//! not hang in foliage.

use super::arms;
use super::part::Part;
use crate::cluster::street::shares::{BUILDING, FENCE, POLE, SMALL, VEHICLE, WIRE};
use crate::model::Lattice;

/// Mean number of neighbours in crowns and facades, of 26, per voxel of a piece, above which the piece is
/// embedded in them. For a piece with fewer, the model of pieces says later whether it is whole
/// (`benches/results/street.md`, "Cutting more").
const EMBEDDED: f64 = 3.0;
/// Share of voxels within 0.5 m of a facade from which an upright piece is a part of the facade. Bins, fences
/// and people do stand at facades and in front of cars. For these, the model of pieces says later whether a
/// piece is whole (`benches/results/street.md`, "What stands at facades").
const AT_FACADE: f64 = 0.7;

/// Whether a component is a core.
pub(crate) fn keeps(part: &Part, lattice: Lattice) -> bool {
    let low = lattice.metres(part.height.0.into());
    let high = lattice.metres(part.height.1.into());
    let tall = high - low;
    let extent = lattice.metres(part.extent());
    let voxels = part.voxels;
    // A small piece with many neighbours in crowns or facades is foliage or a part of a facade.
    let embedded = f64::from(part.contact) > EMBEDDED * f64::from(voxels);
    let free = voxels >= 80 || !embedded;
    let stands = low < 0.8;
    // An upright piece that is fixed to a facade, such as a drain pipe, is a part of it.
    let fixed = f64::from(part.at_facade) >= AT_FACADE * f64::from(voxels);
    match part.class {
        BUILDING => voxels >= 150 && high > 2.5,
        // An upright piece among leaves without a pole chain is a part of a stem, unless it certainly looks
        // like a pole: a pole with a hedge around its foot has no chain.
        POLE => {
            let free = part.decided > 0 || !embedded || arms::is_sure(part);
            tall >= 1.0 && voxels >= 6 && (stands || (low < 1.6 && tall >= 1.5)) && free && !fixed
        }
        VEHICLE => voxels >= 60 && extent > 1.5 && stands && free,
        FENCE => voxels >= 12 && stands && free,
        SMALL => voxels >= 5 && stands && free,
        WIRE => extent >= 3.0,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::street::cores::part::NO_BAND;

    #[test]
    fn a_pole_among_leaves_without_a_chain_is_a_core_if_it_certainly_looks_like_one() {
        // 40 voxels up to 7.9 m, with four leaves around each.
        let voxel = |step: i32| Part::of_voxel(POLE, NO_BAND, [0, 0, step], 100 + 200 * step, [0; 3]);
        let mut lamp = voxel(0);
        (1..40).for_each(|step| lamp.merge(&voxel(step)));
        lamp.contact = 160;
        let is_core =
            |sure_pole, decided| keeps(&Part { sure_pole, decided, ..lamp.clone() }, Lattice::MILLIMETRE);
        assert!(is_core(32, 0) && !is_core(31, 0));
        assert!(is_core(0, 1), "a chain decided that it is a pole");
        lamp.contact = 120;
        assert!(keeps(&lamp, Lattice::MILLIMETRE), "few leaves");
    }
}

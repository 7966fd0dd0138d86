//! The crown of a tree: where it begins, and its extent in the plane.

use std::collections::BTreeSet;

use super::outline::outline;
use super::parts::{Frames, Measures};
use super::rectangle::longest_and_across;
use crate::model::{Lattice, convex_hull};

/// Smallest area of the occupied cells of a crown layer, as a share of the area of the largest layer (chosen:
/// single branches below the crown have less).
const LEAST_SHARE: f64 = 0.15;
/// Smallest area of the occupied cells of a crown layer, in square metres.
const LEAST_AREA_M2: f64 = 0.2;
/// Height over which all layers must belong to the crown where it begins, in metres.
const STEADY_M: f64 = 0.6;
/// Distance from the stem within which cells do not count (by their middle), in metres.
const OF_STEM_M: f64 = 0.35;

/// The crown of a tree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Crown {
    /// Height of its lower end, in metres over lattice z 0.
    pub(crate) base_m: f64,
    /// Area of its outline in square metres.
    pub(crate) area_m2: f64,
    /// Mean of its longest extent and the extent across it, in metres.
    pub(crate) diameter_m: f64,
}

/// The crown of a tree whose stem is at `stem`, in lattice units. `None` if no layer is wide enough.
pub(crate) fn crown(measures: &Measures, frames: &Frames, lattice: Lattice, stem: [f64; 2]) -> Option<Crown> {
    let lowest = begin(measures, frames, lattice, stem)?;
    let polygon = outline(&measures.plan, &frames.plan, lattice, |heights| heights.highest >= lowest)?;
    let frame = &frames.plan;
    let level = measures.plan.level;
    // Middles of cells, doubled.
    let mut middles: Vec<[i64; 2]> = measures
        .plan
        .voxels
        .iter()
        .filter(|(_, heights)| heights.highest >= lowest)
        .map(|([i, j, _], _)| [frame.doubled_middle(level, 0, *i), frame.doubled_middle(level, 1, *j)])
        .collect();
    let [longest, across] = longest_and_across(&convex_hull(&mut middles));
    let step_m = lattice.step_m();
    Some(Crown {
        base_m: lattice.metres(lowest),
        area_m2: polygon.area_units2() * step_m * step_m,
        // A factor of one half for the doubled middles, and one for the mean.
        diameter_m: (longest + across) * step_m / 4.0,
    })
}

/// Height of the lower end of the crown of a tree whose stem is at `stem`, in lattice units, in metres over
/// lattice z 0. `None` if no layer is wide enough.
pub(crate) fn crown_base_m(
    measures: &Measures,
    frames: &Frames,
    lattice: Lattice,
    stem: [f64; 2],
) -> Option<f64> {
    begin(measures, frames, lattice, stem).map(|lowest| lattice.metres(lowest))
}

/// Lattice z of the lower end of the lowest layer of the crown.
fn begin(measures: &Measures, frames: &Frames, lattice: Lattice, stem: [f64; 2]) -> Option<i64> {
    let frame = &frames.crown;
    let level = measures.crown.level;
    let edge = frame.edge_at(level);
    let edge_m = lattice.metres(edge);
    let mut layers: Vec<BTreeSet<[u32; 2]>> = Vec::new();
    let most = measures.crown.voxels.iter().map(|([_, _, k], ())| *k as usize).max()?;
    layers.resize_with(most + 1, BTreeSet::new);
    for ([i, j, k], ()) in &measures.crown.voxels {
        let apart = |axis: usize, index: u32| {
            (frame.doubled_middle(level, axis, index) as f64 / 2.0 - stem[axis]) * lattice.step_m()
        };
        if apart(0, *i).hypot(apart(1, *j)) > OF_STEM_M {
            layers[*k as usize].insert([*i, *j]);
        }
    }
    let areas: Vec<f64> = layers.iter().map(|cells| cells.len() as f64 * edge_m * edge_m).collect();
    let largest = areas.iter().copied().fold(0.0, f64::max);
    let least = (LEAST_SHARE * largest).max(LEAST_AREA_M2);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few layers")]
    let steady = ((STEADY_M / edge_m).ceil() as usize).max(1);
    // A crown with fewer layers needs only the layers that it has.
    let wide = |from: &usize| areas[*from..].iter().take(steady).all(|area| *area >= least);
    let first = (0..areas.len()).find(wide)?;
    Some(frame.corner[2] + i64::try_from(first).ok()? * edge)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{FileId, Kind, ObjectPart, TileCloud};

    #[test]
    fn a_crown_begins_above_the_stem_and_has_the_diameter_of_its_ball() {
        // A stem of 3 m, a ball of leaves of 4 m in diameter above it, and one low branch.
        let mut points: Vec<[i64; 3]> =
            (0..600).map(|k| [100 - (k * 37) % 200, (k * 53) % 150, k * 5]).collect();
        points.extend((0..60_000_i64).filter_map(|k| {
            let p =
                [(k * 7_919) % 4_000 - 2_000, (k * 104_729) % 3_989 - 1_994, (k * 15_485) % 3_967 - 1_983];
            let inside = p.iter().map(|v| v * v).sum::<i64>() <= 4_000_000;
            inside.then_some([p[0], p[1], p[2] + 5_000])
        }));
        points.extend((0..40).map(|k| [400 + k * 20, 0, 1_200]));
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, &points);
        let labels = vec![1; points.len()];
        let whole = ObjectPart::collect(&cloud, &labels, 1, |_| true, |_| FileId::new(0)).remove(0);
        let kind = Kind::new(2, 255);
        let measures =
            Measures::collect(&cloud, &labels, |_| true, |_| Some((&whole, kind, None))).remove(0).1;
        let frames = Frames::new(&whole, kind, None, Lattice::MILLIMETRE);
        let crown = crown(&measures, &frames, Lattice::MILLIMETRE, [0.0, 0.0]).unwrap();
        assert!((3.0..3.6).contains(&crown.base_m), "{crown:?}");
        assert!((crown.diameter_m - 4.0).abs() < 0.15, "{crown:?}");
        assert!((crown.area_m2 - 12.6).abs() < 0.7, "{crown:?}");
        let bare = Measures::empty(&frames);
        assert_eq!(super::crown(&bare, &frames, Lattice::MILLIMETRE, [0.0, 0.0]), None);
    }
}

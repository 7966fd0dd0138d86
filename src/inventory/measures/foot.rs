//! Where an object stands: the foot of its stem or pole, or else the middle of its lowest part, on the
//! ground.

use std::collections::BTreeMap;

use super::parts::{Frames, Measures, POLE, TREE};
use super::profile::Ends;
use super::stem::{Stem, StemAxis};
use crate::inventory::terrain::Terrain;
use crate::model::{Kind, Lattice, ObjectPart};

/// The lowest part of an object: cells of the plan whose lowest point is at most this much further above the
/// ground than the lowest of all, in metres (chosen: wheels and sills, not mirrors).
const LOWEST_PART_M: f64 = 0.3;
/// If most of the lowest part of an object without stem is this much below the ground model, in metres, the
/// model is wrong there: the ground was not seen, for example behind a hedge (chosen: steps and kerbs within
/// a cell are lower). Most, because single cells of the model are wrong as well, and reflections of a facade
/// are up to 16 m below the ground.
const BELOW_GROUND_M: f64 = 0.2;
/// A tree that is lower than this share of its width hides its stem in leaves down to the ground, as a cycad
/// or a bush does: it stands in the middle of them. Its densest leaves are at the side that was seen, and are
/// no stem. Chosen between 0.56, the largest of cycads, and 1.07, the smallest of all other trees of `synth
/// avenue`.
const LOW_TREE: f64 = 0.75;
/// Rounds in which the foot of an axis is found on the ground. A stem that leans by 10 degrees on a slope of
/// 30 degrees gains a digit in each.
const ROUNDS: usize = 4;
/// A mean of a voxel may be this much outside its points by rounding, in metres.
const ROUNDING_M: f64 = 1e-6;

/// Where an object stands.
#[derive(Debug)]
pub(crate) struct Foot {
    /// Place in the plane, in metres.
    pub(crate) place: [f64; 2],
    /// Height of the ground there in metres, which is not above the lowest point of the stem. `None` if none
    /// is known within 10 m.
    pub(crate) ground_m: Option<f64>,
    /// Stem or pole with its axis, in metres from the corner of the frame of the stem.
    pub(crate) stem: Option<(Stem, StemAxis)>,
}

impl Foot {
    /// The foot of a whole object.
    pub(crate) fn new(
        whole: &ObjectPart,
        ends: Ends,
        kind: Kind,
        measures: &Measures,
        frames: &Frames,
        terrain: &Terrain,
        lattice: Lattice,
    ) -> Self {
        let from_corner = |z: i64| lattice.metres(z - frames.stem.corner[2]);
        let between = [from_corner(ends.bottom) - ROUNDING_M, from_corner(ends.top) + ROUNDING_M];
        let stem = Stem::new(&measures.stem, between, lattice, kind.class);
        let is_low = kind.class == TREE && is_low(whole, ends);
        if matches!(kind.class, TREE | POLE)
            && !is_low
            && let Some(axis) = stem.axis()
        {
            let corner = frames.stem.corner.map(|value| lattice.metres(value));
            let mut ground_m = None;
            let mut place = [0, 1].map(|k| corner[k] + axis.at(axis.from)[k]);
            for _ in 0..ROUNDS {
                // A stem begins at the ground or above it. The model is higher where the ground was not seen.
                ground_m = terrain.surface_m(place).map(|surface_m| surface_m.min(corner[2] + axis.from));
                // Without ground, the stem ends at its lowest point.
                let z = ground_m.unwrap_or(lattice.metres(ends.bottom)) - corner[2];
                place = [0, 1].map(|k| corner[k] + axis.at(z)[k]);
            }
            return Self { place, ground_m, stem: Some((stem, axis)) };
        }
        match lowest_part(measures, ends, frames, terrain, lattice) {
            Some((lowest, below_m)) => {
                let middle = |k: usize| lattice.metres(whole.lo[k] + whole.hi[k]) / 2.0;
                let place = if is_low { [middle(0), middle(1)] } else { lowest };
                Self { place, ground_m: terrain.surface_m(place).map(|m| m + below_m), stem: None }
            }
            // No points at all.
            None => Self { place: [0.0; 2], ground_m: None, stem: None },
        }
    }
}

/// Whether a tree is so low that no stem is seen.
fn is_low(whole: &ObjectPart, ends: Ends) -> bool {
    let [x, y] = [0, 1].map(|k| (whole.hi[k] - whole.lo[k]) as f64);
    ((ends.top - ends.bottom) as f64) < LOW_TREE * f64::midpoint(x, y)
}

/// Middle of the lowest part in metres, all of whose cells weigh the same, and how far the ground is below
/// its model there (0 or less). Without ground, heights are counted from zero. `None` without cells.
fn lowest_part(
    measures: &Measures,
    ends: Ends,
    frames: &Frames,
    terrain: &Terrain,
    lattice: Lattice,
) -> Option<([f64; 2], f64)> {
    let frame = &frames.plan;
    let level = measures.plan.level;
    let mut known = BTreeMap::new();
    // What is above detached points is not known. Where they are in every cell, it begins at the bottom.
    let is_clear = |lowest: i64| lowest >= ends.bottom;
    let any_clear = measures.plan.voxels.iter().any(|(_, heights)| is_clear(heights.lowest));
    // Place, height over the ground, and how far the lowest point is below the model.
    let cells: Vec<([i64; 2], f64, f64)> = measures
        .plan
        .voxels
        .iter()
        .filter(|(_, heights)| is_clear(heights.lowest) || !any_clear)
        .map(|([i, j, _], heights)| {
            let doubled = [frame.doubled_middle(level, 0, *i), frame.doubled_middle(level, 1, *j)];
            let place = doubled.map(|value| value.div_euclid(2));
            let ground_m =
                *known.entry(terrain.cell(place)).or_insert_with(|| terrain.height_of_cell_m(place));
            let lowest_m = lattice.metres(heights.lowest.max(ends.bottom));
            match ground_m.map(|ground_m| lowest_m - ground_m) {
                Some(over_m) => (doubled, over_m.max(0.0), over_m.min(0.0)),
                None => (doubled, lowest_m, 0.0),
            }
        })
        .collect();
    let lowest = cells.iter().map(|(_, over, _)| *over).min_by(f64::total_cmp)?;
    let part: Vec<_> = cells.into_iter().filter(|(_, over, _)| *over <= lowest + LOWEST_PART_M).collect();
    let mean = |k: usize| {
        let sum: i128 = part.iter().map(|(place, ..)| i128::from(place[k])).sum();
        sum as f64 / (2 * part.len()) as f64 * lattice.step_m()
    };
    let mut below: Vec<f64> = part.iter().map(|(_, _, below)| *below).collect();
    below.sort_by(f64::total_cmp);
    let middle = below.get(below.len() / 2).copied().filter(|below| *below < -BELOW_GROUND_M);
    Some(([mean(0), mean(1)], middle.unwrap_or(0.0)))
}

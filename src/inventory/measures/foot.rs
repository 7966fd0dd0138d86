//! Where an object stands: the foot of its stem or pole, or else the middle of its lowest part, on the
//! ground. The ground of a building is that before its front, on the side of the street.

use std::collections::{BTreeMap, BTreeSet};

use super::parts::{BUILDING, Frames, Measures, POLE, TREE};
use super::profile::Ends;
use super::stem::Stem;
use super::stem_axis::StemAxis;
use crate::inventory::site::Site;
use crate::model::{Kind, ObjectPart};

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
/// A tree without a stem stands in the middle of its crown if its lowest part is wider than this, in metres:
/// that part is of the crown then. Measured on 23 trees of `synth` that had no direction and were not low:
/// the lowest part was at most 0.42 m wide, or at least 1.04 m.
const WIDEST_STEM_M: f64 = 0.7;
/// The ground of a building is looked up this far before its front, in metres: in the next cell of the model.
/// Within the walls the model is a floor, or reflections below one.
const BEFORE_FRONT_M: f64 = 1.0;
/// A building has one front in so many metres of chainage: those of a cell of the model.
const FRONT_M: f64 = 1.0;
/// Distance in metres over which the way to the axis of the drive is found.
const WAY_M: f64 = 0.5;
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
        site: &Site<'_>,
    ) -> Self {
        let Site { lattice, terrain, .. } = *site;
        let from_corner = |z: i64| lattice.metres(z - frames.stem.corner[2]);
        let between = [from_corner(ends.bottom) - ROUNDING_M, from_corner(ends.top) + ROUNDING_M];
        let middle = [0, 1].map(|k| lattice.metres(whole.lo[k] + whole.hi[k]) / 2.0);
        let is_tree = kind.class == TREE;
        let stem = Stem::new(&measures.stem, between, lattice, is_tree);
        let is_low = is_tree && is_low(whole, ends);
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
        let is_building = kind.class == BUILDING;
        let fronts = is_building.then(|| ground_of_fronts(measures, frames, site));
        let ground_m = |place: [i64; 2]| {
            let before = fronts.as_ref().and_then(|fronts| *fronts.get(&front_of(place, site).0)?);
            before.or_else(|| terrain.height_of_cell_m(place))
        };
        match lowest_part(measures, ends, frames, site, ground_m) {
            Some(part) => {
                let is_of_crown = is_tree && (is_low || part.width_m > WIDEST_STEM_M);
                let place = if is_of_crown { middle } else { part.middle };
                let ground_m = if is_building { part.ground_m } else { terrain.surface_m(place) };
                Self { place, ground_m: ground_m.map(|ground_m| ground_m + part.below_m), stem: None }
            }
            // No points at all.
            None => Self { place: [0.0; 2], ground_m: None, stem: None },
        }
    }
}

/// Number of the front of a building that is at the chainage of a place in lattice units, and distance of the
/// place from the axis in metres.
#[expect(clippy::cast_possible_truncation, reason = "metres of a drive")]
fn front_of(place: [i64; 2], site: &Site<'_>) -> (i64, f64) {
    let station = (site.locate)(place.map(|value| site.lattice.metres(value)));
    ((station.chainage_m / FRONT_M).floor() as i64, station.offset_m.abs())
}

/// Height of the ground in metres before each front of a building: before that of its cells at this chainage
/// which is the nearest to the axis.
fn ground_of_fronts(measures: &Measures, frames: &Frames, site: &Site<'_>) -> BTreeMap<i64, Option<f64>> {
    let cells: BTreeSet<[i64; 2]> = measures
        .plan
        .voxels
        .iter()
        .map(|([i, j, _], _)| {
            let middle = |axis, index| frames.plan.doubled_middle(measures.plan.level, axis, index);
            site.terrain.cell([middle(0, *i).div_euclid(2), middle(1, *j).div_euclid(2)])
        })
        .collect();
    let mut nearest: BTreeMap<i64, (f64, [i64; 2])> = BTreeMap::new();
    for cell in cells {
        let place = site.terrain.middle_of(cell);
        let (front, offset_m) = front_of(place, site);
        let best = nearest.entry(front).or_insert((offset_m, place));
        if offset_m < best.0 {
            *best = (offset_m, place);
        }
    }
    let metres = |place: [i64; 2]| place.map(|value| site.lattice.metres(value));
    let ground_m = |(_, place): (f64, [i64; 2])| site.terrain.surface_m(metres(before(place, site)));
    nearest.into_iter().map(|(front, nearest)| (front, ground_m(nearest))).collect()
}

/// The place 1 m nearer to the axis of the drive, in lattice units.
fn before(place: [i64; 2], site: &Site<'_>) -> [i64; 2] {
    let metres = place.map(|value| site.lattice.metres(value));
    let away = |x: f64, y: f64| (site.locate)([metres[0] + x, metres[1] + y]).offset_m.abs();
    let here = away(0.0, 0.0);
    let way = [here - away(WAY_M, 0.0), here - away(0.0, WAY_M)];
    let length = way[0].hypot(way[1]);
    if length < WAY_M / 2.0 {
        return place; // on the axis
    }
    [0, 1].map(|k| place[k] + site.lattice.units(way[k] / length * BEFORE_FRONT_M))
}

/// Whether a tree is so low that no stem is seen.
fn is_low(whole: &ObjectPart, ends: Ends) -> bool {
    let [x, y] = [0, 1].map(|k| (whole.hi[k] - whole.lo[k]) as f64);
    ((ends.top - ends.bottom) as f64) < LOW_TREE * f64::midpoint(x, y)
}

/// The lowest part of an object, all of whose cells weigh the same. Metres.
struct LowestPart {
    middle: [f64; 2],
    /// Its larger extent in x and y.
    width_m: f64,
    /// Median of the ground of its cells. `None` where no ground is near most of them.
    ground_m: Option<f64>,
    /// How far the ground is below its model, 0 or less.
    below_m: f64,
}

/// A cell of the plan of an object.
struct PlanCell {
    /// Its middle in lattice units, doubled.
    doubled: [i64; 2],
    /// Height of the ground below it, in metres.
    ground_m: Option<f64>,
    /// Height of its lowest point over the ground, or over zero without ground, in metres.
    over_m: f64,
}

/// The lowest part of an object, with the height of the ground of a place in lattice units, which is the same
/// for all places in a cell of the terrain. `None` without cells.
fn lowest_part(
    measures: &Measures,
    ends: Ends,
    frames: &Frames,
    site: &Site<'_>,
    ground_m: impl Fn([i64; 2]) -> Option<f64>,
) -> Option<LowestPart> {
    let frame = &frames.plan;
    let level = measures.plan.level;
    let mut known = BTreeMap::new();
    // What is above detached points is not known. Where they are in every cell, it begins at the bottom.
    let is_clear = |lowest: i64| lowest >= ends.bottom;
    let any_clear = measures.plan.voxels.iter().any(|(_, heights)| is_clear(heights.lowest));
    let cells = measures.plan.voxels.iter().filter(|(_, heights)| is_clear(heights.lowest) || !any_clear);
    let cells: Vec<PlanCell> = cells
        .map(|([i, j, _], heights)| {
            let doubled = [frame.doubled_middle(level, 0, *i), frame.doubled_middle(level, 1, *j)];
            let cell = site.terrain.cell(doubled.map(|value| value.div_euclid(2)));
            let ground_m = *known.entry(cell).or_insert_with(|| ground_m(site.terrain.middle_of(cell)));
            let lowest_m = site.lattice.metres(heights.lowest.max(ends.bottom));
            PlanCell { doubled, ground_m, over_m: lowest_m - ground_m.unwrap_or(0.0) }
        })
        .collect();
    let over_m = |cell: &PlanCell| if cell.ground_m.is_some() { cell.over_m.max(0.0) } else { cell.over_m };
    let lowest = cells.iter().map(over_m).min_by(f64::total_cmp)?;
    let part: Vec<PlanCell> =
        cells.into_iter().filter(|cell| over_m(cell) <= lowest + LOWEST_PART_M).collect();
    let half_step_m = site.lattice.step_m() / 2.0;
    let mean = |k: usize| {
        let sum: i128 = part.iter().map(|cell| i128::from(cell.doubled[k])).sum();
        sum as f64 / part.len() as f64 * half_step_m
    };
    let width = |k: usize| {
        let ends = part.iter().map(|cell| cell.doubled[k]);
        ends.clone().max().unwrap_or(0) - ends.min().unwrap_or(0)
    };
    let width_m = width(0).max(width(1)) as f64 * half_step_m;
    let below = part.iter().map(|cell| if cell.ground_m.is_some() { cell.over_m.min(0.0) } else { 0.0 });
    let below_m = upper_median(below.collect()).filter(|below| *below < -BELOW_GROUND_M).unwrap_or(0.0);
    let ground_m = upper_median(part.iter().filter_map(|cell| cell.ground_m).collect());
    Some(LowestPart { middle: [mean(0), mean(1)], width_m, ground_m, below_m })
}

/// The upper median; `None` of nothing.
fn upper_median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

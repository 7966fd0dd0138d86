//! Where an object stands: the foot of its stem or pole, the middle of the front of a building, the middle of
//! the box of a vehicle, or else the middle of its lowest part, on the ground.

use std::collections::{BTreeMap, BTreeSet};

use super::body::box_of_body;
use super::classes::{BUILDING, POLE, TREE, VEHICLE};
use super::parts::{Frames, Measures};
use super::profile::Ends;
use super::sketch::Heights;
use super::stem::Stem;
use super::stem_axis::StemAxis;
use super::tree_foot::TreeFoot;
use crate::inventory::site::Site;
use crate::model::{Kind, Lattice, ObjectPart};

/// Largest height of a cell of the lowest part of an object above its lowest cell, in metres. Both are
/// heights over the ground (chosen: wheels and sills, not mirrors).
const LOWEST_PART_M: f64 = 0.3;
/// Depth below the ground model, in metres. If most of the lowest part of an object without a stem is deeper,
/// the model is wrong: the ground was not seen there, for example behind a hedge (chosen: steps and kerbs
/// within a cell are lower). Most of the part must be deeper, because single cells of the model are wrong
/// too, and reflections of a facade are up to 16 m below the ground.
const BELOW_GROUND_M: f64 = 0.2;
/// Largest difference of two heights of one ground below an object, in metres (chosen: less than a storey).
const SAME_GROUND_M: f64 = 2.0;
/// Ratio of height to width below which a tree is low. Leaves down to the ground hide its stem, as with a
/// cycad or a bush, so its place is the middle of the leaves. The densest leaves are on the side that was
/// seen, and are not a stem. Chosen between 0.56, the largest ratio of cycads, and 1.07, the smallest ratio
/// of all other trees of `synth avenue`.
const LOW_TREE: f64 = 0.75;
/// Approximate edge of the cells whose mean is the middle of a crown, in metres. Cells give the side that was
/// seen best no more weight. For 155 trees without a stem, the error of the middle (RMSE) was 0.28 m with
/// edges of 0.1 to 0.3 m and 0.39 m with 1 m; the middle of the extents was 0.37 m off. For low plants, the
/// middle of the extents is as good.
const CROWN_CELL_M: f64 = 0.3;
/// Distance before the front of a building at which the plane of its ground is fitted, in metres: in the next
/// cell of the model. Within the walls the model shows a floor, or reflections below one.
const BEFORE_FRONT_M: f64 = 1.0;
/// Length of chainage that has one front of a building, in metres: the edge of a cell of the model.
const FRONT_M: f64 = 1.0;
/// Height above the lowest points of the front from which a part is an eave or a balcony, in metres (chosen:
/// less than the height of a shop window).
const EAVES_M: f64 = 1.0;
/// Step in metres over which the direction to the axis of the drive is measured.
const WAY_M: f64 = 0.5;
/// Rounds of intersecting an axis with the ground. For a stem that leans by 10 degrees on a slope of 30
/// degrees, each round gains a digit.
const ROUNDS: usize = 4;
/// Largest distance by which rounding moves the mean of a voxel outside its points, in metres.
const ROUNDING_M: f64 = 1e-6;

/// Where an object stands.
#[derive(Debug)]
pub(crate) struct Foot {
    /// Place in the plane, in metres. It is in the box of the object, unless a leaning stem leads out of it.
    pub(crate) place: [f64; 2],
    /// Height of the ground there in metres, never above the lowest point of the stem. `None` if no ground is
    /// known within 10 m.
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
        let is_tree = kind.class == TREE;
        let is_building = kind.class == BUILDING;
        let fronts = if is_building { Fronts::new(measures, ends, frames, site) } else { Fronts::default() };
        let ground_m = |place| fronts.ground_m(place, site).or_else(|| terrain.height_of_cell_m(place));
        let part = lowest_part(measures, ends, frames, site, ground_m);
        let stem = Stem::new(&measures.stem, between, lattice, is_tree);
        let is_low = is_tree && is_low(whole, ends);
        let tree = part
            .as_ref()
            .filter(|_| is_tree)
            .map(|part| tree_foot(whole, measures, frames, part, &stem, lattice));
        if matches!(kind.class, TREE | POLE)
            && !is_low
            && let Some(axis) = stem.axis()
        {
            let corner = frames.stem.corner.map(|value| lattice.metres(value));
            let mut ground_m = None;
            let at = |z: f64| {
                let place = [0, 1].map(|k| corner[k] + axis.at(z)[k]);
                // Only a direction that was seen leads out of the box, to a foot that is hidden.
                if axis.has_direction { place } else { in_box(place, whole, lattice) }
            };
            let mut place = at(axis.from);
            for _ in 0..ROUNDS {
                // A stem begins at the ground or above it. The model is higher where the ground was not seen.
                ground_m = terrain.surface_m(place).map(|surface_m| surface_m.min(corner[2] + axis.from));
                // Without ground, the stem ends at its lowest point.
                let z = ground_m.unwrap_or(lattice.metres(ends.bottom)) - corner[2];
                place = at(z);
            }
            if tree.is_none_or(|tree| tree.has_stem_at(place, axis.has_direction)) {
                return Self { place, ground_m, stem: Some((stem, axis)) };
            }
        }
        match part {
            Some(part) => {
                let place = match (kind.class, tree) {
                    (TREE, Some(_)) if is_low => middle_of_extents(whole, lattice),
                    (TREE, Some(tree)) => tree.without_stem(),
                    (VEHICLE, _) => {
                        let around = box_of_body(whole, kind, measures, frames, lattice);
                        around.middle.map(|value| value * lattice.step_m())
                    }
                    _ => part.middle,
                };
                let (place, ground_m) = match fronts.middle(whole, site) {
                    Some((place, ground_m)) => (in_box(place, whole, lattice), ground_m),
                    None => {
                        let place = in_box(place, whole, lattice);
                        (place, terrain.surface_m(place))
                    }
                };
                let ground_m = ground_m.map(|ground_m| ground_m + part.below_m(ground_m));
                Self { place, ground_m, stem: None }
            }
            // No points at all.
            None => Self { place: [0.0; 2], ground_m: None, stem: None },
        }
    }
}

/// Lattice z of the lowest ground before a building, on the side of the axis, without the lowest 1 in 20
/// metres. `None` if no ground is known there.
pub(crate) fn lowest_before_front(measures: &Measures, frames: &Frames, site: &Site<'_>) -> Option<i64> {
    let middle = |axis, index| frames.plan.doubled_middle(measures.plan.level, axis, index).div_euclid(2);
    let places = measures.plan.voxels.iter().map(|([i, j, _], _)| [middle(0, *i), middle(1, *j)]);
    let large: BTreeSet<[i64; 2]> = places.map(|place| site.terrain.middle(place)).collect();
    let mut nearest: BTreeMap<i64, (f64, [i64; 2])> = BTreeMap::new();
    for place in large {
        let (metre, offset_m) = front_of(place, site);
        let found = nearest.entry(metre).or_insert((offset_m, place));
        if offset_m < found.0 {
            *found = (offset_m, place);
        }
    }
    let heights = nearest.into_values().filter_map(|(_, place)| ground_before_m(place, site));
    lowest_of(heights.map(|height_m| site.lattice.units(height_m)).collect())
}

/// The lowest of some heights, without the lowest 1 in 20. `None` without heights.
pub(crate) fn lowest_of(mut heights: Vec<i64>) -> Option<i64> {
    heights.sort_unstable();
    heights.get(heights.len() / 20).copied()
}

/// The front of a building: at each metre of chainage, its cell nearest to the axis.
#[derive(Debug, Default)]
struct Fronts(BTreeMap<i64, Front>);

/// A metre of the front of a building.
#[derive(Debug, Clone, Copy)]
struct Front {
    /// Its place in lattice units.
    place: [i64; 2],
    /// Distance of the place from the axis in metres.
    offset_m: f64,
    /// Height of the ground there in metres, extrapolated from the ground before the front. `None` if no
    /// ground is known within 10 m.
    ground_m: Option<f64>,
}

impl Fronts {
    fn new(measures: &Measures, ends: Ends, frames: &Frames, site: &Site<'_>) -> Self {
        let mut cells: BTreeMap<[i64; 2], Vec<([i64; 2], i64)>> = BTreeMap::new();
        for (place, lowest) in plan_cells(measures, ends, frames) {
            cells.entry(site.terrain.middle(place)).or_default().push((place, lowest));
        }
        let mut by_metre: BTreeMap<i64, Vec<FrontCell>> = BTreeMap::new();
        for (&place, within) in &cells {
            let (metre, offset_m) = front_of(place, site);
            let lowest = within.iter().map(|(_, lowest)| *lowest).min().unwrap_or(i64::MAX);
            by_metre.entry(metre).or_default().push(FrontCell { offset_m, place, lowest });
        }
        let front = |(metre, large): (i64, Vec<FrontCell>)| {
            let nearest = nearest_to_axis(&large, site)?.place;
            let cell = |&(place, lowest): &([i64; 2], i64)| FrontCell {
                offset_m: front_of(place, site).1,
                place,
                lowest,
            };
            let within: Vec<FrontCell> = cells[&nearest].iter().map(cell).collect();
            let FrontCell { place, offset_m, .. } = *nearest_to_axis(&within, site)?;
            Some((metre, Front { place, offset_m, ground_m: ground_before_m(nearest, site) }))
        };
        Self(by_metre.into_iter().filter_map(front).collect())
    }

    /// Height of the ground in metres before the front at the chainage of a place in lattice units.
    fn ground_m(&self, place: [i64; 2], site: &Site<'_>) -> Option<f64> {
        if self.0.is_empty() { None } else { self.0.get(&front_of(place, site).0)?.ground_m }
    }

    /// The middle of the front, half way between both ends of the building along the drive: its place in
    /// metres, and the ground there. Its distance from the axis is the median over all metres of the front,
    /// because a porch or an open door may be in the middle. `None` for other objects.
    #[expect(clippy::cast_possible_truncation, reason = "metres of a drive")]
    fn middle(&self, whole: &ObjectPart, site: &Site<'_>) -> Option<([f64; 2], Option<f64>)> {
        let offset_m = upper_median(self.0.values().map(|front| front.offset_m).collect())?;
        let metres = |place: [i64; 2]| place.map(|value| site.lattice.metres(value));
        let along = whole.hull.iter().map(|&place| (site.locate)(metres(place)).chainage_m);
        let [first, last] = [along.clone().fold(f64::MAX, f64::min), along.fold(f64::MIN, f64::max)];
        let chainage_m = f64::midpoint(first, last);
        let mut from = self.0.range((chainage_m / FRONT_M).floor() as i64..);
        let (_, front) = from.next().or_else(|| self.0.last_key_value())?;
        let place = metres(front.place);
        let Some((nearer, onwards)) = ways(place, site) else { return Some((place, front.ground_m)) };
        let here = (site.locate)(place);
        let by = [here.offset_m.abs() - offset_m, chainage_m - here.chainage_m];
        let place = [0, 1].map(|k| place[k] + by[0] * nearer[k] + by[1] * onwards[k]);
        let ground_m = ground_before_m(place.map(|value| site.lattice.units(value)), site);
        Some((place, ground_m.or(front.ground_m)))
    }
}

/// Height of the ground in metres at a front in lattice units, extrapolated from the ground before it.
fn ground_before_m(place: [i64; 2], site: &Site<'_>) -> Option<f64> {
    let [wall, before] =
        [place, before(place, site)].map(|place| place.map(|value| site.lattice.metres(value)));
    site.terrain.before_wall_m(wall, before).or_else(|| site.terrain.surface_m(before))
}

/// A cell of a building: its distance from the axis in metres, its middle and its lowest point in lattice
/// units.
struct FrontCell {
    offset_m: f64,
    place: [i64; 2],
    lowest: i64,
}

/// The cell nearest to the axis among those that reach down to at most [`EAVES_M`] above the lowest point.
fn nearest_to_axis<'a>(cells: &'a [FrontCell], site: &Site<'_>) -> Option<&'a FrontCell> {
    let bottom = cells.iter().map(|cell| cell.lowest).min()?;
    let low = cells.iter().filter(|cell| cell.lowest <= bottom + site.lattice.units(EAVES_M));
    low.min_by(|one, other| one.offset_m.total_cmp(&other.offset_m))
}

/// The cells of the plan of an object: the middle and the lowest point of each, in lattice units. Detached
/// points below the object do not count.
fn plan_cells(measures: &Measures, ends: Ends, frames: &Frames) -> impl Iterator<Item = ([i64; 2], i64)> {
    let middle = |axis, index| frames.plan.doubled_middle(measures.plan.level, axis, index).div_euclid(2);
    let lowest = move |heights: &Heights| heights.lowest.max(ends.bottom);
    let voxels = measures.plan.voxels.iter();
    voxels.map(move |([i, j, _], heights)| ([middle(0, *i), middle(1, *j)], lowest(heights)))
}

/// Number of the front at the chainage of a place in lattice units, and distance of the place from the axis
/// in metres.
#[expect(clippy::cast_possible_truncation, reason = "metres of a drive")]
fn front_of(place: [i64; 2], site: &Site<'_>) -> (i64, f64) {
    let station = (site.locate)(place.map(|value| site.lattice.metres(value)));
    ((station.chainage_m / FRONT_M).floor() as i64, station.offset_m.abs())
}

/// The place 1 m nearer to the axis of the drive, in lattice units.
fn before(place: [i64; 2], site: &Site<'_>) -> [i64; 2] {
    let Some((nearer, _)) = ways(place.map(|value| site.lattice.metres(value)), site) else { return place };
    [0, 1].map(|k| place[k] + site.lattice.units(nearer[k] * BEFORE_FRONT_M))
}

/// The directions at a place in metres: towards the axis of the drive, and onwards along it. Both are unit
/// vectors. `None` on the axis.
fn ways(place: [f64; 2], site: &Site<'_>) -> Option<([f64; 2], [f64; 2])> {
    let at = |x: f64, y: f64| (site.locate)([place[0] + x, place[1] + y]);
    let [here, east, north] = [at(0.0, 0.0), at(WAY_M, 0.0), at(0.0, WAY_M)];
    let unit = |way: [f64; 2]| {
        let length = way[0].hypot(way[1]);
        (length >= WAY_M / 2.0).then(|| way.map(|part| part / length))
    };
    let nearer = unit([east, north].map(|there| here.offset_m.abs() - there.offset_m.abs()))?;
    let onwards = unit([east, north].map(|there| there.chainage_m - here.chainage_m))?;
    Some((nearer, onwards))
}

/// The candidate places of a tree with this lowest part.
fn tree_foot(
    whole: &ObjectPart,
    measures: &Measures,
    frames: &Frames,
    part: &LowestPart,
    stem: &Stem,
    lattice: Lattice,
) -> TreeFoot {
    let edge = frames.plan.edge_at(measures.plan.level);
    let per_cell = (lattice.units(CROWN_CELL_M) / edge).max(1);
    let keys = measures.plan.voxels.iter();
    let cells: BTreeSet<[i64; 2]> =
        keys.map(|([i, j, _], _)| [i, j].map(|&index| i64::from(index) / per_cell)).collect();
    let middle = [0, 1].map(|k| {
        let sum: i64 = cells.iter().map(|cell| 2 * cell[k] + 1).sum();
        let from_corner = lattice.metres(per_cell * edge) / 2.0 * sum as f64 / cells.len() as f64;
        lattice.metres(frames.plan.corner[k]) + from_corner
    });
    let extent = [0, 1].map(|k| lattice.metres(whole.hi[k] - whole.lo[k]));
    let of_stem = [0, 1].map(|k| part.middle[k] - lattice.metres(frames.stem.corner[k]));
    TreeFoot {
        middle,
        radius_m: f64::midpoint(extent[0], extent[1]) / 2.0,
        lowest: part.middle,
        width_m: part.width_m,
        layers: stem.layers_at(of_stem),
    }
}

/// The place in the box of an object that is the nearest to a place. Metres. The middle of a cell lies beside
/// the only point in it.
fn in_box(place: [f64; 2], whole: &ObjectPart, lattice: Lattice) -> [f64; 2] {
    [0, 1].map(|k| place[k].max(lattice.metres(whole.lo[k])).min(lattice.metres(whole.hi[k])))
}

/// The middle of the extents of an object in x and y, in metres.
fn middle_of_extents(whole: &ObjectPart, lattice: Lattice) -> [f64; 2] {
    [0, 1].map(|k| lattice.metres(whole.lo[k] + whole.hi[k]) / 2.0)
}

/// Whether a tree is so low that no stem is seen.
fn is_low(whole: &ObjectPart, ends: Ends) -> bool {
    let [x, y] = [0, 1].map(|k| (whole.hi[k] - whole.lo[k]) as f64);
    ((ends.top - ends.bottom) as f64) < LOW_TREE * f64::midpoint(x, y)
}

/// The lowest part of an object, in metres. All its cells have the same weight.
struct LowestPart {
    middle: [f64; 2],
    /// Its larger extent in x and y.
    width_m: f64,
    cells: Vec<PlanCell>,
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

/// The lowest part of an object. `ground_m` gives the height of the ground at a place in lattice units; it
/// must be the same for all places in a cell of the terrain. `None` without cells.
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
    // A plan cell keeps only its lowest point, so the object above a detached point is unknown there. If
    // every cell has a detached point, the object begins at its bottom in each of them.
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
    Some(LowestPart { middle: [mean(0), mean(1)], width_m, cells: part })
}

impl LowestPart {
    /// Height of most of the part over the ground where the object stands, `ground_m`, if it is far below;
    /// else 0. Metres. Cells over other ground do not count: below a balcony, the model can be the balcony.
    fn below_m(&self, ground_m: f64) -> f64 {
        let below = self.cells.iter().filter_map(|cell| match cell.ground_m {
            Some(own_m) => ((own_m - ground_m).abs() <= SAME_GROUND_M).then_some(cell.over_m.min(0.0)),
            None => Some(0.0),
        });
        upper_median(below.collect()).filter(|below| *below < -BELOW_GROUND_M).unwrap_or(0.0)
    }
}

/// The upper median; `None` without values.
fn upper_median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

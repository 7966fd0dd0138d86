//! The axis of a stem or a pole, and its section at a height.
//!
//! The stem stands where the object is occupied at the most heights. In a tree, leaves or a sign in the crown
//! may be occupied at nearly as many heights. So of all such places, the stem is the one with the most bare
//! layers and circles. A straight line is fitted there by iterated weighted least squares with Tukey's
//! biweight (Beaton and Tukey, Technometrics 16, 147-185, 1974, doi:10.2307/1267936) of the horizontal
//! distances. Every height has the same weight.
//!
//! For a pole, the fit is then repeated with only the heights at which nothing is beside it, so that signs
//! and arms do not bias it. Its direction is the median of the slopes between heights (Theil, 1950; Sen,
//! 1968, doi:10.1080/01621459.1968.10480934). For a tree, the direction comes from the circles in slices,
//! which leaves do not bias. Circles also correct for the side that was not seen.
//! `benches/results/attributes.md` has the errors.
//!
//! Places are metres from the corner of the frame of the sketch, so that all numbers are small.

use std::collections::{BTreeMap, BTreeSet};

use super::circle::{self, Circle, length};
use super::sketch::{Sketch, Sums};
use super::stem_axis::{StemAxis, line, median, steady_line};
use crate::model::Lattice;

/// Edge of the cells in which occupied heights are counted, and height of a layer, in metres.
const CELL_M: f64 = 0.1;
/// Number of layers above the lowest point in which occupied heights are counted. Higher up, a crown occupies
/// more heights than its stem.
const VOTING_LAYERS: i64 = 30;
/// Smallest number of occupied heights of a place that may be the stem of a tree, as a share of the largest
/// number (chosen: a stem still has this share if a branch or a car hides some heights).
const NEARLY_AS_TALL: f64 = 0.8;
/// Smallest distance between two such places, in cells along one axis.
const OTHER_STEM_CELLS: i64 = 5;
/// Distance between the feet of two axes below which they belong to the same stem, in metres.
const SAME_STEM_M: f64 = 0.4;
/// Cut-off of the biweight in metres, by round. The first is wide enough for a stem that leans by 4 degrees.
const CUT_OFFS_M: [f64; 10] = [0.5, 0.45, 0.4, 0.35, 0.3, 0.25, 0.25, 0.25, 0.25, 0.25];
/// Half the height of a slice in metres.
pub(crate) const HALF_SLICE_M: f64 = 0.1;
/// Distance between slices in metres, up to [`SLICES_TO_M`].
const SLICE_STEP_M: f64 = 0.25;
/// Highest slice over the lowest point in metres.
const SLICES_TO_M: f64 = 3.5;
/// Radius of a slice around the axis, in metres.
const SLICE_REACH_M: f64 = 0.6;
/// Largest distance of the axis outside a circle on it, in metres. A circle farther away belongs to something
/// else.
const OFF_AXIS_M: f64 = 0.1;
/// Smallest part of a circle that must have been seen, in degrees.
pub(crate) const LEAST_SEEN_DEG: f64 = 60.0;
/// Largest standard error of the radius of a circle that gives a place on the axis, in metres.
const LARGEST_ERROR_M: f64 = 0.02;
/// Largest standard error of the radius of a circle that is the section of a stem, in metres.
const SECTION_ERROR_M: f64 = 0.01;
/// Largest difference of the radius of a circle from the median radius along a stem, as a share of the
/// median.
const ONE_STEM: f64 = 0.25;
/// Largest distance of the points of a pole from its axis, in metres: its radius, and the shift of the axis
/// because only one side was seen.
const OF_POLE_M: f64 = 0.13;
/// Smallest share of the points within the radius of a slice that belong to the pole, in a layer of the bare
/// pole.
const BARE_SHARE: f64 = 0.75;
/// Largest distance of the points of a stem from the axis of its tree, in metres.
const OF_STEM_M: f64 = 0.25;
/// Smallest share of the points within the radius of a slice that are near the axis, in a bare layer of a
/// stem. With evenly spread leaves, the share is a sixth.
const STEM_SHARE: f64 = 0.6;
/// Smallest number of bare layers and circles of a stem, so that dense leaves are not taken for a stem.
/// Measured on a tree of `synth suburb` of which only the crown was seen: its leaves have 2 to 5.
const STEM_SEEN: usize = 6;
/// Smallest number of points of a bare layer.
const BARE_POINTS: usize = 3;
/// Smallest number of bare layers for the direction of a pole.
const BARE_LAYERS: usize = 8;
/// Smallest distance between the two layers of a pair, as a share of the height. Slopes between nearer layers
/// are mostly noise.
const BARE_APART: f64 = 1.0 / 3.0;
/// Rounds of choosing bare layers and fitting a line through them.
const BARE_ROUNDS: usize = 2;
/// Heights of the circles with which a section of a stem is compared, relative to the section, in metres.
const NEIGHBOURS_M: [f64; 4] = [-0.4, -0.2, 0.2, 0.4];
/// Smallest number of circles with which a section is compared.
const LEAST_NEIGHBOURS: usize = 2;
/// Largest difference between the radius of a section and the median radius of the circles above and below
/// it: a share of the radius, plus a length in metres. A section that differs more is a fork or a twig.
const SAME_RADIUS: (f64, f64) = (0.15, 0.01);
/// Smallest number of circles for a line through their centres.
const LEAST_CIRCLES: usize = 4;
/// Largest distance of the median centre of the circles from the fitted axis, in metres. The axis runs
/// through the mean of the side that was seen, which is about two thirds of a radius from the centre: this is
/// the distance for a radius of 0.45 m.
const LARGEST_SHIFT_M: f64 = 0.3;
/// Number of layers above the lowest point of an object that are checked for its lowest part: one metre.
const LOWEST_LAYERS: i64 = 10;
/// Largest distance of the points of the lowest part of an object from its middle, in metres.
const OF_LOWEST_M: f64 = 0.3;
/// Length of the shortest axis whose direction is known, in metres.
const SHORTEST_M: f64 = 1.0;

/// The points of a stem or a pole: means of voxels.
#[derive(Debug)]
pub(crate) struct Stem {
    places: Vec<[f64; 3]>,
    /// Numbers of the places in ascending height, so that a slice is a range of them.
    by_height: Vec<usize>,
    is_tree: bool,
}

/// The axis of a tree through the circles in its slices. With too few circles it has no direction, because
/// leaves and branches bias the means of layers.
fn through_circles(axis: StemAxis, centres: &[[f64; 3]]) -> StemAxis {
    let through = steady_line(centres, 0.0).filter(|line| line.to - line.from >= SHORTEST_M);
    match through.filter(|_| centres.len() >= LEAST_CIRCLES) {
        Some(through) => StemAxis { from: axis.from, to: axis.to, ..through },
        None => StemAxis { has_direction: false, ..shifted(axis, centres) },
    }
}

/// Distance between two places in the plane, if it is less than `most`. Most places of a crown are farther
/// away, and a distance costs more than two comparisons.
fn away_within(most: f64, place: [f64; 2], other: [f64; 2]) -> Option<f64> {
    let apart = [0, 1].map(|k| place[k] - other[k]);
    let near = apart.iter().all(|along| along.abs() < most);
    near.then(|| length(apart)).filter(|away| *away < most)
}

impl Stem {
    /// The stem in a sketch of an object: its points between two heights, in metres from the corner.
    pub(crate) fn new(sketch: &Sketch<Sums>, between: [f64; 2], lattice: Lattice, is_tree: bool) -> Self {
        let place = |sums: &Sums| {
            // Sums are counted from the corner, so that they fit 64 bits and a mean is a small number.
            sums.sum.map(|sum| sum as f64 / sums.points as f64 * lattice.step_m())
        };
        let [bottom, top] = between;
        let whole = |place: &[f64; 3]| (bottom..=top).contains(&place[2]);
        let places: Vec<[f64; 3]> = sketch.voxels.iter().map(|(_, sums)| place(sums)).filter(whole).collect();
        Self::of_places(places, is_tree)
    }

    fn of_places(places: Vec<[f64; 3]>, is_tree: bool) -> Self {
        let mut by_height: Vec<usize> = (0..places.len()).collect();
        by_height.sort_by(|&a, &b| places[a][2].total_cmp(&places[b][2]));
        Self { places, by_height, is_tree }
    }

    /// Number of layers of the lowest metre that have points at a place. The place is in metres from the
    /// corner.
    pub(crate) fn layers_at(&self, at: [f64; 2]) -> usize {
        #[expect(clippy::cast_possible_truncation, reason = "metres of an object in tenths")]
        let index = |value: f64| (value / CELL_M).floor() as i64;
        let Some(lowest) = self.by_height.first().map(|&number| self.places[number][2]) else { return 0 };
        let layers = self.by_height.iter().map(|&number| self.places[number]);
        let layers = layers.take_while(|place| index(place[2] - lowest) < LOWEST_LAYERS);
        let near = layers.filter(|place| away_within(OF_LOWEST_M, [place[0], place[1]], at).is_some());
        near.map(|place| index(place[2] - lowest)).collect::<BTreeSet<_>>().len()
    }

    /// The axis; `None` without points, and for a tree whose stem was hardly seen.
    pub(crate) fn axis(&self) -> Option<StemAxis> {
        let columns = self.tall_columns();
        if !self.is_tree {
            return self.axis_of_pole(self.through(*columns.first()?)?);
        }
        let mut stems: Vec<(usize, StemAxis, Vec<[f64; 3]>)> = Vec::new();
        for axis in columns.into_iter().filter_map(|column| self.through(column)) {
            let foot = axis.at(axis.from);
            let is_same = |(_, other, _): &(usize, StemAxis, Vec<[f64; 3]>)| {
                let at = other.at(axis.from);
                away_within(SAME_STEM_M, at, foot).is_some()
            };
            if stems.iter().any(is_same) {
                continue;
            }
            let bare = self.bare_layers(&axis, OF_STEM_M, STEM_SHARE).len();
            let centres = self.centres(&axis);
            let seen = bare + centres.len();
            if seen >= STEM_SEEN {
                stems.push((seen, axis, centres));
            }
        }
        // Of several with the same number, the first.
        let (_, axis, centres) = stems.into_iter().rev().max_by_key(|(seen, ..)| *seen)?;
        Some(if axis.to - axis.from < SHORTEST_M { axis.upright() } else { through_circles(axis, &centres) })
    }

    /// The line along which the object is occupied. The fit begins with a vertical line through a place.
    fn through(&self, foot: [f64; 2]) -> Option<StemAxis> {
        let mut axis = StemAxis { foot, slope: [0.0; 2], from: 0.0, to: 0.0, has_direction: false };
        for cut_off in CUT_OFFS_M {
            axis = line(&self.layers(&axis, cut_off))?;
        }
        Some(axis)
    }

    /// The axis of a pole. The fit begins with a line along the pole.
    fn axis_of_pole(&self, mut axis: StemAxis) -> Option<StemAxis> {
        if axis.to - axis.from < SHORTEST_M {
            return Some(axis.upright());
        }
        for _ in 0..BARE_ROUNDS {
            let bare = self.bare_layers(&axis, OF_POLE_M, BARE_SHARE);
            let through = steady_line(&bare, BARE_APART).filter(|line| line.to - line.from >= SHORTEST_M);
            if let Some(through) = through.filter(|_| bare.len() >= BARE_LAYERS) {
                axis = StemAxis { from: axis.from, to: axis.to, ..through };
            }
        }
        Some(shifted(axis, &self.centres(&axis)))
    }

    /// Mean places of the points in the tallest columns, which are squares of 3 x 3 cells: the one that is
    /// occupied at the most heights, and for a tree others with nearly as many.
    fn tall_columns(&self) -> Vec<[f64; 2]> {
        #[expect(clippy::cast_possible_truncation, reason = "metres of an object in tenths")]
        let index = |value: f64| (value / CELL_M).floor() as i64;
        let Some(lowest) = self.places.iter().map(|place| index(place[2])).min() else { return Vec::new() };
        let mut layers: BTreeMap<[i64; 2], u32> = BTreeMap::new();
        for place in &self.places {
            let layer = index(place[2]) - lowest;
            if layer < VOTING_LAYERS {
                *layers.entry([index(place[0]), index(place[1])]).or_default() |= 1 << layer;
            }
        }
        let all = |cell: &[i64; 2]| {
            around(*cell).iter().filter_map(|cell| layers.get(cell)).fold(0, |all, layers| all | layers)
        };
        let mut tallest: Vec<(u32, [i64; 2])> =
            layers.keys().map(|cell| (all(cell).count_ones(), *cell)).collect();
        tallest.sort_by_key(|(count, cell)| (std::cmp::Reverse(*count), *cell));
        let most = tallest.first().map_or(0, |(count, _)| *count);
        let least = NEARLY_AS_TALL * f64::from(most);
        let mut chosen: Vec<[i64; 2]> = Vec::new();
        for (_, cell) in tallest.into_iter().take_while(|(count, _)| f64::from(*count) >= least) {
            let is_apart = |other: &[i64; 2]| (0..2).any(|k| (cell[k] - other[k]).abs() >= OTHER_STEM_CELLS);
            if chosen.iter().all(is_apart) {
                chosen.push(cell);
            }
            if !self.is_tree {
                break;
            }
        }
        let mean = |cell: [i64; 2]| {
            let cells = around(cell);
            let near: Vec<&[f64; 3]> = self
                .places
                .iter()
                .filter(|place| index(place[2]) - lowest < VOTING_LAYERS)
                .filter(|place| cells.contains(&[index(place[0]), index(place[1])]))
                .collect();
            [0, 1].map(|k| near.iter().map(|place| place[k]).sum::<f64>() / near.len() as f64)
        };
        chosen.into_iter().map(mean).collect()
    }

    /// The mean place of the points near an axis in every layer, by the biweight of their distances.
    fn layers(&self, axis: &StemAxis, cut_off: f64) -> Vec<[f64; 3]> {
        #[expect(clippy::cast_possible_truncation, reason = "metres of an object in tenths")]
        let layer = |z: f64| (z / CELL_M).floor() as i64;
        let mut near: BTreeMap<i64, Vec<([f64; 3], f64)>> = BTreeMap::new();
        for place in &self.places {
            let Some(away) = away_within(cut_off, [place[0], place[1]], axis.at(place[2])) else { continue };
            let share = away / cut_off;
            near.entry(layer(place[2])).or_default().push((*place, (1.0 - share * share).powi(2)));
        }
        let mut means = Vec::new();
        for places in near.values() {
            let weight: f64 = places.iter().map(|(_, weight)| weight).sum();
            if weight > 0.0 {
                let mean = |k: usize| places.iter().map(|(p, w)| p[k] * w).sum::<f64>() / weight;
                means.push([mean(0), mean(1), mean(2)]);
            }
        }
        means
    }

    /// The mean place of the points within `radius` of an axis in every bare layer. In a bare layer these are
    /// at least `share` of the points within the radius of a slice.
    fn bare_layers(&self, axis: &StemAxis, radius: f64, share: f64) -> Vec<[f64; 3]> {
        #[expect(clippy::cast_possible_truncation, reason = "metres of an object in tenths")]
        let layer = |z: f64| (z / CELL_M).floor() as i64;
        let mut layers: BTreeMap<i64, (usize, Vec<[f64; 3]>)> = BTreeMap::new();
        for place in &self.places {
            let at = axis.at(place[2]);
            let Some(away) = away_within(SLICE_REACH_M, [place[0], place[1]], at) else { continue };
            let (all, near) = layers.entry(layer(place[2])).or_default();
            *all += 1;
            if away < radius {
                near.push(*place);
            }
        }
        let bare = layers
            .into_values()
            .filter(|(all, near)| near.len() >= BARE_POINTS && near.len() as f64 >= share * *all as f64);
        let mean = |places: &[[f64; 3]], k: usize| {
            places.iter().map(|place| place[k]).sum::<f64>() / places.len() as f64
        };
        bare.map(|(_, near)| [0, 1, 2].map(|k| mean(&near, k))).collect()
    }

    /// Centres of the circles in the slices, without circles whose radius differs from the median.
    fn centres(&self, axis: &StemAxis) -> Vec<[f64; 3]> {
        let mut circles = Vec::new();
        let mut z = axis.from + SLICE_STEP_M;
        while z <= (axis.from + SLICES_TO_M).min(axis.to) {
            circles.extend(self.circle(axis, z).map(|circle| (circle, z)));
            z += SLICE_STEP_M;
        }
        let radius = median(&mut circles.iter().map(|(circle, _)| circle.radius).collect::<Vec<_>>());
        circles.retain(|(circle, _)| (circle.radius - radius).abs() <= ONE_STEM * radius);
        circles.into_iter().map(|(circle, z)| [circle.centre[0], circle.centre[1], z]).collect()
    }

    /// The circle in a slice around height `z`, if the circles in the slices above and below have nearly its
    /// radius. The error of its radius is the larger of two estimates: from the residuals, and from the
    /// scatter of the radii along the stem, in which leaves and wrong places of the scanner show as well.
    ///
    /// Measured on 758 trees of 17 drives of `synth`: 72 % of the true radii of profilers are within one
    /// error, and 98 % within three (62 and 95 % with the residuals alone); of spinning heads 67 and 97 % (23
    /// and 60 %).
    pub(crate) fn section(&self, axis: &StemAxis, z: f64) -> Option<Circle> {
        let circle = self.circle(axis, z)?;
        let near = NEIGHBOURS_M.iter().filter_map(|by| Some([self.circle(axis, z + by)?.radius, *by]));
        let near: Vec<[f64; 2]> = near.collect();
        let mut radii: Vec<f64> = near.iter().map(|[radius, _]| *radius).collect();
        let enough = radii.len() >= LEAST_NEIGHBOURS;
        let off = (median(&mut radii) - circle.radius).abs();
        let (share, length_m) = SAME_RADIUS;
        let same = off <= share * circle.radius + length_m;
        let good = enough && same && circle.radius_error <= SECTION_ERROR_M;
        let radius_error = (circle.radius_error * circle.cut_factor).max(scatter(circle.radius, &near));
        good.then_some(Circle { radius_error, ..circle })
    }

    /// The circle in a slice around height `z`, if enough of it was seen and it is on the axis. Points are
    /// moved along the axis to that height.
    fn circle(&self, axis: &StemAxis, z: f64) -> Option<Circle> {
        let at = axis.at(z);
        let above = |number: &usize| self.places[*number][2] - z;
        let from = self.by_height.partition_point(|number| above(number) < -HALF_SLICE_M);
        let within = self.by_height[from..].iter().take_while(|number| above(number) <= HALF_SLICE_M);
        let mut numbers: Vec<usize> = within.copied().collect();
        // The circles that are tried depend on the order of the points.
        numbers.sort_unstable();
        let slice: Vec<[f64; 2]> = numbers
            .into_iter()
            .map(|number| self.places[number])
            .map(|place| [0, 1].map(|k| place[k] - axis.slope[k] * (place[2] - z)))
            .filter(|place| away_within(SLICE_REACH_M, *place, at).is_some())
            .collect();
        let circle = circle::fit(&slice)?;
        let off = length([0, 1].map(|k| circle.centre[k] - at[k]));
        let good = circle.seen_deg >= LEAST_SEEN_DEG
            && circle.radius_error <= LARGEST_ERROR_M
            && off <= circle.radius + OFF_AXIS_M;
        good.then_some(circle)
    }
}

/// Standard deviation of the radius of a section and of those near it (radius, height relative to the
/// section) about a line over the height, so that the taper of a stem does not count. 0 for fewer than three
/// radii.
fn scatter(radius: f64, near: &[[f64; 2]]) -> f64 {
    let mut places = vec![[radius, 0.0, 0.0]];
    places.extend(near.iter().map(|[radius, by]| [*radius, 0.0, *by]));
    let Some(taper) = line(&places).filter(|_| places.len() > 2) else { return 0.0 };
    let squared: f64 = places.iter().map(|place| (place[0] - taper.at(place[2])[0]).powi(2)).sum();
    (squared / (places.len() - 2) as f64).sqrt()
}

/// A cell and the eight around it.
fn around([i, j]: [i64; 2]) -> [[i64; 2]; 9] {
    let mut all = [[0; 2]; 9];
    for (number, cell) in (0..).zip(&mut all) {
        *cell = [i + number / 3 - 1, j + number % 3 - 1];
    }
    all
}

/// The axis, moved by the median distance of the centres of circles from it. The axis stays where it is if
/// there are only a few circles, or if they are far away: they belong to something else.
fn shifted(axis: StemAxis, places: &[[f64; 3]]) -> StemAxis {
    if places.len() < LEAST_CIRCLES {
        return axis;
    }
    let off = [0, 1].map(|k| {
        let mut all: Vec<f64> = places.iter().map(|place| place[k] - axis.at(place[2])[k]).collect();
        median(&mut all)
    });
    if length(off) > LARGEST_SHIFT_M {
        return axis;
    }
    StemAxis { foot: [axis.foot[0] + off[0], axis.foot[1] + off[1]], ..axis }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cylinder that leans: the side towards -x only, 0 to `height` metres.
    fn cylinder(
        foot: [f64; 2],
        slope: [f64; 2],
        radius: f64,
        height: f64,
        from_deg: f64,
        to_deg: f64,
    ) -> Vec<[f64; 3]> {
        let mut places = Vec::new();
        let mut z = 0.01;
        while z < height {
            for k in 0..24 {
                let angle = (from_deg + (to_deg - from_deg) * f64::from(k) / 24.0).to_radians();
                let x = foot[0] + slope[0] * z + radius * angle.cos();
                let y = foot[1] + slope[1] * z + radius * angle.sin();
                places.push([x, y, z]);
            }
            z += 0.02;
        }
        places
    }

    #[test]
    fn a_leaning_pole_seen_from_one_side_has_its_true_axis() {
        // 2 degrees towards the east-north-east, with an arm at 5 m and a plate at the foot.
        let lean = 2.0_f64.to_radians().tan();
        let slope = [lean * 0.8, lean * 0.6];
        let mut places = cylinder([4.0, 7.0], slope, 0.08, 6.0, 100.0, 240.0);
        places.extend((0..100).map(|k| [4.2 + 0.02 * f64::from(k), 7.1, 5.0]));
        places
            .extend((0..400).map(|k| [4.3 + 0.02 * f64::from(k % 20), 6.8 + 0.02 * f64::from(k / 20), 2.0]));
        let stem = Stem::of_places(places, false);
        let axis = stem.axis().unwrap();
        assert!((axis.inclination_deg() - 2.0).abs() < 0.1, "{axis:?} {}", axis.inclination_deg());
        assert!((axis.azimuth_deg() - 53.13).abs() < 4.0, "{}", axis.azimuth_deg());
        let foot = axis.at(0.0);
        assert!((foot[0] - 4.0).hypot(foot[1] - 7.0) < 0.03, "{foot:?}");
        let circle = stem.section(&axis, 1.3).unwrap();
        assert!((circle.radius - 0.08).abs() < 0.005, "{circle:?}");
    }

    #[test]
    fn a_stem_below_a_dense_crown_is_found() {
        let mut places = cylinder([2.0, 2.0], [0.0, 0.0], 0.15, 2.5, 0.0, 180.0);
        // Leaves from 2 m on, 3 m wide.
        places.extend((0..6_000).map(|k| {
            let at = |step: i32, most: i32| f64::from(k * step % most) / f64::from(most);
            [0.5 + 3.0 * at(131, 997), 0.5 + 3.0 * at(223, 991), 2.0 + 1.9 * at(311, 983)]
        }));
        let stem = Stem::of_places(places, true);
        let axis = stem.axis().unwrap();
        let foot = axis.at(0.0);
        assert!((foot[0] - 2.0).hypot(foot[1] - 2.0) < 0.03, "{axis:?}");
        let circle = stem.section(&axis, 1.3).unwrap();
        assert!((circle.radius - 0.15).abs() < 0.003, "{circle:?}");
    }

    #[test]
    fn radii_that_scatter_along_a_stem_are_less_certain() {
        // Its radius is 12 mm larger in every other fifth of a metre, or it is 10 mm smaller per metre.
        let stem = |radius: fn(f64) -> f64| {
            let mut places = cylinder([2.0, 2.0], [0.0, 0.0], 1.0, 3.0, 0.0, 180.0);
            for place in &mut places {
                let by = radius(place[2]);
                *place = [2.0 + by * (place[0] - 2.0), 2.0 + by * (place[1] - 2.0), place[2]];
            }
            let stem = Stem::of_places(places, true);
            let axis = stem.axis().unwrap();
            stem.section(&axis, 1.3).unwrap()
        };
        let rough = stem(|z| if ((z - 0.8) / 0.2).floor().rem_euclid(2.0) < 0.5 { 0.156 } else { 0.144 });
        assert!((0.006..0.009).contains(&rough.radius_error), "{rough:?}");
        let tapered = stem(|z| 0.18 - 0.01 * z);
        assert!(tapered.radius_error < 0.001, "{tapered:?}");
    }

    #[test]
    fn layers_of_the_lowest_metre_are_counted_at_a_place() {
        // A post of 0.45 m, a leaf beside it, a crown above.
        let mut places: Vec<[f64; 3]> = (0..45).map(|k| [1.0, 2.0, 0.005 + 0.01 * f64::from(k)]).collect();
        places.extend([[2.0, 2.0, 0.3], [1.1, 2.0, 0.95], [1.0, 2.0, 1.2]]);
        let stem = Stem::of_places(places, true);
        let layers = [[1.0, 2.0], [2.0, 2.2], [4.0, 2.0]].map(|at| stem.layers_at(at));
        assert_eq!(layers, [6, 1, 0]);
        assert_eq!(Stem::of_places(Vec::new(), true).layers_at([0.0; 2]), 0);
    }

    #[test]
    fn a_board_in_the_crown_is_not_the_stem() {
        let mut places = cylinder([2.0, 2.0], [0.0, 0.0], 0.15, 2.8, 0.0, 180.0);
        // A board that ends higher, 1 m from the stem: a post below a plate of 1.2 m by 2.2 m. Leaves
        // begin at 1.5 m.
        places.extend(cylinder([1.0, 2.1], [0.0, 0.0], 0.04, 1.0, 180.0, 360.0));
        places.extend(
            (0..5_280).map(|k| [0.4 + 0.02 * f64::from(k % 60), 2.1, 1.0 + 0.025 * f64::from(k / 60)]),
        );
        places.extend((0..4_000).map(|k| {
            let at = |step: i32, most: i32| f64::from(k * step % most) / f64::from(most);
            [0.5 + 3.0 * at(131, 997), 0.5 + 3.0 * at(223, 991), 1.5 + 2.4 * at(311, 983)]
        }));
        let foot = Stem::of_places(places, true).axis().unwrap().at(0.0);
        assert!((foot[0] - 2.0).hypot(foot[1] - 2.0) < 0.03, "{foot:?}");
    }

    #[test]
    fn no_points_have_no_axis_and_few_have_no_direction() {
        assert_eq!(Stem::of_places(Vec::new(), true).axis(), None);
        let low = Stem::of_places(vec![[1.0, 2.0, 0.1], [1.1, 2.0, 0.1]], false);
        let axis = low.axis().unwrap();
        assert!(!axis.has_direction && (axis.at(9.0)[0] - 1.05).abs() < 1e-9, "{axis:?}");
    }

    #[test]
    fn azimuths_are_clockwise_from_north() {
        let axis = |slope| StemAxis { foot: [0.0; 2], slope, from: 0.0, to: 5.0, has_direction: true };
        for (slope, azimuth) in
            [([0.0, 1.0], 0.0), ([1.0, 0.0], 90.0), ([0.0, -1.0], 180.0), ([-1.0, 0.0], 270.0)]
        {
            assert!((axis(slope).azimuth_deg() - azimuth).abs() < 1e-9);
            assert!((axis(slope).inclination_deg() - 45.0).abs() < 1e-9);
        }
    }
}

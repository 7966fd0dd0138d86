//! Where the data ends: the last profiles at the ends of the drive and at gaps in it, and the straight
//! borders of what was cut out of a drive.
//!
//! Profiles stand obliquely on the street, so a drive ends in two slanting lines that meet on the axis. The
//! convex hull of its cells, and single strays, lie far outside these lines. At each end, the farthest
//! occupied cell is found on the axis and in strips beside it. The line through these cells follows from the
//! strips on the roadway: behind parked cars and facades nothing was seen, so strips there would put the line
//! too far inside.

use std::collections::BTreeMap;

use crate::model::{Lattice, convex_hull};
use crate::spatial::{Cell, CellGrid, PackedCells, PackedCursor};
use crate::survey::{Axis, AxisSource};

/// Smallest number of points in an occupied cell, or a quarter of the median if that is less. Cells of strays
/// have fewer.
const LEAST_POINTS: u32 = 5;
/// Smallest number of cells with points among an occupied cell and its eight neighbours (chosen: at an edge
/// there are six, at the tip of a narrow street five). Around strays there are fewer.
const LEAST_CELLS: usize = 5;

/// Longest stretch of the axis without occupied cells that is not a gap in the data, in vertices of 1 m
/// (chosen: longer than a lorry that drove in front).
const GAP_VERTICES: usize = 15;
/// Largest gap along the axis beyond which the search for the farthest cell of an end goes on, in metres.
const GAP_M: f64 = 5.0;
/// Distance over which the direction of the axis at an end is found, in vertices of 1 m. An axis found from
/// points wobbles by a metre.
const DIRECTION_VERTICES: usize = 20;
/// Largest distance of the farthest cell from its end, in metres. If the data goes on for longer, this is not
/// an end.
const BEYOND_M: f64 = 40.0;
/// Nearest and farthest offset of the strips that give the line of an end, in metres: the roadway and its
/// sides.
const STRIPS_M: [f64; 2] = [3.0, 15.0];
/// Smallest number of strips with occupied cells from which the slope of a side is found.
const LEAST_STRIPS: usize = 4;
/// Share of the strips that end before the line: in some, nothing was seen up to the end. Measured on three
/// drives of `synth` in three files each, on the objects in the middle file. A comparison with the whole
/// drives shows that the ends of the file shorten 39 of them by more than 0.7 m, many only because one side
/// is hidden. With 0.8, 22 of these are found, and 4 others are called cut; with 0.6, 25 and 12.
const SHARE: f64 = 0.8;
/// Distance inside the line within which a place is at the end, in cells.
const WITHIN_CELLS: f64 = 1.5;
/// Largest distance from an end, along and across the axis, of places that the end applies to, in metres.
const AROUND_M: f64 = 60.0;
/// Largest distance inside the drive at which the last profiles meet an object on the axis, in metres. Beside
/// the axis it is larger by the offset, because profiles stand obliquely; tilted profiles meet the tops of
/// trees even further inside. A spinning head sees 100 m inside in the same time. Measured on `synth` by
/// replaying the rule on tables. With profiles (twelve drives, four cut in time), 532 objects have points of
/// such a time and are cut; with 5, 8 and 10 m, 526, 529 and 532 stay so, the rest in a forest. With spinning
/// heads (three drives cut in time, one with a gap), 121 were cut, 17 of them shortened by more than 0.7 m;
/// with 10 m, 90 and 16. What lies ahead counts at any distance: it has 10 of 14 that were shortened in one.
const INSIDE_M: f64 = 10.0;

/// Smallest length of a straight border of a scene, in metres.
const SHORTEST_M: f64 = 10.0;
/// Smallest share of the length of a straight border with occupied cells beside it. A hull also has edges
/// from corner to corner, beside which the data ends only with the range of the scanner.
const BESIDE_SHARE: f64 = 0.5;

/// Where the data ends.
#[derive(Debug)]
pub(crate) struct Border<'a> {
    ends: Vec<End>,
    edges: Vec<Edge>,
    axis: &'a Axis,
    lattice: Lattice,
    /// Edge of a cell in metres.
    cell_m: f64,
}

/// An end of the drive.
#[derive(Debug)]
struct End {
    /// Vertex of the axis.
    vertex: usize,
    /// Place of the vertex in metres, and the direction of the axis there, pointing out of the data.
    place: [f64; 2],
    out: [f64; 2],
    /// How far the data reaches beyond the vertex on the axis, in metres, and how much further for each metre
    /// to the right and to the left of the axis.
    reach_m: f64,
    slopes: [f64; 2],
}

/// A place where the drive begins, stops or has a gap, in metres, and the direction out of the data there.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stop {
    place: [f64; 2],
    out: [f64; 2],
}

/// A straight border in lattice units, counter-clockwise.
type Edge = [[i64; 2]; 2];

impl<'a> Border<'a> {
    /// The border of these cells.
    pub(crate) fn of(cells: &PackedCells, axis: &'a Axis, grid: CellGrid, lattice: Lattice) -> Self {
        let mut raster = Raster::new(cells, grid, lattice);
        // An axis that was guessed from the points need not be a street.
        let ends = if axis.source == AxisSource::Principal { Vec::new() } else { ends(axis, &mut raster) };
        let edges = edges(cells, &mut raster);
        Self { ends, edges, axis, lattice, cell_m: raster.cell_m }
    }

    /// Whether a place in lattice units is where the data ends.
    pub(crate) fn is_near(&self, place: [i64; 2]) -> bool {
        let within = self.cell_m / self.lattice.step_m();
        let metres = place.map(|value| self.lattice.metres(value));
        self.edges.iter().any(|edge| {
            let [inside, before, behind] = beside(*edge, place);
            inside <= within && before >= -within && behind >= -within
        }) || self.ends.iter().any(|end| self.is_at(end, metres))
    }

    /// The place in metres as one where the drive begins, stops or has a gap; `None` if it does not around
    /// the place. At a gap, the nearest end gives the direction.
    pub(crate) fn stop_at(&self, place: [f64; 2]) -> Option<Stop> {
        let apart = |end: &End| (place[0] - end.place[0]).hypot(place[1] - end.place[1]);
        let ends = self.ends.iter().filter(|end| apart(end) <= BEYOND_M);
        let nearest = ends.min_by(|one, other| apart(one).total_cmp(&apart(other)))?;
        Some(Stop { place, out: nearest.out })
    }

    /// Whether an object with this hull, in lattice units, reaches to where the last profiles at a stop may
    /// be. The points that it was seen at last are not enough: a spinning head sees an object that it passed
    /// long before until the drive ends.
    pub(crate) fn reaches(&self, hull: &[[i64; 2]], stop: &Stop) -> bool {
        // What is farthest out between these slanting lines is a vertex of the hull.
        hull.iter().any(|vertex| {
            let [along, across] =
                position(stop.place, stop.out, vertex.map(|value| self.lattice.metres(value)));
            along >= -(across.abs() + INSIDE_M)
        })
    }

    fn is_at(&self, end: &End, place: [f64; 2]) -> bool {
        let [along, across] = end.position(place);
        let slope = end.slopes[usize::from(across > 0.0)];
        across.abs() <= AROUND_M
            && along.abs() <= AROUND_M
            && along >= end.reach_m + slope * across.abs() - WITHIN_CELLS * self.cell_m
            // Another street is not at the end of this one.
            && self.axis.nearest(place).abs_diff(end.vertex) as f64 <= AROUND_M
    }
}

impl End {
    /// Distance of a place along the axis, beyond the end, and across it to the left, in metres.
    fn position(&self, place: [f64; 2]) -> [f64; 2] {
        position(self.place, self.out, place)
    }

    /// The place at a position, in metres.
    fn at(&self, along: f64, across: f64) -> [f64; 2] {
        let [ux, uy] = self.out;
        [self.place[0] + along * ux - across * uy, self.place[1] + along * uy + across * ux]
    }
}

/// Distance of a place from an origin along a direction, and across it to the left, in metres.
fn position(origin: [f64; 2], out: [f64; 2], place: [f64; 2]) -> [f64; 2] {
    let [x, y] = [0, 1].map(|k| place[k] - origin[k]);
    [x * out[0] + y * out[1], y * out[0] - x * out[1]]
}

/// The occupied cells.
struct Raster<'a> {
    cells: PackedCursor<'a>,
    least: u32,
    cell_m: f64,
    grid: CellGrid,
    lattice: Lattice,
}

impl<'a> Raster<'a> {
    fn new(cells: &'a PackedCells, grid: CellGrid, lattice: Lattice) -> Self {
        // Number of cells by their number of points. The last entry counts all cells with more.
        let mut counts = [0_usize; 4 * LEAST_POINTS as usize + 1];
        for (_, points) in cells.iter() {
            counts[(points as usize).min(counts.len() - 1)] += 1;
        }
        let mut below = 0;
        let median = counts.iter().position(|cells_with| {
            below += cells_with;
            2 * below >= cells.len()
        });
        let least = u32::try_from(median.unwrap_or(0) / 4).unwrap_or(LEAST_POINTS).clamp(1, LEAST_POINTS);
        Self { cells: cells.cursor(), least, cell_m: lattice.metres(grid.edge()), grid, lattice }
    }

    fn is_occupied(&mut self, [i, j]: Cell) -> bool {
        if self.cells.get([i, j]) < self.least {
            return false;
        }
        let around = (-1..=1).flat_map(|di| (-1..=1).map(move |dj| [i + di, j + dj]));
        around.filter(|cell| self.cells.get(*cell) > 0).count() >= LEAST_CELLS
    }

    /// Whether the cell of a place in metres is occupied.
    fn is_occupied_at(&mut self, place: [f64; 2]) -> bool {
        let [x, y] = place.map(|value| self.lattice.units(value));
        self.grid.cell(x, y).is_some_and(|cell| self.is_occupied(cell))
    }
}

/// The ends of the stretches of the axis that have data.
fn ends(axis: &Axis, raster: &mut Raster<'_>) -> Vec<End> {
    let mut ends = Vec::new();
    let mut first = 0;
    for stretch in axis.stretches() {
        let occupied = (0..stretch.len()).filter(|&k| raster.is_occupied_at(stretch[k]));
        let occupied: Vec<usize> = occupied.collect();
        for run in occupied.chunk_by(|one, next| next - one <= GAP_VERTICES) {
            let (begin, stop) = (run[0], run[run.len() - 1]);
            if stop - begin < DIRECTION_VERTICES {
                continue;
            }
            for (at, inner) in [(begin, begin + DIRECTION_VERTICES), (stop, stop - DIRECTION_VERTICES)] {
                let found = end(first + at, stretch[at], stretch[inner], raster);
                // Where another stretch goes on, the data does not end.
                ends.extend(found.filter(|end| {
                    let nearest = axis.nearest(end.at(end.reach_m, 0.0));
                    nearest.abs_diff(first + at) < GAP_VERTICES
                }));
            }
        }
        first += stretch.len();
    }
    ends
}

/// The end at a vertex of the axis; `None` if the data goes on.
fn end(vertex: usize, place: [f64; 2], inner: [f64; 2], raster: &mut Raster<'_>) -> Option<End> {
    let way = [0, 1].map(|k| place[k] - inner[k]);
    let length = way[0].hypot(way[1]);
    if length <= 0.0 {
        return None;
    }
    let mut end = End { vertex, place, out: way.map(|value| value / length), reach_m: 0.0, slopes: [0.0; 2] };
    let step_m = raster.cell_m / 2.0;
    let mut along = 0.0;
    while along <= end.reach_m + GAP_M.max(raster.cell_m) {
        // The roadway is wider than a cell.
        if [-1.0, 0.0, 1.0].iter().any(|across| raster.is_occupied_at(end.at(along, *across))) {
            end.reach_m = along;
        }
        if along > BEYOND_M {
            return None;
        }
        along += step_m;
    }
    let slopes = [-1.0, 1.0].map(|side| slope(&end, side, raster));
    end.slopes = slopes;
    Some(end)
}

/// How much further the data reaches for each metre away from the axis, on one side of an end.
fn slope(end: &End, side: f64, raster: &mut Raster<'_>) -> f64 {
    let step_m = raster.cell_m / 2.0;
    let mut slopes = Vec::new();
    let mut away = STRIPS_M[0];
    while away <= STRIPS_M[1] {
        let mut along = end.reach_m + BEYOND_M;
        while along > end.reach_m - BEYOND_M && !raster.is_occupied_at(end.at(along, side * away)) {
            along -= step_m;
        }
        if along > end.reach_m - BEYOND_M {
            slopes.push((along - end.reach_m) / away);
        }
        away += raster.cell_m;
    }
    if slopes.len() < LEAST_STRIPS {
        return 0.0;
    }
    slopes.sort_unstable_by(f64::total_cmp);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a part of a length")]
    let number = (SHARE * (slopes.len() - 1) as f64) as usize;
    slopes[number]
}

/// The edges of the convex hull of the occupied cells that are borders.
fn edges(cells: &PackedCells, raster: &mut Raster<'_>) -> Vec<Edge> {
    // Lowest and highest cell of each column: the others are not on the hull.
    let mut columns: BTreeMap<i32, (i32, i32)> = BTreeMap::new();
    for ([i, j], _) in cells.iter().filter(|(cell, _)| raster.is_occupied(*cell)) {
        let ends = columns.entry(i).or_insert((j, j));
        *ends = (ends.0.min(j), ends.1.max(j));
    }
    let edge = raster.grid.edge();
    let corners = |(i, (low, high)): (i32, (i32, i32))| {
        let [left, bottom, top] = [i, low, high].map(|index| i64::from(index) * edge);
        [[left, bottom], [left + edge, bottom], [left, top + edge], [left + edge, top + edge]]
    };
    let mut places: Vec<[i64; 2]> = columns.into_iter().flat_map(corners).collect();
    let hull = without_steps(convex_hull(&mut places), edge as f64);
    let pairs = (0..hull.len()).map(|k| [hull[k], hull[(k + 1) % hull.len()]]);
    pairs.filter(|edge| is_border(*edge, raster)).collect()
}

/// A hull without the vertices that lie at most `within` outside the line between their neighbours. The hull
/// around the cells of a slanting border has many short edges.
fn without_steps(mut hull: Vec<[i64; 2]>, within: f64) -> Vec<[i64; 2]> {
    while hull.len() > 3 {
        let count = hull.len();
        let outside = |k: usize| -beside([hull[(k + count - 1) % count], hull[(k + 1) % count]], hull[k])[0];
        let least = (0..count).min_by(|one, other| outside(*one).total_cmp(&outside(*other)));
        match least.filter(|least| outside(*least) <= within) {
            Some(least) => _ = hull.remove(least),
            None => break,
        }
    }
    hull
}

/// Whether an edge of the hull is long and has occupied cells beside it.
fn is_border([from, to]: Edge, raster: &mut Raster<'_>) -> bool {
    let way = [0, 1].map(|k| (to[k] - from[k]) as f64);
    let length = way[0].hypot(way[1]);
    let step = raster.grid.edge() as f64;
    if length < raster.lattice.units(SHORTEST_M) as f64 {
        return false;
    }
    // Places a cell apart along it, half a cell inside.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "cells of a drive")]
    let steps = (length / step) as usize;
    let inside = [-way[1], way[0]].map(|value| value / length * step / 2.0);
    let is_filled = |number: &usize| {
        let share = (*number as f64 + 0.5) / steps as f64;
        [1.0, 3.0].iter().any(|depth| {
            let place = [0, 1].map(|k| {
                raster.lattice.metres(from[k])
                    + raster.lattice.step_m() * (share * way[k] + depth * inside[k])
            });
            raster.is_occupied_at(place)
        })
    };
    let filled = (0..steps).filter(is_filled).count();
    filled as f64 >= BESIDE_SHARE * steps as f64
}

/// Three distances in lattice units: of a place inside an edge, from the start of the edge along it, and from
/// there to the end of the edge.
fn beside([from, to]: Edge, place: [i64; 2]) -> [f64; 3] {
    let along = [0, 1].map(|k| (to[k] - from[k]) as f64);
    let arm = [0, 1].map(|k| (place[k] - from[k]) as f64);
    let length = along[0].hypot(along[1]);
    let inside = (along[0] * arm[1] - along[1] * arm[0]) / length;
    let before = (along[0] * arm[0] + along[1] * arm[1]) / length;
    [inside, before, length - before]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spatial::CellMap;

    fn axis(source: AxisSource, from: f64, to: f64) -> Axis {
        Axis::from_positions(source, &[[from, 0.5], [to, 0.5]]).unwrap()
    }

    fn packed(cells: impl Iterator<Item = Cell>) -> PackedCells {
        let mut map = CellMap::default();
        cells.for_each(|cell| *map.entry(cell) = 40);
        PackedCells::from(map)
    }

    fn near(border: &Border<'_>, x: i64, y: i64) -> bool {
        border.is_near([1_000 * x, 1_000 * y])
    }

    #[test]
    fn a_drive_ends_at_its_last_profiles_whatever_strays_lie_behind() {
        // Profiles at 45 degrees: beside the axis, the data begins earlier and ends later. Beyond 15 m, only
        // objects were seen. The axis is shorter than the data, and strays lie all around.
        let street = (0..2_400).flat_map(|k| (-40..=40).map(move |j: i32| [k / 10 - 40, j]));
        let is_seen = |[i, j]: &Cell| {
            let slant = j.abs().min(15);
            (-slant..=150 + slant).contains(i) && (j.abs() <= 15 || i.rem_euclid(40) < 12)
        };
        let strays =
            (-10..30).map(|k: i32| [10 * k, 90 + k % 7]).chain((0..12).map(|k| [170 + 5 * k, 3 * k]));
        let cells = packed(street.filter(is_seen).chain(strays));
        let axis = axis(AxisSource::Trajectory, 4.0, 147.0);
        let border = Border::of(&cells, &axis, CellGrid::new(1_000), Lattice::MILLIMETRE);
        assert_eq!(border.ends.len(), 2, "{border:?}");
        for (x, y, expected) in [
            (151, 0, true),
            (146, 0, false),
            (-1, 1, true),
            (5, 0, false),
            (160, 10, true),
            (155, 10, false),
            (-10, -10, true),
            (-4, -10, false),
            (75, 15, false),
            (75, -40, false),
        ] {
            assert_eq!(near(&border, x, y), expected, "{x} {y}: {border:?}");
        }
    }

    #[test]
    fn a_file_that_is_left_out_is_an_end_on_both_sides_and_an_axis_without_data_is_none() {
        let cells =
            packed((0..300).filter(|i| !(100..160).contains(i)).flat_map(|i| (-9..=9).map(move |j| [i, j])));
        let axis = axis(AxisSource::Trajectory, -80.0, 400.0);
        let border = Border::of(&cells, &axis, CellGrid::new(1_000), Lattice::MILLIMETRE);
        let found: Vec<bool> = [0, 50, 99, 161, 220, 299].map(|x| near(&border, x, 3)).to_vec();
        assert_eq!(found, [true, false, true, true, false, true], "{border:?}");
    }

    #[test]
    fn an_object_that_stands_inside_the_last_profiles_does_not_reach_a_stop() {
        let cells =
            packed((0..300).filter(|i| !(100..130).contains(i)).flat_map(|i| (-9..=9).map(move |j| [i, j])));
        let axis = axis(AxisSource::Trajectory, 0.0, 300.0);
        let border = Border::of(&cells, &axis, CellGrid::new(1_000), Lattice::MILLIMETRE);
        let reaches = |place: [f64; 2], x: i64, y: i64| {
            let hull = [[0, 0], [1_000, 0], [0, 1_000]].map(|[dx, dy]| [1_000 * x + dx, 1_000 * y + dy]);
            border.reaches(&hull, &border.stop_at(place).unwrap())
        };
        // 20 m before the end at offset 15 m; far ahead of it; 30 m before it on the roadway.
        let end = [298.0, 0.5];
        let found = [(278, 15), (380, 40), (268, 3), (278, -16)].map(|(x, y)| reaches(end, x, y));
        assert_eq!(found, [true, true, false, true], "{border:?}");
        // The gap is 30 m long, so both its ends are around each of its sides.
        let found = [([98.0, 0.5], 70), ([98.0, 0.5], 115), ([132.0, 0.5], 160), ([132.0, 0.5], 115)];
        assert_eq!(found.map(|(stop, x)| reaches(stop, x, 3)), [false, true, false, true], "{border:?}");
        assert!(border.stop_at([200.0, 0.5]).is_none());
    }

    #[test]
    fn a_slanting_border_is_one_although_its_cells_are_steps() {
        // A parabola that rises by 4 m over 30 m.
        let cells = packed((0..30).flat_map(|i| (0..30).map(move |j| [i, j + i * i / 200])));
        let axis = axis(AxisSource::Principal, 0.0, 60.0);
        let border = Border::of(&cells, &axis, CellGrid::new(1_000), Lattice::MILLIMETRE);
        let found = [(22, 2), (22, 5), (7, 0)].map(|(x, y)| near(&border, x, y));
        assert_eq!(found, [true, false, true], "{border:?}");
    }

    #[test]
    fn a_scene_that_was_cut_out_ends_at_its_straight_borders() {
        // 60 m by 40 m, with strays around it. On one side, half of the last metre was not seen; on another,
        // most of the last 6 m.
        let is_seen = |[i, j]: &Cell| (*j < 39 || i % 4 < 2) && (*i < 54 || *j < 10);
        let scene = (0..60).flat_map(|i| (0..40).map(move |j| [i, j])).filter(is_seen);
        let cells = packed(scene.chain((0..9).map(|k| [80 + 3 * k, 50 - 7 * k])));
        let axis = axis(AxisSource::Principal, 0.0, 60.0);
        let border = Border::of(&cells, &axis, CellGrid::new(1_000), Lattice::MILLIMETRE);
        for (x, y, expected) in
            [(30, 39, true), (30, 36, false), (1, 20, true), (3, 20, false), (30, 1, true), (53, 25, false)]
        {
            assert_eq!(near(&border, x, y), expected, "{x} {y}: {border:?}");
        }
    }
}

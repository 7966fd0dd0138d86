//! Vehicles side by side: the lane of each column of voxels of a component.
//!
//! Noise and ghosts join a moving vehicle to the parked cars beside it. They are thin. A body is what remains
//! without the columns that have empty columns around them. Bodies that follow each other are one lane. Every
//! other column belongs to the nearest body.

use std::collections::{BTreeMap, BTreeSet};

use crate::cluster::street::cores::footprint::centre;
use crate::cluster::street::settings::EDGE_M;
use crate::cluster::street::spans::{Extent, Spans};
use crate::model::Lattice;
use crate::spatial::Cell;

/// Smallest number of occupied neighbours, of eight, of a column inside a body.
const NEIGHBOURS: usize = 6;
/// Smallest number of columns inside a body: half of a small car.
const BODY: usize = 150;
/// Largest width of the box around bodies that follow each other, in metres: a lorry with its mirrors.
const WIDTH_M: f64 = 2.8;
/// Extra width of the box around a lane, in metres: for each metre of its length, and at most. A box is
/// turned in steps, and a road bends: in a bend of 120 m whose middle is 9 m beside its chord, 4 m of the
/// lane deviate by 1.3 m. In lanes of 3.5 m, cars of 1.8 m are 1.7 m apart.
const BEND: f64 = 0.1;
pub(crate) const ASIDE_M: f64 = 1.5;

/// The columns of each lane, in the order of their first bodies; `None` if there is one lane.
pub(crate) fn of<T: Copy>(columns: &BTreeMap<Cell, T>, lattice: Lattice) -> Option<Vec<BTreeMap<Cell, T>>> {
    let mut lane = bodies(columns);
    let count = follow_each_other(&mut lane, lattice);
    if count < 2 {
        return None;
    }
    spread(columns, &mut lane);
    let mut lanes = vec![BTreeMap::new(); count];
    for (&cell, &column) in columns {
        lanes[lane[&cell]].insert(cell, column);
    }
    Some(lanes)
}

/// Whether the content of a box is in one lane, if a vehicle is at most `width_m` metres wide.
pub(crate) fn is_one(around: Extent, width_m: f64, lattice: Lattice) -> bool {
    #[expect(clippy::cast_possible_truncation, reason = "a part of a length in lattice units")]
    let bend = ((BEND * around.length as f64) as i64).min(lattice.units(ASIDE_M));
    around.width <= lattice.units(width_m) + bend
}

fn around([i, j]: Cell) -> impl Iterator<Item = Cell> {
    let steps = (-1..=1).flat_map(|x| (-1..=1).map(move |y| [x, y]));
    steps.filter(|&step| step != [0, 0]).map(move |[x, y]| [i + x, j + y])
}

/// The number of the body of each column that is inside a body. Bodies are numbered by their first columns.
fn bodies<T>(columns: &BTreeMap<Cell, T>) -> BTreeMap<Cell, usize> {
    let is_inside =
        |&cell: &Cell| around(cell).filter(|near| columns.contains_key(near)).count() >= NEIGHBOURS;
    let mut left: BTreeSet<Cell> = columns.keys().copied().filter(is_inside).collect();
    let mut body = BTreeMap::new();
    let mut count = 0;
    while let Some(first) = left.pop_first() {
        let mut found = vec![first];
        let mut at = 0;
        while let Some(&cell) = found.get(at) {
            found.extend(around(cell).filter(|near| left.remove(near)));
            at += 1;
        }
        if found.len() >= BODY {
            body.extend(found.into_iter().map(|cell| (cell, count)));
            count += 1;
        }
    }
    body
}

/// Replaces the numbers of bodies by numbers of lanes, and returns the number of lanes. The two lanes with
/// the narrowest box around both are joined first; of equal widths, the lanes with the first columns.
fn follow_each_other(body: &mut BTreeMap<Cell, usize>, lattice: Lattice) -> usize {
    let edge = lattice.units(EDGE_M);
    let mut boxes: Vec<Option<Spans>> = Vec::new();
    for (&cell, &number) in &*body {
        let place = Spans::of_place(centre(cell, edge));
        boxes.resize(boxes.len().max(number + 1), None);
        match &mut boxes[number] {
            Some(whole) => whole.merge(&place),
            none => *none = Some(place),
        }
    }
    let mut lane: Vec<usize> = (0..boxes.len()).collect();
    let width = |one: &Spans, other: &Spans| {
        let around = one.union(other).narrowest();
        is_one(around, WIDTH_M, lattice).then_some(around.width)
    };
    loop {
        let pairs = (0..boxes.len()).flat_map(|one| (one + 1..boxes.len()).map(move |other| (one, other)));
        let narrowest = pairs
            .filter_map(|(one, other)| {
                Some((width(boxes[one].as_ref()?, boxes[other].as_ref()?)?, one, other))
            })
            .min();
        let Some((_, one, other)) = narrowest else { break };
        if let (Some(joined), Some(whole)) = (boxes[other].take(), &mut boxes[one]) {
            whole.merge(&joined);
        }
        lane.iter_mut().filter(|lane| **lane == other).for_each(|lane| *lane = one);
    }
    let mut kept: Vec<usize> = lane.clone();
    kept.sort_unstable();
    kept.dedup();
    body.values_mut().for_each(|number| *number = kept.partition_point(|&other| other < lane[*number]));
    kept.len()
}

/// Gives each column without a lane the lane of a neighbour, step by step; of several lanes, the first.
/// Columns that touch no lane get the lane of the nearest column.
fn spread<T>(columns: &BTreeMap<Cell, T>, lane: &mut BTreeMap<Cell, usize>) {
    let mut edge: Vec<Cell> = lane.keys().copied().collect();
    while !edge.is_empty() {
        let mut next: BTreeMap<Cell, usize> = BTreeMap::new();
        for cell in edge {
            let number = lane[&cell];
            for near in around(cell).filter(|near| columns.contains_key(near) && !lane.contains_key(near)) {
                next.entry(near).and_modify(|other| *other = number.min(*other)).or_insert(number);
            }
        }
        edge = next.keys().copied().collect();
        lane.extend(next);
    }
    let apart: Vec<Cell> = columns.keys().copied().filter(|cell| !lane.contains_key(cell)).collect();
    let far = |one: Cell, other: Cell| {
        let [x, y] = [0, 1].map(|axis| i64::from(one[axis]) - i64::from(other[axis]));
        x * x + y * y
    };
    let nearest = |&cell: &Cell| {
        let number = lane.iter().map(|(&other, &number)| (far(cell, other), number)).min()?.1;
        Some((cell, number))
    };
    let found: Vec<(Cell, usize)> = apart.iter().filter_map(nearest).collect();
    lane.extend(found);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The columns of boxes, each from one corner to the other in voxels.
    fn columns(boxes: &[[i32; 4]]) -> BTreeMap<Cell, ()> {
        let of_box =
            |&[x0, y0, x1, y1]: &[i32; 4]| (x0..x1).flat_map(move |i| (y0..y1).map(move |j| ([i, j], ())));
        boxes.iter().flat_map(of_box).collect()
    }

    /// The number of columns of each lane; empty if there is one lane.
    fn sizes(boxes: &[[i32; 4]]) -> Vec<usize> {
        let Some(lanes) = of(&columns(boxes), Lattice::MILLIMETRE) else { return Vec::new() };
        assert_eq!(lanes.iter().map(BTreeMap::len).sum::<usize>(), columns(boxes).len());
        lanes.iter().map(BTreeMap::len).collect()
    }

    #[test]
    fn what_moves_is_apart_from_the_parked_cars_beside_it() {
        let parked = [[0, 20, 28, 32], [31, 20, 60, 32], [63, 20, 90, 32]];
        let trail = [0, 0, 150, 12];
        let bridges = [[14, 12, 15, 20], [70, 12, 72, 20], [28, 26, 31, 27], [60, 26, 63, 27]];
        let all: Vec<[i32; 4]> = parked.into_iter().chain([trail]).chain(bridges).collect();
        let found = sizes(&all);
        assert_eq!(found.len(), 2);
        // Each lane has half of the bridges to the other.
        assert!(found[0].abs_diff(150 * 12) < 30 && found[1].abs_diff(84 * 12) < 30, "{found:?}");
    }

    #[test]
    fn one_lane_stays_as_it_is() {
        assert_eq!(sizes(&[[0, 0, 28, 12], [31, 0, 60, 12], [28, 5, 31, 6]]), [0; 0], "a row");
        assert_eq!(sizes(&[[0, 0, 80, 17]]), [0; 0], "a lorry");
        assert_eq!(sizes(&[[0, 0, 28, 12], [10, 12, 11, 16], [5, 16, 15, 26]]), [0; 0], "a car and a bush");
    }

    #[test]
    fn cars_beside_each_other_in_a_car_park_are_apart() {
        let cars = [[0, 0, 12, 30], [16, 0, 28, 30], [32, 0, 44, 30], [12, 14, 16, 15], [28, 3, 32, 4]];
        assert_eq!(sizes(&cars).len(), 3);
    }

    #[test]
    fn columns_that_touch_nothing_go_to_the_nearest_lane() {
        let found = sizes(&[[0, 0, 60, 12], [0, 20, 60, 32], [63, 22, 65, 24], [63, 3, 64, 4]]);
        assert_eq!(found, [60 * 12 + 1, 60 * 12 + 4]);
    }
}

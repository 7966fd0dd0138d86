//! Objects in front of or behind a fence or hedge that were joined with it: bushes, bins, benches.
//!
//! A fence is a line. Each of its two sides is followed as a running median over some metres, so that the
//! line may bend. A bulge of a side over a short piece of the line is an object of its own. A line that turns
//! off makes a thin bulge, and a long bulge is a parallel line.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::footprint::{self, Columns, Footprint, centre};
use super::part::Part;
use crate::cluster::street::settings::EDGE_M;
use crate::cluster::street::spans::{self, Spans};
use crate::model::Lattice;
use crate::spatial::Cell;

/// Smallest length and width of the box around a component beside whose line an object may stand, in metres.
const LINE_M: f64 = 3.0;
const WIDE_M: f64 = 1.0;
/// Length along the line, before and after a place, over which the medians of the sides are taken, in metres.
const AROUND_M: f64 = 4.0;
/// Smallest distances from the side of the line, in metres: of the outermost column of voxels at each step
/// along an object, of its farthest column, and of any column that belongs to it.
const EACH_M: f64 = 0.3;
const FARTHEST_M: f64 = 0.45;
const BESIDE_M: f64 = 0.15;
/// The farthest column must exceed its limit by this multiple of the side's own (median) variation. Most
/// fences and clipped hedges vary by at most 0.25 m, rows of shrubs by up to 0.8 m.
/// `benches/results/street.md` has the study.
const TIMES_ITSELF: i64 = 3;
/// Shortest and longest piece of the line that an object takes up, in metres, and the longest gap in this
/// piece, in voxels.
const PIECE_M: (f64, f64) = (0.45, 4.0);
const GAP: usize = 2;
/// Smallest ratio of the length of this piece to the distance by which it sticks out. Below it, a line turns
/// off.
const STOUT: f64 = 0.4;
/// Smallest number of voxels of an object.
const VOXELS: u32 = 12;

/// Whether an object may stand beside the line of a component.
pub(crate) fn may_be_beside(spans: &Spans, lattice: Lattice) -> bool {
    let around = spans.narrowest();
    around.length > lattice.units(LINE_M) && around.width > lattice.units(WIDE_M)
}

/// The objects beside the line of a component.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Beside {
    /// The columns of voxels of each object, ascending, and its number from 1.
    columns: Vec<(Cell, u32)>,
    /// The middle of each object, in lattice units.
    places: Vec<[i64; 2]>,
    /// Edge of a column, in lattice units.
    edge: i64,
}

impl Beside {
    /// The objects beside the line of a component with these spans and columns; `None` if there are none.
    pub(crate) fn of(spans: &Spans, footprint: &Footprint, lattice: Lattice) -> Option<Self> {
        if !may_be_beside(spans, lattice) {
            return None;
        }
        let edge = lattice.units(EDGE_M);
        let mut steps = footprint::along(footprint.columns(), spans, edge);
        let mut objects = out_of(&steps, footprint.columns(), lattice);
        // The lower side is the upper one of the mirrored line.
        steps.iter_mut().flatten().for_each(|(position, _)| *position = -*position);
        objects.extend(out_of(&steps, footprint.columns(), lattice));
        if objects.is_empty() {
            return None;
        }
        let middle = |columns: &Vec<Cell>| {
            let count = i64::try_from(columns.len()).unwrap_or(i64::MAX);
            let sum = |axis: usize| columns.iter().map(|&column| centre(column, edge)[axis]).sum::<i64>();
            [sum(0) / count, sum(1) / count]
        };
        let places = objects.iter().map(middle).collect();
        let numbered =
            (1..).zip(&objects).flat_map(|(number, columns)| columns.iter().map(move |&at| (at, number)));
        let mut columns: Vec<(Cell, u32)> = numbered.collect();
        columns.sort_unstable();
        Some(Self { columns, places, edge })
    }

    /// Restricts the figures of a component to its line.
    pub(crate) fn leave_line(&self, part: &mut Part, footprint: &Footprint) {
        let line = footprint.columns().iter().filter(|(column, _)| self.of_column(**column) == 0);
        let figures = |(&column, &(top, count)): (&Cell, &(i32, u32))| {
            let [x, y] = centre(column, self.edge);
            let one = Part::of_voxel(part.class, part.band, part.first, top, [x, y, 0]);
            let times = |value: i64| value * i64::from(count);
            Part { voxels: count, sum: [times(x), times(y)], footprint: None, ..one }
        };
        let merged = line.map(figures).reduce(|mut whole, one| {
            whole.merge(&one);
            whole
        });
        let Some(line) = merged else { return };
        #[expect(clippy::cast_possible_truncation, reason = "at most the figure")]
        let share =
            |figure: u32| (u64::from(figure) * u64::from(line.voxels) / u64::from(part.voxels)) as u32;
        *part = Part {
            height: (part.height.0, line.height.1),
            contact: share(part.contact),
            decided: share(part.decided),
            ..line
        };
    }

    /// Adds the objects beside another line that is united with this one.
    pub(crate) fn merge(&mut self, other: Self) {
        let before = u32::try_from(self.places.len()).unwrap_or(u32::MAX);
        self.columns.extend(other.columns.into_iter().map(|(column, number)| (column, before + number)));
        self.columns.sort_unstable();
        self.columns.dedup_by_key(|column| column.0);
        self.places.extend(other.places);
    }

    /// The middles of the objects beside the line.
    pub(crate) fn places(&self) -> &[[i64; 2]] {
        &self.places
    }

    /// Number of the object at a place, from 1; 0 for the line.
    pub(crate) fn number(&self, place: [i64; 2]) -> usize {
        self.of_column(footprint::column(place, self.edge))
    }

    fn of_column(&self, column: Cell) -> usize {
        let found = self.columns.binary_search_by_key(&column, |&(column, _)| column);
        found.map_or(0, |at| self.columns[at].1 as usize)
    }
}

/// The columns of each object that sticks out of the upper side of a line. `steps` comes from
/// [`footprint::along`].
fn out_of(steps: &[Vec<(i64, Cell)>], columns: &Columns, lattice: Lattice) -> Vec<Vec<Cell>> {
    let units = |metres: f64| lattice.units(metres) * spans::SCALE_UNITS;
    let edge = lattice.units(EDGE_M);
    let around = usize::try_from(lattice.units(AROUND_M) / edge).unwrap_or(0);
    let top: Vec<Option<i64>> =
        steps.iter().map(|step| step.iter().map(|(position, _)| *position).max()).collect();
    let side = |at: usize| {
        let mut near: Vec<i64> = top[at.saturating_sub(around)..(at + around + 1).min(top.len())]
            .iter()
            .flatten()
            .copied()
            .collect();
        near.sort_unstable();
        near.get(near.len() / 2).copied().unwrap_or(0)
    };
    let sides: Vec<i64> = (0..steps.len()).map(side).collect();
    let out = |at: usize| top[at].map_or(0, |top| top - sides[at]);
    let mut pieces: Vec<Range<usize>> = Vec::new();
    for at in (0..steps.len()).filter(|&at| out(at) >= units(EACH_M)) {
        match pieces.last_mut() {
            Some(piece) if at <= piece.end + GAP => piece.end = at + 1,
            _ => pieces.push(at..at + 1),
        }
    }
    let mut varies: Vec<i64> =
        (0..top.len()).filter(|&at| top[at].is_some()).map(|at| out(at).abs()).collect();
    varies.sort_unstable();
    let itself = varies.get(varies.len() / 2).copied().unwrap_or(0);
    let sticks_out = units(FARTHEST_M) + TIMES_ITSELF * itself;
    let object = |piece: Range<usize>| {
        let farthest = piece.clone().map(out).max().unwrap_or(0);
        let length = i64::try_from(piece.len()).unwrap_or(i64::MAX) * edge * spans::SCALE_UNITS;
        let is_stout = length as f64 >= STOUT * farthest as f64;
        if farthest < sticks_out || length < units(PIECE_M.0) || length > units(PIECE_M.1) || !is_stout {
            return None;
        }
        let beside = piece.flat_map(|at| {
            let limit = sides[at] + units(BESIDE_M);
            steps[at].iter().filter(move |(position, _)| *position > limit).map(|(_, column)| *column)
        });
        let beside: Vec<Cell> = beside.collect();
        let voxels: u32 = beside.iter().map(|column| columns[column].1).sum();
        (voxels >= VOXELS).then_some(beside)
    };
    pieces.into_iter().filter_map(object).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::cluster::street::cores::part::NO_BAND;
    use crate::cluster::street::shares::FENCE;

    const LATTICE: Lattice = Lattice::MILLIMETRE;

    /// A component with these columns, each with its height in voxels of 0.15 m.
    fn component(columns: impl IntoIterator<Item = (Cell, u32)>) -> Part {
        let edge = LATTICE.units(EDGE_M);
        let voxel = |(column, level): (Cell, u32)| {
            let [x, y] = centre(column, edge);
            let z = i64::from(level) * edge + edge / 2;
            let level = i32::try_from(level).unwrap();
            Part::of_voxel(
                FENCE,
                NO_BAND,
                [column[0], column[1], level],
                i32::try_from(z).unwrap(),
                [x, y, z],
            )
        };
        let columns: BTreeSet<(Cell, u32)> = columns.into_iter().collect();
        let voxels =
            columns.into_iter().flat_map(|(column, high)| (0..high).map(move |level| (column, level)));
        let merged = voxels.map(voxel).reduce(|mut whole, one| {
            whole.merge(&one);
            whole
        });
        merged.unwrap()
    }

    fn beside(part: &Part) -> Option<Beside> {
        Beside::of(part.spans.as_ref().unwrap(), part.footprint.as_ref().unwrap(), LATTICE)
    }

    /// 15 m of a hedge of 0.45 m, 1.2 m high, along a curve.
    fn hedge(side: impl Fn(i32) -> i32) -> impl Iterator<Item = (Cell, u32)> {
        (0..100).flat_map(move |i| {
            let from = side(i);
            (from..from + 3).map(move |j| ([i, j], 8))
        })
    }

    /// The columns of a bush of 1.3 m around a column, 1.8 m high.
    fn bush([i, j]: Cell) -> impl Iterator<Item = (Cell, u32)> {
        let around = (-4..=4).flat_map(|di: i32| (-4..=4).map(move |dj: i32| (di, dj)));
        around.filter(|(di, dj)| di * di + dj * dj < 20).map(move |(di, dj)| ([i + di, j + dj], 12))
    }

    fn at([i, j]: Cell) -> [i64; 2] {
        centre([i, j], LATTICE.units(EDGE_M))
    }

    #[test]
    fn a_bush_before_a_hedge_is_an_object_and_the_hedge_is_what_it_is_without_it() {
        for bends in [0, 1500, 500] {
            let side = |i: i32| if bends == 0 { 0 } else { i * i / bends };
            let alone = component(hedge(side));
            assert_eq!(beside(&alone), None, "bends {bends}");
            let places = [[30, side(30) + 9], [70, side(70) - 8]];
            let mut part = component(hedge(side).chain(bush(places[0])).chain(bush(places[1])));
            let found = beside(&part).unwrap();
            assert_eq!(found.places().len(), 2);
            let mut numbers = places.map(|place| found.number(at(place)));
            numbers.sort_unstable();
            assert_eq!(numbers, [1, 2]);
            let on_line = (0..100).filter(|&i| found.number(at([i, side(i) + 1])) == 0).count();
            assert_eq!(on_line, 100);
            for place in places {
                let [x, y] = found.places()[found.number(at(place)) - 1];
                let [u, v] = at(place);
                assert!((x - u).abs().max((y - v).abs()) < 200, "{x} {y} {u} {v}");
            }
            let footprint = part.footprint.clone().unwrap();
            found.leave_line(&mut part, &footprint);
            assert!(part.voxels.abs_diff(alone.voxels) < 30, "{} {}", part.voxels, alone.voxels);
            assert_eq!(part.height, alone.height);
            let width = |part: &Part| part.spans.as_ref().unwrap().narrowest().width;
            assert!((width(&part) - width(&alone)).abs() <= 300);
        }
    }

    #[test]
    fn what_turns_off_or_goes_on_beside_a_line_is_a_part_of_it() {
        let turn = (3..20).flat_map(|j| (97..100).map(move |i| ([i, j], 8)));
        assert_eq!(beside(&component(hedge(|_| 0).chain(turn))), None, "a corner");
        let second = (20..60).flat_map(|i| (8..10).map(move |j| ([i, j], 8)));
        assert_eq!(beside(&component(hedge(|_| 0).chain(second))), None, "6 m of a second line");
        assert_eq!(
            beside(&component(hedge(|_| 0).chain([([50, 6], 8), ([51, 6], 3)]))),
            None,
            "a few voxels"
        );
    }

    #[test]
    fn of_a_row_of_shrubs_only_what_sticks_out_far_is_cut() {
        let row = |i: i32| [0, 2, -3, 1, -1, 4, 0, -2][usize::try_from(i / 5 % 8).unwrap()];
        let with = |j: i32| beside(&component(hedge(row).chain(bush([50, j]))));
        assert_eq!(with(4), None);
        assert_eq!(with(13).map(|found| found.places().len()), Some(1));
    }

    #[test]
    fn two_lines_that_are_one_have_the_objects_of_both() {
        let mut first = beside(&component(hedge(|_| 0).chain(bush([30, 8])))).unwrap();
        let second = component(hedge(|_| 0).chain(bush([60, 8]))).footprint.unwrap();
        let moved = second.columns().iter().map(|(&[i, j], &(_, count))| ([i + 200, j], count));
        first.merge(beside(&component(moved)).unwrap());
        assert_eq!([[30, 8], [260, 8], [260, 1]].map(|place| first.number(at(place))), [1, 2, 0]);
        assert_eq!(first.places().len(), 2);
    }
}

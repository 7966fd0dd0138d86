//! A dense raster over the cells of an outline. Gaps are closed, holes filled and parts joined, so that its
//! border is one ring that does not touch itself.

use crate::spatial::NearestIndex;

/// Largest number of parts that are joined by bridges.
const MOST_PARTS: usize = 16;

/// Cells of a rectangle of the plane, with an empty margin around the occupied ones.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Grid {
    width: usize,
    height: usize,
    /// Index of cell (0, 0) in the frame of the object.
    pub(super) first: [i64; 2],
    filled: Vec<bool>,
}

impl Grid {
    /// The grid of these cells with a margin of `margin` cells. `None` if it would have more than `most`
    /// cells, or if there are none.
    pub(super) fn of(cells: &[[u32; 2]], margin: u32, most: usize) -> Option<Self> {
        let ends = |k: usize| {
            let of_axis = || cells.iter().map(|cell| i64::from(cell[k]));
            Some((of_axis().min()? - i64::from(margin), of_axis().max()? + i64::from(margin)))
        };
        let (left, right) = ends(0)?;
        let (bottom, top) = ends(1)?;
        let width = usize::try_from(right - left + 1).ok()?;
        let height = usize::try_from(top - bottom + 1).ok()?;
        let area = width.checked_mul(height).filter(|area| *area <= most)?;
        let mut grid = Self { width, height, first: [left, bottom], filled: vec![false; area] };
        for cell in cells {
            let [i, j] = [i64::from(cell[0]) - left, i64::from(cell[1]) - bottom];
            // Not negative, because `first` is the smallest.
            let at = usize::try_from(i).ok()? * height + usize::try_from(j).ok()?;
            grid.filled[at] = true;
        }
        Some(grid)
    }

    /// Number of filled cells.
    #[cfg(test)]
    fn count(&self) -> usize {
        self.filled.iter().filter(|filled| **filled).count()
    }

    /// Whether a cell is filled. Cells outside are not.
    pub(super) fn is_filled(&self, i: usize, j: usize) -> bool {
        i < self.width && j < self.height && self.filled[i * self.height + j]
    }

    /// Positions of the four neighbours of a position.
    fn beside(&self, at: usize) -> impl Iterator<Item = usize> + use<> {
        let (width, height) = (self.width, self.height);
        let (i, j) = (at / height, at % height);
        let all = [
            (i > 0).then(|| at - height),
            (i + 1 < width).then(|| at + height),
            (j > 0).then(|| at - 1),
            (j + 1 < height).then(|| at + 1),
        ];
        all.into_iter().flatten()
    }

    /// Closes gaps: fills the cells that no disc of radius `reach` cells covers without a filled cell in it
    /// (a morphological closing). The margin is wider than the disc.
    pub(super) fn close(&mut self, reach: u32) {
        let reach = i64::from(reach);
        let all = (-reach..=reach).flat_map(|i| (-reach..=reach).map(move |j| [i, j]));
        // A little larger than the circle through the cell at (reach, 0), so that slanting lines do not
        // become wide.
        let disc: Vec<[i64; 2]> = all.filter(|[i, j]| i * i + j * j <= reach * reach + reach / 2).collect();
        let cells = |grid: &Self, value: bool| -> Vec<usize> {
            grid.filled.iter().enumerate().filter(|(_, filled)| **filled == value).map(|(at, _)| at).collect()
        };
        for at in cells(self, true) {
            self.stamp(at, &disc, true);
        }
        for at in cells(self, false) {
            self.stamp(at, &disc, false);
        }
    }

    /// Gives a value to the cells of a disc around a position.
    fn stamp(&mut self, at: usize, disc: &[[i64; 2]], value: bool) {
        let (i, j) = (at / self.height, at % self.height);
        for [di, dj] in disc {
            let place = |index: usize, by: i64, end: usize| {
                index.checked_add_signed(isize::try_from(by).ok()?).filter(|index| *index < end)
            };
            if let (Some(i), Some(j)) = (place(i, *di, self.width), place(j, *dj, self.height)) {
                self.filled[i * self.height + j] = value;
            }
        }
    }

    /// The parts whose cells are connected by their sides, each with the positions of its cells, ascending.
    fn parts(&self) -> Vec<Vec<usize>> {
        let mut seen = vec![false; self.filled.len()];
        let mut parts = Vec::new();
        for start in 0..self.filled.len() {
            if !self.filled[start] || seen[start] {
                continue;
            }
            let mut part = Vec::new();
            let mut open = vec![start];
            seen[start] = true;
            while let Some(at) = open.pop() {
                part.push(at);
                for next in self.beside(at) {
                    if self.filled[next] && !seen[next] {
                        seen[next] = true;
                        open.push(next);
                    }
                }
            }
            part.sort_unstable();
            parts.push(part);
        }
        parts
    }

    /// Joins the parts by bridges of one cell, each between the nearest cells. `false` if there are too many
    /// of them.
    pub(super) fn join(&mut self) -> bool {
        // Cells that meet at a corner are one part.
        while self.fill_corners() {}
        let mut parts = self.parts();
        if parts.len() > MOST_PARTS {
            return false;
        }
        for part in &mut parts {
            part.retain(|at| self.beside(*at).any(|next| !self.filled[next]));
        }
        let place = |at: usize| [(at / self.height) as f64, (at % self.height) as f64];
        let mut bridges = Vec::new();
        while parts.len() > 1 {
            let places: Vec<[f64; 2]> = parts[0].iter().map(|at| place(*at)).collect();
            let index = NearestIndex::new(&places);
            let mut best: Option<(f64, usize, usize, usize)> = None;
            for (number, part) in parts.iter().enumerate().skip(1) {
                for &from in part {
                    let Some(to) = index.nearest(place(from)) else { continue };
                    let [[a, b], [c, d]] = [place(from), places[to]];
                    let squared = (a - c).powi(2) + (b - d).powi(2);
                    if best.is_none_or(|(least, ..)| squared < least) {
                        best = Some((squared, number, from, parts[0][to]));
                    }
                }
            }
            let Some((_, number, from, to)) = best else { return false };
            let joined = parts.remove(number);
            parts[0].extend(joined);
            parts[0].sort_unstable();
            bridges.push((from, to));
        }
        for (from, to) in bridges {
            self.bridge(from, to);
        }
        true
    }

    /// Fills a line of cells that are connected by their sides.
    fn bridge(&mut self, from: usize, to: usize) {
        let [mut i, mut j] = [from / self.height, from % self.height];
        let [k, l] = [to / self.height, to % self.height];
        let step = |a: usize, b: usize| if b > a { a + 1 } else { a - 1 };
        while [i, j] != [k, l] {
            if i.abs_diff(k) >= j.abs_diff(l) {
                i = step(i, k);
            } else {
                j = step(j, l);
            }
            self.filled[i * self.height + j] = true;
        }
    }

    /// Fills holes, and one cell beside every two filled cells that meet only at a corner, until there are
    /// neither.
    pub(super) fn solidify(&mut self) {
        loop {
            self.fill_holes();
            if !self.fill_corners() {
                return;
            }
        }
    }

    fn fill_holes(&mut self) {
        // The first cell is in the margin.
        let mut outside = vec![false; self.filled.len()];
        let mut open = vec![0];
        outside[0] = true;
        while let Some(at) = open.pop() {
            for next in self.beside(at) {
                if !self.filled[next] && !outside[next] {
                    outside[next] = true;
                    open.push(next);
                }
            }
        }
        for (filled, outside) in self.filled.iter_mut().zip(outside) {
            *filled |= !outside;
        }
    }

    /// Fills a cell at every place where two filled and two empty cells meet crosswise. Returns whether there
    /// was one.
    fn fill_corners(&mut self) -> bool {
        let mut any = false;
        for i in 0..self.width - 1 {
            for j in 0..self.height - 1 {
                let at = i * self.height + j;
                let [a, b, c, d] =
                    [at, at + 1, at + self.height, at + self.height + 1].map(|at| self.filled[at]);
                if a == d && b == c && a != b {
                    self.filled[if a { at + 1 } else { at }] = true;
                    any = true;
                }
            }
        }
        any
    }

    /// The border of a solid part, counter-clockwise: the corners of cells that it passes, one cell apart,
    /// beginning at the lowest of the leftmost corners. A corner has the index of the cell to its upper
    /// right.
    pub(super) fn border(&self) -> Vec<[i64; 2]> {
        let Some(start) = self.filled.iter().position(|filled| *filled) else { return Vec::new() };
        let start = [start / self.height, start % self.height];
        let mut corners = Vec::new();
        let mut at = start;
        let mut heading = 0;
        loop {
            corners.push(at);
            // East, north, west, south; then the cells to the left and right ahead of the new corner.
            at = match heading {
                0 => [at[0] + 1, at[1]],
                1 => [at[0], at[1] + 1],
                2 => [at[0] - 1, at[1]],
                _ => [at[0], at[1] - 1],
            };
            if at == start {
                break;
            }
            // The margin is at least one cell wide, so that no corner has index 0.
            let [i, j] = at;
            let (left, right) = match heading {
                0 => ([i, j], [i, j - 1]),
                1 => ([i - 1, j], [i, j]),
                2 => ([i - 1, j - 1], [i - 1, j]),
                _ => ([i, j - 1], [i - 1, j - 1]),
            };
            let [left, right] = [left, right].map(|[i, j]| self.is_filled(i, j));
            heading = match (left, right) {
                (false, _) => (heading + 1) % 4,
                (true, true) => (heading + 3) % 4,
                (true, false) => heading,
            };
        }
        let of_frame = |(first, index): (i64, usize)| first.saturating_add_unsigned(index as u64);
        let [left, bottom] = self.first;
        corners.into_iter().map(|[i, j]| [(left, i), (bottom, j)].map(of_frame)).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;

    fn grid(cells: &[[u32; 2]]) -> Grid {
        Grid::of(cells, 4, 1 << 20).unwrap()
    }

    #[test]
    fn a_cell_has_four_corners_and_an_l_has_eight_steps() {
        let mut one = grid(&[[5, 7]]);
        one.solidify();
        assert_eq!(one.border(), [[5, 7], [6, 7], [6, 8], [5, 8]]);
        let l = grid(&[[5, 7], [6, 7], [5, 8]]);
        assert_eq!(l.border(), [[5, 7], [6, 7], [7, 7], [7, 8], [6, 8], [6, 9], [5, 9], [5, 8]]);
    }

    #[test]
    fn gaps_and_holes_are_filled_and_bays_are_not() {
        // A square of 9 cells without its middle, closed by 1: full.
        let ring: Vec<[u32; 2]> = (0..81)
            .map(|k| [10 + k / 9, 10 + k % 9])
            .filter(|[i, j]| !(13..16).contains(i) || !(13..16).contains(j))
            .collect();
        let mut holed = grid(&ring);
        holed.solidify();
        assert_eq!(holed.count(), 81);
        // Two columns with a gap of two: closed by 1, up to the ends of the gap.
        let column = |i: u32| (0..9).map(move |j| [i, j]);
        let mut pair = grid(&column(4).chain(column(7)).collect::<Vec<_>>());
        pair.close(1);
        assert_eq!(pair.count(), 2 * 9 + 2 * 7);
        // A bay of five cells stays when 1 is closed.
        let bay: Vec<[u32; 2]> =
            (0..7).map(|k| [0, k]).chain((0..10).flat_map(|k| [[k, 0], [k, 6]])).collect();
        let mut open = grid(&bay);
        open.close(1);
        open.solidify();
        assert!(!open.is_filled(5 + 4, 3 + 4) && open.count() < 40, "{}", open.count());
    }

    proptest! {
        /// For any cells, the border of the joined grid is one ring that passes no corner twice and contains
        /// every cell.
        #[test]
        fn borders_are_simple_and_hold_every_cell(
            cells in prop::collection::btree_set((0..24_u32, 0..24_u32), 1..60),
            reach in 0..3_u32,
        ) {
            let cells: Vec<[u32; 2]> = cells.into_iter().map(|(i, j)| [i, j]).collect();
            let mut grid = grid(&cells);
            grid.close(reach);
            if !grid.join() {
                prop_assert!(grid.parts().len() > MOST_PARTS);
                return Ok(());
            }
            grid.solidify();
            prop_assert_eq!(grid.parts().len(), 1);
            let border = grid.border();
            prop_assert_eq!(border.iter().collect::<BTreeSet<_>>().len(), border.len(), "a corner twice");
            // The area by the shoelace formula, doubled, is twice that of the filled cells.
            let next = |k: usize| border[(k + 1) % border.len()];
            let doubled: i64 = (0..border.len()).map(|k| border[k][0] * next(k)[1] - next(k)[0] * border[k][1]).sum();
            prop_assert_eq!(doubled, 2 * i64::try_from(grid.count()).unwrap());
            for [i, j] in cells {
                let at = [i64::from(i) - grid.first[0], i64::from(j) - grid.first[1]].map(|v| usize::try_from(v).unwrap());
                prop_assert!(grid.is_filled(at[0], at[1]), "{i} {j} was lost");
            }
        }
    }
}

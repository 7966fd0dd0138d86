//! Which cells of the drive have been searched for a set of points, and how far around a cell the search is
//! complete.
//!
//! A nearest neighbour is certain if no occupied cell that has not been searched is nearer. Distances between
//! cells are measured between their borders, so that no points of the two cells are closer to each other.

use std::collections::BTreeMap;

use crate::spatial::{Cell, CellGrid, CellMap, LARGEST_EXTENT, PackedCells};

/// Number of rings of cells around a cell that are tried before the list of all cells.
const RINGS: i32 = 48;

/// The cells that have been searched.
pub(crate) struct LookedAt<'a> {
    occupied: &'a PackedCells,
    grid: CellGrid,
    base: &'a CellMap<u8>,
    added: CellMap<u8>,
    /// Results of earlier queries.
    known: BTreeMap<Cell, Clear>,
}

/// Distance around a cell within which every occupied cell has been searched, in lattice units.
#[derive(Debug, Clone, Copy)]
struct Clear {
    distance: i64,
    /// Whether the nearest cell that has not been searched is exactly this far away. Otherwise it may be
    /// further.
    exact: bool,
}

impl<'a> LookedAt<'a> {
    /// The state in which the cells of `base` have been searched, out of the `occupied` cells of a drive.
    pub(crate) fn of(occupied: &'a PackedCells, grid: CellGrid, base: &'a CellMap<u8>) -> Self {
        Self { occupied, grid, base, added: CellMap::default(), known: BTreeMap::new() }
    }

    fn is_missing(&self, cell: Cell) -> bool {
        self.base.get(cell) == 0 && self.added.get(cell) == 0 && self.occupied.get(cell) != 0
    }

    fn gap_squared(&self, by: [i64; 2]) -> i128 {
        let gap = |steps: i64| i128::from((steps.abs() - 1).max(0)) * i128::from(self.grid.edge());
        gap(by[0]).pow(2) + gap(by[1]).pow(2)
    }

    fn between(&self, a: Cell, b: Cell) -> i128 {
        self.gap_squared([0, 1].map(|k| i64::from(a[k]) - i64::from(b[k])))
    }

    /// Whether everything within `distance` lattice units of any point of `cell` has been searched.
    pub(crate) fn is_clear(&mut self, cell: Cell, distance: i64) -> bool {
        let known = self.known.get(&cell).copied();
        let mut clear = known.unwrap_or_else(|| self.clear_nearby(cell));
        if distance > clear.distance && !clear.exact {
            clear = self.clear_far(cell);
        }
        self.known.insert(cell, clear);
        distance <= clear.distance
    }

    /// The distance around a cell within which everything has been searched, from the rings of cells around
    /// it.
    fn clear_nearby(&self, cell: Cell) -> Clear {
        let mut least = None::<i128>;
        for ring in 0..=RINGS {
            // No cell of this ring or of an outer one is nearer than this.
            let ring_gap = self.gap_squared([i64::from(ring), 0]);
            if let Some(least) = least.filter(|&least| least <= ring_gap) {
                return Clear { distance: root(least), exact: true };
            }
            for step in -ring..=ring {
                for by in [[-ring, step], [ring, step], [step, -ring], [step, ring]] {
                    if self.is_missing([cell[0].wrapping_add(by[0]), cell[1].wrapping_add(by[1])]) {
                        let squared = self.gap_squared(by.map(i64::from));
                        least = Some(least.map_or(squared, |least| least.min(squared)));
                    }
                }
            }
        }
        let rings = self.gap_squared([i64::from(RINGS) + 1, 0]);
        Clear { distance: root(least.map_or(rings, |least| least.min(rings))), exact: false }
    }

    /// The same from the list of all cells.
    fn clear_far(&self, cell: Cell) -> Clear {
        let far = self.occupied.iter().filter(|(other, _)| self.is_missing(*other));
        let distance = far.map(|(other, _)| self.between(cell, other)).min().map_or(i64::MAX, root);
        Clear { distance, exact: true }
    }

    /// Occupied cells that have not been searched and lie within the given distance of some cell, ascending.
    /// `around` has cells and their distances in lattice units.
    pub(crate) fn missing_within(&self, around: &BTreeMap<Cell, i64>) -> Vec<(Cell, u32)> {
        let farthest = around.values().copied().max().unwrap_or(0);
        let near =
            |other: Cell, cell: Cell, reach: i64| self.between(cell, other) <= i128::from(reach).pow(2);
        if farthest / self.grid.edge() > i64::from(RINGS) {
            let wanted = |(other, _): &(Cell, u32)| {
                self.is_missing(*other) && around.iter().any(|(cell, reach)| near(*other, *cell, *reach))
            };
            let mut found: Vec<(Cell, u32)> = self.occupied.iter().filter(wanted).collect();
            found.sort_unstable();
            return found;
        }
        let disc = self.grid.disc(farthest);
        let mut found = Vec::new();
        for (&cell, &reach) in around {
            for by in &disc {
                let other = [cell[0].wrapping_add(by[0]), cell[1].wrapping_add(by[1])];
                if self.is_missing(other) && near(other, cell, reach) {
                    found.push((other, self.occupied.get(other)));
                }
            }
        }
        found.sort_unstable();
        found.dedup();
        found
    }

    /// Marks cells as searched.
    pub(crate) fn add(&mut self, cells: &[(Cell, u32)]) {
        for (cell, _) in cells {
            *self.added.entry(*cell) = 1;
        }
        self.known.clear();
    }

    /// Divides cells into pieces of at most `most` points (or one cell) that can be read at once.
    pub(crate) fn pieces(&self, cells: &[(Cell, u32)], most: u64) -> Vec<Vec<Cell>> {
        let mut pieces: Vec<Vec<Cell>> = Vec::new();
        let (mut points, mut lo, mut hi) = (0, [0; 2], [0; 2]);
        for &(cell, count) in cells {
            let grown = [0, 1].map(|k| (cell[k].min(lo[k]), cell[k].max(hi[k])));
            let extent = |(lo, hi): (i32, i32)| (i64::from(hi) - i64::from(lo)) * self.grid.edge();
            points += u64::from(count);
            match pieces.last_mut() {
                Some(piece) if points <= most && grown.iter().all(|&ends| extent(ends) < LARGEST_EXTENT) => {
                    piece.push(cell);
                    (lo, hi) = (grown.map(|ends| ends.0), grown.map(|ends| ends.1));
                }
                _ => {
                    pieces.push(vec![cell]);
                    (points, lo, hi) = (u64::from(count), cell, cell);
                }
            }
        }
        pieces
    }
}

/// The square root of a squared distance, rounded down. Queried distances are integers, so no cell within one
/// is missed.
fn root(squared: i128) -> i64 {
    i64::try_from(squared.isqrt()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packed(cells: &[(Cell, u32)]) -> PackedCells {
        let mut map = CellMap::default();
        cells.iter().for_each(|(cell, points)| *map.entry(*cell) = *points);
        map.into()
    }

    fn looked(cells: impl IntoIterator<Item = Cell>) -> CellMap<u8> {
        let mut map = CellMap::default();
        cells.into_iter().for_each(|cell| *map.entry(cell) = 1);
        map
    }

    const METRE: i64 = 1_000;

    #[test]
    fn clear_is_what_lies_before_the_nearest_cell_not_looked_at() {
        let mut cells: Vec<(Cell, u32)> = (0..40).map(|i| ([i, 0], 5)).collect();
        cells.push(([400, 0], 1));
        let (occupied, base) = (packed(&cells), looked((7..23).map(|i| [i, 0])));
        let mut held = LookedAt::of(&occupied, CellGrid::new(METRE), &base);
        let clear = |held: &mut LookedAt<'_>, i: i32, distance: i64| {
            held.is_clear([i, 0], distance) && !held.is_clear([i, 0], distance + 1)
        };
        assert!(clear(&mut held, 10, 3_000) && clear(&mut held, 15, 7_000) && clear(&mut held, 19, 3_000));
        let around = BTreeMap::from([([19, 0], 4_000)]);
        assert_eq!(held.missing_within(&around), [([23, 0], 5), ([24, 0], 5)]);
        held.add(&cells[23..25]);
        assert!(clear(&mut held, 19, 5_000));
        let all = held.missing_within(&BTreeMap::from([([19, 0], 1_000_000)]));
        assert_eq!(all.len(), 7 + 15 + 1);
        held.add(&all[..22]);
        assert!(
            held.is_clear([19, 0], 10_000) && clear(&mut held, 19, 380_000) && held.is_clear([19, 0], 10_000)
        );
        held.add(&all);
        assert!(held.is_clear([19, 0], i64::MAX));
        // Across a corner: a cell that was not within reach is further away than the reach.
        let (occupied, base) = (packed(&[([0, 0], 1), ([20, 20], 1)]), looked([[0, 0]]));
        let mut held = LookedAt::of(&occupied, CellGrid::new(METRE), &base);
        assert!(clear(&mut held, 0, 26_870));
        assert!(held.missing_within(&BTreeMap::from([([0, 0], 26_870)])).is_empty());
        assert_eq!(held.missing_within(&BTreeMap::from([([0, 0], 26_871)])).len(), 1);
    }

    #[test]
    fn pieces_hold_about_so_many_points() {
        let all: Vec<(Cell, u32)> = (0..23).map(|i| ([i, 0], 5)).collect();
        let (occupied, base) = (packed(&all), CellMap::default());
        let held = LookedAt::of(&occupied, CellGrid::new(METRE), &base);
        let sizes: Vec<usize> = held.pieces(&all, 50).iter().map(Vec::len).collect();
        assert_eq!(sizes, [10, 10, 3]);
    }
}

//! The geometry of the occupancy raster: cells of the plane on the lattice, and sparse paged maps over them.
//!
//! A cell is a square of `edge` lattice units, anchored at multiples of its edge. A map consists of pages of
//! 64 x 64 cells, so that a stray point kilometres away costs one page, not the area in between.

use crate::model::in_u32;
use rustc_hash::FxHashMap;

/// Largest extent of the core of a tile, or of cells that are read at once, in lattice units (60 km at 1 mm).
/// Points far away get tiles of their own. So local coordinates fit 31 bits and methods can index their
/// cells, for any cell size of the raster.
pub(crate) const LARGEST_EXTENT: i64 = 60_000_000;

/// A cell of the occupancy raster: `floor(x / edge)`, `floor(y / edge)`.
pub type Cell = [i32; 2];

/// The division of the plane into cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellGrid {
    edge: i64,
    reciprocal: f64,
}

impl CellGrid {
    /// Cells with edges of `edge` lattice units (> 0).
    #[must_use]
    pub fn new(edge: i64) -> Self {
        let edge = edge.max(1);
        Self { edge, reciprocal: 1.0 / edge as f64 }
    }

    /// Edge of a cell in lattice units.
    #[must_use]
    pub fn edge(&self) -> i64 {
        self.edge
    }

    /// Cell index of one lattice coordinate: `floor(value / edge)`, exactly.
    #[inline]
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "|value| < 2^50, see LatticeTransform::LIMIT_UNITS")]
    pub fn index(&self, value: i64) -> i64 {
        // A multiplication and a correction, several times faster than a 64-bit division. It is exact,
        // because for |value| < 2^50 the truncated floating-point quotient is wrong by at most one.
        let quotient = (value as f64 * self.reciprocal) as i64;
        let remainder = value - quotient * self.edge;
        quotient - i64::from(remainder < 0) + i64::from(remainder >= self.edge)
    }

    /// Cell of a point; `None` when it lies more than 2^31 cells from the origin.
    #[inline]
    #[must_use]
    pub fn cell(&self, x: i64, y: i64) -> Option<Cell> {
        let i = self.index(x);
        let j = self.index(y);
        Some([i32::try_from(i).ok()?, i32::try_from(j).ok()?])
    }

    /// Offsets of all cells whose distance from cell (0, 0), border to border, is at most `reach` lattice
    /// units.
    #[must_use]
    pub fn disc(&self, reach: i64) -> Vec<[i32; 2]> {
        let limit = i32::try_from(reach / self.edge + 1).unwrap_or(i32::MAX - 1);
        let gap = |offset: i32| i128::from((offset.abs() - 1).max(0)) * i128::from(self.edge);
        let mut offsets = Vec::new();
        for di in -limit..=limit {
            for dj in -limit..=limit {
                if gap(di).pow(2) + gap(dj).pow(2) <= i128::from(reach).pow(2) {
                    offsets.push([di, dj]);
                }
            }
        }
        offsets
    }
}

/// Cells per page and axis.
const PAGE: i32 = 64;
const PAGE_BITS: u32 = PAGE.trailing_zeros();
pub(super) const PAGE_CELLS: usize = (PAGE * PAGE) as usize;

/// A sparse map from cells to small values. A cell that was never set has the default value.
#[derive(Debug, Clone)]
pub struct CellMap<T> {
    index: FxHashMap<[i32; 2], u32>,
    pages: Vec<([i32; 2], Box<[T]>)>,
}

impl<T: Copy + Default + PartialEq> Default for CellMap<T> {
    fn default() -> Self {
        Self { index: FxHashMap::default(), pages: Vec::new() }
    }
}

/// The page of `cell`.
#[inline]
pub(super) fn page_of(cell: Cell) -> [i32; 2] {
    [cell[0] >> PAGE_BITS, cell[1] >> PAGE_BITS]
}

/// The position of `cell` in its page.
#[inline]
#[expect(clippy::cast_sign_loss, reason = "masked to 0..64")]
pub(super) fn slot_of(cell: Cell) -> usize {
    ((cell[0] & (PAGE - 1)) * PAGE + (cell[1] & (PAGE - 1))) as usize
}

/// The cell at a position of a page.
#[inline]
#[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "below 64 x 64")]
pub(super) fn cell_of(page: [i32; 2], slot: usize) -> Cell {
    let slot = slot as i32;
    [(page[0] << PAGE_BITS) + slot / PAGE, (page[1] << PAGE_BITS) + slot % PAGE]
}

impl<T: Copy + Default + PartialEq> CellMap<T> {
    fn page_index(&mut self, page: [i32; 2]) -> u32 {
        let pages = &mut self.pages;
        *self.index.entry(page).or_insert_with(|| {
            pages.push((page, vec![T::default(); PAGE_CELLS].into_boxed_slice()));
            in_u32(pages.len() - 1, "pages of cells")
        })
    }

    /// The value of `cell`, for changing it.
    pub fn entry(&mut self, cell: Cell) -> &mut T {
        let page = self.page_index(page_of(cell));
        &mut self.pages[page as usize].1[slot_of(cell)]
    }

    /// The value of `cell`.
    #[must_use]
    pub fn get(&self, cell: Cell) -> T {
        self.index
            .get(&page_of(cell))
            .map_or_else(T::default, |&page| self.pages[page as usize].1[slot_of(cell)])
    }

    /// All cells with a value other than the default, in ascending (i, j).
    #[must_use]
    pub fn entries(&self) -> Vec<(Cell, T)> {
        let mut entries = Vec::new();
        for (page, values) in &self.pages {
            for (slot, &value) in values.iter().enumerate() {
                if value != T::default() {
                    entries.push((cell_of(*page, slot), value));
                }
            }
        }
        entries.sort_unstable_by_key(|entry| entry.0);
        entries
    }

    /// The pages with the values of their cells.
    pub(super) fn into_pages(self) -> impl Iterator<Item = ([i32; 2], Box<[T]>)> {
        self.pages.into_iter()
    }

    /// A reader that remembers the last page. Points come in scan order, so the next one is mostly on that
    /// page.
    #[must_use]
    pub fn cursor(&self) -> CellCursor<'_, T> {
        CellCursor { map: self, page: [i32::MIN; 2], values: None }
    }
}

/// See [`CellMap::cursor`].
#[derive(Debug, Clone)]
pub struct CellCursor<'a, T> {
    map: &'a CellMap<T>,
    page: [i32; 2],
    values: Option<&'a [T]>,
}

impl<T: Copy + Default + PartialEq> CellCursor<'_, T> {
    /// The value of `cell`.
    #[inline]
    pub fn get(&mut self, cell: Cell) -> T {
        let page = page_of(cell);
        if page != self.page {
            self.page = page;
            self.values = self.map.index.get(&page).map(|&index| &*self.map.pages[index as usize].1);
        }
        self.values.map_or_else(T::default, |values| values[slot_of(cell)])
    }
}

/// A writer that remembers the last page, for counting points.
#[derive(Debug)]
pub struct CellCounter {
    map: CellMap<u32>,
    page: [i32; 2],
    current: usize,
}

impl Default for CellCounter {
    fn default() -> Self {
        Self { map: CellMap::default(), page: [i32::MIN; 2], current: 0 }
    }
}

impl CellCounter {
    /// Counts one point in `cell`.
    #[inline]
    pub fn add(&mut self, cell: Cell) {
        let page = page_of(cell);
        if page != self.page {
            self.current = self.map.page_index(page) as usize;
            self.page = page;
        }
        self.map.pages[self.current].1[slot_of(cell)] += 1;
    }

    /// The counts.
    #[must_use]
    pub fn into_map(self) -> CellMap<u32> {
        self.map
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn index_is_floor_division() {
        for edge in [1_i64, 3, 174, 1_000, 10_000] {
            let grid = CellGrid::new(edge);
            for value in [0, 1, -1, edge - 1, edge, -edge, -edge - 1, (1 << 50) - 1, -(1 << 50) + 1] {
                assert_eq!(grid.index(value), value.div_euclid(edge), "{value} / {edge}");
            }
        }
    }

    #[test]
    fn disc_holds_the_cells_within_reach_border_to_border() {
        let grid = CellGrid::new(1_000);
        // A reach below one cell: the eight neighbours, whose borders touch.
        assert_eq!(grid.disc(300).len(), 9);
        // A reach of exactly one cell: along an axis, cells two away have a gap of one cell. So do cells a
        // knight's move away.
        assert_eq!(grid.disc(1_000).len(), 9 + 4 * 3);
        assert!(grid.disc(0).contains(&[1, 1]));
    }

    #[test]
    fn maps_remember_cells_far_apart_and_below_zero() {
        let mut map = CellMap::<u32>::default();
        for cell in [[0, 0], [-1, -1], [-64, 63], [2_000_000_000, -2_000_000_000]] {
            *map.entry(cell) += 7;
        }
        assert_eq!(map.get([-1, -1]), 7);
        assert_eq!(map.get([1, 1]), 0);
        let cells: Vec<Cell> = map.entries().into_iter().map(|entry| entry.0).collect();
        assert_eq!(cells, [[-64, 63], [-1, -1], [0, 0], [2_000_000_000, -2_000_000_000]]);
        let mut cursor = map.cursor();
        assert_eq!((cursor.get([0, 0]), cursor.get([-64, 63]), cursor.get([5, 5])), (7, 7, 0));
    }
}

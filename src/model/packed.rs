//! Values of cells that do not change any more, in as few bits as every page of them needs.
//!
//! What is known per cell grows with the street and is held for as long as a drive is worked on. Neighbouring cells have
//! similar values: points in a square metre, the stretch of the axis, the tile. A page of 64 x 64 cells keeps the
//! smallest of them once, and for every cell the difference in 1, 2, 4, 8, 16 or 32 bits.

use rustc_hash::FxHashMap;

use crate::model::cells::{self, Cell, CellMap, PAGE_CELLS};

/// A sparse map from cells to values above 0 that is only read; other cells have the value 0.
#[derive(Debug, Clone, Default)]
pub struct PackedCells {
    index: FxHashMap<[i32; 2], u32>,
    /// Ascending by place.
    pages: Vec<Page>,
    len: usize,
}

/// 64 x 64 cells. A cell without a value stores 0, others their difference to `base`, which is one below the smallest.
#[derive(Debug, Clone)]
struct Page {
    place: [i32; 2],
    base: u32,
    largest: u32,
    /// Bits per cell, as a power of two.
    shift: u32,
    words: Box<[u64]>,
}

impl Page {
    /// The page of these values; `None` when all of them are 0.
    fn pack(place: [i32; 2], values: &[u32]) -> Option<Self> {
        let occupied = || values.iter().copied().filter(|&value| value > 0);
        let (base, largest) = (occupied().min()? - 1, occupied().max()?);
        let shift = (u32::BITS - (largest - base).leading_zeros()).next_power_of_two().trailing_zeros();
        let mut words = vec![0_u64; (PAGE_CELLS << shift) / 64].into_boxed_slice();
        for (slot, &value) in values.iter().enumerate() {
            let bit = slot << shift;
            words[bit / 64] |= u64::from(value.saturating_sub(base)) << (bit % 64);
        }
        Some(Self { place, base, largest, shift, words })
    }

    #[inline]
    #[expect(clippy::cast_possible_truncation, reason = "masked to at most 32 bits")]
    fn value(&self, slot: usize) -> u32 {
        let bit = slot << self.shift;
        let mask = u32::MAX >> (u32::BITS - (1 << self.shift));
        let stored = (self.words[bit / 64] >> (bit % 64)) as u32 & mask;
        if stored == 0 { 0 } else { self.base + stored }
    }

    /// Cells with a value above 0, ascending.
    fn iter(&self) -> impl Iterator<Item = (Cell, u32)> + '_ {
        (0..PAGE_CELLS)
            .map(|slot| (cells::cell_of(self.place, slot), self.value(slot)))
            .filter(|(_, value)| *value > 0)
    }
}

impl From<CellMap<u32>> for PackedCells {
    fn from(map: CellMap<u32>) -> Self {
        // A page is given back before the next one is packed.
        Self::of(map.into_pages().filter_map(|(place, values)| Page::pack(place, &values)).collect())
    }
}

impl PackedCells {
    fn of(mut pages: Vec<Page>) -> Self {
        pages.sort_unstable_by_key(|page| page.place);
        let index = (0..).zip(&pages).map(|(number, page)| (page.place, number)).collect();
        let len = pages.iter().map(|page| page.iter().count()).sum();
        Self { index, pages, len }
    }

    /// The same cells with other values.
    #[must_use]
    pub fn map(&self, mut value: impl FnMut(Cell, u32) -> u32) -> Self {
        let mut values = vec![0; PAGE_CELLS];
        let packed = self.pages.iter().filter_map(|page| {
            for (slot, new) in values.iter_mut().enumerate() {
                let old = page.value(slot);
                *new = if old == 0 { 0 } else { value(cells::cell_of(page.place, slot), old) };
            }
            Page::pack(page.place, &values)
        });
        Self::of(packed.collect())
    }

    /// Number of cells with a value above 0.
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether no cell has a value above 0.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Bytes of memory that the values take.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.pages.iter().map(|page| (page.words.len() * 8 + size_of::<Page>()) as u64).sum()
    }

    /// The value of `cell`.
    #[must_use]
    pub fn get(&self, cell: Cell) -> u32 {
        self.page(cells::page_of(cell)).map_or(0, |page| page.value(cells::slot_of(cell)))
    }

    fn page(&self, place: [i32; 2]) -> Option<&Page> {
        self.index.get(&place).map(|&number| &self.pages[number as usize])
    }

    /// All cells with a value above 0: page by page, ascending within a page.
    pub fn iter(&self) -> impl Iterator<Item = (Cell, u32)> + '_ {
        self.pages.iter().flat_map(Page::iter)
    }

    /// The cells with this value, which is above 0, ascending.
    #[must_use]
    pub fn cells_with(&self, value: u32) -> Vec<Cell> {
        let pages = self.pages.iter().filter(|page| page.base < value && value <= page.largest);
        let mut cells: Vec<Cell> =
            pages.flat_map(Page::iter).filter(|entry| entry.1 == value).map(|entry| entry.0).collect();
        cells.sort_unstable();
        cells
    }

    /// A reader that remembers the last page: points come in scan order, so the next one is mostly on the same page.
    #[must_use]
    pub fn cursor(&self) -> PackedCursor<'_> {
        PackedCursor { cells: self, place: [i32::MIN; 2], page: None }
    }
}

/// See [`PackedCells::cursor`].
#[derive(Debug, Clone)]
pub struct PackedCursor<'a> {
    cells: &'a PackedCells,
    place: [i32; 2],
    page: Option<&'a Page>,
}

impl PackedCursor<'_> {
    /// The value of `cell`.
    #[inline]
    pub fn get(&mut self, cell: Cell) -> u32 {
        let place = cells::page_of(cell);
        if place != self.place {
            self.place = place;
            self.page = self.cells.page(place);
        }
        self.page.map_or(0, |page| page.value(cells::slot_of(cell)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_takes_the_bits_that_its_values_need() {
        // Largest difference to one below the smallest value, and bytes of the page.
        for (values, bits) in [
            (vec![7], 1),
            (vec![1_000_000, 1_000_000], 1),
            (vec![7, 8], 2),
            (vec![7, 9], 2),
            (vec![7, 10], 4),
            (vec![1, 255], 8),
            (vec![1, 256], 16),
            (vec![1, 65_536], 32),
            (vec![1, u32::MAX], 32),
        ] {
            let mut map = CellMap::<u32>::default();
            (-40_i32..).zip(&values).for_each(|(i, value)| *map.entry([i, 5]) = *value);
            let packed = PackedCells::from(map);
            assert_eq!((packed.pages.len(), packed.pages[0].words.len()), (1, bits * 64), "{values:?}");
            assert_eq!(packed.iter().map(|entry| entry.1).collect::<Vec<_>>(), values);
        }
    }

    #[test]
    fn values_are_those_of_the_map_wherever_they_are() {
        let mut map = CellMap::<u32>::default();
        let cells = [[0, 0], [63, 63], [-1, -1], [-64, 63], [2_000_000_000, -2_000_000_000]];
        for (cell, value) in cells.iter().zip([7, 900, 1, 70_000, u32::MAX]) {
            *map.entry(*cell) = value;
        }
        let entries = map.entries();
        let packed = PackedCells::from(map);
        let mut found: Vec<(Cell, u32)> = packed.iter().collect();
        found.sort_unstable();
        assert_eq!(found, entries);
        assert_eq!((packed.len(), packed.get([1, 0]), packed.get([500, 0])), (5, 0, 0));
        let mut cursor = packed.cursor();
        assert!(
            entries.iter().all(|(cell, value)| cursor.get(*cell) == *value && packed.get(*cell) == *value)
        );
        let rows = packed.map(|cell, value| if value == 900 { 0 } else { u32::from(cell[0] < 0) + 1 });
        assert_eq!(rows.cells_with(2), [[-64, 63], [-1, -1]]);
        assert_eq!((rows.len(), rows.cells_with(1).len(), rows.cells_with(3).len()), (4, 2, 0));
    }
}

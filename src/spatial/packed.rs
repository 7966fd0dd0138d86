//! Values of cells that no longer change, stored with as few bits as each page needs.
//!
//! The values per cell grow with the street and are kept during the whole run. Neighbouring cells have
//! similar values: number of points, stretch of the axis, tile. A page of 64 x 64 cells stores the smallest
//! value once, and for every cell the difference in 1, 2, 4, 8, 16 or 32 bits.

use rustc_hash::FxHashMap;

use crate::spatial::cells::{self, Cell, CellMap, PAGE_CELLS};

/// A read-only sparse map from cells to values above 0. Other cells have the value 0.
#[derive(Debug, Clone, Default)]
pub struct PackedCells {
    index: FxHashMap<[i32; 2], u32>,
    /// The pages, ascending by position.
    pages: Vec<Page>,
    /// The words of all pages, in one block. With a block per page, the freed memory between them could not
    /// be returned to the system.
    words: Vec<u64>,
    len: usize,
}

/// 64 x 64 cells. A cell without a value stores 0. The others store the difference to `base`, which is one
/// below the smallest value.
#[derive(Debug, Clone, Copy)]
struct Page {
    place: [i32; 2],
    base: u32,
    largest: u32,
    /// Bits per cell, as a power of two.
    shift: u32,
    /// First word of the page.
    at: usize,
}

impl Page {
    /// The value at a position of the page; `words` has the words of all pages.
    #[inline]
    #[expect(clippy::cast_possible_truncation, reason = "masked to at most 32 bits")]
    fn value(&self, words: &[u64], slot: usize) -> u32 {
        let bit = slot << self.shift;
        let mask = u32::MAX >> (u32::BITS - (1 << self.shift));
        let stored = (words[self.at + bit / 64] >> (bit % 64)) as u32 & mask;
        if stored == 0 { 0 } else { self.base + stored }
    }
}

impl From<CellMap<u32>> for PackedCells {
    fn from(map: CellMap<u32>) -> Self {
        let mut packed = Self::default();
        // A page is freed before the next one is packed.
        map.into_pages().for_each(|(place, values)| packed.add(place, &values));
        packed.complete()
    }
}

impl PackedCells {
    /// Packs a page, unless all its values are 0.
    fn add(&mut self, place: [i32; 2], values: &[u32]) {
        let occupied = || values.iter().copied().filter(|&value| value > 0);
        let (Some(smallest), Some(largest)) = (occupied().min(), occupied().max()) else { return };
        let base = smallest - 1;
        let shift = (u32::BITS - (largest - base).leading_zeros()).next_power_of_two().trailing_zeros();
        let at = self.words.len();
        self.words.resize(at + (PAGE_CELLS << shift) / 64, 0);
        for (slot, &value) in values.iter().enumerate() {
            let bit = slot << shift;
            self.words[at + bit / 64] |= u64::from(value.saturating_sub(base)) << (bit % 64);
        }
        self.len += occupied().count();
        self.pages.push(Page { place, base, largest, shift, at });
    }

    /// Completes the map after the last page.
    fn complete(mut self) -> Self {
        self.pages.sort_unstable_by_key(|page| page.place);
        self.index = (0..).zip(&self.pages).map(|(number, page)| (page.place, number)).collect();
        self.words.shrink_to_fit();
        self
    }

    /// The same cells with other values.
    #[must_use]
    pub fn map(&self, mut value: impl FnMut(Cell, u32) -> u32) -> Self {
        let mut values = vec![0; PAGE_CELLS];
        let mut packed = Self::default();
        for page in &self.pages {
            for (slot, new) in values.iter_mut().enumerate() {
                let old = page.value(&self.words, slot);
                *new = if old == 0 { 0 } else { value(cells::cell_of(page.place, slot), old) };
            }
            packed.add(page.place, &values);
        }
        packed.complete()
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

    /// Bytes of memory that they take.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let entry = size_of::<Page>() + size_of::<([i32; 2], u32)>();
        (self.words.len() * size_of::<u64>() + self.pages.len() * entry) as u64
    }

    /// The value of `cell`.
    #[must_use]
    pub fn get(&self, cell: Cell) -> u32 {
        self.page(cells::page_of(cell)).map_or(0, |page| page.value(&self.words, cells::slot_of(cell)))
    }

    fn page(&self, place: [i32; 2]) -> Option<&Page> {
        self.index.get(&place).map(|&number| &self.pages[number as usize])
    }

    /// All cells with a value above 0: page by page, ascending within a page.
    pub fn iter(&self) -> impl Iterator<Item = (Cell, u32)> + '_ {
        self.pages.iter().flat_map(|page| self.cells_of(page))
    }

    /// Cells of a page with a value above 0, ascending.
    fn cells_of(&self, page: &Page) -> impl Iterator<Item = (Cell, u32)> + '_ {
        let page = *page;
        (0..PAGE_CELLS)
            .map(move |slot| (cells::cell_of(page.place, slot), page.value(&self.words, slot)))
            .filter(|(_, value)| *value > 0)
    }

    /// The cells with this value (above 0), ascending.
    #[must_use]
    pub fn cells_with(&self, value: u32) -> Vec<Cell> {
        let pages = self.pages.iter().filter(|page| page.base < value && value <= page.largest);
        let cells = pages.flat_map(|page| self.cells_of(page));
        let mut cells: Vec<Cell> = cells.filter(|entry| entry.1 == value).map(|entry| entry.0).collect();
        cells.sort_unstable();
        cells
    }

    /// A reader that remembers the last page. Points come in scan order, so the next one is mostly on that
    /// page.
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
        self.page.map_or(0, |page| page.value(&self.cells.words, cells::slot_of(cell)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_takes_the_bits_that_its_values_need() {
        // The largest difference to one below the smallest value, and the bytes of the page.
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
            assert_eq!((packed.pages.len(), packed.words.len()), (1, bits * 64), "{values:?}");
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

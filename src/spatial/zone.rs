//! The zone map: where and when the points of a block of records were measured, so that a tile reads few
//! blocks.

use serde::{Deserialize, Serialize};

use crate::spatial::Cell;

/// Occupancy cells per coarse cell and axis, as a power of two (8 cells: 8 m).
const COARSE_BITS: u32 = 3;

/// Where and when the points of one block were measured: one entry of the zone map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BlockZone {
    /// Number of records of the block.
    pub count: u32,
    /// How many of them are withheld.
    pub withheld: u32,
    /// Smallest cell on each axis.
    pub lo: Cell,
    /// Largest cell on each axis.
    pub hi: Cell,
    /// First and last finite GPS time in seconds, if there is one.
    pub time: Option<(f64, f64)>,
    /// Coarse cells (8 x 8 cells) with points, sorted. Empty if there are too many to list.
    pub coarse: Vec<Cell>,
}

impl BlockZone {
    /// Its memory in bytes.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        (size_of::<Self>() + self.coarse.capacity() * size_of::<Cell>()) as u64
    }

    /// The coarse cell of `cell`.
    #[inline]
    #[must_use]
    pub fn coarse_of(cell: Cell) -> Cell {
        [cell[0] >> COARSE_BITS, cell[1] >> COARSE_BITS]
    }

    /// Whether points of this block may be in the area.
    #[must_use]
    pub fn may_meet(&self, area: &Area) -> bool {
        let apart = |k: usize| self.hi[k] < area.lo[k] || area.hi[k] < self.lo[k];
        if self.count == 0 || area.coarse.is_empty() || apart(0) || apart(1) {
            return false;
        }
        if self.coarse.is_empty() {
            let lo = Self::coarse_of(self.lo);
            let hi = Self::coarse_of(self.hi);
            return area.coarse.iter().any(|cell| (0..2).all(|k| lo[k] <= cell[k] && cell[k] <= hi[k]));
        }
        // Both lists are sorted and short: search the longer for each cell of the shorter.
        let (short, long) = if self.coarse.len() < area.coarse.len() {
            (&self.coarse, &area.coarse)
        } else {
            (&area.coarse, &self.coarse)
        };
        short.iter().any(|cell| long.binary_search(cell).is_ok())
    }
}

/// A coarse set of cells, for comparison with the blocks of the zone map.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Area {
    /// Smallest cell on each axis.
    pub lo: Cell,
    /// Largest cell on each axis.
    pub hi: Cell,
    /// Coarse cells that contain any of the cells, sorted.
    coarse: Vec<Cell>,
}

impl Area {
    /// The area of `cells`.
    #[must_use]
    pub fn of(cells: impl Iterator<Item = Cell>) -> Self {
        let mut area = Self { lo: [i32::MAX; 2], hi: [i32::MIN; 2], coarse: Vec::new() };
        for cell in cells {
            area.lo = [area.lo[0].min(cell[0]), area.lo[1].min(cell[1])];
            area.hi = [area.hi[0].max(cell[0]), area.hi[1].max(cell[1])];
            let coarse = BlockZone::coarse_of(cell);
            if area.coarse.last() != Some(&coarse) {
                area.coarse.push(coarse);
            }
        }
        area.coarse.sort_unstable();
        area.coarse.dedup();
        area
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_meet_areas_where_points_are_and_not_between() {
        let listed = BlockZone {
            count: 2,
            withheld: 0,
            lo: [0, 0],
            hi: [100, 0],
            time: None,
            coarse: vec![[0, 0], [12, 0]],
        };
        let boxed = BlockZone { coarse: Vec::new(), ..listed.clone() };
        let area = |cell: Cell| Area::of([cell].into_iter());
        assert!(listed.may_meet(&area([0, 0])) && listed.may_meet(&area([100, 0])));
        assert!(!listed.may_meet(&area([50, 0])) && boxed.may_meet(&area([50, 0])));
        assert!(!boxed.may_meet(&area([50, 20])) && !boxed.may_meet(&Area::of(std::iter::empty())));
    }
}

//! Where most of a drive lies: how many occupied cells there are in every row of the raster.

use std::collections::BTreeMap;

use crate::spatial::PackedCells;

/// Occupied cells by their index on one axis.
pub(crate) struct Rows {
    rows: BTreeMap<i32, usize>,
    cells: usize,
}

impl Rows {
    /// The rows of `cells` on axis `k` (0: east, 1: north).
    pub(crate) fn of(cells: &PackedCells, k: usize) -> Self {
        let mut rows = BTreeMap::new();
        for (cell, _) in cells.iter() {
            *rows.entry(cell[k]).or_default() += 1;
        }
        Self { rows, cells: cells.len() }
    }

    /// The row below which a share of the cells lies, 0 to 1; 0 where there are none.
    pub(crate) fn quantile(&self, share: f64) -> i32 {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share of a number of cells"
        )]
        let mut before = (self.cells.saturating_sub(1) as f64 * share).round() as usize;
        for (&row, &cells) in &self.rows {
            match before.checked_sub(cells) {
                Some(rest) => before = rest,
                None => return row,
            }
        }
        0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spatial::CellMap;

    #[test]
    fn quantiles_count_cells_and_not_points() {
        let mut map = CellMap::default();
        for (cell, points) in [([-7, 0], 900), ([1, 5], 1), ([1, 6], 1), ([1, 7], 2), ([4, 0], 3)] {
            *map.entry(cell) = points;
        }
        let cells = PackedCells::from(map);
        let rows = Rows::of(&cells, 0);
        assert_eq!([0.0, 0.1, 0.2, 0.5, 0.8, 1.0].map(|share| rows.quantile(share)), [-7, -7, 1, 1, 1, 4]);
        let rows = Rows::of(&cells, 1);
        assert_eq!([0.0, 0.25, 0.5, 1.0].map(|share| rows.quantile(share)), [0, 0, 5, 7]);
        assert_eq!(Rows::of(&PackedCells::default(), 0).quantile(0.5), 0);
    }
}

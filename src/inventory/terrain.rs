//! Height of the ground by cell of the raster, for heights of objects above ground.

use crate::model::Lattice;
use crate::spatial::{Cell, CellGrid, CellMap, PackedCells};

/// How far from an object's centre ground is looked for, in metres (methods, section 5.1 has the same distance).
const SEARCH_M: f64 = 10.0;

/// Mean height of the ground points of every cell that has any.
#[derive(Debug)]
pub struct Terrain {
    grid: CellGrid,
    lattice: Lattice,
    /// Lattice z that heights are counted from.
    lowest: i64,
    /// Heights over `lowest` in lattice units, plus one.
    heights: PackedCells,
}

/// Collects the ground points of a drive cell by cell.
#[derive(Debug)]
pub struct TerrainSums {
    grid: CellGrid,
    lattice: Lattice,
    lowest: i64,
    heights: CellMap<u32>,
}

impl TerrainSums {
    /// No ground yet; `lowest` is the smallest lattice z of the drive.
    #[must_use]
    pub fn new(grid: CellGrid, lattice: Lattice, lowest: i64) -> Self {
        Self { grid, lattice, lowest, heights: CellMap::default() }
    }

    /// Adds a cell with the number of its ground points and the sum of their lattice z. A cell is added once: it belongs
    /// to one tile.
    pub fn add(&mut self, cell: Cell, points: u32, sum: i64) {
        let over = sum.div_euclid(i64::from(points.max(1))) - self.lowest;
        *self.heights.entry(cell) = u32::try_from(over).unwrap_or(0) + 1;
    }

    /// The terrain of what was added.
    #[must_use]
    pub fn into_terrain(self) -> Terrain {
        let Self { grid, lattice, lowest, heights } = self;
        Terrain { grid, lattice, lowest, heights: heights.into() }
    }
}

impl Terrain {
    /// Mean height of the ground in metres in the cell whose centre is nearest to a place in lattice units, of equally near
    /// ones the first; `None` beyond 10 m.
    #[must_use]
    pub fn height_m(&self, place: [i64; 2]) -> Option<f64> {
        let reach = self.lattice.units(SEARCH_M);
        // Twice the distance, so that the centre of a cell is whole.
        let apart = |index: i64, k: usize| (2 * index + 1) * self.grid.edge() - 2 * place[k];
        let rows = |k: usize| self.grid.index(place[k] - reach)..=self.grid.index(place[k] + reach);
        let mut heights = self.heights.cursor();
        let mut nearest = None::<(i64, u32)>;
        for i in rows(0) {
            for j in rows(1) {
                let squared = apart(i, 0).pow(2) + apart(j, 1).pow(2);
                let nearer = squared <= 4 * reach.pow(2) && nearest.is_none_or(|best| squared < best.0);
                let (true, Ok(i), Ok(j)) = (nearer, i32::try_from(i), i32::try_from(j)) else { continue };
                let height = heights.get([i, j]);
                if height > 0 {
                    nearest = Some((squared, height));
                }
            }
        }
        nearest.map(|(_, height)| self.lattice.metres(self.lowest + i64::from(height) - 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ground_of_the_nearest_cell_within_ten_metres_counts() {
        // Cells of 1 m at 1 mm: ground at -2 m about (0.5, 0.5), at 3 m about (6.5, 0.5).
        let mut sums = TerrainSums::new(CellGrid::new(1_000), Lattice::MILLIMETRE, -2_500);
        sums.add([0, 0], 2, -4_001);
        sums.add([6, 0], 1, 3_000);
        let terrain = sums.into_terrain();
        for (place, expected) in [
            ([500, 500], Some(-2.001)),
            ([3_499, 500], Some(-2.001)),
            ([3_500, 500], Some(-2.001)), // equally near: the first
            ([3_501, 500], Some(3.0)),
            ([-9_500, 500], Some(-2.001)), // exactly 10 m
            ([-9_501, 500], None),
            ([12_500, 8_500], Some(3.0)), // 6 m and 8 m
            ([12_501, 8_500], None),
        ] {
            assert_eq!(terrain.height_m(place), expected, "{place:?}");
        }
    }
}

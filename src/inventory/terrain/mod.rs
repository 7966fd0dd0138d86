//! Height of the ground by cell of the raster, and between cells, for heights of objects above ground.

mod raised;
mod surface;

use self::raised::without_raised;
use self::surface::{Near, height_amid, plane_amid};
use crate::model::Lattice;
use crate::spatial::{Cell, CellGrid, CellMap, PackedCells};

/// Search radius for ground around the centre of an object, in metres (methods, section 5.1 has the same
/// distance).
const SEARCH_M: f64 = 10.0;

/// Largest distance between a place and the middle of a cell that determines the slope of the ground there,
/// in metres (chosen: below a tree or a car, more of these cells are ground than are wrongly classified as
/// ground).
const SLOPE_M: f64 = 4.0;

/// Height difference below which neighbouring cells belong to one patch of ground, in metres (chosen: a slope
/// of 1 in 5, or more than a kerb), see `raised.rs`.
const STEP_M: f64 = 0.2;

/// Largest slope with which the ground before a wall is extrapolated to it (chosen: front gardens are less
/// steep, steps are steeper).
const STEEPEST: f64 = 0.25;

/// Mean height of the ground points of every cell that has any, without cells that are raised above the
/// ground around them.
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

    /// Adds a cell with the number of its ground points and the sum of their lattice z. A cell is added only
    /// once, because it belongs to one tile.
    pub fn add(&mut self, cell: Cell, points: u32, sum: i64) {
        let over = sum.div_euclid(i64::from(points.max(1))) - self.lowest;
        *self.heights.entry(cell) = u32::try_from(over).unwrap_or(0) + 1;
    }

    /// The terrain of all added cells that are not raised.
    #[must_use]
    pub fn into_terrain(self) -> Terrain {
        let Self { grid, lattice, lowest, heights } = self;
        let step = u32::try_from(lattice.units(STEP_M)).unwrap_or(u32::MAX);
        let heights = without_raised(&heights.into(), step);
        Terrain { grid, lattice, lowest, heights }
    }
}

impl Terrain {
    /// Mean height of the ground in metres in the cell whose centre is nearest to a place in lattice units.
    /// If several are equally near, the first counts. `None` beyond 10 m.
    #[must_use]
    pub fn height_m(&self, place: [i64; 2]) -> Option<f64> {
        let reach = self.lattice.units(SEARCH_M);
        // Distances are doubled, so that the centre of a cell is an integer.
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
        nearest.map(|(_, height)| self.metres(height))
    }

    /// Height in metres of a stored height.
    fn metres(&self, height: u32) -> f64 {
        self.lattice.metres(self.lowest + i64::from(height) - 1)
    }

    /// The cell of a place in lattice units.
    pub(super) fn cell(&self, place: [i64; 2]) -> [i64; 2] {
        place.map(|value| self.grid.index(value))
    }

    /// [`Self::height_m`] of the middle of the cell of a place: the same for all places of the cell.
    pub(super) fn height_of_cell_m(&self, place: [i64; 2]) -> Option<f64> {
        self.height_m(self.middle(place))
    }

    /// The middle of the cell of a place, in lattice units.
    pub(super) fn middle(&self, place: [i64; 2]) -> [i64; 2] {
        self.middle_of(self.cell(place))
    }

    /// The middle of a cell, in lattice units.
    pub(super) fn middle_of(&self, cell: [i64; 2]) -> [i64; 2] {
        let edge = self.grid.edge();
        cell.map(|index| index * edge + edge / 2)
    }

    /// Diagonal of a cell in metres.
    pub(super) fn diagonal_m(&self) -> f64 {
        self.lattice.metres(self.grid.edge()) * std::f64::consts::SQRT_2
    }

    /// Height of the ground in metres at a place in metres. A plane is fitted to the cells within 4 m; nearer
    /// cells have more weight, and cells that are not ground have none. If there are too few cells for a
    /// slope, it is the height of the nearest cell ([`Self::height_m`]). `None` where no cell is within 10 m.
    #[must_use]
    pub fn surface_m(&self, place: [f64; 2]) -> Option<f64> {
        let nearest = self.height_m(place.map(|value| self.lattice.units(value)))?;
        Some(height_amid(&self.near(place), nearest))
    }

    /// Height of the ground in metres at a wall, extrapolated from the ground before it: the plane of
    /// [`Self::surface_m`] at the place `before`, through the cells on this side of the wall only. Beyond the
    /// wall are floors and reflections of windows. `None` if no such cell is within 4 m.
    pub(super) fn before_wall_m(&self, wall: [f64; 2], before: [f64; 2]) -> Option<f64> {
        let way = [0, 1].map(|k| wall[k] - before[k]);
        let length = way[0].hypot(way[1]);
        let edge_m = self.lattice.metres(self.grid.edge());
        let beyond_m = |cell: &Near| (cell.away[0] * way[0] + cell.away[1] * way[1]) / length;
        let mut cells = self.near(before);
        cells.retain(|cell| beyond_m(cell) <= length - edge_m / 2.0);
        let away_m = |cell: &Near| cell.away[0].hypot(cell.away[1]);
        let nearest = cells.iter().min_by(|one, other| away_m(one).total_cmp(&away_m(other)))?;
        let [height, along_x, along_y] = plane_amid(&cells, nearest.height);
        let rise = along_x * way[0] + along_y * way[1];
        Some(height + rise.clamp(-STEEPEST * length, STEEPEST * length))
    }

    /// The cells whose middle is within [`SLOPE_M`] of a place in metres.
    fn near(&self, place: [f64; 2]) -> Vec<Near> {
        let units = place.map(|value| self.lattice.units(value));
        let edge_m = self.lattice.metres(self.grid.edge());
        let reach = self.lattice.units(SLOPE_M);
        let rows = |k: usize| self.grid.index(units[k] - reach)..=self.grid.index(units[k] + reach);
        let mut heights = self.heights.cursor();
        let mut cells = Vec::new();
        for i in rows(0) {
            for j in rows(1) {
                let (Ok(column), Ok(row)) = (i32::try_from(i), i32::try_from(j)) else { continue };
                let height = heights.get([column, row]);
                let away = [(i, 0), (j, 1)].map(|(index, k)| (index as f64 + 0.5) * edge_m - place[k]);
                if height > 0 && away[0].hypot(away[1]) <= SLOPE_M {
                    cells.push(Near { away, height: self.metres(height) });
                }
            }
        }
        cells
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

    #[test]
    fn between_cells_the_ground_is_a_plane() {
        // A slope of 0.2 m per metre to the east and -0.1 m per metre to the north, in cells of 1 m.
        let mut sums = TerrainSums::new(CellGrid::new(1_000), Lattice::MILLIMETRE, -10_000);
        for k in 0..400 {
            let (i, j) = (k / 20, k % 20);
            sums.add([i, j], 1, 200 * i64::from(i) - 100 * i64::from(j) + 50);
        }
        let terrain = sums.into_terrain();
        // The mean of a cell is the height of its middle: 0.05 m at (0.5, 0.5).
        for place in [[5.0, 5.0], [5.5, 5.5], [10.13, 7.77], [0.1, 0.2], [19.9, 19.9], [20.5, 10.0]] {
            let expected = 0.2 * (place[0] - 0.5) - 0.1 * (place[1] - 0.5) + 0.05;
            let found = terrain.surface_m(place).unwrap();
            assert!((found - expected).abs() < 1e-3, "{place:?}: {found}, expected {expected}");
        }
        assert_eq!(terrain.surface_m([40.0, 10.0]), None);
        // A single cell, and a row of cells, have no slope across.
        let mut row = TerrainSums::new(CellGrid::new(1_000), Lattice::MILLIMETRE, 0);
        (0..9).for_each(|i| row.add([i, 0], 1, 300));
        row.add([20, 0], 1, 700);
        let row = row.into_terrain();
        assert_eq!((row.surface_m([4.4, 0.5]), row.surface_m([20.9, 0.1])), (Some(0.3), Some(0.7)));
    }
}

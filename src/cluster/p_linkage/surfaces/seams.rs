//! The points of a tile that other tiles read, with a value for each: its tree, or its surface. Other tiles
//! identify points by their ids.

use super::around::Around;
use crate::cluster::TileWindow;
use crate::model::PointId;
use crate::spatial::CellMap;

/// The value of each point of a tile that other tiles within `reach` of it read, with its id, ascending.
/// `of_own` has the values of all its points, in the order of `around`.
pub(super) fn near_others(
    tile: &dyn TileWindow,
    around: &Around,
    of_own: &[u32],
    reach: i64,
) -> Vec<(PointId, u32)> {
    let cells = near_foreign_cells(tile, reach);
    let mut cells = cells.cursor();
    let grid = tile.grid();
    let own = (0..around.len()).filter(|&point| around.is_core(point)).zip(of_own);
    let near = own.filter(|(point, _)| {
        let [x, y, _] = around.lattice_point(*point);
        grid.cell(x, y).is_some_and(|cell| cells.get(cell) != 0)
    });
    let mut near: Vec<(PointId, u32)> = near.map(|(point, value)| (around.id[point], *value)).collect();
    near.sort_unstable();
    near
}

/// The cells within `reach` of cells that other tiles own.
fn near_foreign_cells(tile: &dyn TileWindow, reach: i64) -> CellMap<u8> {
    let grid = tile.grid();
    let disc = grid.disc(reach);
    let mut near = CellMap::default();
    for (cell, _) in tile.cells(reach).entries() {
        let low = cell.map(|index| i64::from(index) * grid.edge());
        let high = low.map(|value| value + grid.edge() - 1);
        if tile.owner(low, high).is_some_and(|owner| owner != tile.tile()) {
            for by in &disc {
                *near.entry([0, 1].map(|axis| cell[axis].wrapping_add(by[axis]))) = 1;
            }
        }
    }
    near
}

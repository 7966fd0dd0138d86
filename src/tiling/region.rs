//! The region that a tile reads: its core and its halo.
//!
//! The halo is the dilation of the core in the plane by the reach of the method. It is not a range of
//! chainage: on a loop, neighbouring tiles can be far apart in chainage and time.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;

use crate::model::TileId;
use crate::spatial::{Area, Cell, CellGrid, CellMap};
use crate::tiling::plan::{Plan, owner_of};

/// The cells that a tile reads, and their roles.
#[derive(Debug)]
pub struct Region {
    /// Core and halo as a coarse set of cells.
    pub area: Area,
    /// [`Region::CORE`] or [`Region::HALO`]; 0 outside.
    pub roles: CellMap<u8>,
    /// Tiles that own any of the cells, ascending.
    pub tiles: Vec<TileId>,
    /// Points in core and halo.
    pub points: u64,
    /// The raster.
    pub grid: CellGrid,
}

impl Region {
    /// Role of a cell that the tile owns.
    pub const CORE: u8 = 1;
    /// Role of a cell that another tile owns and this one reads.
    pub const HALO: u8 = 2;
}

impl Plan {
    /// Number of points that tile number `tile` reads with a reach of `reach` lattice units.
    #[must_use]
    pub fn region_points(&self, tile: usize, reach: i64) -> u64 {
        let cells = self.core(tile);
        let halo = self.halo(tile, &cells, reach);
        let mut counts = self.cells().cursor();
        cells.iter().chain(&halo).map(|cell| u64::from(counts.get(*cell))).sum()
    }

    /// The region that tile number `tile` reads: its core and every occupied cell within `reach` lattice
    /// units.
    #[must_use]
    pub fn region(&self, tile: usize, reach: i64) -> Region {
        let cells = self.core(tile);
        let halo = self.halo(tile, &cells, reach);
        let mut roles = CellMap::<u8>::default();
        cells.iter().for_each(|&cell| *roles.entry(cell) = Region::CORE);
        halo.iter().for_each(|&cell| *roles.entry(cell) = Region::HALO);
        self.members([cells, halo].concat(), roles)
    }

    /// The cells of other tiles within `reach` lattice units of `cells`, the cells of tile number `tile`.
    fn halo(&self, tile: usize, cells: &[Cell], reach: i64) -> Vec<Cell> {
        let own = owner_of(tile);
        let mut owners = self.owners().cursor();
        let mut halo = Vec::new();
        for (i, strips) in dilated(cells, &self.grid().disc(reach)) {
            for cell in strips.into_iter().flatten().map(|j| [i, j]) {
                let owner = owners.get(cell);
                if owner != 0 && owner != own {
                    halo.push(cell);
                }
            }
        }
        halo
    }

    /// The region that consists of some cells, whichever tiles own them. None of them is core.
    #[must_use]
    pub fn region_of(&self, cells: Vec<Cell>) -> Region {
        let mut roles = CellMap::<u8>::default();
        cells.iter().for_each(|&cell| *roles.entry(cell) = Region::HALO);
        self.members(cells, roles)
    }

    fn members(&self, mut members: Vec<Cell>, roles: CellMap<u8>) -> Region {
        members.sort_unstable();
        let (mut owners, mut counts) = (self.owners().cursor(), self.cells().cursor());
        let tile = |cell: &Cell| TileId::new(owners.get(*cell).saturating_sub(1));
        let tiles: BTreeSet<TileId> = members.iter().map(tile).collect();
        let tiles = tiles.into_iter().collect();
        let points = members.iter().map(|cell| u64::from(counts.get(*cell))).sum();
        Region { area: Area::of(members.into_iter()), roles, tiles, points, grid: self.grid() }
    }
}

/// The cells that a disc around each of some ascending cells covers. For each first index, they are ascending
/// ranges of the second index that do not overlap. So each cell is visited once, however large the disc is.
fn dilated(cells: &[Cell], disc: &[[i32; 2]]) -> BTreeMap<i32, Vec<RangeInclusive<i32>>> {
    // A disc is convex and symmetric, so its largest step along the second index determines a row.
    let mut half_widths = BTreeMap::<i32, i32>::new();
    for &[di, dj] in disc {
        let half = half_widths.entry(di).or_default();
        *half = dj.max(*half);
    }
    let mut strips = BTreeMap::<i32, Vec<RangeInclusive<i32>>>::new();
    for run in cells.chunk_by(|a, b| a[0] == b[0] && a[1].checked_add(1) == Some(b[1])) {
        let (Some([i, from]), Some([_, to])) = (run.first(), run.last()) else { continue };
        for (di, half) in &half_widths {
            let Some(i) = i.checked_add(*di) else { continue };
            strips.entry(i).or_default().push(from.saturating_sub(*half)..=to.saturating_add(*half));
        }
    }
    for strips in strips.values_mut() {
        strips.sort_unstable_by_key(|strip| *strip.start());
        strips.dedup_by(|next, last| {
            let joins = *next.start() <= *last.end();
            if joins && next.end() > last.end() {
                *last = *last.start()..=*next.end();
            }
            joins
        });
    }
    strips
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_have_the_cells_within_the_disc_and_each_once() {
        let grid = CellGrid::new(1_000);
        let mut cells = vec![[0, 0], [0, 1], [0, 9], [3, 4], [7, -2], [-5, i32::MAX]];
        cells.sort_unstable();
        for reach in [0, 700, 1_000, 2_500, 6_100] {
            let disc = grid.disc(reach);
            let near = |cell: &Cell| {
                disc.iter().map(|by| [cell[0] + by[0], cell[1].saturating_add(by[1])]).collect::<Vec<_>>()
            };
            let expected: BTreeSet<Cell> = cells.iter().flat_map(near).collect();
            let found: Vec<Cell> = dilated(&cells, &disc)
                .into_iter()
                .flat_map(|(i, strips)| strips.into_iter().flatten().map(move |j| [i, j]))
                .collect();
            assert!(found.is_sorted() && found.iter().copied().eq(expected), "reach {reach}");
        }
    }
}

//! The region that a tile reads: its core and its halo.
//!
//! The halo is the dilation of the core in the plane by the reach of the method. It is not a range of
//! chainage: on a loop, tiles can be neighbours and far apart in time.

use std::collections::BTreeSet;

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
        self.region(tile, reach).points
    }

    /// The region that tile number `tile` reads: its core and every occupied cell within `reach` lattice
    /// units.
    #[must_use]
    pub fn region(&self, tile: usize, reach: i64) -> Region {
        let cells = self.core(tile);
        let own = owner_of(tile);
        let disc = self.grid().disc(reach);
        let mut roles = CellMap::<u8>::default();
        for &cell in &cells {
            *roles.entry(cell) = Region::CORE;
        }
        let mut owners = self.owners().cursor();
        let mut halo = Vec::new();
        let mut beside =
            |cell: Cell, by: [i32; 2]| owners.get([cell[0].wrapping_add(by[0]), cell[1].wrapping_add(by[1])]);
        for &cell in &cells {
            // Only a core cell with a foreign or empty neighbour can have a foreign cell within reach.
            if [[1, 0], [-1, 0], [0, 1], [0, -1]].iter().all(|by| beside(cell, *by) == own) {
                continue;
            }
            for by in &disc {
                let near = [cell[0].wrapping_add(by[0]), cell[1].wrapping_add(by[1])];
                let owner = beside(cell, *by);
                if owner != 0 && owner != own {
                    let role = roles.entry(near);
                    if *role == 0 {
                        *role = Region::HALO;
                        halo.push(near);
                    }
                }
            }
        }
        self.members([cells, halo].concat(), roles)
    }

    /// The region that consists of some cells, whoever owns them. None of them is core.
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

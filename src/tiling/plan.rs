//! The plan: cores that partition the occupied cells, and the region a tile reads around its core.
//!
//! A core is a set of cells with neighbouring chainage. The halo is the dilation of the core in the plane by the
//! reach of the method, never "chainage plus or minus": on a loop, tiles are neighbours that are far apart in time.

use serde::{Deserialize, Serialize};

use crate::model::{Area, Cell, CellGrid, CellMap};

/// Largest extent of a core in lattice units (60 km at 1 mm): stray points far outside get tiles of their own, so that
/// local coordinates fit 31 bits and methods can index their cells, whatever the edge of a cell of the raster.
const CORE_EXTENT_UNITS: i64 = 60_000_000;

/// How long a tile is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum TileSize {
    /// As few tiles of about equal points as have at most about so many in the core.
    Points(u64),
    /// So many metres of chainage.
    Metres(f64),
}

/// What a plan is made from.
#[derive(Debug)]
pub struct PlanRequest<'a> {
    /// Occupied cells with their points, ascending.
    pub cells: &'a [(Cell, u32)],
    /// Chainage of each of them in metres.
    pub chainage_m: &'a [f64],
    /// The raster.
    pub grid: CellGrid,
    /// How long a tile is.
    pub size: TileSize,
}

/// One tile.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Tile {
    /// Cells it owns, ascending.
    #[serde(skip)]
    pub cells: Vec<Cell>,
    /// Points it owns.
    pub points: u64,
    /// Chainage of its first cell in metres.
    pub from_m: f64,
    /// Chainage of its last cell in metres.
    pub to_m: f64,
}

/// The tiles of a run.
#[derive(Debug)]
pub struct Plan {
    /// Tiles in order of chainage.
    pub tiles: Vec<Tile>,
    grid: CellGrid,
    occupancy: CellMap<u32>,
    /// Tile that owns a cell, plus one.
    owner: CellMap<u32>,
}

impl Plan {
    /// Cuts the occupied cells into tiles.
    #[must_use]
    pub fn new(request: &PlanRequest<'_>) -> Self {
        let mut order: Vec<usize> = (0..request.cells.len()).collect();
        let chainage = request.chainage_m;
        order.sort_by(|&a, &b| chainage[a].total_cmp(&chainage[b]).then(a.cmp(&b)));
        let total: u64 = request.cells.iter().map(|(_, points)| u64::from(*points)).sum();
        let share = match request.size {
            TileSize::Points(most) => total.div_ceil(total.div_ceil(most.max(1)).max(1)).max(1),
            TileSize::Metres(_) => u64::MAX,
        };
        let mut tiles: Vec<Tile> = Vec::new();
        let (mut before, mut taken) = (0_u64, 0_u64);
        let (mut lo, mut hi) = ([0_i32; 2], [0_i32; 2]);
        for at in order {
            let (cell, points) = request.cells[at];
            let (grown_lo, grown_hi) = (min(lo, cell), max(hi, cell));
            let full = tiles.last().is_none_or(|tile| {
                let extent =
                    |k: usize| (i64::from(grown_hi[k]) - i64::from(grown_lo[k])) * request.grid.edge();
                let too_wide = (0..2).any(|k| extent(k) >= CORE_EXTENT_UNITS);
                too_wide
                    || match request.size {
                        TileSize::Points(_) => before / share > taken,
                        TileSize::Metres(length) => {
                            (tile.from_m / length).floor() < (chainage[at] / length).floor()
                        }
                    }
            });
            if full {
                taken = before / share;
                tiles.push(Tile { cells: Vec::new(), points: 0, from_m: chainage[at], to_m: chainage[at] });
                (lo, hi) = (cell, cell);
            } else {
                (lo, hi) = (grown_lo, grown_hi);
            }
            if let Some(tile) = tiles.last_mut() {
                tile.cells.push(cell);
                tile.points += u64::from(points);
                tile.to_m = chainage[at];
            }
            before += u64::from(points);
        }
        let (mut occupancy, mut owner) = (CellMap::default(), CellMap::default());
        for (cell, points) in request.cells {
            *occupancy.entry(*cell) = *points;
        }
        for (number, tile) in (1_u32..).zip(&mut tiles) {
            tile.cells.sort_unstable();
            tile.cells.shrink_to_fit();
            tile.cells.iter().for_each(|cell| *owner.entry(*cell) = number);
        }
        Self { tiles, grid: request.grid, occupancy, owner }
    }

    /// The raster.
    #[must_use]
    pub fn grid(&self) -> CellGrid {
        self.grid
    }

    /// Tile that owns each cell, plus one; 0 where no point is.
    #[must_use]
    pub fn owners(&self) -> &CellMap<u32> {
        &self.owner
    }

    /// Points in a cell.
    #[must_use]
    pub fn points_of(&self, cell: Cell) -> u32 {
        self.occupancy.get(cell)
    }

    /// All occupied cells with their points, ascending.
    #[must_use]
    pub fn occupied(&self) -> Vec<(Cell, u32)> {
        self.occupancy.entries()
    }

    /// Points that tile number `tile` reads with a reach of `reach` lattice units.
    #[must_use]
    pub fn region_points(&self, tile: usize, reach: i64) -> u64 {
        self.region(tile, reach).points
    }

    /// One number for the whole geometry: which cell belongs to which tile.
    #[must_use]
    pub fn digest(&self) -> u64 {
        let mut hasher = xxhash_rust::xxh3::Xxh3::new();
        for tile in &self.tiles {
            hasher.update(&(tile.cells.len() as u64).to_le_bytes());
            for cell in &tile.cells {
                hasher.update(&cell[0].to_le_bytes());
                hasher.update(&cell[1].to_le_bytes());
            }
        }
        hasher.digest()
    }

    /// What tile number `tile` reads: its core and every occupied cell within `reach` lattice units of it.
    #[must_use]
    pub fn region(&self, tile: usize, reach: i64) -> Region {
        let cells = &self.tiles[tile].cells;
        let own = u32::try_from(tile + 1).unwrap_or(u32::MAX);
        let disc = self.grid.disc(reach);
        let mut roles = CellMap::<u8>::default();
        let mut members = cells.clone();
        for &cell in cells {
            *roles.entry(cell) = Region::CORE;
        }
        let mut owners = self.owner.cursor();
        let mut beside =
            |cell: Cell, by: [i32; 2]| owners.get([cell[0].wrapping_add(by[0]), cell[1].wrapping_add(by[1])]);
        for &cell in cells {
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
                        members.push(near);
                    }
                }
            }
        }
        self.members(members, roles)
    }

    /// What reading some cells means, whoever owns them; none of them is a core.
    #[must_use]
    pub fn region_of(&self, cells: Vec<Cell>) -> Region {
        let mut roles = CellMap::<u8>::default();
        cells.iter().for_each(|&cell| *roles.entry(cell) = Region::HALO);
        self.members(cells, roles)
    }

    fn members(&self, mut members: Vec<Cell>, roles: CellMap<u8>) -> Region {
        members.sort_unstable();
        let mut tiles: Vec<u32> =
            members.iter().map(|cell| self.owner.get(*cell).saturating_sub(1)).collect();
        tiles.sort_unstable();
        tiles.dedup();
        let points = members.iter().map(|cell| u64::from(self.occupancy.get(*cell))).sum();
        Region { area: Area::of(members.into_iter()), roles, tiles, points, grid: self.grid }
    }
}

fn min(a: Cell, b: Cell) -> Cell {
    [a[0].min(b[0]), a[1].min(b[1])]
}

fn max(a: Cell, b: Cell) -> Cell {
    [a[0].max(b[0]), a[1].max(b[1])]
}

/// The cells a tile reads, and what they are to it.
#[derive(Debug)]
pub struct Region {
    /// Core and halo, coarsely.
    pub area: Area,
    /// [`Region::CORE`] or [`Region::HALO`]; 0 outside.
    pub roles: CellMap<u8>,
    /// Tiles that own any of the cells, ascending.
    pub tiles: Vec<u32>,
    /// Points in core and halo.
    pub points: u64,
    /// The raster.
    pub grid: CellGrid,
}

impl Region {
    /// Role of a cell that the tile owns.
    pub const CORE: u8 = 1;
    /// Role of a cell that another tile owns and this one sees.
    pub const HALO: u8 = 2;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(cells: &[(Cell, u32)], size: TileSize) -> Plan {
        let chainage: Vec<f64> = cells.iter().map(|(cell, _)| f64::from(cell[0])).collect();
        Plan::new(&PlanRequest { cells, chainage_m: &chainage, grid: CellGrid::new(1_000), size })
    }

    fn street(length: i32) -> Vec<(Cell, u32)> {
        (0..length).flat_map(|i| (0..5).map(move |j| ([i, j], 10))).collect()
    }

    #[test]
    fn cores_partition_the_occupied_cells() {
        let cells = street(100);
        for size in
            [TileSize::Points(1), TileSize::Points(333), TileSize::Metres(7.0), TileSize::Points(1 << 40)]
        {
            let plan = plan(&cells, size);
            let mut seen: Vec<Cell> = plan.tiles.iter().flat_map(|tile| tile.cells.clone()).collect();
            seen.sort_unstable();
            assert_eq!(seen, cells.iter().map(|entry| entry.0).collect::<Vec<_>>());
            assert_eq!(plan.tiles.iter().map(|tile| tile.points).sum::<u64>(), 5_000);
            for (number, tile) in plan.tiles.iter().enumerate() {
                assert!(tile.cells.iter().all(|cell| plan.owners().get(*cell) as usize == number + 1));
            }
        }
    }

    #[test]
    fn tiles_by_points_are_few_and_about_equal() {
        // 5,000 points in cells of 10: three tiles, of at most a third of them and a cell.
        let points: Vec<u64> =
            plan(&street(100), TileSize::Points(2_000)).tiles.iter().map(|tile| tile.points).collect();
        assert_eq!(points, [1_670, 1_670, 1_660]);
    }

    #[test]
    fn tiles_by_length_are_whole_multiples() {
        let plan = plan(&street(100), TileSize::Metres(20.0));
        let spans: Vec<(f64, f64)> = plan.tiles.iter().map(|tile| (tile.from_m, tile.to_m)).collect();
        assert_eq!(spans, [(0.0, 19.0), (20.0, 39.0), (40.0, 59.0), (60.0, 79.0), (80.0, 99.0)]);
    }

    #[test]
    fn the_halo_is_every_foreign_cell_within_reach() {
        let plan = plan(&street(100), TileSize::Metres(20.0));
        let region = plan.region(1, 2_500);
        // Cells 17..=19 and 40..=42: a reach of 2.5 m covers gaps of up to two whole cells.
        let halo: Vec<i32> = (0..100).filter(|&i| region.roles.get([i, 2]) == Region::HALO).collect();
        assert_eq!(halo, [17, 18, 19, 40, 41, 42]);
        assert_eq!((region.points, &region.tiles[..]), ((20 + 6) * 50, &[0, 1, 2][..]));
        assert_eq!(plan.region(1, 0).points, (20 + 2) * 50);
    }

    #[test]
    fn a_stray_point_far_away_has_its_own_tile() {
        let mut cells = street(10);
        cells.push(([5_000_000, 0], 1));
        let plan = plan(&cells, TileSize::Points(1 << 40));
        assert_eq!(plan.tiles.len(), 2);
    }
}

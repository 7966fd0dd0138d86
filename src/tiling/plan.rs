//! The plan: cores that partition the occupied cells. A core is a set of cells with neighbouring chainage.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::model::in_u32;
use crate::spatial::{Cell, CellGrid, LARGEST_EXTENT, PackedCells};

/// Load of a tile. Large, because the load per point is rounded to an integer, but small enough that the sum
/// over thousands of tiles fits u64. The rounding can move the beginning of a tile by one cell.
const TILE_LOAD: f64 = (1_u64 << 44) as f64;

/// A place along the street: a strip, and a cell of it.
pub type Place = (u32, Cell);

/// The rule for the length of tiles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum TileSize {
    /// This many metres of chainage.
    Metres(f64),
    /// This many tiles with about the same load.
    Equal {
        /// Number of tiles.
        tiles: u64,
        /// Places, ascending, each with the load per point from there on; 1 before the first. Where the load
        /// per point is larger, tiles are shorter.
        weights: Vec<(Place, u64)>,
    },
}

impl TileSize {
    /// This many tiles with about the same number of points.
    #[must_use]
    pub const fn equal(tiles: u64) -> Self {
        Self::Equal { tiles, weights: Vec::new() }
    }

    /// Load of a point in a cell.
    fn weight(&self, place: Place) -> u64 {
        let Self::Equal { weights, .. } = self else { return 1 };
        let begun = weights.partition_point(|(begin, _)| *begin <= place);
        weights[..begun].last().map_or(1, |(_, weight)| *weight)
    }
}

/// The input of a plan. A strip across the street consists of the cells with the same nearest vertex of the
/// axis.
#[derive(Debug)]
pub struct PlanRequest<'a> {
    /// Points of the occupied cells.
    pub cells: &'a Arc<PackedCells>,
    /// The strip of each cell, counted from 1.
    pub strips: &'a PackedCells,
    /// Chainage of each strip in metres, never decreasing.
    pub chainage_m: &'a [f64],
    /// The raster.
    pub grid: CellGrid,
    /// The rule for the length of tiles.
    pub size: &'a TileSize,
    /// Whether each strip is inside the planned section; `None` if all are. Every tile is either completely
    /// inside or completely outside it.
    pub inside: Option<&'a [bool]>,
}

/// One tile.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Tile {
    /// Points it owns.
    pub points: u64,
    /// Chainage of its first cell in metres.
    pub from_m: f64,
    /// Chainage of its last cell in metres.
    pub to_m: f64,
    /// Whether it is inside the section. Tiles outside only complete the objects of the section.
    #[serde(skip)]
    pub inside: bool,
    /// Where it begins. If the strip is not cut, the cell is the smallest possible index.
    #[serde(skip)]
    pub first: Place,
}

/// The tiles of a run.
#[derive(Debug)]
pub struct Plan {
    /// Tiles in order of chainage.
    pub tiles: Vec<Tile>,
    grid: CellGrid,
    /// Points of the occupied cells.
    cells: Arc<PackedCells>,
    /// The tile that owns a cell, plus one.
    owners: PackedCells,
}

/// Cells that are assigned to a tile together.
#[derive(Debug, Clone, Copy)]
struct Bunch {
    points: u64,
    /// Load of their points.
    load: u64,
    lo: Cell,
    hi: Cell,
}

impl Bunch {
    const EMPTY: Self = Self { points: 0, load: 0, lo: [i32::MAX; 2], hi: [i32::MIN; 2] };

    fn of(cell: Cell, points: u32, weight: u64) -> Self {
        Self { points: points.into(), load: u64::from(points).saturating_mul(weight), lo: cell, hi: cell }
    }

    fn and(&self, other: &Self) -> Self {
        let [i, j] = [0, 1].map(|k| (self.lo[k].min(other.lo[k]), self.hi[k].max(other.hi[k])));
        let points = self.points + other.points;
        let load = self.load.saturating_add(other.load);
        Self { points, load, lo: [i.0, j.0], hi: [i.1, j.1] }
    }

    /// The longer side in lattice units.
    fn extent(&self, grid: CellGrid) -> i64 {
        let side = |k: usize| (i64::from(self.hi[k]) - i64::from(self.lo[k])) * grid.edge();
        side(0).max(side(1))
    }
}

/// Cuts the street into tiles. Bunches come in order of chainage.
struct Cutter<'a> {
    size: &'a TileSize,
    grid: CellGrid,
    inside: Option<&'a [bool]>,
    /// Load of a tile, if all tiles have the same load.
    share: u64,
    /// Load before the next bunch. `filled` is the number of tiles that the load before the last tile fills.
    before: u64,
    filled: u64,
    tiles: Vec<Tile>,
    /// Content of the last tile.
    core: Bunch,
}

impl<'a> Cutter<'a> {
    fn new(request: &PlanRequest<'a>, load: u64) -> Self {
        let &PlanRequest { size, grid, inside, .. } = request;
        let share = match size {
            TileSize::Equal { tiles, .. } => load.div_ceil((*tiles).max(1)).max(1),
            TileSize::Metres(_) => u64::MAX,
        };
        Self { size, grid, inside, share, before: 0, filled: 0, tiles: Vec::new(), core: Bunch::EMPTY }
    }

    /// Whether a new tile may have to begin within the next bunch.
    fn may_cut(&self, before: u64, bunch: &Bunch) -> bool {
        before / self.share < before.saturating_add(bunch.load) / self.share
            || bunch.extent(self.grid) >= LARGEST_EXTENT / 2
    }

    /// Adds the next bunch, which begins at `first`, to the last tile or to a new one.
    fn take(&mut self, first: Place, chainage_m: f64, bunch: &Bunch) {
        let grown = self.core.and(bunch);
        let inside = self.inside.is_none_or(|inside| inside[first.0 as usize - 1]);
        let full = self.tiles.last().is_none_or(|tile| {
            tile.inside != inside
                || grown.extent(self.grid) >= LARGEST_EXTENT
                || match self.size {
                    TileSize::Equal { .. } => self.before / self.share > self.filled,
                    TileSize::Metres(length) => {
                        (tile.from_m / length).floor() < (chainage_m / length).floor()
                    }
                }
        });
        if full {
            self.filled = self.before / self.share;
            self.tiles.push(Tile { points: 0, from_m: chainage_m, to_m: chainage_m, inside, first });
        }
        self.core = if full { *bunch } else { grown };
        if let Some(tile) = self.tiles.last_mut() {
            tile.points = self.core.points;
            tile.to_m = chainage_m;
        }
        self.before = self.before.saturating_add(bunch.load);
    }
}

impl Plan {
    /// Cuts the occupied cells into tiles: by chainage, and within a strip by cell.
    ///
    /// Needs memory for the strips, and for the cells of strips that are cut, but not for all cells.
    #[must_use]
    pub fn new(request: &PlanRequest<'_>) -> Self {
        let cells = || {
            let mut points = request.cells.cursor();
            request.strips.iter().map(move |(cell, strip)| {
                (strip, cell, Bunch::of(cell, points.get(cell), request.size.weight((strip, cell))))
            })
        };
        let mut strips = vec![Bunch::EMPTY; request.chainage_m.len()];
        for (strip, _, of_cell) in cells() {
            let bunch = &mut strips[strip as usize - 1];
            *bunch = bunch.and(&of_cell);
        }
        let load = strips.iter().fold(0, |load: u64, strip| load.saturating_add(strip.load));
        let mut cutter = Cutter::new(request, load);
        let mut before = 0;
        let mut cut: BTreeMap<u32, Vec<(Cell, Bunch)>> = BTreeMap::new();
        for (number, strip) in (1..).zip(&strips) {
            if cutter.may_cut(before, strip) {
                cut.insert(number, Vec::new());
            }
            before = before.saturating_add(strip.load);
        }
        for (strip, cell, of_cell) in cells() {
            if let Some(list) = cut.get_mut(&strip) {
                list.push((cell, of_cell));
            }
        }
        for ((number, strip), &chainage_m) in (1..).zip(&strips).zip(request.chainage_m) {
            match cut.get_mut(&number) {
                Some(list) => {
                    list.sort_unstable_by_key(|(cell, _)| *cell);
                    for (cell, of_cell) in list {
                        cutter.take((number, *cell), chainage_m, of_cell);
                    }
                }
                None if strip.points > 0 => cutter.take((number, [i32::MIN; 2]), chainage_m, strip),
                None => {}
            }
        }
        let tiles = cutter.tiles;
        // The beginnings of tiles are ascending. A cell belongs to the last tile that begins at or before it.
        let owners = request.strips.map(|cell, strip| {
            let owner = tiles.partition_point(|tile| tile.first <= (strip, cell));
            in_u32(owner, "tiles")
        });
        Self { tiles, grid: request.grid, cells: Arc::clone(request.cells), owners }
    }

    /// The rule that cuts each tile of this plan into about as many parts as `parts` says for it. The numbers
    /// may be fractional; the number of new tiles is their sum, rounded.
    #[must_use]
    pub fn cut_into(&self, parts: &[f64]) -> TileSize {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "the load of a tile fits, see TILE_LOAD"
        )]
        let weight =
            |(tile, parts): (&Tile, &f64)| (tile.first, (TILE_LOAD * parts / tile.points as f64) as u64);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count of tiles")]
        let tiles = parts.iter().sum::<f64>().round() as u64;
        TileSize::Equal { tiles, weights: self.tiles.iter().zip(parts).map(weight).collect() }
    }

    /// Points of the tiles inside the section.
    #[must_use]
    pub fn points_inside(&self) -> u64 {
        self.tiles.iter().filter(|tile| tile.inside).map(|tile| tile.points).sum()
    }

    /// Whether the tile that owns a cell is inside the section.
    #[must_use]
    pub fn is_inside(&self, cell: Cell) -> bool {
        let owner = self.owners.get(cell) as usize;
        owner.checked_sub(1).and_then(|tile| self.tiles.get(tile)).is_some_and(|tile| tile.inside)
    }

    /// The raster.
    #[must_use]
    pub fn grid(&self) -> CellGrid {
        self.grid
    }

    /// The tile that owns each cell, plus one; 0 for cells without points.
    #[must_use]
    pub fn owners(&self) -> &PackedCells {
        &self.owners
    }

    /// The cells of tile number `tile`, ascending.
    #[must_use]
    pub fn core(&self, tile: usize) -> Vec<Cell> {
        self.owners.cells_with(owner_of(tile))
    }

    /// Points of the occupied cells.
    #[must_use]
    pub fn cells(&self) -> &PackedCells {
        &self.cells
    }

    /// A hash of the whole geometry: which cell belongs to which tile.
    #[must_use]
    pub fn digest(&self) -> u64 {
        let mut hasher = xxhash_rust::xxh3::Xxh3::new();
        for (cell, owner) in self.owners.iter() {
            cell.iter().for_each(|index| hasher.update(&index.to_le_bytes()));
            hasher.update(&owner.to_le_bytes());
        }
        hasher.digest()
    }
}

/// The stored value for the owner of a cell; 0 means no tile.
pub(super) fn owner_of(tile: usize) -> u32 {
    in_u32(tile + 1, "tiles")
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::model::TileId;
    use crate::spatial::CellMap;
    use crate::tiling::Region;

    /// A plan of cells whose chainage is their first index.
    fn plan(cells: &[(Cell, u32)], size: &TileSize) -> Plan {
        section(cells, size, None)
    }

    fn section(cells: &[(Cell, u32)], size: &TileSize, section_m: Option<(f64, f64)>) -> Plan {
        let mut map = CellMap::<u32>::default();
        cells.iter().for_each(|(cell, points)| *map.entry(*cell) = *points);
        let counts = Arc::new(PackedCells::from(map));
        let columns: BTreeSet<i32> = cells.iter().map(|(cell, _)| cell[0]).collect();
        let chainage_m: Vec<f64> = columns.iter().copied().map(f64::from).collect();
        let number: BTreeMap<i32, u32> = columns.into_iter().zip(1..).collect();
        let strips = counts.map(|cell, _| number[&cell[0]]);
        let grid = CellGrid::new(1_000);
        let chainage_m = &chainage_m;
        let inside: Option<Vec<bool>> =
            section_m.map(|(from, to)| chainage_m.iter().map(|at| (from..=to).contains(at)).collect());
        let inside = inside.as_deref();
        Plan::new(&PlanRequest { cells: &counts, strips: &strips, chainage_m, grid, size, inside })
    }

    fn street(length: i32) -> Vec<(Cell, u32)> {
        (0..length).flat_map(|i| (0..5).map(move |j| ([i, j], 10))).collect()
    }

    #[test]
    fn cores_partition_the_occupied_cells() {
        let cells = street(100);
        let weights = vec![((20, [0, 0]), 3), ((60, [59, 2]), 2)];
        for size in [
            TileSize::equal(5_000),
            TileSize::equal(15),
            TileSize::Metres(7.0),
            TileSize::equal(0),
            TileSize::Equal { tiles: 9, weights },
        ] {
            let plan = plan(&cells, &size);
            let mut seen: Vec<Cell> = (0..plan.tiles.len()).flat_map(|tile| plan.core(tile)).collect();
            seen.sort_unstable();
            assert_eq!(seen, cells.iter().map(|entry| entry.0).collect::<Vec<_>>());
            assert_eq!(plan.tiles.iter().map(|tile| tile.points).sum::<u64>(), 5_000);
            for (number, tile) in plan.tiles.iter().enumerate() {
                let points =
                    plan.core(number).iter().map(|cell| u64::from(plan.cells().get(*cell))).sum::<u64>();
                assert!(points == tile.points && points > 0);
            }
        }
    }

    #[test]
    fn tiles_have_about_the_same_load() {
        let points = |size: &TileSize| -> Vec<u64> {
            plan(&street(100), size).tiles.iter().map(|tile| tile.points).collect()
        };
        // 5,000 points in cells of 10: each tile has at most a third of them, plus a cell.
        assert_eq!(points(&TileSize::equal(3)), [1_670, 1_670, 1_660]);
        // Points of the second half have three times the load: 10,000 in all.
        let weights = vec![((51, [i32::MIN; 2]), 3)];
        assert_eq!(points(&TileSize::Equal { tiles: 4, weights }), [2_500, 840, 830, 830]);
        // The second of four tiles becomes two tiles, and the last two become three. All are equal to within
        // one cell.
        let four = plan(&street(100), &TileSize::equal(4));
        let parts = points(&four.cut_into(&[1.0, 2.0, 1.5, 1.5]));
        let expected = [1_250, 625, 625, 833, 833, 833_u64];
        assert!(parts.len() == 6 && (0..6).all(|k| parts[k].abs_diff(expected[k]) <= 10), "{parts:?}");
    }

    #[test]
    fn tiles_by_length_are_whole_multiples() {
        let plan = plan(&street(100), &TileSize::Metres(20.0));
        let spans: Vec<(f64, f64)> = plan.tiles.iter().map(|tile| (tile.from_m, tile.to_m)).collect();
        assert_eq!(spans, [(0.0, 19.0), (20.0, 39.0), (40.0, 59.0), (60.0, 79.0), (80.0, 99.0)]);
    }

    #[test]
    fn a_tile_is_inside_or_beside_the_section() {
        for size in [TileSize::Metres(20.0), TileSize::equal(3), TileSize::equal(1)] {
            let plan = section(&street(100), &size, Some((25.0, 70.0)));
            for (number, tile) in plan.tiles.iter().enumerate() {
                let inside = |cell: &Cell| (25..=70).contains(&cell[0]);
                assert!(plan.core(number).iter().all(|cell| inside(cell) == tile.inside), "{tile:?}");
            }
            assert_eq!(plan.points_inside(), 46 * 50);
            assert!(plan.is_inside([25, 0]) && !plan.is_inside([24, 0]) && !plan.is_inside([200, 0]));
        }
    }

    #[test]
    fn the_halo_is_every_foreign_cell_within_reach() {
        let plan = plan(&street(100), &TileSize::Metres(20.0));
        let region = plan.region(1, 2_500);
        // Cells 17..=19 and 40..=42: a reach of 2.5 m covers gaps of up to two whole cells.
        let halo: Vec<i32> = (0..100).filter(|&i| region.roles.get([i, 2]) == Region::HALO).collect();
        assert_eq!(halo, [17, 18, 19, 40, 41, 42]);
        assert_eq!((region.points, &region.tiles[..]), ((20 + 6) * 50, &[0, 1, 2].map(TileId::new)[..]));
        assert_eq!(plan.region(1, 0).points, (20 + 2) * 50);
    }

    #[test]
    fn a_stray_point_far_away_has_its_own_tile() {
        let mut cells = street(10);
        cells.push(([5_000_000, 0], 1));
        let plan = plan(&cells, &TileSize::equal(1));
        assert_eq!(plan.tiles.len(), 2);
    }
}

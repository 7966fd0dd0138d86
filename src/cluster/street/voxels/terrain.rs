//! The height of the ground: a raster of 0.5 m with one or two layers per cell, and its interpolation over
//! gaps.
//!
//! *Layers.* The ground points of a cell are one layer, unless a gap of 2.5 m or more separates them, as
//! below and on a bridge. Then the points below the lowest such gap are the lower layer. The points above the
//! highest such gap are the upper layer if there are at least 3. The height of a layer is the lower quartile
//! of its points, so that single points below the ground and the feet of objects count little.
//!
//! *Which layer.* A voxel stands on the upper layer if its centre is above it or less than 0.5 m below it,
//! and otherwise on the lower one. So the height of an object on a bridge is measured from the deck. The
//! height of an object under the bridge, or of a girder, is measured from the road below.
//!
//! *Gaps.* For a cell without ground, the nearest cell with ground in each of eight sectors within 12 m is
//! used. A plane is fitted to these with weights 1 / d^2. Its slope is damped towards zero where the cells
//! are near and on one side only: a plane through neighbouring cells would continue a kerb as a ramp. So a
//! gap surrounded by ground follows the slope (within 2 cm below a car on a slope of 10 %), and beyond the
//! edge of the ground the height continues level. If one of the cells has two layers, the gap has two layers
//! as well, provided that they differ by 2.5 m there.
//!
//! *Rough ground.* Where the scanner saw no ground, the ground filter takes the lower side of crowns for
//! ground, and every hanging bough would be a trunk. Such places have few cells with ground, and their
//! heights are not on a plane. These cells count as cells without ground.
//!
//! *No ground within 12 m.* The height is measured from the lowest rough cell within 12 m. Without rough
//! cells it is measured from the lowest voxel of the column.
//!
//! Everything is computed from whole cells on the global lattice in a fixed order, and rounded to lattice
//! units. So two tiles that see the same 15 m around a cell find the same height: 12 m for the gap, and 3 m
//! around each cell that may be rough.
#![expect(
    clippy::cast_possible_truncation,
    reason = "offsets of cells within 12 m, heights of a drive in lattice units"
)]

use serde::{Deserialize, Serialize};

use super::plane::Plane;
use super::stored::{SECTION_GROUND, Voxels};
use crate::cluster::street::settings::{STEP_VOXELS, edge};
use crate::cluster::{DriveWindow, TileWindow};
use crate::codec;
use crate::error::Result;
use crate::model::{Lattice, TileId};
use crate::spatial::{Cell, CellMap};

/// Edge of a cell in metres.
pub(crate) const CELL_M: f64 = 0.5;
/// Distance within which gaps are filled, in metres.
pub(crate) const REACH_M: f64 = 12.0;
/// Vertical gap that separates two layers, in metres.
pub(crate) const LAYER_GAP_M: f64 = 2.5;
/// Depth below the upper layer at which a voxel still stands on it, in metres.
const BELOW_UPPER_M: f64 = 0.5;
/// Smallest number of points of an upper layer.
const UPPER_POINTS: usize = 3;
/// Radius around a cell within which ground counts as sparse or not, in metres: less than the distance
/// between two crowns.
const SPARSE_REACH_M: f64 = 3.0;
/// Share of cells with ground below which ground is sparse.
const SPARSE: f64 = 0.2;
/// Root mean square distance of sparse ground to a plane above which it is rough, in metres.
/// `benches/results/street.md`, "Ground below crowns", says how often such ground is not ground.
const ROUGH_M: f64 = 0.2;
/// Smallest number of cells for this test. Fewer cells are always near a plane, so they count as rough.
const FEWEST: u32 = 4;

/// The ground raster of a tile, as differences to the previous cell.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct StoredGround {
    /// Differences of i, j and lower height, and the upper height above the lower one.
    cells: Vec<(i32, i32, i64, u64)>,
    /// The previous cell and its lower height.
    #[serde(skip)]
    last: (Cell, i64),
}

impl StoredGround {
    /// Adds a cell with its lower and upper height in lattice units.
    pub(crate) fn push(&mut self, cell: Cell, [lower, upper]: [i64; 2]) {
        let (last, height) = self.last;
        self.cells.push((cell[0] - last[0], cell[1] - last[1], lower - height, upper.abs_diff(lower)));
        self.last = (cell, lower);
    }

    fn cells(&self) -> impl Iterator<Item = (Cell, [i64; 2])> + '_ {
        let mut at = [0, 0];
        let mut lower = 0;
        self.cells.iter().map(move |&(di, dj, dz, more)| {
            at = [at[0] + di, at[1] + dj];
            lower += dz;
            (at, [lower, lower.saturating_add_unsigned(more)])
        })
    }
}

/// Lower and upper height of the ground points in a cell. A gap of at least `gap` separates layers. `None` if
/// there are no points. Changes the order of `heights`.
pub(crate) fn layers(heights: &mut [i32], gap: i32) -> Option<[i32; 2]> {
    let lowest = *heights.iter().min()?;
    let highest = *heights.iter().max()?;
    if highest - lowest < gap {
        return Some([quartile(heights); 2]);
    }
    heights.sort_unstable();
    let gaps = || (1..heights.len()).filter(|&at| heights[at] - heights[at - 1] >= gap);
    let (Some(first), Some(last)) = (gaps().next(), gaps().next_back()) else {
        return Some([heights[(heights.len() - 1) / 4]; 2]);
    };
    let lower = heights[(first - 1) / 4];
    let above = &heights[last..];
    Some([lower, if above.len() < UPPER_POINTS { lower } else { above[(above.len() - 1) / 4] }])
}

/// The lower quartile.
fn quartile(heights: &mut [i32]) -> i32 {
    let rank = (heights.len() - 1) / 4;
    *heights.select_nth_unstable(rank).1
}

/// The ground around a tile.
#[derive(Debug)]
pub(crate) struct Terrain {
    lattice: Lattice,
    /// Position in `layers` plus one: of the cells that are not rough, and of the rough cells.
    places: CellMap<u32>,
    rough: CellMap<u32>,
    /// Lower and upper height of cells with ground; equal where there is one layer.
    layers: Vec<[i64; 2]>,
    /// Offsets of cells within reach, nearest first, with their sector.
    around: Vec<([i32; 2], u8)>,
}

impl Terrain {
    /// Loads the ground for voxels within `reach` lattice units of the voxels of the tile.
    pub(crate) fn load(tile: &dyn TileWindow, reach: i64) -> Result<Self> {
        let lattice = tile.lattice();
        let further = lattice.units(REACH_M)
            + lattice.units(SPARSE_REACH_M)
            + 4 * lattice.units(CELL_M)
            + 4 * i64::from(edge(lattice));
        let mut cells = Vec::new();
        for near in tile.near(reach + further) {
            cells.extend(read(tile, near)?.cells());
        }
        Ok(Self::new(lattice, cells))
    }

    /// The ground of these cells, given their lower and upper heights.
    pub(crate) fn new(lattice: Lattice, cells: impl IntoIterator<Item = (Cell, [i64; 2])>) -> Self {
        let (cells, layers): (Vec<Cell>, Vec<[i64; 2]>) = cells.into_iter().unzip();
        let mut all = CellMap::default();
        for (place, &cell) in (1_u32..).zip(&cells) {
            *all.entry(cell) = place;
        }
        let around = around();
        let patch = Patch::new(&around, lattice);
        let (mut places, mut rough) = (CellMap::default(), CellMap::default());
        for (place, &cell) in (1_u32..).zip(&cells) {
            let cells = if patch.is_rough(cell, &all, &layers) { &mut rough } else { &mut places };
            *cells.entry(cell) = place;
        }
        Self { lattice, places, rough, layers, around }
    }

    /// The heights of the voxels above ground in lattice units.
    pub(crate) fn heights(&self, voxels: &Voxels) -> Vec<i32> {
        let units = i64::from(edge(self.lattice));
        let cell_units = self.lattice.units(CELL_M);
        let below = self.lattice.units(BELOW_UPPER_M);
        let mut surfaces = Surfaces { terrain: self, known: CellMap::default(), found: Vec::new() };
        let mut heights = vec![0; voxels.len()];
        for (column, at) in voxels.columns.cells().iter().enumerate() {
            let range = voxels.columns.voxels(column);
            let cell = at.map(|index| (i64::from(index) * units + units / 2).div_euclid(cell_units) as i32);
            let lowest = voxels.centre[range.start][2];
            let [lower, upper] = surfaces.at(cell).unwrap_or([lowest; 2]);
            for voxel in range {
                let z = voxels.centre[voxel][2];
                let base = if z >= upper - below { upper } else { lower };
                heights[voxel] = (z - base).clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32;
            }
        }
        heights
    }

    /// The lowest rough ground within reach of a cell.
    fn lowest_rough(&self, [i, j]: Cell) -> Option<i64> {
        let mut rough = self.rough.cursor();
        let offsets = [[0, 0]].into_iter().chain(self.around.iter().map(|around| around.0));
        let places = offsets.map(|by| rough.get([i.wrapping_add(by[0]), j.wrapping_add(by[1])]));
        places.filter_map(|place| Some(self.layers[place.checked_sub(1)? as usize][0])).min()
    }

    /// Lower and upper height of the ground in a cell without ground, from the cells around it.
    fn fill(&self, cell: Cell) -> Option<[i64; 2]> {
        let mut samples: Vec<([i32; 2], [i64; 2])> = Vec::with_capacity(8);
        let mut sectors = 0_u8;
        let mut places = self.places.cursor();
        for &(by, sector) in &self.around {
            if sectors & sector == 0 {
                let place = places.get([cell[0].wrapping_add(by[0]), cell[1].wrapping_add(by[1])]);
                if let Some(place) = place.checked_sub(1) {
                    samples.push((by, self.layers[place as usize]));
                    sectors |= sector;
                    if sectors == u8::MAX {
                        break;
                    }
                }
            }
        }
        if samples.is_empty() {
            return self.lowest_rough(cell).map(|lowest| [lowest; 2]);
        }
        let lower = plane(samples.iter().map(|(by, heights)| (*by, heights[0])));
        let upper = plane(samples.iter().map(|(by, heights)| (*by, heights[1])));
        let two = upper - lower >= self.lattice.units(LAYER_GAP_M);
        Some([lower, if two { upper } else { lower }])
    }
}

/// The surrounding cells that decide whether a cell is rough.
struct Patch {
    offsets: Vec<[i32; 2]>,
    /// Number of cells from which ground is not sparse.
    dense: f64,
    /// The square of [`ROUGH_M`] in lattice units.
    rough: f64,
}

impl Patch {
    /// `around` has the offsets within reach, nearest first.
    fn new(around: &[([i32; 2], u8)], lattice: Lattice) -> Self {
        let most = (SPARSE_REACH_M / CELL_M) as i32;
        let near = around.iter().map(|around| around.0).take_while(|[i, j]| i * i + j * j <= most * most);
        let offsets: Vec<[i32; 2]> = [[0, 0]].into_iter().chain(near).collect();
        let dense = SPARSE * offsets.len() as f64;
        Self { offsets, dense, rough: (lattice.units(ROUGH_M) as f64).powi(2) }
    }

    /// Whether the ground around a cell is sparse and rough. `all` has positions in `layers` plus one.
    fn is_rough(&self, [i, j]: Cell, all: &CellMap<u32>, layers: &[[i64; 2]]) -> bool {
        let mut all = all.cursor();
        let mut plane = Plane::default();
        let mut count = 0_u32;
        for &by in &self.offsets {
            if let Some(place) = all.get([i.wrapping_add(by[0]), j.wrapping_add(by[1])]).checked_sub(1) {
                plane.add(by, layers[place as usize][0], 1.0);
                count += 1;
                if f64::from(count) >= self.dense {
                    return false;
                }
            }
        }
        count < FEWEST || plane.residual() > self.rough
    }
}

/// Surfaces of cells, each computed once.
struct Surfaces<'a> {
    terrain: &'a Terrain,
    /// Position in `found` plus one.
    known: CellMap<u32>,
    found: Vec<Option<[i64; 2]>>,
}

impl Surfaces<'_> {
    fn at(&mut self, cell: Cell) -> Option<[i64; 2]> {
        if let Some(place) = self.terrain.places.get(cell).checked_sub(1) {
            return Some(self.terrain.layers[place as usize]);
        }
        if let Some(place) = self.known.get(cell).checked_sub(1) {
            return self.found[place as usize];
        }
        let surface = self.terrain.fill(cell);
        self.found.push(surface);
        *self.known.entry(cell) = self.found.len() as u32;
        surface
    }
}

/// Offsets within reach in ascending (distance, i, j), with a bit for the sector. A sector contains the
/// direction at which it begins, but not the one at which it ends.
fn around() -> Vec<([i32; 2], u8)> {
    let most = (REACH_M / CELL_M) as i32;
    let mut offsets: Vec<(i32, [i32; 2])> = (-most..=most)
        .flat_map(|i| (-most..=most).map(move |j| (i * i + j * j, [i, j])))
        .filter(|(square, _)| (1..=most * most).contains(square))
        .collect();
    offsets.sort_unstable();
    offsets.into_iter().map(|(_, by)| (by, sector(by))).collect()
}

/// The bit of the sector of 45 degrees that contains a direction.
fn sector([i, j]: [i32; 2]) -> u8 {
    let (quadrant, along, across) = if i > 0 && j >= 0 {
        (0, i, j)
    } else if i <= 0 && j > 0 {
        (1, j, -i)
    } else if i < 0 && j <= 0 {
        (2, -i, -j)
    } else {
        (3, -j, i)
    };
    1 << (2 * quadrant + u8::from(across >= along))
}

/// The height at offset (0, 0) of the plane through heights at offsets, with weights 1 / d^2.
fn plane(samples: impl Iterator<Item = ([i32; 2], i64)>) -> i64 {
    let mut plane = Plane::default();
    samples.for_each(|(by @ [i, j], height)| plane.add(by, height, 1.0 / f64::from(i * i + j * j)));
    plane.height()
}

/// The ground raster of a tile.
fn read(drive: &(impl DriveWindow + ?Sized), tile: TileId) -> Result<StoredGround> {
    codec::decode(codec::section(&drive.payload(STEP_VOXELS, tile)?, SECTION_GROUND)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ground z = 0.1 x - 0.04 y, in lattice units, in the cells that `keep` accepts.
    fn slope(keep: impl Fn(Cell) -> bool) -> Terrain {
        let cells = (-40..40).flat_map(|i| (-40..40).map(move |j| [i, j])).filter(|cell| keep(*cell));
        Terrain::new(Lattice::MILLIMETRE, cells.map(|cell| (cell, [plane_at(cell); 2])))
    }

    fn plane_at([i, j]: Cell) -> i64 {
        i64::from(i * 50 - j * 20) + 7_000
    }

    #[test]
    fn gaps_follow_a_slope() {
        // A gap of 5 m by 2.5 m, as below a car.
        let terrain = slope(|[i, j]| !((-5..5).contains(&i) && (-2..3).contains(&j)));
        for i in -5..5 {
            for j in -2..3 {
                let [lower, upper] = terrain.fill([i, j]).unwrap();
                assert_eq!(lower, upper);
                assert!((lower - plane_at([i, j])).abs() <= 21, "{i} {j}: {lower}");
            }
        }
    }

    #[test]
    fn beyond_the_edge_of_the_ground_a_kerb_goes_on_level() {
        // A step of 0.12 m between the last two rows of cells before the gap.
        let step = |[i, _]: Cell| if i < -1 { 0 } else { 120 };
        let cells = (-40..0).flat_map(|i| (-40..40).map(move |j| [i, j]));
        let terrain = Terrain::new(Lattice::MILLIMETRE, cells.map(|cell| (cell, [step(cell); 2])));
        for i in 0..20 {
            let [lower, _] = terrain.fill([i, 0]).unwrap();
            assert!((lower - 120).abs() <= 2, "{i}: {lower}");
        }
    }

    #[test]
    fn sectors_are_eight_and_ground_beyond_the_reach_does_not_count() {
        let mut counts = [0; 8];
        for (by, sector) in around() {
            assert!(by[0] * by[0] + by[1] * by[1] <= 24 * 24);
            counts[sector.trailing_zeros() as usize] += 1;
        }
        // The axes are in the even sectors, the diagonals in the odd ones.
        assert_eq!(counts, [228, 220].repeat(4)[..]);
        let patch = |i: i32, j: i32, height| {
            let cells = [[0, 0], [1, 0], [0, -1], [1, -1]];
            cells.map(|[di, dj]| ([i + di, j + dj], [height; 2]))
        };
        let terrain = Terrain::new(Lattice::MILLIMETRE, [patch(25, 0, 0), patch(0, -24, 50)].concat());
        assert_eq!(terrain.fill([0, 0]), Some([50; 2]));
        assert_eq!(terrain.fill([-1, 1]), None);
    }

    #[test]
    fn heights_below_a_crown_are_over_the_ground_beside_it_or_over_its_lowest_bough() {
        // Ground up to 7 m from the crown, and an eighth of 5 x 5 m of its lower side, 2.1 to 4.2 m above.
        let bough = |[i, j]: Cell| 2_100 + i64::from((i * 3 + j * j * 5 + i * j).rem_euclid(4)) * 700;
        let places = (0..10).flat_map(|i| (0..10).map(move |j| [i, j]));
        let below = places.filter(|[i, j]| (i + 3 * j) % 8 == 0).map(|cell| (cell, [bough(cell); 2]));
        let below: Vec<_> = below.collect();
        let ground = (-20..-14).flat_map(|i| (0..10).map(move |j| ([i, j], [0; 2])));
        let at = |terrain: &Terrain, cell: Cell| {
            Surfaces { terrain, known: CellMap::default(), found: Vec::new() }.at(cell)
        };
        let beside = Terrain::new(Lattice::MILLIMETRE, ground.chain(below.iter().copied()));
        assert!(below.iter().all(|(cell, _)| at(&beside, *cell) == Some([0; 2])));
        let alone = Terrain::new(Lattice::MILLIMETRE, below.iter().copied());
        assert!(below.iter().all(|(cell, _)| at(&alone, *cell) == Some([2_100; 2])));
        // On an equally sparse slope, every cell has its own height.
        let slope = below.iter().map(|&(cell @ [i, _], _)| (cell, [150 * i64::from(i); 2]));
        let slope: Vec<_> = slope.collect();
        let terrain = Terrain::new(Lattice::MILLIMETRE, slope.iter().copied());
        assert!(slope.iter().all(|&(cell, height)| at(&terrain, cell) == Some(height)));
    }

    #[test]
    fn a_bridge_is_a_second_layer() {
        let mut heights = vec![6_000, 10, 20, 6_010, 0, 30, 6_020];
        assert_eq!(layers(&mut heights, 2_500), Some([0, 6_000]));
        assert_eq!(layers(&mut [0, 10, 6_000], 2_500), Some([0, 0]), "one point is no bridge");
        assert_eq!(layers(&mut [0, 1_000, 2_000, 3_000, 4_000], 2_500), Some([1_000; 2]), "a steep bank");
        assert_eq!(layers(&mut [], 2_500), None);
        let cells = [[0, 0], [2, 0], [0, 2], [2, 2]].map(|cell| (cell, [0, 6_000]));
        let terrain = Terrain::new(Lattice::MILLIMETRE, cells);
        let points: Vec<[i64; 3]> =
            [100, 600].into_iter().flat_map(|x| [1_000, 5_000, 5_700, 8_000].map(|z| [x, 100, z])).collect();
        let voxels = Voxels::of_points(Lattice::MILLIMETRE, &points);
        assert_eq!(terrain.heights(&voxels), [1_000, 5_000, -300, 2_000, 1_000, 5_000, -300, 2_000]);
    }
}

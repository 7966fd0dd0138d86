//! The voxels of a tile and around it: how a tile stores those that it owns, and how a step loads them. This
//! file has neither points nor classes.
//!
//! A tile owns whole columns of voxels. Its voxels are stored in ascending (i, j, k). A later step may store
//! one value per voxel in the same order, and [`Voxels::gather`] brings the values of all tiles together.
#![expect(
    clippy::cast_possible_truncation,
    reason = "voxels of a tile fit u32 (VoxelIndex), reaches are a few metres"
)]

use std::collections::BTreeMap;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::cluster::columns::{Columns, Voxel};
use crate::cluster::street::settings::{STEP_VOXELS, edge};
use crate::cluster::{DriveWindow, TileWindow};
use crate::codec;
use crate::error::{Error, Result};
use crate::model::{Lattice, TileId};
use crate::spatial::{Cell, CellGrid, CellMap};

/// Sections of the payload of the step `voxels`.
pub(crate) const SECTION_VOXELS: usize = 0;
pub(crate) const SECTION_GROUND: usize = 1;
pub(crate) const SECTION_COUNTS: usize = 2;

/// Edge, in columns, of the squares by which the columns near a tile are found.
const SQUARE: i32 = 8;

/// Voxels in ascending order of their keys, stored as differences to the previous one: 7 to 10 bytes per
/// voxel, because small numbers are encoded in few bytes.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct StoredVoxels {
    /// Differences of i and j to the previous column, and the number of voxels.
    columns: Vec<(i32, i32, u32)>,
    /// Differences of k to the previous voxel, also across columns.
    k: Vec<i32>,
    /// Points of each voxel.
    points: Vec<u32>,
    /// Centre of the points of each voxel, from its lowest corner, in lattice units.
    offset: Vec<[u16; 3]>,
}

impl StoredVoxels {
    /// Number of voxels.
    pub(crate) fn len(&self) -> usize {
        self.k.len()
    }

    /// Points of each voxel.
    pub(crate) fn points(&self) -> &[u32] {
        &self.points
    }

    /// Keys of the voxels, ascending.
    pub(crate) fn keys(&self) -> impl Iterator<Item = Voxel> + '_ {
        let mut k = 0;
        let columns = self.columns.iter().scan([0, 0], |at, &(di, dj, count)| {
            *at = [at[0] + di, at[1] + dj];
            Some((*at, count))
        });
        let cells = columns.flat_map(|(cell, count)| std::iter::repeat_n(cell, count as usize));
        cells.zip(&self.k).map(move |([i, j], step)| [i, j, add(&mut k, *step)])
    }

    /// Columns and the range of their voxels.
    fn columns(&self) -> impl Iterator<Item = ([i32; 2], Range<usize>)> + '_ {
        let mut end = 0;
        let mut at = [0, 0];
        self.columns.iter().map(move |&(di, dj, count)| {
            at = [at[0] + di, at[1] + dj];
            let start = end;
            end += count as usize;
            (at, start..end)
        })
    }
}

/// Collects voxels, which must come in ascending order.
#[derive(Debug, Default)]
pub(crate) struct Storing {
    stored: StoredVoxels,
    last: Voxel,
}

impl Storing {
    /// Adds a voxel: its number of points, and the sums of their offsets from its lowest corner. The centre
    /// is the mean, rounded down to a lattice unit.
    pub(crate) fn push(&mut self, key: Voxel, points: u32, sums: [u64; 3]) {
        let [i, j, k] = key;
        match self.stored.columns.last_mut() {
            Some(column) if self.last[..2] == key[..2] => column.2 += 1,
            _ => self.stored.columns.push((i - self.last[0], j - self.last[1], 1)),
        }
        self.stored.k.push(k - self.last[2]);
        self.stored.points.push(points);
        self.stored.offset.push(sums.map(|sum| (sum / u64::from(points.max(1))) as u16));
        self.last = key;
    }

    /// The voxels in the form of the payload.
    pub(crate) fn finish(self) -> StoredVoxels {
        self.stored
    }
}

/// Voxels of a tile and around it, in ascending (i, j, k).
#[derive(Debug)]
pub(crate) struct Voxels {
    /// The lattice of the run.
    pub(crate) lattice: Lattice,
    /// Keys on the global lattice: the lowest corner is `key * edge`.
    pub(crate) key: Vec<Voxel>,
    /// Points that are neither ground nor noise.
    pub(crate) points: Vec<u32>,
    /// Mean position of the points in lattice units, rounded down.
    pub(crate) centre: Vec<[i64; 3]>,
    /// Whether the tile owns the voxel. The owned voxels have the order in which the tile stores them.
    pub(crate) owned: Vec<bool>,
    /// The tile that owns the voxel, and the position among its voxels.
    pub(crate) origin: Vec<(TileId, u32)>,
    /// The voxels as columns.
    pub(crate) columns: Columns,
}

impl Voxels {
    /// Loads the voxels of a tile, and every voxel whose column is within `reach` lattice units of a column
    /// of the tile. Some columns further away may be among them.
    pub(crate) fn load(tile: &dyn TileWindow, reach: i64) -> Result<Self> {
        Self::load_with(tile, reach, &[])
    }

    /// Loads these voxels, and those around the columns `also`. A tile may have points in a column that
    /// another tile owns, far from any column of its own.
    pub(crate) fn load_with(tile: &dyn TileWindow, reach: i64, also: &[Cell]) -> Result<Self> {
        let units = i64::from(edge(tile.lattice()));
        let own = read(tile, tile.tile())?;
        let columns = own.columns().map(|column| column.0).chain(also.iter().copied());
        let near = Near::around(columns, reach.div_euclid(units) + 1);
        let mut found: Vec<([i32; 2], u32, Range<usize>)> = Vec::new();
        let mut tiles: Vec<(TileId, StoredVoxels)> = vec![(tile.tile(), own)];
        // The owner of a column owns a cell that meets it: at most two edges away on both sides.
        for other in tile.near(reach + 4 * units).into_iter().filter(|&other| other != tile.tile()) {
            tiles.push((other, read(tile, other)?));
        }
        for ((_, stored), number) in tiles.iter().zip(0_u32..) {
            let columns = stored.columns().filter(|(cell, _)| near.holds(*cell));
            found.extend(columns.map(|(cell, range)| (cell, number, range)));
        }
        found.sort_unstable_by_key(|column| column.0);
        Self::of(tile.lattice(), tile.tile(), &tiles, &found)
    }

    fn of(
        lattice: Lattice,
        own: TileId,
        tiles: &[(TileId, StoredVoxels)],
        found: &[([i32; 2], u32, Range<usize>)],
    ) -> Result<Self> {
        let units = i64::from(edge(lattice));
        let count = found.iter().map(|column| column.2.len()).sum();
        let heights: Vec<Vec<i32>> = tiles
            .iter()
            .map(|(_, stored)| stored.k.iter().scan(0, |k, step| Some(add(k, *step))).collect())
            .collect();
        let mut key = Vec::with_capacity(count);
        let mut points = Vec::with_capacity(count);
        let mut centre = Vec::with_capacity(count);
        let mut owned = Vec::with_capacity(count);
        let mut origin = Vec::with_capacity(count);
        for ([i, j], number, range) in found {
            let (tile, stored) = &tiles[*number as usize];
            for position in range.clone() {
                let at = [*i, *j, heights[*number as usize][position]];
                let offset = stored.offset[position];
                key.push(at);
                points.push(stored.points[position]);
                centre.push([0, 1, 2].map(|axis| i64::from(at[axis]) * units + i64::from(offset[axis])));
                owned.push(*tile == own);
                origin.push((*tile, position as u32));
            }
        }
        let columns = Columns::new(key.iter().copied());
        if columns.cells().len() != found.len() {
            return Err(Error::bug("two tiles own one column of voxels"));
        }
        Ok(Self { lattice, key, points, centre, owned, origin, columns })
    }

    /// Number of voxels.
    pub(crate) fn len(&self) -> usize {
        self.key.len()
    }

    /// The voxel with a key.
    pub(crate) fn find(&self, key: Voxel) -> Option<usize> {
        self.key.binary_search(&key).ok()
    }

    /// The loaded voxels of each tile: their positions among the voxels of the tile, ascending, and their
    /// numbers here.
    pub(crate) fn by_tile(&self) -> BTreeMap<TileId, Vec<(u32, u32)>> {
        let mut tiles = BTreeMap::<TileId, Vec<(u32, u32)>>::new();
        for (number, &(tile, position)) in (0_u32..).zip(&self.origin) {
            tiles.entry(tile).or_default().push((position, number));
        }
        tiles
    }

    /// Collects the values that a step stored for the voxels of each tile. `read` gives one value per voxel
    /// of a tile, in the order in which the tile stores its voxels.
    pub(crate) fn gather<T: Copy>(&self, mut read: impl FnMut(TileId) -> Result<Vec<T>>) -> Result<Vec<T>> {
        let mut tiles: Vec<TileId> = self.origin.iter().map(|origin| origin.0).collect();
        tiles.sort_unstable();
        tiles.dedup();
        let stored = tiles.iter().map(|&tile| read(tile)).collect::<Result<Vec<_>>>()?;
        let mut last = (TileId::default(), None);
        let value = |&(tile, position): &(TileId, u32)| {
            if last.1.is_none() || last.0 != tile {
                last = (tile, tiles.binary_search(&tile).ok());
            }
            let found = last.1.and_then(|number| stored[number].get(position as usize)).copied();
            found.ok_or_else(|| Error::bug(format!("voxel {position} of tile {tile:?} has no value")))
        };
        self.origin.iter().map(value).collect()
    }
}

fn add(sum: &mut i32, step: i32) -> i32 {
    *sum += step;
    *sum
}

/// The voxels that a tile owns.
pub(crate) fn read(drive: &(impl DriveWindow + ?Sized), tile: TileId) -> Result<StoredVoxels> {
    codec::decode(codec::section(&drive.payload(STEP_VOXELS, tile)?, SECTION_VOXELS)?)
}

/// The columns near those of a tile, found by squares of columns.
struct Near {
    grid: CellGrid,
    squares: CellMap<u8>,
}

impl Near {
    /// The columns within `steps` columns of these.
    fn around(columns: impl Iterator<Item = Cell>, steps: i64) -> Self {
        let grid = CellGrid::new(i64::from(SQUARE));
        let disc = grid.disc(steps);
        let mut squares = CellMap::default();
        let mut done = CellMap::<u8>::default();
        for column in columns {
            let square = column.map(|index| index.div_euclid(SQUARE));
            if std::mem::replace(done.entry(square), 1) == 0 {
                disc.iter().for_each(|by| *squares.entry([square[0] + by[0], square[1] + by[1]]) = 1);
            }
        }
        Self { grid, squares }
    }

    fn holds(&self, column: [i32; 2]) -> bool {
        let [i, j] = column.map(i64::from);
        self.grid.cell(i, j).is_some_and(|square| self.squares.get(square) == 1)
    }
}

#[cfg(test)]
impl Voxels {
    /// The voxels of some points, all owned by one tile.
    pub(crate) fn of_points(lattice: Lattice, points: &[[i64; 3]]) -> Self {
        let units = i64::from(edge(lattice));
        let mut keyed: Vec<(Voxel, [u64; 3])> = points
            .iter()
            .map(|point| {
                let key = point.map(|value| i32::try_from(value.div_euclid(units)).unwrap());
                (key, point.map(|value| value.rem_euclid(units).unsigned_abs()))
            })
            .collect();
        keyed.sort_unstable();
        let mut storing = Storing::default();
        for voxel in keyed.chunk_by(|a, b| a.0 == b.0) {
            let sums = [0, 1, 2].map(|axis| voxel.iter().map(|point| point.1[axis]).sum());
            storing.push(voxel[0].0, voxel.len() as u32, sums);
        }
        let stored = storing.finish();
        let found: Vec<_> = stored.columns().map(|(cell, range)| (cell, 0, range)).collect();
        let tile = TileId::new(0);
        Self::of(lattice, tile, &[(tile, stored)], &found).unwrap()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn voxels_return_from_their_stored_form_with_the_mean_of_their_points() {
        let points = [[-1, 0, 0], [-3, 0, 5], [0, 149, 149], [0, 149, 150], [-1, 0, -4_000], [40_000, -7, 1]];
        let voxels = Voxels::of_points(Lattice::MILLIMETRE, &points);
        assert_eq!(voxels.key, [[-1, 0, -27], [-1, 0, 0], [0, 0, 0], [0, 0, 1], [266, -1, 0]]);
        assert_eq!(voxels.points, [1, 2, 1, 1, 1]);
        assert_eq!(voxels.centre[1], [-2, 0, 2]);
        assert_eq!(voxels.centre[0], [-1, 0, -4_000]);
        assert_eq!(voxels.find([0, 0, 1]), Some(3));
        assert_eq!(voxels.find([0, 1, 1]), None);
        let stored: StoredVoxels = codec::decode(&codec::encode(&StoredVoxels::default()).unwrap()).unwrap();
        assert_eq!(stored.len(), 0);
    }

    /// The tile has points in the second column, but another tile owns it.
    #[test]
    fn every_column_within_reach_is_near() {
        let near = Near::around([[-3, 5], [40, 7]].into_iter(), 10);
        let gap = |a: i32, b: i32| (i64::from(a.abs_diff(b)) - 1).max(0);
        for i in -40..80 {
            for j in -30..40 {
                let within = |[x, y]: [i32; 2]| gap(i, x).pow(2) + gap(j, y).pow(2) <= 100;
                assert!(near.holds([i, j]) || !(within([-3, 5]) || within([40, 7])), "{i} {j}");
            }
        }
        assert!(!near.holds([-40, 5]) && !near.holds([18, 30]), "far columns are left out");
    }
}

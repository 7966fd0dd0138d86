//! Stage `peaks`: height above ground, density, parent, delta and centres of the voxels of a tile (section
//! 3.2 of the paper). Its reduction resolves the chains of parents that leave a tile, over the whole drive.
//! It works only on voxels, not on points.
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "voxels of a tile fit u32, squared distances of indices within reach are small"
)]

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::ops::Range;

use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

use super::decision::density_class;
use super::settings::{DensityPeaksConfig, STAGE_PEAKS, STAGE_VOXELS};
use super::stage_voxels::{self, StoredVoxel};
use crate::cluster::columns::{Columns, Finder, Voxel, disc};
use crate::cluster::sliced;
use crate::cluster::{DriveWindow, Mapped, TileWindow};
use crate::codec;
use crate::error::{Error, Result};
use crate::model::TileId;
use crate::spatial::{Cell, CellMap};

/// Search distance for ground around a column, in metres (chosen; the paper says "the horizontally closest").
pub(super) const GROUND_SEARCH_M: f64 = 10.0;

/// The payload of a tile.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct PeaksPayload {
    /// The end of the chain of parents of each voxel of the tile, in the order of its columns. 0 without a
    /// centre, otherwise 1 + position in the list of `centres` followed by `exits`.
    pub(super) ends: Vec<u32>,
    /// Centres: density, and squared delta.
    pub(super) centres: Vec<(f64, u32)>,
    /// Voxels of other tiles to which chains lead: tile, and position among its voxels.
    exits: Vec<(TileId, u32)>,
    /// The decision graph: class of density, squared delta, number of voxels.
    pub(super) graph: Vec<(u32, u32, u64)>,
}

/// Number of clusters, which equals the number of centres, from the global of this stage.
pub(super) fn clusters(global: &[u8]) -> Result<u32> {
    sliced::head(global)
}

/// Cluster (from 1) of every end of a tile except end 0, from the global of this stage. 0: the chain ends
/// without a centre.
pub(super) fn ends(global: &[u8], tile: TileId) -> Result<Vec<u32>> {
    sliced::slice(global, tile)
}

/// Voxels of a tile and of its surroundings, with the values for the search for parents.
struct Neighbourhood {
    columns: Columns,
    /// Component over the drive.
    component: Vec<u32>,
    /// Tile, and position among its voxels.
    origin: Vec<(TileId, u32)>,
    density: Vec<f64>,
    /// Largest density of each column.
    densest: Vec<f64>,
}

impl Neighbourhood {
    /// Loads the voxels in the columns of the tile and within the search radius around them, with their
    /// densities.
    fn load(tile: &dyn TileWindow, config: &DensityPeaksConfig, edge: u32) -> Result<Self> {
        let units = i64::from(edge);
        let steps = config.search_radius.ceil() as i32;
        let ground_units = tile.lattice().units(GROUND_SEARCH_M);
        let ground_steps = (ground_units / units) as i32;
        let global = tile.global(STAGE_VOXELS);
        let own = stage_voxels::load(tile, tile.tile())?;
        let window = Window::around(own.columns().map(|column| column.0));
        let voxel_window = window.grown(steps);
        let ground_window = voxel_window.grown(ground_steps);
        // Column, tile, and the range of the column's voxels among those of the tile.
        let mut found: Vec<(Cell, TileId, Range<usize>)> = Vec::new();
        let mut tiles = BTreeMap::<TileId, (Vec<StoredVoxel>, Vec<u32>)>::new();
        let mut ground: Vec<(Cell, i32)> = Vec::new();
        for near in tile.near(i64::from(steps + 2 + ground_steps + 2) * units) {
            let payload = stage_voxels::load(tile, near)?;
            ground.extend(payload.ground.iter().filter(|column| ground_window.holds(column.0)));
            let before = found.len();
            let columns = payload.columns().filter(|column| voxel_window.holds(column.0));
            found.extend(columns.map(|(cell, voxels)| (cell, near, voxels)));
            if found.len() > before {
                tiles.insert(near, (payload.stored, stage_voxels::components(global, near)?));
            }
        }
        found.sort_unstable_by_key(|column| column.0);
        let columns = Columns::new(found.iter().flat_map(|(cell, near, voxels)| {
            tiles[near].0[voxels.clone()].iter().map(|voxel| [cell[0], cell[1], voxel.k])
        }));
        let mut stored = Vec::new();
        let mut component = Vec::new();
        let mut origin = Vec::new();
        for (_, near, voxels) in found {
            let (of_tile, components) = &tiles[&near];
            let here = &of_tile[voxels.clone()];
            component.extend(here.iter().map(|voxel| components[voxel.component as usize]));
            origin.extend(voxels.map(|position| (near, position as u32)));
            stored.extend_from_slice(here);
        }
        drop(tiles);
        let base = Ground::new(&ground).below(&columns, ground_units.pow(2) / units.pow(2));
        let most = match config.most_points {
            0 => stage_voxels::most(global)?,
            given => given,
        };
        let density = densities(&columns, &stored, &base, most, config);
        let column = |column: usize| density[columns.voxels(column)].iter().copied();
        let densest = (0..columns.cells().len()).map(|number| column(number).fold(0.0, f64::max)).collect();
        Ok(Self { columns, component, origin, density, densest })
    }

    /// The order of densities: larger density first, ties by (k, j, i).
    fn order(&self, (a, at_a): (usize, Voxel), (b, at_b): (usize, Voxel)) -> Ordering {
        let reversed = |[i, j, k]: Voxel| [k, j, i];
        self.density[b].total_cmp(&self.density[a]).then_with(|| reversed(at_a).cmp(&reversed(at_b)))
    }

    fn denser(&self, a: (usize, Voxel), b: (usize, Voxel)) -> bool {
        self.order(a, b).is_lt()
    }

    /// The nearest denser voxel of the same component at a squared distance below `limit`, with that
    /// distance. Of equally near voxels, it is the densest. Columns are visited in the order of their
    /// distance, and columns without a denser voxel are skipped. Within a column, voxels are visited from the
    /// nearest outwards up to the first denser one. For most voxels the parent is the voxel below, and the
    /// search ends at once. The bench `nearest_denser` compares this with four other ways
    /// (`benches/results/nearest-denser.md`).
    fn parent(
        &self,
        finder: &mut Finder<'_>,
        steps: &[(i64, [i32; 2])],
        voxel: (usize, Voxel),
        limit: f64,
    ) -> Option<(i64, usize)> {
        let (number, at) = voxel;
        let heights = self.columns.heights();
        let mut best: Option<(i64, usize, Voxel)> = None;
        for &(across, [di, dj]) in steps {
            if best.is_some_and(|best| across > best.0) {
                break;
            }
            let cell = [at[0] + di, at[1] + dj];
            let Some(column) = finder.number(cell) else { continue };
            if self.densest[column] < self.density[number] {
                continue;
            }
            let range = self.columns.voxels(column);
            let middle = range.start + heights[range.clone()].partition_point(|&k| k < at[2]);
            let mut see = |other: usize| {
                let k = heights[other];
                let distance = across + i64::from(k - at[2]).pow(2);
                if distance as f64 >= limit || best.is_some_and(|best| distance > best.0) {
                    return false;
                }
                let there = [cell[0], cell[1], k];
                let fits = other != number
                    && self.component[other] == self.component[number]
                    && self.denser((other, there), voxel);
                if !fits {
                    return true;
                }
                if best.is_none_or(|best| distance < best.0 || self.denser((other, there), (best.1, best.2)))
                {
                    best = Some((distance, other, there));
                }
                false
            };
            let _ = (middle..range.end).all(&mut see);
            let _ = (range.start..middle).rev().all(&mut see);
        }
        best.map(|best| (best.0, best.1))
    }
}

/// A rectangle of columns.
#[derive(Debug, Clone, Copy)]
struct Window {
    lo: Cell,
    hi: Cell,
}

impl Window {
    fn around(cells: impl Iterator<Item = Cell>) -> Self {
        let mut window = Self { lo: [i32::MAX; 2], hi: [i32::MIN; 2] };
        for cell in cells {
            window.lo = [0, 1].map(|axis| window.lo[axis].min(cell[axis]));
            window.hi = [0, 1].map(|axis| window.hi[axis].max(cell[axis]));
        }
        window
    }

    fn grown(self, by: i32) -> Self {
        Self {
            lo: self.lo.map(|low| low.saturating_sub(by)),
            hi: self.hi.map(|high| high.saturating_add(by)),
        }
    }

    fn holds(&self, cell: Cell) -> bool {
        (0..2).all(|axis| (self.lo[axis]..=self.hi[axis]).contains(&cell[axis]))
    }
}

/// Lowest ground voxels by column.
struct Ground<'a> {
    columns: &'a [(Cell, i32)],
    places: CellMap<u32>,
}

impl<'a> Ground<'a> {
    fn new(columns: &'a [(Cell, i32)]) -> Self {
        let mut places = CellMap::default();
        for (place, (cell, _)) in (1_u32..).zip(columns) {
            *places.entry(*cell) = place;
        }
        Self { columns, places }
    }

    /// For each column, k of the horizontally nearest ground voxel at a squared distance of at most `most`.
    /// Of equally near ones, the lowest. Without ground nearby, k of the lowest voxel of the column itself.
    fn below(&self, columns: &Columns, most: i64) -> Vec<i32> {
        let steps = disc(most);
        let mut places = self.places.cursor();
        let nearest = |(column, &[i, j]): (usize, &Cell)| {
            let mut found: Option<(i64, i32)> = None;
            for &(distance, [di, dj]) in &steps {
                if found.is_some_and(|found| distance > found.0) {
                    break;
                }
                let place = places.get([i + di, j + dj]) as usize;
                if place > 0 {
                    let k = self.columns[place - 1].1;
                    found = Some((distance, found.map_or(k, |found| found.1.min(k))));
                }
            }
            found.map_or_else(|| columns.heights()[columns.voxels(column).start], |found| found.1)
        };
        columns.cells().iter().enumerate().map(nearest).collect()
    }
}

/// Equation 3, as one fixed formula over exact integers, so that every tile computes the same number.
fn densities(
    columns: &Columns,
    stored: &[StoredVoxel],
    base: &[i32],
    most: u32,
    config: &DensityPeaksConfig,
) -> Vec<f64> {
    let heights = columns.heights();
    let mut density = Vec::with_capacity(stored.len());
    for (column, &ground) in base.iter().enumerate() {
        let voxels = columns.voxels(column);
        let mut start = voxels.start;
        while start < voxels.end {
            let mut end = start + 1;
            while end < voxels.end && heights[end] - heights[end - 1] == 1 {
                end += 1;
            }
            let length = (end - start) as f64;
            for voxel in start..end {
                let position = (voxel - start) as f64;
                let rho = length - position / length + f64::from(stored[voxel].points) / f64::from(most);
                let above = f64::from(heights[voxel] - ground);
                density.push(if above >= config.scale_above { rho / above.max(1.0) } else { rho });
            }
            start = end;
        }
    }
    density
}

/// The end of a chain of parents during the work on a tile.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum End {
    /// The chain ends without a centre.
    Nowhere,
    /// The chain ends at this centre, from 1.
    Centre(u32),
    /// The chain leads to this voxel of another tile, from 1.
    Exit(u32),
}

/// The payload of a tile.
pub(super) fn map(tile: &dyn TileWindow, config: &DensityPeaksConfig, edge: u32) -> Result<Mapped> {
    let around = Neighbourhood::load(tile, config, edge)?;
    let indices: Vec<Voxel> = around.columns.indices().collect();
    let mut own: Vec<usize> =
        (0..indices.len()).filter(|&voxel| around.origin[voxel].0 == tile.tile()).collect();
    own.sort_unstable_by(|&a, &b| around.order((a, indices[a]), (b, indices[b])));
    let mut ends = vec![End::Nowhere; own.len()];
    let mut payload = PeaksPayload::default();
    let mut exits = FxHashMap::<(TileId, u32), u32>::default();
    let mut graph = BTreeMap::<(u32, u32), u64>::new();
    let limit = config.search_radius.powi(2);
    let steps = disc(limit.ceil() as i64);
    let mut finder = around.columns.finder();
    for voxel in own {
        let parent = around.parent(&mut finder, &steps, (voxel, indices[voxel]), limit);
        let rho = around.density[voxel];
        let delta = parent.map_or(limit, |parent| parent.0 as f64);
        *graph.entry((density_class(rho), delta as u32)).or_default() += 1;
        let slot = around.origin[voxel].1 as usize;
        if rho > config.min_density && delta > config.min_separation.powi(2) {
            payload.centres.push((rho, delta as u32));
            ends[slot] = End::Centre(payload.centres.len() as u32);
        } else if let Some((_, parent)) = parent {
            let origin = around.origin[parent];
            ends[slot] = if origin.0 == tile.tile() {
                // The parent is denser, so its end is already known.
                ends[origin.1 as usize]
            } else {
                End::Exit(*exits.entry(origin).or_insert_with(|| {
                    payload.exits.push(origin);
                    payload.exits.len() as u32
                }))
            };
        }
    }
    let centres = payload.centres.len() as u32;
    let code = |end| match end {
        End::Nowhere => 0,
        End::Centre(centre) => centre,
        End::Exit(exit) => centres + exit,
    };
    payload.ends = ends.into_iter().map(code).collect();
    payload.graph = graph.into_iter().map(|((rho, delta), count)| (rho, delta, count)).collect();
    Ok(Mapped::payload(codec::encode(&payload)?))
}

/// A chain that leaves a tile: its end there, and the voxel to which it leads.
struct Exit {
    /// Tile that it leaves, and number of its end there (from 1).
    from: (TileId, u32),
    /// Tile, and position among its voxels.
    to: (TileId, u32),
}

/// The cluster of every end. It keeps the ends of all tiles and the exits in memory, but no voxels. Only
/// chains from voxels near borders leave a tile, so the exits are few.
pub(super) fn reduce(drive: &dyn DriveWindow) -> Result<Vec<u8>> {
    let mut ends: Vec<Vec<u32>> = Vec::new();
    let mut exits: Vec<Exit> = Vec::new();
    let mut clusters = 0;
    for tile in TileId::first(drive.tiles()) {
        let payload = load(drive, tile)?;
        let centres = payload.centres.len() as u32;
        ends.push((clusters + 1..=clusters + centres).chain(payload.exits.iter().map(|_| 0)).collect());
        exits.extend((centres + 1..).zip(&payload.exits).map(|(end, &to)| Exit { from: (tile, end), to }));
        clusters += centres;
    }
    // Finds the end to which each exit leads. The exits are sorted, so that each tile is loaded once.
    exits.sort_unstable_by_key(|exit| exit.to);
    let mut loaded = None;
    let mut next: Vec<Vec<u32>> = ends.iter().map(|ends| vec![0; ends.len()]).collect();
    let mut target = FxHashMap::<(TileId, u32), (TileId, u32)>::default();
    for exit in &exits {
        let (tile, position) = exit.to;
        if loaded.as_ref().is_none_or(|(number, _)| *number != tile) {
            loaded = Some((tile, load(drive, tile)?));
        }
        let end = loaded.as_ref().and_then(|(_, payload)| payload.ends.get(position as usize).copied());
        let end = end.ok_or_else(|| Error::bug(format!("tile {tile} has no voxel {position}")))?;
        target.insert(exit.from, (tile, end));
    }
    // Density grows along a chain, so every chain ends.
    for exit in &exits {
        let mut at = exit.from;
        while let Some(&on) = target.get(&at) {
            at = on;
        }
        let (tile, end) = at;
        let cluster = end.checked_sub(1).map_or(0, |end| ends[tile.index()][end as usize]);
        next[exit.from.0.index()][exit.from.1 as usize - 1] = cluster;
    }
    for (ends, next) in ends.iter_mut().zip(next) {
        ends.iter_mut().zip(next).filter(|(end, _)| **end == 0).for_each(|(end, cluster)| *end = cluster);
    }
    sliced::encode(&clusters, &ends)
}

/// The payload of a tile, decoded.
pub(super) fn load(drive: &dyn DriveWindow, tile: TileId) -> Result<PeaksPayload> {
    codec::decode(&drive.payload(STAGE_PEAKS, tile)?)
}

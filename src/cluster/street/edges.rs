//! Step `edges`: which voxels are neighbours. Growth needs it in every round, so it is found once.
//!
//! A voxel has edges to the voxels that touch it or, where these are few, to the nearest ones further away. An
//! edge of one end is an edge of both.
#![expect(clippy::cast_possible_truncation, reason = "voxels of a tile fit u32; lengths are a few voxels")]

use serde::{Deserialize, Serialize};

use super::settings::{EDGE_M, STEP_EDGES};
use super::voxels::Voxels;
use super::window::Window;
use crate::cluster::columns::Finder;
use crate::cluster::{Mapped, TileWindow};
use crate::codec;
use crate::error::{Error, Result};
use crate::model::{Lattice, TileId};

/// Largest number of voxels that a voxel has edges to by itself. Edges lead both ways, so it may have more.
const NEIGHBOURS: usize = 14;
/// Number of neighbours from which none are looked for further away.
const ENOUGH: usize = 8;
/// Largest length of an edge in metres.
const MOST_M: f64 = 1.0;

/// Distance within which the voxels lie to which the voxels of a tile have edges, in lattice units.
pub(super) fn reach(lattice: Lattice) -> i64 {
    lattice.units_up(MOST_M)
}

/// The payload of a tile: the edges of its voxels.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Payload {
    /// Number of the edges of each voxel to voxels of the tile with a greater number.
    inside: Vec<u32>,
    /// Differences of the numbers of these, ascending for each voxel.
    steps: Vec<u32>,
    /// Edges to voxels of other tiles: number in the tile, tile and number there.
    across: Vec<(u32, TileId, u32)>,
}

/// Finds the edges of a tile.
pub(super) fn map(tile: &dyn TileWindow) -> Result<Mapped> {
    let lattice = tile.lattice();
    // Which voxels are the neighbours of a neighbour depends on voxels up to twice as far away.
    let voxels = Voxels::load(tile, 2 * reach(lattice) + lattice.units_up(EDGE_M))?;
    let mut search = Search::new(&voxels, lattice);
    let mut pairs: Vec<(u32, u32)> = Vec::new();
    let mut across: Vec<(u32, TileId, u32)> = Vec::new();
    for voxel in 0..voxels.len() {
        let (tile, number) = voxels.origin[voxel];
        for &(_, other) in search.neighbours(voxel) {
            let (other_tile, other_number) = voxels.origin[other as usize];
            match (voxels.owned[voxel], voxels.owned[other as usize]) {
                (true, true) => pairs.push((number.min(other_number), number.max(other_number))),
                (true, false) => across.push((number, other_tile, other_number)),
                (false, true) => across.push((other_number, tile, number)),
                (false, false) => {}
            }
        }
    }
    pairs.sort_unstable();
    pairs.dedup();
    across.sort_unstable();
    across.dedup();
    let own = voxels.owned.iter().filter(|owned| **owned).count();
    let mut payload = Payload { inside: vec![0; own], steps: Vec::with_capacity(pairs.len()), across };
    for (from, to) in pairs {
        payload.inside[from as usize] += 1;
        payload.steps.push(to - from);
    }
    Ok(Mapped::payload(codec::encode(&payload)?))
}

/// The neighbours of a voxel: those that touch it or, where these are few, the nearest ones further away.
struct Search<'a> {
    voxels: &'a Voxels,
    finder: Finder<'a>,
    windows: Vec<Window>,
    most: i64,
    found: Vec<(i64, u32)>,
}

impl<'a> Search<'a> {
    fn new(voxels: &'a Voxels, lattice: Lattice) -> Self {
        let edge = lattice.units(EDGE_M);
        let most = lattice.units(MOST_M);
        let farthest = (most / edge) as i32 + 1;
        let windows = [1, 2, 3, 5].into_iter().chain([farthest]).map(Window::square).collect();
        let finder = voxels.columns.finder();
        Self { voxels, finder, windows, most: most * most, found: Vec::new() }
    }

    /// Squared distance and number of each neighbour.
    fn neighbours(&mut self, voxel: usize) -> &[(i64, u32)] {
        let Self { voxels, finder, windows, most, found } = self;
        let [i, j, k] = voxels.key[voxel];
        let [x, y, z] = voxels.centre[voxel];
        for window in windows {
            found.clear();
            window.visit(&voxels.columns, finder, [i, j], k, |other| {
                let [u, v, w] = voxels.centre[other];
                let distance = (u - x).pow(2) + (v - y).pow(2) + (w - z).pow(2);
                if distance <= *most && other != voxel {
                    found.push((distance, other as u32));
                }
            });
            if found.len() >= ENOUGH {
                break;
            }
        }
        if found.len() > NEIGHBOURS {
            // Of equally far voxels the first counts: numbers are in the order of keys in every tile.
            found.select_nth_unstable(NEIGHBOURS - 1);
            found.truncate(NEIGHBOURS);
        }
        found
    }
}

/// The edges that lead to voxels of a tile, by the voxels that they lead from.
pub(super) struct Edges {
    first: Vec<u32>,
    to: Vec<u32>,
}

impl Edges {
    /// Loads them. `voxels` are those within [`reach`] of the tile.
    pub(super) fn load(tile: &dyn TileWindow, voxels: &Voxels) -> Result<Self> {
        let payload: Payload = codec::decode(&tile.payload(STEP_EDGES, tile.tile())?)?;
        let by_tile = voxels.by_tile();
        let lost = || Error::bug("a voxel with an edge was not loaded");
        let own: Vec<u32> =
            by_tile.get(&tile.tile()).into_iter().flatten().map(|&(_, number)| number).collect();
        let mut pairs: Vec<(u32, u32)> = Vec::with_capacity(2 * payload.steps.len() + payload.across.len());
        let mut steps = payload.steps.iter();
        for (from, &count) in payload.inside.iter().enumerate() {
            for step in steps.by_ref().take(count as usize) {
                let one = *own.get(from).ok_or_else(lost)?;
                let other = *own.get(from + *step as usize).ok_or_else(lost)?;
                pairs.push((one, other));
                pairs.push((other, one));
            }
        }
        for (number, other, there) in payload.across {
            let places = by_tile.get(&other).ok_or_else(lost)?;
            let at = places.binary_search_by_key(&there, |place| place.0).map_err(|_| lost())?;
            pairs.push((places[at].1, *own.get(number as usize).ok_or_else(lost)?));
        }
        Ok(Self::of(&pairs, voxels.len()))
    }

    fn of(pairs: &[(u32, u32)], voxels: usize) -> Self {
        let mut first = vec![0_u32; voxels + 1];
        for &(from, _) in pairs {
            first[from as usize + 1] += 1;
        }
        for voxel in 0..voxels {
            first[voxel + 1] += first[voxel];
        }
        let mut next = first.clone();
        let mut to = vec![0_u32; pairs.len()];
        for &(from, other) in pairs {
            let at = &mut next[from as usize];
            to[*at as usize] = other;
            *at += 1;
        }
        Self { first, to }
    }

    /// Voxels of the tile that a voxel has edges to.
    pub(super) fn of_voxel(&self, voxel: usize) -> &[u32] {
        &self.to[self.first[voxel] as usize..self.first[voxel + 1] as usize]
    }
}

//! Step `edges`: finds which voxels are neighbours. Growth needs the edges in every round, so they are found
//! once.
//!
//! A voxel has edges to the voxels that touch it or, if these are few, to the nearest ones further away. An
//! edge that one voxel chooses is an edge of both.
#![expect(clippy::cast_possible_truncation, reason = "voxels of a tile fit u32; lengths are a few voxels")]

use super::graph;
use crate::cluster::street::cores::stage_cores::Cored;
use crate::cluster::street::settings::EDGE_M;
use crate::cluster::street::voxels::stored::Voxels;
use crate::cluster::street::window::{Visitor, Window};
use crate::cluster::{Mapped, TileWindow};
use crate::error::Result;
use crate::model::Lattice;

/// Largest number of edges that a voxel chooses itself. Edges lead both ways, so it may have more.
const NEIGHBOURS: usize = 14;
/// Number of neighbours from which the search goes no further.
const ENOUGH: usize = 8;
/// Largest length of an edge in metres.
const MOST_M: f64 = 1.0;

/// Largest distance of the voxels to which the voxels of a tile have edges, in lattice units.
pub(crate) fn reach(lattice: Lattice) -> i64 {
    lattice.units_up(MOST_M)
}

/// Finds the edges of a tile, and stores them with everything that growth needs to know about their ends.
pub(crate) fn map(tile: &dyn TileWindow) -> Result<Mapped> {
    let lattice = tile.lattice();
    // The neighbours of a neighbour depend on voxels up to twice as far away.
    let cored = Cored::load(tile, 2 * reach(lattice) + lattice.units_up(EDGE_M), &[])?;
    let voxels = &cored.around.voxels;
    let mut search = Search::new(voxels, lattice);
    let mut edges: Vec<(u32, u32)> = Vec::new();
    for voxel in 0..voxels.len() {
        for &(_, other) in search.neighbours(voxel) {
            // A tile keeps the edges with an end that it owns. The first end of an edge is always owned.
            match (voxels.owned[voxel], voxels.owned[other as usize]) {
                (true, true) => edges.push(((voxel as u32).min(other), (voxel as u32).max(other))),
                (true, false) => edges.push((voxel as u32, other)),
                (false, true) => edges.push((other, voxel as u32)),
                (false, false) => {}
            }
        }
    }
    edges.sort_unstable();
    edges.dedup();
    Ok(Mapped::payload(graph::encode(&cored, edges)?))
}

/// The neighbours of a voxel: the voxels that touch it or, if these are few, the nearest ones further away.
struct Search<'a> {
    voxels: &'a Voxels,
    windows: Vec<Visitor<'a>>,
    most: i64,
    found: Vec<(i64, u32)>,
}

impl<'a> Search<'a> {
    fn new(voxels: &'a Voxels, lattice: Lattice) -> Self {
        let edge = lattice.units(EDGE_M);
        let most = lattice.units(MOST_M);
        let farthest = (most / edge) as i32 + 1;
        let window = |steps| Window::square(steps).over(&voxels.columns);
        let windows = [1, 2, 3, 5].into_iter().chain([farthest]).map(window).collect();
        Self { voxels, windows, most: most * most, found: Vec::new() }
    }

    /// Squared distance and number of each neighbour.
    fn neighbours(&mut self, voxel: usize) -> &[(i64, u32)] {
        let Self { voxels, windows, most, found } = self;
        let [i, j, k] = voxels.key[voxel];
        let [x, y, z] = voxels.centre[voxel];
        for window in windows {
            found.clear();
            window.visit([i, j], k, |other| {
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
            // Of equally distant voxels, the first wins: numbers are in the order of keys in every tile.
            found.select_nth_unstable(NEIGHBOURS - 1);
            found.truncate(NEIGHBOURS);
        }
        found
    }
}

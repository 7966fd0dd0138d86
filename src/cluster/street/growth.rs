//! Step `growth`: every voxel takes the label of the core with the least path cost to it.
//!
//! A path runs over edges to the nearest voxels. An edge costs (length / 0.15 m)^1.5, so that many short steps
//! through a dense crown are cheaper than a jump over a gap. It costs more where the voxel hardly is of the
//! class of the core. For trees it costs more downwards, and where it leads away from the stem in the plane.
//! A voxel is closed to a class that it hardly can be.
//!
//! Costs are integers. A voxel takes the smallest (cost, label) over its edges. All costs are positive, so
//! exactly one assignment satisfies this for all voxels, in whatever order they are computed. In a round, a
//! tile computes its voxels anew from the borders of its neighbours in the round before. It does not improve
//! the values that it had: the cost of an edge depends on the label, so a better neighbour may mean a worse
//! value further on. After r rounds, all voxels are right whose path crosses at most r seams.
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "voxels of a tile fit u32; costs of an edge are positive and below 2^24"
)]

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

use super::classified::Shares;
use super::cores::{Core, Cored};
use super::edges::{self, Edges};
use super::settings::{CLASSES, EDGE_M, STEP_GROWTH};
use super::shares::{GROUND, POLE, TREE};
use super::voxels::Voxels;
use crate::cluster::{Mapped, TileWindow};
use crate::codec;
use crate::error::Result;
use crate::model::Lattice;
use crate::spatial::{Cell, CellMap};

/// Smallest share of a class that opens a voxel to it, by class.
const OPEN: [u8; CLASSES] = [255, 5, 127, 25, 13, 51, 51, 26];
/// How much dearer an edge is to a voxel that is of another class.
const OTHER_CLASS: f64 = 8.0;
/// How much dearer an edge is that leads straight down, for trees.
const DOWN: f64 = 3.0;
/// Cost of a voxel's edge of distance from the stem in the plane, for trees.
const AWAY: f64 = 0.5;
/// Cost of a square metre of the square of this distance. Between two crowns that touch, it moves the boundary towards the
/// middle between their stems, however much denser one of them was seen.
const AWAY_SQUARE: f64 = 1.0;
/// Cost of an edge of the length of a voxel.
const UNIT: f64 = 256.0;
/// Largest number of rounds. A path that crosses more seams would be longer than any object.
pub(super) const MOST_ROUNDS: u32 = 200;

/// Label and cost of a voxel. Label 0: no core reaches it.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Reached {
    pub(super) label: u32,
    pub(super) cost: u32,
}

/// The payload of a tile: its voxels in their order, and the cores of their labels.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Payload {
    pub(super) labels: Vec<u32>,
    pub(super) cores: Vec<Core>,
}

/// What other tiles see: voxels near the border of the tile that a core reaches, and the cores.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Border {
    reached: Vec<(u32, Reached)>,
    cores: Vec<Core>,
}

/// Distance within which a tile sees the borders of others, in lattice units. The owner of a column of voxels
/// owns a cell that meets it.
pub(super) fn border_reach(lattice: Lattice) -> i64 {
    edges::reach(lattice) + 4 * lattice.units_up(EDGE_M)
}

/// The share of a class for growth. A tree may also grow over voxels that look like poles: most of them are trunks
/// and branches, and poles are cores.
fn share_for(shares: &Shares, class: u8) -> u8 {
    let share = shares[usize::from(class)];
    if class == TREE { share.saturating_add(shares[usize::from(POLE)]) } else { share }
}

/// Costs of edges in lattice units of one drive.
struct Costs {
    edge: f64,
    metre: f64,
}

impl Costs {
    /// Cost of the edge from one voxel to another for a core.
    fn edge(&self, from: [i64; 3], to: [i64; 3], core: &Core, share: u8) -> u32 {
        let [dx, dy, dz] = [0, 1, 2].map(|axis| (to[axis] - from[axis]) as f64);
        let length = (dx * dx + dy * dy + dz * dz).sqrt();
        let ratio = length / self.edge;
        let mut cost = ratio * ratio.sqrt();
        if core.class == TREE {
            if dz < 0.0 {
                cost *= 1.0 - DOWN * dz / length;
            }
            let from_stem = |[x, y, _]: [i64; 3]| {
                let [u, v] = core.place;
                (((x - u) * (x - u) + (y - v) * (y - v)) as f64).sqrt()
            };
            let (start, end) = (from_stem(from), from_stem(to));
            if end > start {
                let square_m2 = (end * end - start * start) / (self.metre * self.metre);
                cost += AWAY * (end - start) / self.edge + AWAY_SQUARE * square_m2;
            }
        }
        let other = 1.0 - f64::from(share) / 255.0;
        (UNIT * cost * (1.0 + OTHER_CLASS * other) + 0.5).max(1.0) as u32
    }
}

/// The labels of the voxels of a tile, from the borders of other tiles in the round before.
pub(super) fn map(tile: &dyn TileWindow) -> Result<Mapped> {
    let lattice = tile.lattice();
    let cored = Cored::load(tile, edges::reach(lattice), &[])?;
    let voxels = &cored.around.voxels;
    let mut cores: FxHashMap<u32, Core> = cored.cores.iter().map(|(label, core)| (*label, *core)).collect();
    let mut known: Vec<Option<Reached>> = vec![None; voxels.key.len()];
    for (voxel, known) in known.iter_mut().enumerate() {
        if cored.label[voxel] != 0 && open(&cored, voxel) {
            *known = Some(Reached { label: cored.label[voxel], cost: 0 });
        }
    }
    for (near, places) in voxels.by_tile() {
        if near == tile.tile() {
            continue;
        }
        let bytes = tile.border(near)?;
        if bytes.is_empty() {
            continue;
        }
        let border: Border = codec::decode(&bytes)?;
        cores.extend(border.cores.iter().map(|core| (core.label, *core)));
        let mut reached = border.reached.iter().peekable();
        for &(voxel, at) in &places {
            while reached.next_if(|entry| entry.0 < voxel).is_some() {}
            if let Some((_, value)) = reached.next_if(|entry| entry.0 == voxel) {
                known[at as usize] = Some(*value);
            }
        }
    }
    let edges = Edges::load(tile, voxels)?;
    let reached = grow(&cored, &edges, &cores, known, lattice);

    let mut payload = Payload::default();
    let mut border = Border::default();
    let at_border = near_foreign(voxels);
    let mut used = Vec::new();
    let mut seen = Vec::new();
    for (number, voxel) in (0_u32..).zip((0..reached.len()).filter(|&voxel| voxels.owned[voxel])) {
        let value = reached[voxel];
        payload.labels.push(value.label);
        if value.label != 0 {
            used.push(value.label);
            if at_border[voxel] {
                border.reached.push((number, value));
                seen.push(value.label);
            }
        }
    }
    payload.cores = named(used, &cores);
    border.cores = named(seen, &cores);
    Ok(Mapped { payload: codec::encode(&payload)?, border: codec::encode(&border)?, labelled: None })
}

/// The cores of these labels, ascending.
fn named(mut labels: Vec<u32>, cores: &FxHashMap<u32, Core>) -> Vec<Core> {
    labels.sort_unstable();
    labels.dedup();
    labels.iter().filter_map(|label| cores.get(label).copied()).collect()
}

/// Whether a voxel can belong to an object.
fn open(cored: &Cored, voxel: usize) -> bool {
    cored.around.shares[voxel][usize::from(GROUND)] <= 127
}

/// Label and cost of the voxels of the tile. `known` are those of cores and of other tiles.
fn grow(
    cored: &Cored,
    edges: &Edges,
    cores: &FxHashMap<u32, Core>,
    known: Vec<Option<Reached>>,
    lattice: Lattice,
) -> Vec<Reached> {
    let voxels = &cored.around.voxels;
    let costs = Costs { edge: lattice.units(EDGE_M) as f64, metre: lattice.units(1.0) as f64 };
    let mut reached = vec![Reached { label: 0, cost: u32::MAX }; known.len()];
    let mut queue = BinaryHeap::new();
    for (voxel, value) in known.into_iter().enumerate() {
        if let Some(value) = value {
            reached[voxel] = value;
            queue.push(Reverse((value.cost, value.label, voxel as u32)));
        }
    }
    while let Some(Reverse((cost, label, voxel))) = queue.pop() {
        let voxel = voxel as usize;
        if reached[voxel] != (Reached { label, cost }) {
            continue;
        }
        let Some(core) = cores.get(&label) else { continue };
        for &other in edges.of_voxel(voxel) {
            let other = other as usize;
            let share = share_for(&cored.around.shares[other], core.class);
            if share < OPEN[usize::from(core.class)] || !open(cored, other) {
                continue;
            }
            let step = costs.edge(voxels.centre[voxel], voxels.centre[other], core, share);
            let found = Reached { label, cost: cost.saturating_add(step) };
            if (found.cost, found.label) < (reached[other].cost, reached[other].label) {
                reached[other] = found;
                queue.push(Reverse((found.cost, label, other as u32)));
            }
        }
    }
    for value in &mut reached {
        if value.label == 0 {
            value.cost = 0;
        }
    }
    reached
}

/// Columns per edge of the squares of [`near_foreign`]: longer than an edge between voxels.
const SQUARE: i32 = 8;

/// Voxels of the tile that may have edges to voxels of another tile: those in squares of columns in which, or
/// beside which, another tile has voxels.
fn near_foreign(voxels: &Voxels) -> Vec<bool> {
    let columns = &voxels.columns;
    let square = |[i, j]: Cell| [i.div_euclid(SQUARE), j.div_euclid(SQUARE)];
    let mut beside = CellMap::<u8>::default();
    for (column, &cell) in columns.cells().iter().enumerate() {
        if !voxels.owned[columns.voxels(column).start] {
            let [i, j] = square(cell);
            for (di, dj) in (-1..=1).flat_map(|di| (-1..=1).map(move |dj| (di, dj))) {
                *beside.entry([i + di, j + dj]) = 1;
            }
        }
    }
    let mut near = vec![false; columns.len()];
    for (column, &cell) in columns.cells().iter().enumerate() {
        let range = columns.voxels(column);
        let own = voxels.owned[range.start];
        near[range].fill(own && beside.get(square(cell)) == 1);
    }
    near
}

/// The labels of the voxels around a tile.
pub(super) struct Grown {
    pub(super) cored: Cored,
    /// Label of each voxel, or 0.
    pub(super) label: Vec<u32>,
}

impl Grown {
    /// Loads the voxels within `reach` of a tile, and those of the columns `also`.
    pub(super) fn load(tile: &dyn TileWindow, reach: i64, also: &[Cell]) -> Result<Self> {
        let mut cored = Cored::load(tile, reach, also)?;
        let mut label = vec![0; cored.class.len()];
        let mut cores = std::mem::take(&mut cored.cores);
        for (near, places) in cored.around.voxels.by_tile() {
            let payload: Payload = codec::decode(&tile.payload(STEP_GROWTH, near)?)?;
            for &(voxel, at) in &places {
                label[at as usize] = payload.labels[voxel as usize];
            }
            cores.extend(payload.cores.into_iter().map(|core| (core.label, core)));
        }
        cored.cores = cores;
        Ok(Self { cored, label })
    }
}

//! Step `growth`: every voxel takes the label of the core with the least path cost to it, see
//! [`super::paths`].
//!
//! A path runs over edges to the nearest voxels. An edge costs (length / 0.15 m)^1.5, so that many short
//! steps through a dense crown are cheaper than a jump over a gap. It costs more to a voxel with a small
//! share of the class of the core. For trees it costs more downwards, and away from the stem in the plane. A
//! voxel is closed to a class of which its share is very small.
//!
//! In a round, a tile finds the values of its voxels from the borders of its neighbours in the previous
//! round. It starts from its own earlier values, and computes only what the borders change. After r rounds,
//! all voxels whose path crosses at most r seams have their final values.

use std::collections::BTreeMap;

use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

use super::graph::Graph;
use super::paths::{Found, Offer, Paths, Reached};
use super::stage_edges;
use crate::cluster::street::cores::stage_cores::{Core, Cored, named};
use crate::cluster::street::settings::{EDGE_M, STEP_GROWTH};
use crate::cluster::street::shares::TREE;
use crate::cluster::street::voxels::stored;
use crate::cluster::{DriveWindow, Mapped, TileWindow};
use crate::codec;
use crate::error::Result;
use crate::model::{Lattice, TileId};
use crate::spatial::Cell;

/// Largest number of rounds. A path that crosses more seams would be longer than any object.
pub(crate) const MOST_ROUNDS: u32 = 200;

/// Sections of the payload: [`Payload`], and the costs of the voxels, which only the tile itself reads.
const SECTION_LABELS: usize = 0;
const SECTION_COSTS: usize = 1;

/// The payload of a tile: its voxels in their order, and the cores of their labels.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct Payload {
    pub(crate) labels: Vec<u32>,
    pub(crate) cores: Vec<Core>,
}

/// The part that other tiles see: the voxels near the border of the tile that a core reaches, and the cores.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Border {
    reached: Vec<AtBorder>,
    cores: Vec<Core>,
}

impl Border {
    fn voxel(&self, number: u32) -> Option<&AtBorder> {
        let at = self.reached.binary_search_by_key(&number, |voxel| voxel.number).ok()?;
        Some(&self.reached[at])
    }
}

#[derive(Debug, Serialize, Deserialize)]
struct AtBorder {
    /// Number of the voxel in its tile.
    number: u32,
    value: Reached,
    /// The last voxel of another tile on its path, and the cost there; `None` if the path began in this tile.
    through: Option<(TileId, u32, u32)>,
}

/// Distance within which a tile sees the borders of other tiles, in lattice units. The owner of a column of
/// voxels owns a cell that meets it.
pub(crate) fn border_reach(lattice: Lattice) -> i64 {
    stage_edges::reach(lattice) + 4 * lattice.units_up(EDGE_M)
}

/// The labels of the voxels of a tile, from the borders of other tiles in the previous round.
pub(crate) fn map(tile: &dyn TileWindow) -> Result<Mapped> {
    let graph = Graph::load(tile)?;
    let mut cores: FxHashMap<u32, Core> = graph.cores().iter().map(|core| (core.label, *core)).collect();
    let outside = seen(tile, &graph, &mut cores)?;
    let earlier = if tile.round() == 0 { None } else { Some(earlier(tile, &mut cores)?) };
    let paths = Paths::new(&graph, &cores, &outside, tile.lattice());
    let Found { reached, through } = match earlier {
        Some(earlier) => paths.changed_from(&earlier),
        None => paths.found(),
    };

    let core = |label: u32| cores.get(&label).copied();
    let labels: Vec<u32> = reached.iter().map(|value| value.label).collect();
    let costs: Vec<u32> = reached.iter().map(|value| value.cost).collect();
    let payload = Payload { cores: named(labels.clone(), core), labels };
    let at_border = graph.at_border().iter().zip(through).map(|(&number, through)| AtBorder {
        number,
        value: reached[number as usize],
        through: through.and_then(|vertex| {
            let at = vertex - graph.own();
            let (tile, number) = graph.outside()[at];
            Some((tile, number, outside[at]?.value.cost))
        }),
    });
    let reached: Vec<AtBorder> = at_border.filter(|voxel| voxel.value.label != 0).collect();
    let labels = reached.iter().map(|voxel| voxel.value.label).collect();
    let border = Border { cores: named(labels, core), reached };
    let payload = codec::pack(&[codec::encode(&payload)?, codec::encode(&costs)?]);
    Ok(Mapped { payload, border: codec::encode(&border)?, labelled: None })
}

/// The values of the vertices of other tiles in the previous round. Their cores are added to `cores`. A value
/// whose path came through a third tile is left out if the voxel there has another value by now.
fn seen(
    tile: &dyn TileWindow,
    graph: &Graph,
    cores: &mut FxHashMap<u32, Core>,
) -> Result<Vec<Option<Offer>>> {
    let mut borders: BTreeMap<TileId, Border> = BTreeMap::new();
    for vertices in graph.outside().chunk_by(|a, b| a.0 == b.0) {
        let bytes = tile.border(vertices[0].0)?;
        let border: Border = if bytes.is_empty() { Border::default() } else { codec::decode(&bytes)? };
        cores.extend(border.cores.iter().map(|core| (core.label, *core)));
        borders.insert(vertices[0].0, border);
    }
    let offer = |&(other, number): &(TileId, u32)| {
        let AtBorder { value, through, .. } = borders.get(&other)?.voxel(number)?;
        let offer = |through| Some(Offer { value: *value, through });
        match *through {
            Some((near, number, cost)) if near == tile.tile() => offer(Some((number, cost))),
            Some((near, number, cost)) => {
                let before = Reached { label: value.label, cost };
                let lasts = |border: &Border| border.voxel(number).is_some_and(|voxel| voxel.value == before);
                if borders.get(&near).is_none_or(lasts) { offer(None) } else { None }
            }
            None => offer(None),
        }
    };
    Ok(graph.outside().iter().map(offer).collect())
}

/// The values that the tile found when it ran last. Its cores are added to `cores`.
fn earlier(tile: &dyn TileWindow, cores: &mut FxHashMap<u32, Core>) -> Result<Vec<Reached>> {
    let payload = tile.payload(STEP_GROWTH, tile.tile())?;
    let Payload { labels, cores: named } = labels_of(&payload)?;
    let costs: Vec<u32> = codec::decode(codec::section(&payload, SECTION_COSTS)?)?;
    cores.extend(named.iter().map(|core| (core.label, *core)));
    Ok(labels.into_iter().zip(costs).map(|(label, cost)| Reached { label, cost }).collect())
}

/// The trees of the drive with fewer than `smallest` points: their labels, ascending. They are pieces of
/// crowns that were taken for stems: of 80 such trees with fewer than 60 points on labelled drives, only 8
/// were really trees.
pub(crate) fn reduce(drive: &dyn DriveWindow, smallest: u64) -> Result<Vec<u8>> {
    let mut trees: BTreeMap<u32, u64> = BTreeMap::new();
    for tile in TileId::first(drive.tiles()) {
        let Payload { labels, cores } = labels_of(&drive.payload(STEP_GROWTH, tile)?)?;
        for core in cores.iter().filter(|core| core.class == TREE) {
            trees.entry(core.label).or_insert(0);
        }
        for (label, points) in labels.iter().zip(stored::read(drive, tile)?.points()) {
            if let Some(sum) = trees.get_mut(label) {
                *sum += u64::from(*points);
            }
        }
    }
    let small: Vec<u32> =
        trees.into_iter().filter(|(_, points)| *points < smallest).map(|(label, _)| label).collect();
    codec::encode(&small)
}

fn labels_of(payload: &[u8]) -> Result<Payload> {
    codec::decode(codec::section(payload, SECTION_LABELS)?)
}

/// The labels of the voxels around a tile. The voxels of trees that are too small have none.
pub(crate) struct Grown {
    pub(crate) cored: Cored,
    /// Label of each voxel, or 0.
    pub(crate) label: Vec<u32>,
}

impl Grown {
    /// Loads the voxels within `reach` of a tile, and those of the columns `also`.
    pub(crate) fn load(tile: &dyn TileWindow, reach: i64, also: &[Cell]) -> Result<Self> {
        let mut cored = Cored::load(tile, reach, also)?;
        let mut label = vec![0; cored.class.len()];
        let mut cores = std::mem::take(&mut cored.cores);
        let small: Vec<u32> = codec::decode(tile.global(STEP_GROWTH))?;
        for (near, places) in cored.around.voxels.by_tile() {
            let payload = labels_of(&tile.payload(STEP_GROWTH, near)?)?;
            for &(voxel, at) in &places {
                let found = payload.labels[voxel as usize];
                label[at as usize] = if small.binary_search(&found).is_ok() { 0 } else { found };
            }
            cores.extend(payload.cores.into_iter().map(|core| (core.label, core)));
        }
        cored.cores = cores;
        Ok(Self { cored, label })
    }
}

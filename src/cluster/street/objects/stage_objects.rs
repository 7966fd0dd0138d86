//! Step `objects`: the label of every point, from the label of its voxel; class and confidence of objects.
//!
//! A model with a part for objects names each object as a whole, from the figures over its voxels
//! (`figures.rs`). Without it, an object has the class of its core. A further part of the model finds pieces
//! of objects (`wholes.rs`). Without it, each piece is an object.
#![expect(clippy::cast_possible_truncation, reason = "voxels of a tile fit u32, a mean share is at most 255")]

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::contacts::{self, Contacts};
use super::figures::{self, Figures};
use super::fixtures;
use super::islands;
use super::leaves::{self, Leaves};
use super::stage_leftovers::Whole;
use super::wholes::{MOST_VOXELS, Object, Pieces};
use crate::cluster::columns::{Voxel, global_indices};
use crate::cluster::street::model::{self, StreetModel};
use crate::cluster::street::settings::{NAME, STEP_OBJECTS, StreetConfig, edge};
use crate::cluster::street::shares::FENCE;
use crate::cluster::{DriveWindow, Grouped, Labelled, Mapped, TileWindow};
use crate::codec;
use crate::error::{Error, Result};
use crate::model::{Hedge, Kind, Lattice, TileId};
use crate::spatial::{Cell, VoxelIndex};

/// Depth of the highest voxel below the ground, in metres, from which an object is made of reflections. The
/// measures of objects also leave out single points from this depth on (chosen).
const BURIED_M: f64 = 1.0;

/// The payload of a tile.
#[derive(Debug, Serialize, Deserialize)]
struct Payload {
    labels: Vec<OfTile>,
    /// Figures of each label over the voxels of the tile, if a model names objects or finds pieces.
    figures: BTreeMap<u32, Figures>,
    /// Thickness of the objects of the tile.
    leaves: BTreeMap<u32, Leaves>,
    /// Contacts of the labels of growth and leftovers, if a model finds pieces.
    contacts: Contacts,
}

/// A label of a tile.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct OfTile {
    /// Label in the drive.
    label: u32,
    class: u8,
    /// Sum of the shares of its class over the points that the tile owns, and their number.
    share: u64,
    points: u64,
}

/// The objects of the voxels of a tile, corrected by their surroundings, and the counts from before the
/// correction.
pub(crate) struct Settled {
    pub(crate) whole: Whole,
    /// Thickness around each voxel, in lattice units.
    thickness: Vec<Option<u64>>,
    /// Empty if contacts are not requested.
    pub(crate) contacts: Contacts,
}

impl Settled {
    /// The objects of the voxels of a tile and of these columns.
    pub(crate) fn load(tile: &dyn TileWindow, columns: &[Cell], with_contacts: bool) -> Result<Self> {
        let mut whole = Whole::load(tile, tile.lattice().units_up(islands::REACH_M), columns)?;
        // Contacts are counted before labels are settled, because until then the labels of the neighbours of
        // the tile's voxels are right too.
        let contacts = if with_contacts { contacts::count(&whole, MOST_VOXELS) } else { Contacts::default() };
        let thickness = leaves::thickness(&whole);
        settle(&mut whole, tile.lattice());
        Ok(Self { whole, thickness, contacts })
    }
}

/// Labels the points of a tile, and collects what the model needs to know about objects.
pub(crate) fn map(tile: &dyn TileWindow, model: &StreetModel) -> Result<Mapped> {
    let edge = edge(tile.lattice());
    let points = tile.points(0, true)?;
    let index = VoxelIndex::build(NAME, &points.cloud, edge)?;
    let mut core = vec![false; index.len()];
    for (range, voxel) in index.streaks() {
        core[voxel] |= points.core[range].contains(&true);
    }
    let indices = global_indices(NAME, &index, |voxel| core[voxel])?;
    // Another tile may own the column of a point.
    let mut columns: Vec<Cell> = indices.iter().map(|([i, j, _], _)| [*i, *j]).collect();
    columns.dedup();
    let Settled { whole, thickness, contacts } = Settled::load(tile, &columns, model.wholes.is_some())?;
    let leaves = leaves::find(&whole, &thickness);
    let with_figures = model.objects.is_some() || model.wholes.is_some();
    let figures = if with_figures { figures::find(&whole, tile.lattice()) } else { BTreeMap::new() };
    let voxels = &whole.grown.cored.around.voxels;
    let mut place = vec![u32::MAX; index.len()];
    for (key, number) in indices {
        let lost = |key: Voxel| Error::bug(format!("voxel {key:?} has points and no tile"));
        place[number as usize] = voxels.find(key).ok_or_else(|| lost(key))? as u32;
    }
    let mut numbers: BTreeMap<u32, u32> = BTreeMap::new();
    let mut labels = vec![0; points.cloud.len()];
    let mut of_tile: Vec<OfTile> = Vec::new();
    for (range, voxel) in index.streaks().filter(|(_, voxel)| core[*voxel]) {
        let voxel = place[voxel] as usize;
        let label = whole.grown.label[voxel];
        if label == 0 {
            continue;
        }
        let unknown = || Error::bug(format!("object {label} has points and no class"));
        let class = whole.class.get(&label).copied().ok_or_else(unknown)?;
        for point in range {
            if !points.core[point] {
                continue;
            }
            let next = of_tile.len() as u32;
            let number = *numbers.entry(label).or_insert(next);
            if number == next {
                of_tile.push(OfTile { label, class, share: 0, points: 0 });
            }
            let entry = &mut of_tile[number as usize];
            entry.points += 1;
            entry.share += u64::from(whole.shares(voxel)[usize::from(class)]);
            labels[point] = number + 1;
        }
    }
    let count = of_tile.len() as u32;
    let labelled = Labelled { points, labels, count, with_halo: false };
    Ok(Mapped {
        payload: codec::encode(&Payload { labels: of_tile, figures, leaves, contacts })?,
        labelled: Some(labelled),
        ..Mapped::default()
    })
}

/// Corrects labels by the surroundings of an object. Both rules use the labels of growth and leftovers,
/// because these are right for all voxels that were read. Free space around a group outweighs a wall beside
/// an object.
fn settle(whole: &mut Whole, lattice: Lattice) {
    let fixtures = fixtures::find(whole);
    let before = whole.grown.label.clone();
    islands::settle(whole, lattice);
    for (label, before) in whole.grown.label.iter_mut().zip(before) {
        if let Some(building) = fixtures.get(&before).filter(|_| *label == before) {
            *label = *building;
        }
    }
}

/// The class of an object, the sum of the shares of this class over its points, and their number.
#[derive(Debug, Clone, Copy)]
struct Sum {
    class: u8,
    share: u64,
    points: u64,
}

/// The wanted objects of the drive.
pub(crate) fn reduce(drive: &dyn DriveWindow, config: &StreetConfig, model: &StreetModel) -> Result<Grouped> {
    let lattice = drive.lattice();
    let mut labels = Vec::new();
    let mut contacts = Vec::new();
    let mut figures = BTreeMap::<u32, Figures>::new();
    let mut leaves = BTreeMap::<u32, Leaves>::new();
    for tile in TileId::first(drive.tiles()) {
        let payload: Payload = codec::decode(&drive.payload(STEP_OBJECTS, tile)?)?;
        labels.push(payload.labels);
        contacts.push(payload.contacts);
        for (label, of_tile) in payload.figures {
            figures.entry(label).or_default().merge(&of_tile);
        }
        for (label, of_tile) in payload.leaves {
            leaves.entry(label).or_default().merge(&of_tile);
        }
    }
    let mut sums = BTreeMap::<u32, Sum>::new();
    for one in labels.iter().flatten() {
        let sum = sums.entry(one.label).or_insert(Sum { class: one.class, share: 0, points: 0 });
        sum.share += one.share;
        sum.points += one.points;
    }
    let touched = contacts::of_objects(&contacts, MOST_VOXELS);
    let of = |(&label, sum): (&u32, &Sum)| {
        Some((label, Object { class: sum.class, figures: figures.remove(&label)? }))
    };
    let objects: BTreeMap<u32, Object> = sums.iter().filter_map(of).collect();
    let pieces = match &model.wholes {
        Some(wholes) => Pieces::find(wholes, &objects, &touched, lattice)?,
        None => Pieces::default(),
    };
    let mut of_wholes = BTreeMap::<u32, (u64, Leaves)>::new();
    for (label, sum) in &sums {
        if let Some(whole) = pieces.whole(*label) {
            let (points, of_whole) = of_wholes.entry(whole).or_default();
            *points += sum.points;
            leaves.get(label).iter().for_each(|of_piece| of_whole.merge(of_piece));
        }
    }
    let mut named = BTreeMap::new();
    for (&label, &(points, leaves)) in &of_wholes {
        let Sum { class: before, share, points: own } = sums[&label];
        let figures = objects.get(&label).map(|object| pieces.figures(label, &object.figures));
        if figures.is_some_and(|figures| figures.highest_m(lattice) < -BURIED_M) {
            continue;
        }
        let (class, confidence) = match (&model.objects, figures) {
            (Some(names), Some(figures)) => model::name(names, &figures.features(before, lattice), before)?,
            _ => (before, (share / own.max(1)) as u8),
        };
        let is_large =
            config.is_large(class, points) || (pieces.is_likely(label) && points >= config.min_points);
        if config.wants(class) && is_large {
            let hedge = if class == FENCE { leaves.hedge(lattice) } else { Hedge::No };
            named.insert(label, Kind { class, confidence, hedge });
        }
    }
    let kinds: BTreeMap<u32, Kind> =
        named.into_iter().map(|(label, kind)| (label, Kind { class: kind.class + 1, ..kind })).collect();
    let group = |one: &OfTile| pieces.whole(one.label).filter(|label| kinds.contains_key(label)).unwrap_or(0);
    let groups = labels.iter().map(|of_tile| of_tile.iter().map(group).collect()).collect();
    Ok(Grouped { groups, kinds, ..Grouped::default() })
}

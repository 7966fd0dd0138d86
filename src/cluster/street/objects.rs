//! Step `objects`: the label of every point, from the label of its voxel; class and confidence of objects.
//!
//! A model with a part for objects names each object as a whole, from the figures over its voxels
//! (`figures.rs`). Without it, an object has the class of its core.
#![expect(clippy::cast_possible_truncation, reason = "voxels of a tile fit u32, a mean share is at most 255")]

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::figures::{self, Figures};
use super::fixtures;
use super::fragments::{self, Counts};
use super::islands;
use super::leftovers::Whole;
use super::model;
use super::settings::{NAME, STEP_OBJECTS, StreetConfig, edge};
use crate::boosting::Model;
use crate::cluster::columns::{Voxel, global_indices};
use crate::cluster::{DriveWindow, Grouped, Labelled, Mapped, TileWindow};
use crate::codec;
use crate::error::{Error, Result};
use crate::model::{Kind, Lattice, TileId};
use crate::spatial::{Cell, VoxelIndex};

/// The payload of a tile.
#[derive(Debug, Serialize, Deserialize)]
struct Payload {
    labels: Vec<OfTile>,
    /// Counts over the labels of growth and leftovers.
    counts: Counts,
    /// Figures of each label over the voxels of the tile, if a model names objects.
    figures: BTreeMap<u32, Figures>,
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

/// The objects of the voxels of a tile and of these columns, corrected by what is around them, with the
/// counts for fragments.
pub(super) fn settled(tile: &dyn TileWindow, columns: &[Cell]) -> Result<(Whole, Counts)> {
    let mut whole = Whole::load(tile, tile.lattice().units_up(islands::REACH_M), columns)?;
    // Neighbours of the voxels of the tile count too. Labels are right for all of these before they are
    // settled.
    let counts = fragments::count(&whole);
    settle(&mut whole, tile.lattice());
    Ok((whole, counts))
}

/// Labels the points of a tile. `with_figures`: a model names objects.
pub(super) fn map(tile: &dyn TileWindow, with_figures: bool) -> Result<Mapped> {
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
    let (whole, counts) = settled(tile, &columns)?;
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
        payload: codec::encode(&Payload { labels: of_tile, counts, figures })?,
        labelled: Some(labelled),
        ..Mapped::default()
    })
}

/// Corrects labels by what is around an object. Both rules see the labels of growth and leftovers, because
/// these are right for all voxels that were read. Free space around a group counts more than a wall beside an
/// object.
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

/// The objects of the drive that are wanted. `names` is the model that names objects, if there is one.
pub(super) fn reduce(
    drive: &dyn DriveWindow,
    config: &StreetConfig,
    names: Option<&Model>,
) -> Result<Grouped> {
    let mut labels = Vec::new();
    let mut counts = Vec::new();
    let mut figures = BTreeMap::<u32, Figures>::new();
    for tile in TileId::first(drive.tiles()) {
        let payload: Payload = codec::decode(&drive.payload(STEP_OBJECTS, tile)?)?;
        labels.push(payload.labels);
        counts.push(payload.counts);
        for (label, of_tile) in payload.figures {
            figures.entry(label).or_default().merge(&of_tile);
        }
    }
    let fragments = fragments::find(&counts, drive.lattice());
    // A tree may have become a part of a building.
    let present: BTreeSet<u32> = labels.iter().flatten().map(|one| one.label).collect();
    let whole =
        |label: u32| fragments.get(&label).copied().filter(|tree| present.contains(tree)).unwrap_or(label);
    // Of the class of the object: sum of the shares, and number of points.
    let mut sums: BTreeMap<u32, (u8, u64, u64)> = BTreeMap::new();
    for one in labels.iter().flatten().filter(|one| whole(one.label) == one.label) {
        let sum = sums.entry(one.label).or_insert((one.class, 0, 0));
        sum.1 += one.share;
        sum.2 += one.points;
    }
    for one in labels.iter().flatten().filter(|one| whole(one.label) != one.label) {
        if let Some(sum) = sums.get_mut(&whole(one.label)) {
            sum.1 += if one.class == sum.0 { one.share } else { 0 };
            sum.2 += one.points;
        }
    }
    let figures = of_whole(figures, whole);
    let mut kinds = BTreeMap::new();
    for (label, (class, share, points)) in sums {
        let (class, confidence) = match (names, figures.get(&label)) {
            (Some(names), Some(figures)) => {
                model::name(names, &figures.features(class, drive.lattice()), class)?
            }
            _ => (class, (share / points.max(1)) as u8),
        };
        if config.keeps(class, points) {
            kinds.insert(label, Kind { class: class + 1, confidence });
        }
    }
    let group = |one: &OfTile| Some(whole(one.label)).filter(|label| kinds.contains_key(label)).unwrap_or(0);
    let groups = labels.iter().map(|of_tile| of_tile.iter().map(group).collect()).collect();
    Ok(Grouped { groups, kinds, ..Grouped::default() })
}

/// Figures of whole objects, from those of their labels. `whole` is the object of a label.
fn of_whole(figures: BTreeMap<u32, Figures>, whole: impl Fn(u32) -> u32) -> BTreeMap<u32, Figures> {
    let mut sums = BTreeMap::<u32, Figures>::new();
    for (label, part) in figures {
        sums.entry(whole(label)).or_default().merge(&part);
    }
    sums
}

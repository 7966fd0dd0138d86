//! Samples for the model of objects: what `street` finds in a labelled drive with the models of voxels.
//!
//! Each object is a sample. Its class is that of most of its points, if that is the class of at least
//! [`CLEAR`] of those that have one.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::figures::{self, Figures};
use super::settings::CLASSES;
use super::{fragments, objects};
use crate::cluster::TileWindow;
use crate::cluster::columns::Voxel;
use crate::codec;
use crate::error::{Error, Result};
use crate::model::Lattice;

/// Share of the points of an object that have one class, if its class is clear.
const CLEAR: f64 = 0.6;

/// What a tile knows of objects, by their labels.
#[derive(Debug, Serialize, Deserialize)]
struct ObjectsOfTile {
    objects: BTreeMap<u32, ObjectPart>,
    fragments: fragments::Counts,
}

/// An object over the voxels of a tile: what the steps before call it, its figures, and its points of each
/// true class.
#[derive(Debug, Serialize, Deserialize)]
struct ObjectPart {
    class: u8,
    figures: Figures,
    truth: [u64; CLASSES],
}

/// The objects of a tile. `labelled` are the keys and codes of the voxels that it owns.
pub(super) fn map(tile: &dyn TileWindow, labelled: Vec<(Voxel, u8)>) -> Result<Vec<u8>> {
    let (whole, fragments) = objects::settled(tile, &[])?;
    let voxels = &whole.grown.cored.around.voxels;
    let own = (0..voxels.len()).filter(|&voxel| voxels.owned[voxel]);
    let mut truth = BTreeMap::<u32, [u64; CLASSES]>::new();
    for (voxel, (_, code)) in own.zip(labelled) {
        let label = whole.grown.label[voxel];
        if let Some(place) = usize::from(code).checked_sub(1).filter(|_| label != 0) {
            truth.entry(label).or_default()[place] += u64::from(voxels.points[voxel]);
        }
    }
    let mut found = BTreeMap::new();
    for (label, figures) in figures::find(&whole, tile.lattice()) {
        let unknown = || Error::bug(format!("object {label} has voxels and no class"));
        let class = whole.class.get(&label).copied().ok_or_else(unknown)?;
        let truth = truth.remove(&label).unwrap_or_default();
        found.insert(label, ObjectPart { class, figures, truth });
    }
    codec::encode(&ObjectsOfTile { objects: found, fragments })
}

/// Label, class and features of the objects in the payloads of all tiles, in the order of their labels. An
/// object without a clear class is left out.
pub(super) fn reduce(payloads: &[Vec<u8>], lattice: Lattice) -> Result<Vec<(u32, u8, Vec<f32>)>> {
    let mut counts = Vec::new();
    let mut parts = Vec::new();
    for payload in payloads {
        let ObjectsOfTile { objects, fragments } = codec::decode(payload)?;
        counts.push(fragments);
        parts.extend(objects);
    }
    let fragments = fragments::find(&counts, lattice);
    let mut whole = BTreeMap::<u32, ObjectPart>::new();
    // The parts of an object itself come first: they have its class.
    parts.sort_by_key(|(label, _)| (fragments.contains_key(label), *label));
    for (label, part) in parts {
        let label = fragments.get(&label).copied().unwrap_or(label);
        match whole.get_mut(&label) {
            Some(object) => {
                object.figures.merge(&part.figures);
                object.truth.iter_mut().zip(part.truth).for_each(|(sum, count)| *sum += count);
            }
            None => {
                whole.insert(label, part);
            }
        }
    }
    let sample = |(label, object): (u32, ObjectPart)| {
        let points: u64 = object.truth.iter().sum();
        let class = (0..CLASSES).rev().max_by_key(|&class| object.truth[class])?;
        let is_clear = points > 0 && object.truth[class] as f64 >= CLEAR * points as f64;
        let features = || object.figures.features(object.class, lattice).to_vec();
        is_clear.then(|| (label, u8::try_from(class).unwrap_or_default(), features()))
    };
    Ok(whole.into_iter().filter_map(sample).collect())
}

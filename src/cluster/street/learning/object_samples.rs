//! Samples for the models of objects: the objects that `street` finds in a labelled drive with the models of
//! voxels.
//!
//! Each object is a sample. Its class is the most frequent true class of its points, if at least [`CLEAR`] of
//! the points with a class have it. Its main true object is the one that most of its points belong to. The
//! object is whole if it has more than half of the points of its main true object. Otherwise it is a part if
//! the larger object that it touches has the same main true object. If not, it is a stray piece.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::cluster::TileWindow;
use crate::cluster::columns::Voxel;
use crate::cluster::street::objects::contacts::{self, Contacts};
use crate::cluster::street::objects::figures::{self, Figures};
use crate::cluster::street::objects::stage_objects::Settled;
use crate::cluster::street::objects::wholes::{self, MOST_VOXELS, Object, PART, STRAY, Seen, WHOLE};
use crate::cluster::street::settings::CLASSES;
use crate::codec;
use crate::error::{Error, Result};
use crate::model::Lattice;

/// Smallest share of the points of an object that have the same class if its class is clear.
const CLEAR: f64 = 0.6;

/// What a tile knows about objects, by their labels.
#[derive(Debug, Serialize, Deserialize)]
struct ObjectsOfTile {
    objects: BTreeMap<u32, ObjectPart>,
    contacts: Contacts,
    /// Points of the true objects in all voxels that the tile owns; empty if the drive has no true objects.
    instances: BTreeMap<u32, u64>,
}

/// An object over the voxels of a tile: the class that the earlier steps gave it, its figures, and its points
/// of each true class and of each true object (0 for none).
#[derive(Debug, Serialize, Deserialize)]
struct ObjectPart {
    class: u8,
    figures: Figures,
    truth: Truth,
}

#[derive(Debug, Default, Serialize, Deserialize)]
struct Truth {
    classes: [u64; CLASSES],
    instances: BTreeMap<u32, u64>,
}

impl Truth {
    fn merge(&mut self, other: &Self) {
        self.classes.iter_mut().zip(other.classes).for_each(|(sum, count)| *sum += count);
        for (instance, count) in &other.instances {
            *self.instances.entry(*instance).or_default() += count;
        }
    }

    /// The class of the object, if it is clear.
    fn class(&self) -> Option<u8> {
        let points: u64 = self.classes.iter().sum();
        let class = (0..CLASSES).rev().max_by_key(|&class| self.classes[class])?;
        let is_clear = points > 0 && self.classes[class] as f64 >= CLEAR * points as f64;
        is_clear.then(|| u8::try_from(class).unwrap_or_default())
    }

    /// The true object that most of the points belong to, and their number.
    fn main(&self) -> Option<(u32, u64)> {
        self.instances
            .iter()
            .rev()
            .max_by_key(|(_, count)| **count)
            .map(|(instance, count)| (*instance, *count))
    }
}

/// The sample of an object.
#[derive(Debug)]
pub(crate) struct ObjectSample {
    pub(crate) label: u32,
    /// Its true class, if it is clear.
    pub(crate) class: Option<u8>,
    /// Whether it is whole, a part or a stray piece, if the drive has true objects.
    pub(crate) whole: Option<u8>,
    /// Features for both models. The first ones are for the model of names.
    pub(crate) features: Vec<f32>,
}

/// The objects of a tile. `labelled` has the keys and class codes of the voxels that it owns. `instances` has
/// their true objects, or is empty.
pub(crate) fn map(tile: &dyn TileWindow, labelled: Vec<(Voxel, u8)>, instances: &[u32]) -> Result<Vec<u8>> {
    let Settled { whole, contacts, .. } = Settled::load(tile, &[], true)?;
    let voxels = &whole.grown.cored.around.voxels;
    let own = (0..voxels.len()).filter(|&voxel| voxels.owned[voxel]);
    let mut truth = BTreeMap::<u32, Truth>::new();
    let mut points_of = BTreeMap::<u32, u64>::new();
    for (number, (voxel, (_, code))) in own.zip(labelled).enumerate() {
        let Some(place) = usize::from(code).checked_sub(1) else { continue };
        let points = u64::from(voxels.points[voxel]);
        let instance = instances.get(number).copied();
        if let Some(instance) = instance {
            *points_of.entry(instance).or_default() += points;
        }
        let label = whole.grown.label[voxel];
        if label == 0 {
            continue;
        }
        let truth = truth.entry(label).or_default();
        truth.classes[place] += points;
        if let Some(instance) = instance {
            *truth.instances.entry(instance).or_default() += points;
        }
    }
    let mut objects = BTreeMap::new();
    for (label, figures) in figures::find(&whole, tile.lattice()) {
        let unknown = || Error::bug(format!("object {label} has voxels and no class"));
        let class = whole.class.get(&label).copied().ok_or_else(unknown)?;
        objects.insert(label, ObjectPart { class, figures, truth: truth.remove(&label).unwrap_or_default() });
    }
    codec::encode(&ObjectsOfTile { objects, contacts, instances: points_of })
}

/// The objects in the payloads of all tiles, in the order of their labels.
pub(crate) fn reduce(payloads: &[Vec<u8>], lattice: Lattice) -> Result<Vec<ObjectSample>> {
    let mut objects = BTreeMap::<u32, Object>::new();
    let mut truths = BTreeMap::<u32, Truth>::new();
    let mut touching = Vec::new();
    let mut points_of = BTreeMap::<u32, u64>::new();
    for payload in payloads {
        let ObjectsOfTile { objects: parts, contacts, instances } = codec::decode(payload)?;
        for (label, ObjectPart { class, figures, truth }) in parts {
            objects
                .entry(label)
                .and_modify(|object| object.figures.merge(&figures))
                .or_insert_with(|| Object { class, figures });
            truths.entry(label).or_default().merge(&truth);
        }
        touching.push(contacts);
        for (instance, points) in instances {
            *points_of.entry(instance).or_default() += points;
        }
    }
    let touched = contacts::of_objects(&touching, MOST_VOXELS);
    let mut samples = Vec::new();
    for (label, object) in &objects {
        let Seen { features, larger } = wholes::see(object, touched.get(label), &objects, lattice);
        let truth = &truths[label];
        let of_larger = larger.and_then(|label| truths.get(&label)?.main());
        let whole = is_whole(truth, object.figures.points(), of_larger, &points_of);
        samples.push(ObjectSample {
            label: *label,
            class: truth.class(),
            whole,
            features: features.to_vec(),
        });
    }
    Ok(samples)
}

/// Whether an object is whole, a part or a stray piece; `None` if at least half of its `points` have no
/// label. `larger` is the main true object of the larger object. `points_of` has the points of the true
/// objects.
fn is_whole(
    truth: &Truth,
    points: u64,
    larger: Option<(u32, u64)>,
    points_of: &BTreeMap<u32, u64>,
) -> Option<u8> {
    let labelled: u64 = truth.instances.values().sum();
    let (instance, count) = truth.main().filter(|_| 2 * labelled > points)?;
    let all = points_of.get(&instance).copied().unwrap_or_default();
    Some(match instance {
        0 => STRAY,
        _ if 2 * count > all => WHOLE,
        _ if larger.is_some_and(|(of, _)| of == instance) => PART,
        _ => STRAY,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_object_with_most_of_a_true_one_is_whole() {
        let truth = |counts: &[(u32, u64)]| Truth {
            classes: [0; CLASSES],
            instances: counts.iter().copied().collect(),
        };
        let points_of = BTreeMap::from([(0, 1000), (1, 100), (2, 30)]);
        let of = |counts: &[(u32, u64)], larger| is_whole(&truth(counts), 60, larger, &points_of);
        assert_eq!(of(&[(1, 51)], None), Some(WHOLE));
        assert_eq!(of(&[(1, 50)], Some((2, 9))), Some(STRAY));
        assert_eq!(of(&[(1, 50)], Some((1, 9))), Some(PART));
        // Most of its points belong to another object, or to none.
        assert_eq!(of(&[(1, 31), (2, 30)], Some((2, 9))), Some(STRAY));
        assert_eq!(of(&[(0, 31), (2, 29)], Some((2, 9))), Some(STRAY));
        // At least half of its points are unlabelled.
        assert_eq!(of(&[(1, 30)], None), None);
        assert_eq!(of(&[], None), None);
    }
}

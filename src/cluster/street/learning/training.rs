//! Labelled voxels of a drive, to learn from or to score a model with. This method runs the first steps of
//! `street` on the points of a labelled drive, in its own steps `voxels`, `classes` (if the model of shapes
//! is known) and `samples`.
//!
//! *Which voxels.* The voxels with the smallest hashes of their keys are chosen, up to a number: of each
//! class for the model of shapes, and of all classes together for the model of the context. So the second
//! model learns how frequent the classes are. The choice does not depend on tiles. One square of 20 m in five
//! is held out: no model learns from its voxels, and models are scored on them. The features of voxels in one
//! square overlap, so holding out single voxels would score the memory of the model.
//!
//! *Objects.* For the models of objects, all steps of `street` run with the models of voxels. See
//! `object_samples.rs`.
//!
//! *Thinning.* A share of the points, chosen by a hash of their coordinates, is taken before the voxels are
//! made. So neither the order of records nor the files show. The ground is that of all points.

use std::ops::RangeInclusive;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_64_with_seed;

use super::object_samples::{self, ObjectSample};
use super::truth::{self, Known};
use crate::boosting::Model;
use crate::cluster::columns::Voxel;
use crate::cluster::street::classes::classified::Classified;
use crate::cluster::street::classes::features::{self, NAMES, context};
use crate::cluster::street::classes::stage_classes::{self, Around, Classify};
use crate::cluster::street::classes::stage_context;
use crate::cluster::street::model::{self, StreetModel};
use crate::cluster::street::objects::figures;
use crate::cluster::street::settings::{CLASSES, STEP_CLASSES, STEP_OBJECTS, STEP_VOXELS, StreetConfig};
use crate::cluster::street::shares;
use crate::cluster::street::voxels::stage_voxels;
use crate::cluster::street::voxels::stored::{self, Voxels};
use crate::cluster::street::{self, Street};
use crate::cluster::{BytesPer, DriveWindow, Mapped, Method, Reduced, Repeat, Step, TilePoints, TileWindow};
use crate::codec;
use crate::error::{Error, Result};
use crate::model::{Field, Lattice, Reach, TileCloud, TileId};

/// Bytes per point that a tile needs at its peak: the features of all voxels of a tile of the step `classes`.
const BYTES_PER_POINT: u64 = 90;

/// One object of a drive in this many is held out.
const OBJECTS_HELD_OUT: u32 = 5;

const STEPS: [Step; 2] = [step("voxels"), step("samples")];
const STEPS_WITH_CLASSES: [Step; 3] = [step("voxels"), step("classes"), step("samples")];
const STEPS_WITH_OBJECTS: [Step; 9] = street::steps(step("samples"));

const fn step(name: &'static str) -> Step {
    Step { name, settings: &[], bytes: BytesPer::Point(BYTES_PER_POINT), repeat: Repeat::Once }
}

/// Edge of a square that is held out or not, in voxels: 20 m.
const SQUARE: i32 = 133;
/// One square in this many is held out.
const HELD_OUT: u64 = 5;
/// Ratio of the number of samples for the context, of all classes together, to the number of samples of one
/// class for the shapes.
const CONTEXT_SAMPLES: usize = 4;
/// Ratio of the number of samples to learn from to the number of held-out samples, per class.
const FEWER: usize = 4;

/// The purpose of the voxels.
#[derive(Debug, Clone)]
pub(crate) enum Purpose {
    /// Samples for the model of shapes, up to a number per class.
    Shapes {
        /// Seed of the hashes that choose the voxels.
        seed: u64,
        /// The largest number to learn from, per class.
        most: usize,
    },
    /// Samples for the model of the context.
    Context {
        /// Seed of the hashes that choose the voxels.
        seed: u64,
        /// The largest number to learn from is four times this.
        most: usize,
        /// The model that classifies the voxels.
        shapes: Box<Model>,
    },
    /// Samples for the model of objects: all steps of the method, with the models of voxels.
    Objects(Box<Street>),
    /// The score of a model.
    Score(Box<StreetModel>),
}

impl Purpose {
    /// Samples of the objects that the method finds with these models of voxels.
    pub(crate) fn objects(model: StreetModel) -> Result<Self> {
        let street = Street { model: Some(Arc::new(model)), ..Street::new(&StreetConfig::default())? };
        Ok(Self::Objects(Box::new(street)))
    }
}

/// Chooses voxels of a labelled drive and computes their features.
#[derive(Debug, Clone)]
pub(crate) struct Training {
    pub(crate) purpose: Purpose,
    /// Share of the points that is taken, from 0 to 1.
    pub(crate) share: f64,
    /// What the drive knows about its points.
    pub(crate) known: Known,
}

/// A voxel with a label.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Sample {
    /// The samples of a drive are sorted by this.
    hash: u64,
    key: Voxel,
    /// Index of its class.
    pub(crate) class: u8,
    /// Whether it is held out from learning.
    pub(crate) held_out: bool,
    /// Its features.
    pub(crate) features: Vec<f32>,
}

/// Samples of the objects of a drive.
#[derive(Debug, Default)]
pub(crate) struct SamplesOfObjects {
    /// For the model that names them.
    pub(crate) names: Vec<Sample>,
    /// For the model that says whether they are whole.
    pub(crate) wholes: Vec<Sample>,
}

/// Number of voxels by true class (first) and by the class that a model gives them (second).
pub(crate) type Counts = [[u64; CLASSES]; CLASSES];

/// Largest chosen hash per class: for the samples to learn from, and for the held-out samples.
#[derive(Debug, Serialize, Deserialize)]
struct Limits([[u64; CLASSES]; 2]);

impl Limits {
    /// Whether a voxel with this label is chosen.
    fn choose(&self, key: Voxel, label: u8, seed: u64) -> bool {
        let limits = &self.0[usize::from(held_out(key, seed))];
        usize::from(label).checked_sub(1).is_some_and(|place| hash(key, seed) <= limits[place])
    }
}

impl Training {
    /// The samples in the payloads of all tiles, in an order that does not depend on the tiles.
    pub(crate) fn samples(payloads: &[Vec<u8>]) -> Result<Vec<Sample>> {
        let mut samples = Vec::new();
        for payload in payloads {
            samples.extend(codec::decode::<Vec<Sample>>(payload)?);
        }
        samples.sort_unstable_by_key(|sample| (sample.hash, sample.key));
        Ok(samples)
    }

    /// The samples of objects in the payloads of all tiles, in the order of their labels.
    pub(crate) fn objects(payloads: &[Vec<u8>], lattice: Lattice) -> Result<SamplesOfObjects> {
        let mut samples = SamplesOfObjects::default();
        for ObjectSample { label, class, whole, features } in object_samples::reduce(payloads, lattice)? {
            let sample = |class: u8, features: &[f32]| Sample {
                hash: u64::from(label),
                key: [0; 3],
                class,
                held_out: label.is_multiple_of(OBJECTS_HELD_OUT),
                features: features.to_vec(),
            };
            samples.names.extend(class.map(|class| sample(class, &features[..figures::NAMES.len()])));
            samples.wholes.extend(whole.map(|whole| sample(whole, &features)));
        }
        Ok(samples)
    }

    /// The sums of the counts in the payloads of all tiles.
    pub(crate) fn counts(payloads: &[Vec<u8>]) -> Result<Counts> {
        let mut sums = Counts::default();
        for payload in payloads {
            let counts: Counts = codec::decode(payload)?;
            sums.as_flattened_mut()
                .iter_mut()
                .zip(counts.as_flattened())
                .for_each(|(sum, count)| *sum += count);
        }
        Ok(sums)
    }

    fn voxels(&self, tile: &dyn TileWindow) -> Result<Mapped> {
        let points = tile.points(stage_voxels::points_reach(tile.lattice()), false)?;
        let cut = stage_voxels::cut_of(tile, thinned(points, self.share))?;
        let [labels, instances] = self.known.sections(&cut);
        let payload = cut.payload()?;
        let of_street = |number| codec::section(&payload, number);
        let of_both =
            [of_street(stored::SECTION_VOXELS)?, of_street(stored::SECTION_GROUND)?, &labels, &instances];
        Ok(Mapped::payload(codec::pack(&of_both)))
    }

    /// The largest chosen hashes, for `most` voxels of each class, or of all classes together.
    fn limits(drive: &dyn DriveWindow, seed: u64, most: usize, together: bool) -> Result<Limits> {
        let limits = [most, most.div_ceil(FEWER)];
        let mut smallest: [[Smallest; CLASSES]; 2] =
            limits.map(|most| std::array::from_fn(|_| Smallest::new(most)));
        for tile in TileId::first(drive.tiles()) {
            for (key, label) in truth::labelled(drive, tile)? {
                if let Some(place) = usize::from(label).checked_sub(1) {
                    let place = if together { 0 } else { place };
                    smallest[usize::from(held_out(key, seed))][place].add(hash(key, seed));
                }
            }
        }
        let largest = smallest.map(|classes| classes.map(Smallest::largest));
        Ok(Limits(if together { largest.map(|classes| [classes[0]; CLASSES]) } else { largest }))
    }

    /// The label of each of these voxels (0 for voxels of other tiles), and whether it is chosen.
    fn chosen(tile: &dyn TileWindow, voxels: &Voxels, seed: u64) -> Result<(Vec<u8>, Vec<bool>)> {
        let limits: Limits = codec::decode(tile.global(STEP_VOXELS))?;
        let mut labels = truth::labelled(tile, tile.tile())?.into_iter();
        let mut class = vec![0_u8; voxels.len()];
        let mut chosen = vec![false; voxels.len()];
        for voxel in (0..voxels.len()).filter(|&voxel| voxels.owned[voxel]) {
            let Some((key, label)) = labels.next().filter(|(key, _)| *key == voxels.key[voxel]) else {
                return Err(Error::bug("labels and voxels of a tile differ"));
            };
            class[voxel] = label;
            chosen[voxel] = limits.choose(key, label, seed);
        }
        Ok((class, chosen))
    }

    fn samples_of_shapes(tile: &dyn TileWindow, seed: u64) -> Result<Vec<Sample>> {
        let around = Around::load(tile)?;
        let (class, chosen) = Self::chosen(tile, &around.voxels, seed)?;
        let mut samples = Vec::new();
        features::compute(&around.voxels, &around.heights, &chosen, &mut |numbers, rows| {
            let rows = numbers.iter().zip(rows.chunks_exact(NAMES.len()));
            samples.extend(rows.map(|(&voxel, row)| Sample::new(&around.voxels, voxel, &class, seed, row)));
        });
        Ok(samples)
    }

    fn samples_of_context(tile: &dyn TileWindow, seed: u64) -> Result<Vec<Sample>> {
        let Classified { voxels, height, shares } = stage_context::load(tile)?;
        let (class, chosen) = Self::chosen(tile, &voxels, seed)?;
        let mut samples = Vec::new();
        context::compute(&voxels, &height, &shares, &chosen, &mut |numbers, rows| {
            let rows = numbers.iter().zip(rows.chunks_exact(context::NAMES.len()));
            samples.extend(rows.map(|(&voxel, row)| Sample::new(&voxels, voxel, &class, seed, row)));
        });
        Ok(samples)
    }

    fn score(tile: &dyn TileWindow, model: &StreetModel) -> Result<Counts> {
        let labels = truth::labelled(tile, tile.tile())?;
        let around = stage_context::load(tile)?;
        let classify: Classify<'_> = &|rows, shares| model::classify(&model.context, rows, shares);
        let shares = stage_context::classified(&around, classify)?;
        let own = (0..shares.len()).filter(|&voxel| around.voxels.owned[voxel]).map(|voxel| shares[voxel]);
        let mut counts = Counts::default();
        for ((_, label), shares) in labels.into_iter().zip(own) {
            let Some(place) = usize::from(label).checked_sub(1) else { continue };
            counts[place][usize::from(shares::class(&shares))] += 1;
        }
        Ok(counts)
    }
}

impl Sample {
    fn new(voxels: &Voxels, voxel: u32, class: &[u8], seed: u64, row: &[f32]) -> Self {
        let key = voxels.key[voxel as usize];
        Self {
            hash: hash(key, seed),
            key,
            class: class[voxel as usize] - 1,
            held_out: held_out(key, seed),
            features: row.to_vec(),
        }
    }
}

#[cfg(test)]
impl Sample {
    /// A sample that belongs to no voxel.
    pub(crate) fn of_class(class: u8, held_out: bool, features: Vec<f32>) -> Self {
        Self { hash: 0, key: [0; 3], class, held_out, features }
    }
}

/// A pseudo-random number for a voxel.
fn hash(key: Voxel, seed: u64) -> u64 {
    xxh3_64_with_seed(bytemuck::bytes_of(&key), seed)
}

/// Whether the square of a voxel is held out.
fn held_out([i, j, _]: Voxel, seed: u64) -> bool {
    let square = [i.div_euclid(SQUARE), j.div_euclid(SQUARE)];
    xxh3_64_with_seed(bytemuck::bytes_of(&square), seed).is_multiple_of(HELD_OUT)
}

/// The smallest of many numbers, `most` of them at most.
struct Smallest {
    most: usize,
    numbers: Vec<u64>,
}

impl Smallest {
    fn new(most: usize) -> Self {
        Self { most, numbers: Vec::new() }
    }

    fn add(&mut self, number: u64) {
        self.numbers.push(number);
        if self.numbers.len() >= 2 * self.most + 1_000 {
            self.shorten();
        }
    }

    fn shorten(&mut self) {
        self.numbers.sort_unstable();
        self.numbers.truncate(self.most);
    }

    /// The largest of them; 0 if there are none.
    fn largest(mut self) -> u64 {
        self.shorten();
        self.numbers.last().copied().unwrap_or(0)
    }
}

/// The share of the points whose coordinates have the smallest hashes.
fn thinned(points: TilePoints, share: f64) -> TilePoints {
    if share >= 1.0 {
        return points;
    }
    // The upper 32 bits of a hash are a number from 0 to 1 that a double holds exactly.
    let below = |point: [i64; 3]| {
        let upper = xxh3_64_with_seed(bytemuck::bytes_of(&point), 0) >> 32;
        u32::try_from(upper).map_or(0.0, f64::from) / 4_294_967_296.0 < share
    };
    let TilePoints { cloud, core, ground } = points;
    let kept: Vec<bool> = (0..cloud.len()).map(|point| below(cloud.lattice_point(point))).collect();
    let fields = cloud.fields.into_iter().map(|(field, values)| (field, only(values, &kept))).collect();
    let cloud = TileCloud {
        lattice: cloud.lattice,
        origin: cloud.origin,
        x: only(cloud.x, &kept),
        y: only(cloud.y, &kept),
        z: only(cloud.z, &kept),
        id: only(cloud.id, &kept),
        fields,
    };
    TilePoints { cloud, core: only(core, &kept), ground: only(ground, &kept) }
}

fn only<T>(values: Vec<T>, kept: &[bool]) -> Vec<T> {
    values.into_iter().zip(kept).filter(|(_, kept)| **kept).map(|(value, _)| value).collect()
}

impl Method for Training {
    fn name(&self) -> &'static str {
        "street"
    }

    fn object_size(&self) -> RangeInclusive<u64> {
        1..=u64::MAX
    }

    fn steps(&self) -> &[Step] {
        match self.purpose {
            Purpose::Shapes { .. } => &STEPS,
            Purpose::Context { .. } | Purpose::Score(_) => &STEPS_WITH_CLASSES,
            Purpose::Objects(_) => &STEPS_WITH_OBJECTS,
        }
    }

    fn fields(&self) -> &[Field] {
        self.known.fields()
    }

    fn depends_on(&self, step: usize) -> Vec<(&'static str, String)> {
        if step == STEP_VOXELS {
            return vec![("share of the points", self.share.to_string())];
        }
        let which =
            |seed: &u64, most: &usize| vec![("samples", most.to_string()), ("seed", seed.to_string())];
        let of_model = |checksum: u64| ("model", format!("{checksum:016x}"));
        match &self.purpose {
            Purpose::Shapes { seed, most } => which(seed, most),
            Purpose::Context { seed, most, shapes } => {
                which(seed, most).into_iter().chain([of_model(shapes.checksum())]).collect()
            }
            Purpose::Objects(street) => street.depends_on(step),
            Purpose::Score(model) => vec![of_model(model.checksum())],
        }
    }

    fn planning_reach(&self, lattice: Lattice) -> Reach {
        Reach::Exact { metres: lattice.metres(stage_voxels::points_reach(lattice)) }
    }

    fn border_reach(&self, step: usize, lattice: Lattice) -> i64 {
        match &self.purpose {
            Purpose::Objects(street) => street.border_reach(step, lattice),
            _ => 0,
        }
    }

    fn map(&self, step: usize, tile: &dyn TileWindow) -> Result<Mapped> {
        let samples = |samples: Vec<Sample>| Ok(Mapped::payload(codec::encode(&samples)?));
        let shapes =
            |model: &Model| stage_classes::map(tile, &|rows, shares| model::classify(model, rows, shares));
        match (step, &self.purpose) {
            (STEP_VOXELS, _) => self.voxels(tile),
            (STEP_OBJECTS, Purpose::Objects(_)) => {
                let instances = truth::instances(tile, tile.tile())?;
                let labelled = truth::labelled(tile, tile.tile())?;
                Ok(Mapped::payload(object_samples::map(tile, labelled, &instances)?))
            }
            (_, Purpose::Objects(street)) => street.map(step, tile),
            (_, Purpose::Shapes { seed, .. }) => samples(Self::samples_of_shapes(tile, *seed)?),
            (STEP_CLASSES, Purpose::Context { shapes: model, .. }) => shapes(model),
            (_, Purpose::Context { seed, .. }) => samples(Self::samples_of_context(tile, *seed)?),
            (STEP_CLASSES, Purpose::Score(model)) => shapes(&model.shapes),
            (_, Purpose::Score(model)) => Ok(Mapped::payload(codec::encode(&Self::score(tile, model)?)?)),
        }
    }

    fn reduce(&self, step: usize, drive: &dyn DriveWindow) -> Result<Reduced> {
        let limits = match (step, &self.purpose) {
            // There is no warning of sparse points: its counts would be in the section that has the labels
            // here.
            (STEP_VOXELS, Purpose::Objects(_)) => return Ok(Reduced::Global(Vec::new())),
            (STEP_VOXELS.., Purpose::Objects(street)) if step < STEP_OBJECTS => {
                return street.reduce(step, drive);
            }
            (STEP_VOXELS, Purpose::Shapes { seed, most }) => Self::limits(drive, *seed, *most, false)?,
            (STEP_VOXELS, Purpose::Context { seed, most, .. }) => {
                Self::limits(drive, *seed, CONTEXT_SAMPLES * most, true)?
            }
            (STEP_VOXELS, Purpose::Score(_))
            | (STEP_CLASSES, Purpose::Context { .. } | Purpose::Score(_)) => {
                return Ok(Reduced::Global(Vec::new()));
            }
            _ => return Err(Error::bug("samples are not joined to objects")),
        };
        Ok(Reduced::Global(codec::encode(&limits)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_takes_the_same_places_whatever_the_order_of_the_points() {
        let places: Vec<[i64; 3]> = (0..4_000).map(|n| [n * 7 % 4_001, n * n % 999 - 500, n]).collect();
        let of = |places: &[[i64; 3]]| {
            let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, places);
            let core = places.iter().map(|[x, ..]| x % 2 == 0).collect();
            let ground = places.iter().map(|[.., z]| z % 3 == 0).collect();
            let thin = thinned(TilePoints { cloud, core, ground }, 0.25);
            let mut left: Vec<([i64; 3], bool, bool)> = (0..thin.cloud.len())
                .map(|point| (thin.cloud.lattice_point(point), thin.core[point], thin.ground[point]))
                .collect();
            left.sort_unstable();
            left
        };
        let expected = of(&places);
        assert!((900..1_100).contains(&expected.len()), "{}", expected.len());
        assert!(
            expected.iter().all(|([x, _, z], core, ground)| (x % 2 == 0, z % 3 == 0) == (*core, *ground))
        );
        let reversed: Vec<[i64; 3]> = places.iter().rev().copied().collect();
        assert_eq!(of(&reversed), expected);
    }
}

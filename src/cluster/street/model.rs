//! The model of `street`: how it classifies voxels and names objects, and which models it accepts.
//!
//! It consists of two to four models. The first classifies a voxel by the shape of its surroundings, the
//! second by the classes that the first finds there. The third is optional and names an object by the
//! features of its voxels. The fourth is optional and says whether an object is whole or a piece.

use std::sync::{Arc, OnceLock};

use xxhash_rust::xxh3::xxh3_64;

use super::settings::{CLASSES, Scene};
use super::shares::{self, GROUND, POLE, TREE, VEHICLE};
use crate::boosting::{BoostingError, Model};
use crate::cluster::street::classes::classified::Shares;
use crate::cluster::street::classes::features::{self, context};
use crate::cluster::street::objects::figures;
use crate::cluster::street::objects::wholes;
use crate::error::Result;

/// Names of the classes. The code of a class is its place plus one.
pub(crate) const CLASS_NAMES: [&str; CLASSES] =
    ["none", "tree", "pole", "vehicle", "building", "fence or hedge", "small", "wire"];

/// The model of `street`. Its file holds the files of its models, one after the other.
#[derive(Debug, Clone)]
pub struct StreetModel {
    /// Classifies voxels by shapes.
    pub shapes: Model,
    /// Classifies voxels by the classes around them.
    pub context: Model,
    /// Names objects. Without it, an object has the class of its core.
    pub objects: Option<Model>,
    /// Finds pieces of objects. Without it, each piece is an object.
    pub wholes: Option<Model>,
}

impl StreetModel {
    /// Decodes the model in `content`. It must fit the features and classes of `street`. `file` is its name
    /// in messages.
    ///
    /// # Errors
    /// A [`BoostingError`] that says what is wrong with the file.
    pub fn decode(file: &str, content: &[u8]) -> Result<Self, BoostingError> {
        let (of_voxels, rest) = Self::split(file, content)?;
        // The first model of the rest, and the bytes that follow it. Both are empty if an optional model is
        // missing.
        let split = |rest| if <[u8]>::is_empty(rest) { Ok((rest, rest)) } else { Model::split(file, rest) };
        let optional = |bytes: &[u8], features: &[&str], classes: &[&str]| {
            if bytes.is_empty() { Ok(None) } else { read(file, bytes, features, classes).map(Some) }
        };
        let (objects, wholes) = split(rest)?;
        let objects = optional(objects, &figures::NAMES, &CLASS_NAMES)?;
        let wholes = optional(wholes, &wholes::NAMES, &wholes::CLASS_NAMES)?;
        Ok(Self { objects, wholes, ..of_voxels })
    }

    /// Decodes the parts of the model that classify voxels. The parts for objects are not read, because they
    /// are learned again.
    ///
    /// # Errors
    /// A [`BoostingError`] that says what is wrong with the file.
    pub fn decode_of_voxels(file: &str, content: &[u8]) -> Result<Self, BoostingError> {
        Self::split(file, content).map(|(of_voxels, _)| of_voxels)
    }

    /// The parts that classify voxels, and the bytes that follow them.
    fn split<'a>(file: &str, content: &'a [u8]) -> Result<(Self, &'a [u8]), BoostingError> {
        let (shapes, context) = Model::split(file, content)?;
        let shapes = read(file, shapes, &features::NAMES, &CLASS_NAMES)?;
        if context.is_empty() {
            let what = "it has no model of the classes around a voxel".to_owned();
            return Err(BoostingError::Unfit { origin: file.to_owned(), what });
        }
        let (context, rest) = Model::split(file, context)?;
        let context = read(file, context, &context::NAMES, &CLASS_NAMES)?;
        Ok((Self { shapes, context, objects: None, wholes: None }, rest))
    }

    /// The bytes of the model.
    ///
    /// # Errors
    /// A defect of chainage, if a list of the model cannot be encoded.
    pub fn encode(&self) -> Result<Vec<u8>> {
        let mut bytes = self.shapes.encode()?;
        bytes.extend(self.context.encode()?);
        for of_objects in self.objects.iter().chain(&self.wholes) {
            bytes.extend(of_objects.encode()?);
        }
        Ok(bytes)
    }

    /// A number that distinguishes models.
    #[must_use]
    pub fn checksum(&self) -> u64 {
        let of_objects = self.objects.iter().chain(&self.wholes);
        of_objects.fold(self.checksum_of_voxels(), |sum, model| of_both(sum, model.checksum()))
    }

    /// A number that distinguishes models by the parts that classify voxels.
    #[must_use]
    pub(crate) fn checksum_of_voxels(&self) -> u64 {
        of_both(self.shapes.checksum(), self.context.checksum())
    }
}

/// One part of the model in `file`, if it fits these features and classes.
fn read(file: &str, bytes: &[u8], features: &[&str], classes: &[&str]) -> Result<Model, BoostingError> {
    let model = Model::decode(file, bytes)?;
    model.check(file, features, classes)?;
    Ok(model)
}

fn of_both(one: u64, other: u64) -> u64 {
    xxh3_64(bytemuck::bytes_of(&[one, other].map(u64::to_le_bytes)))
}

/// The models that `scripts/train_model.sh` made from synthetic drives. `benches/results/street-model.md` and
/// `forest-model.md` are their cards.
const OF_STREETS: &[u8] = include_bytes!("model.bin");
const OF_FORESTS: &[u8] = include_bytes!("forest.bin");

/// A built-in model. It is decoded once.
pub(crate) fn built_in(scene: Scene) -> Result<Arc<StreetModel>, BoostingError> {
    type Decoded = OnceLock<Result<Arc<StreetModel>, BoostingError>>;
    static OF_STREET: Decoded = OnceLock::new();
    static OF_FOREST: Decoded = OnceLock::new();
    let decode = |bytes| StreetModel::decode("the built-in model", bytes).map(Arc::new);
    match scene {
        Scene::Street => OF_STREET.get_or_init(|| decode(OF_STREETS)),
        Scene::Forest => OF_FOREST.get_or_init(|| decode(OF_FORESTS)),
    }
    .clone()
}

/// Classifies voxels by their features: one set of probabilities per row.
pub(crate) fn classify(model: &Model, rows: &[f32], shares: &mut [Shares]) -> Result<()> {
    shares.copy_from_slice(&model.shares(rows)?);
    Ok(())
}

/// Class and confidence of an object, by its features. `class` is the class that the earlier steps gave it.
///
/// An object gets another class only if that class has more than half of the shares and is not `none`. A tree
/// or a pole can only become a vehicle, because its stem already decided it as a whole. The study is in
/// `benches/results/street.md`.
pub(crate) fn name(model: &Model, features: &[f32], class: u8) -> Result<(u8, u8)> {
    let shares = model.shares::<CLASSES>(features)?;
    let shares = shares.first().copied().unwrap_or_default();
    let named = shares::class(&shares);
    let is_clear = shares[usize::from(named)] > u8::MAX / 2 && named != GROUND;
    let may_be = named == VEHICLE || !matches!(class, TREE | POLE);
    let class = if is_clear && may_be { named } else { class };
    Ok((class, shares[usize::from(class)].max(1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_models_fit_the_features_and_are_small() {
        assert!(OF_STREETS.len() + OF_FORESTS.len() <= 2 << 20);
        for (scene, bytes) in [(Scene::Street, OF_STREETS), (Scene::Forest, OF_FORESTS)] {
            let model = built_in(scene).unwrap();
            assert!(Arc::ptr_eq(&model, &built_in(scene).unwrap()));
            assert_eq!(model.encode().unwrap(), bytes);
            names_anything(&model);
        }
        let [street, forest] = [Scene::Street, Scene::Forest].map(|scene| built_in(scene).unwrap());
        assert_ne!(street.checksum(), forest.checksum());
    }

    fn names_anything(model: &StreetModel) {
        let mut shares = [Shares::default(); 3];
        classify(&model.shapes, &[0.0; 3 * features::NAMES.len()], &mut shares).unwrap();
        classify(&model.context, &[0.0; 3 * context::NAMES.len()], &mut shares).unwrap();
        assert!(shares.iter().all(|shares| shares.iter().map(|&share| u32::from(share)).sum::<u32>() == 255));
        let objects = model.objects.as_ref().unwrap();
        for class in TREE..=shares::WIRE {
            let (named, confidence) = name(objects, &[0.0; figures::NAMES.len()], class).unwrap();
            assert!(named != GROUND && confidence > 0);
        }
    }

    #[test]
    fn an_object_gets_a_clear_name_and_a_tree_only_becomes_a_vehicle() {
        use shares::{BUILDING, FENCE, SMALL};
        let row = |length: f32| {
            let mut row = [0.0; figures::NAMES.len()];
            row[0] = length;
            row
        };
        let mut samples = crate::boosting::Samples::new(&figures::NAMES, &CLASS_NAMES);
        for number in 0..900_u16 {
            samples.push(&row(4.0), VEHICLE).unwrap();
            samples.push(&row(1.0), FENCE).unwrap();
            samples.push(&row(9.0), GROUND).unwrap();
            samples.push(&row(2.0), [FENCE, SMALL, BUILDING][usize::from(number % 3)]).unwrap();
        }
        let settings = crate::boosting::Settings { rounds: 30, features: 1.0, ..Default::default() };
        let model = crate::boosting::learn(&samples, &settings, &|_| Ok(())).unwrap();
        let named = |length, class| name(&model, &row(length), class).unwrap().0;
        assert_eq!([SMALL, BUILDING, TREE, POLE].map(|class| named(4.0, class)), [VEHICLE; 4]);
        assert_eq!([SMALL, VEHICLE, TREE, POLE].map(|class| named(1.0, class)), [FENCE, FENCE, TREE, POLE]);
        // The model says `none`, or gives no class more than half of the shares.
        assert_eq!([SMALL, TREE].map(|class| named(9.0, class)), [SMALL, TREE]);
        assert_eq!([SMALL, VEHICLE].map(|class| named(2.0, class)), [SMALL, VEHICLE]);
        assert!(
            name(&model, &row(4.0), TREE).unwrap().1 > 200 && name(&model, &row(1.0), TREE).unwrap().1 < 50
        );
    }

    #[test]
    fn voxels_do_not_depend_on_the_models_of_objects_and_these_may_be_missing() {
        let whole = (*built_in(Scene::Street).unwrap()).clone();
        let voxels = StreetModel { objects: None, wholes: None, ..whole.clone() };
        assert_eq!(whole.checksum_of_voxels(), voxels.checksum());
        let names = StreetModel { wholes: None, ..whole.clone() };
        assert_ne!(whole.checksum(), names.checksum());
        assert_ne!(names.checksum(), voxels.checksum());
        for model in [whole, names, voxels] {
            let read = StreetModel::decode("my.model", &model.encode().unwrap()).unwrap();
            assert_eq!(read.checksum(), model.checksum());
            assert_eq!(read.objects.is_some(), model.objects.is_some());
            assert_eq!(read.wholes.is_some(), model.wholes.is_some());
        }
    }

    #[test]
    fn a_model_for_other_voxels_and_half_a_model_are_refused() {
        let mut samples = crate::boosting::Samples::new(&["a"], &["low", "high"]);
        (0..200_u8).for_each(|n| samples.push(&[f32::from(n)], u8::from(n > 99)).unwrap());
        let settings = crate::boosting::Settings { rounds: 1, ..crate::boosting::Settings::default() };
        let other = crate::boosting::learn(&samples, &settings, &|_| Ok(())).unwrap().encode().unwrap();
        let error = StreetModel::decode("my.model", &other).unwrap_err().to_string();
        assert!(error.starts_with("my.model does not fit this program: it has 1 features"), "{error}");
        let half = built_in(Scene::Street).unwrap().shapes.encode().unwrap();
        let error = StreetModel::decode("my.model", &half).unwrap_err().to_string();
        assert!(error.contains("it has no model of the classes around a voxel"), "{error}");
        let foreign =
            [&half[..], &built_in(Scene::Street).unwrap().context.encode().unwrap(), &other].concat();
        let error = StreetModel::decode("my.model", &foreign).unwrap_err().to_string();
        assert!(error.contains("it has 1 features"), "{error}");
        // The parts of a model for objects may fit another version only. Its parts for voxels can be kept.
        let voxels = StreetModel::decode_of_voxels("my.model", &foreign).unwrap();
        assert!(voxels.objects.is_none() && voxels.wholes.is_none());
        assert_eq!(voxels.checksum(), built_in(Scene::Street).unwrap().checksum_of_voxels());
        let error = StreetModel::decode("my.model", &OF_STREETS[..half.len() + 20]).unwrap_err().to_string();
        assert!(error.contains("damaged"), "{error}");
    }
}

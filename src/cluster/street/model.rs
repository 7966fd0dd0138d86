//! The model of `street`: how it classifies voxels, and what a model must be to do so. It is two models: the
//! first classifies a voxel by the shape of what is around it, the second by the classes that the first finds
//! around it.

use std::sync::{Arc, OnceLock};

use xxhash_rust::xxh3::xxh3_64;

use super::classified::Shares;
use super::features::{self, context};
use super::settings::CLASSES;
use crate::boosting::{BoostingError, Model};
use crate::error::Result;

/// Names of the classes. The code of a class is its place plus one.
pub(crate) const CLASS_NAMES: [&str; CLASSES] =
    ["none", "tree", "pole", "vehicle", "building", "fence or hedge", "small", "wire"];

/// The model of `street`. Its file is the files of both, one after the other.
#[derive(Debug, Clone)]
pub struct StreetModel {
    /// Classifies voxels by shapes.
    pub shapes: Model,
    /// Classifies voxels by the classes around them.
    pub context: Model,
}

impl StreetModel {
    /// The model in the content of `file` (a name for messages). It is for the features and classes of
    /// `street`.
    ///
    /// # Errors
    /// A [`BoostingError`] that says what is wrong with the file.
    pub fn decode(file: &str, content: &[u8]) -> Result<Self, BoostingError> {
        let (shapes, context) = Model::split(file, content)?;
        let shapes = Model::decode(file, shapes)?;
        shapes.check(file, &features::NAMES, &CLASS_NAMES)?;
        if context.is_empty() {
            let what = "it has no model of the classes around a voxel".to_owned();
            return Err(BoostingError::Unfit { origin: file.to_owned(), what });
        }
        let context = Model::decode(file, context)?;
        context.check(file, &context::NAMES, &CLASS_NAMES)?;
        Ok(Self { shapes, context })
    }

    /// The bytes of the model.
    ///
    /// # Errors
    /// A defect of chainage, if a list of it cannot be encoded.
    pub fn encode(&self) -> Result<Vec<u8>> {
        let mut bytes = self.shapes.encode()?;
        bytes.extend(self.context.encode()?);
        Ok(bytes)
    }

    /// A number that tells models apart.
    #[must_use]
    pub fn checksum(&self) -> u64 {
        let both = [self.shapes.checksum(), self.context.checksum()];
        xxh3_64(bytemuck::bytes_of(&both.map(u64::to_le_bytes)))
    }
}

/// The model that `scripts/train_model.sh` made from synthetic drives. `benches/results/street-model.md` is
/// its card.
const BUILT_IN: &[u8] = include_bytes!("model.bin");

/// The built-in model. It is decoded once.
pub(crate) fn built_in() -> Result<Arc<StreetModel>, BoostingError> {
    static DECODED: OnceLock<Result<Arc<StreetModel>, BoostingError>> = OnceLock::new();
    let decode = || StreetModel::decode("the built-in model", BUILT_IN).map(Arc::new);
    DECODED.get_or_init(decode).clone()
}

/// Classifies voxels by their features: one set of probabilities per row.
pub(super) fn classify(model: &Model, rows: &[f32], shares: &mut [Shares]) -> Result<()> {
    shares.copy_from_slice(&model.shares(rows)?);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_model_fits_the_features_and_is_small() {
        let model = built_in().unwrap();
        assert!(BUILT_IN.len() <= 2 << 20, "{} bytes", BUILT_IN.len());
        assert!(Arc::ptr_eq(&model, &built_in().unwrap()));
        assert_eq!(model.encode().unwrap(), BUILT_IN);
        let mut shares = [Shares::default(); 3];
        classify(&model.shapes, &[0.0; 3 * features::NAMES.len()], &mut shares).unwrap();
        classify(&model.context, &[0.0; 3 * context::NAMES.len()], &mut shares).unwrap();
        assert!(shares.iter().all(|shares| shares.iter().map(|&share| u32::from(share)).sum::<u32>() == 255));
    }

    #[test]
    fn a_model_for_other_voxels_and_half_a_model_are_refused() {
        let mut samples = crate::boosting::Samples::new(&["a"], &["low", "high"]);
        (0..200_u8).for_each(|n| samples.push(&[f32::from(n)], u8::from(n > 99)).unwrap());
        let settings = crate::boosting::Settings { rounds: 1, ..crate::boosting::Settings::default() };
        let other = crate::boosting::learn(&samples, &settings, &|_| ()).unwrap().encode().unwrap();
        let error = StreetModel::decode("my.model", &other).unwrap_err().to_string();
        assert!(error.starts_with("my.model does not fit this program: it has 1 features"), "{error}");
        let half = built_in().unwrap().shapes.encode().unwrap();
        let error = StreetModel::decode("my.model", &half).unwrap_err().to_string();
        assert!(error.contains("it has no model of the classes around a voxel"), "{error}");
        let error = StreetModel::decode("my.model", &BUILT_IN[..half.len() + 20]).unwrap_err().to_string();
        assert!(error.contains("damaged"), "{error}");
    }
}

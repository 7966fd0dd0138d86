//! The model of `street`: how it classifies voxels, and what a model must be to do so.

use std::sync::{Arc, OnceLock};

use super::classified::Shares;
use super::features;
use super::settings::CLASSES;
use crate::boosting::{BoostingError, Model};
use crate::error::Result;

/// Names of the classes. The code of a class is its place plus one.
pub(crate) const CLASS_NAMES: [&str; CLASSES] =
    ["none", "tree", "pole", "vehicle", "building", "fence or hedge", "small", "wire"];

/// The model in the content of `file`. It is for the features and classes of `street`.
pub(crate) fn read(file: &str, content: &[u8]) -> Result<Model, BoostingError> {
    let model = Model::decode(file, content)?;
    model.check(file, &features::NAMES, &CLASS_NAMES)?;
    Ok(model)
}

/// The model that `scripts/train_model.sh` made from synthetic drives. `benches/results/street-model.md` is its card.
const BUILT_IN: &[u8] = include_bytes!("model.bin");

/// The built-in model. It is decoded once.
pub(crate) fn built_in() -> Result<Arc<Model>, BoostingError> {
    static DECODED: OnceLock<Result<Arc<Model>, BoostingError>> = OnceLock::new();
    DECODED.get_or_init(|| read("the built-in model", BUILT_IN).map(Arc::new)).clone()
}

/// Classifies voxels by their features: `NAMES.len()` values and one set of probabilities per voxel.
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
        let mut shares = [Shares::default(); 3];
        classify(&model, &[0.0; 3 * features::NAMES.len()], &mut shares).unwrap();
        assert!(shares.iter().all(|shares| shares.iter().map(|&share| u32::from(share)).sum::<u32>() == 255));
    }

    #[test]
    fn a_model_for_other_voxels_is_refused() {
        let mut samples = crate::boosting::Samples::new(&["a"], &["low", "high"]);
        (0..200_u8).for_each(|n| samples.push(&[f32::from(n)], u8::from(n > 99)).unwrap());
        let settings = crate::boosting::Settings { rounds: 1, ..crate::boosting::Settings::default() };
        let other = crate::boosting::learn(&samples, &settings, &|_| ()).unwrap().encode().unwrap();
        let error = read("my.model", &other).unwrap_err().to_string();
        assert!(error.starts_with("my.model does not fit this program: it has 1 features"), "{error}");
    }
}

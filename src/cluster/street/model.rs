//! The model of `street`: how it classifies voxels, and what a model must be to do so.

use std::sync::OnceLock;

use xxhash_rust::xxh3::xxh3_64;

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

/// Classifies voxels by their features: `NAMES.len()` values and one set of probabilities per voxel.
pub(super) fn classify(model: &Model, rows: &[f32], shares: &mut [Shares]) -> Result<()> {
    shares.copy_from_slice(&model.shares(rows)?);
    Ok(())
}

/// The model that the program contains. `scripts/train_model.sh` makes it from synthetic drives alone.
const BUILT_IN: &[u8] = include_bytes!("model.bin");

/// The model of a run: the one that the program contains, or that of a file.
#[derive(Debug, Clone)]
pub(super) struct StreetModel {
    checksum: u64,
    decoded: OnceLock<Model>,
}

impl StreetModel {
    /// The model that the program contains. It is decoded at its first use.
    pub(super) fn built_in() -> Self {
        Self { checksum: xxh3_64(BUILT_IN), decoded: OnceLock::new() }
    }

    /// The model in the content of `file`.
    pub(super) fn of_file(file: &str, content: &[u8]) -> Result<Self, BoostingError> {
        let decoded = OnceLock::from(read(file, content)?);
        Ok(Self { checksum: xxh3_64(content), decoded })
    }

    /// Checksum of the file of the model.
    pub(super) fn checksum(&self) -> u64 {
        self.checksum
    }

    /// The model.
    pub(super) fn get(&self) -> Result<&Model> {
        if let Some(model) = self.decoded.get() {
            return Ok(model);
        }
        let model = read("the built-in model", BUILT_IN)?;
        Ok(self.decoded.get_or_init(|| model))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_model_is_for_these_features_and_classes() {
        StreetModel::built_in().get().unwrap();
    }
}

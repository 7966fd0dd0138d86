//! The model of `street`: how it classifies voxels, and what a model must be to do so.

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

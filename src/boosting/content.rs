//! The content of a model, and where it comes from.

use serde::{Deserialize, Serialize};

use super::tree::Tree;

/// What a model was learned from, and by which settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct About {
    /// The settings, for a reader.
    pub settings: String,
    /// The seed of the learning.
    pub seed: u64,
    /// Samples of each class.
    pub samples: Vec<u64>,
    /// Share of each feature in the gain of all splits.
    pub importance: Vec<f64>,
    /// The sources of the samples, if its maker named them.
    pub trained_on: Vec<TrainedOn>,
}

/// A source of samples.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct TrainedOn {
    /// Its name.
    pub name: String,
    /// Samples of each class.
    pub samples: Vec<u64>,
}

/// The content of the file of a model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Content {
    pub(super) features: Vec<String>,
    pub(super) classes: Vec<String>,
    /// Per feature, ascending.
    pub(super) thresholds: Vec<Vec<f32>>,
    /// Score of each class before the first tree.
    pub(super) base: Vec<i32>,
    /// One tree per class and round.
    pub(super) trees: Vec<Tree>,
    pub(super) about: About,
}

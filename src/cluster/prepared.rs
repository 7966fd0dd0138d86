//! Methods that have to know something of the whole drive before they can look at a tile: statistics of fields, or an
//! epsilon that is estimated. The engine finds it out, and gets a method of one pass.

use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

use super::Clusterer;
use crate::config::ConfigError;
use crate::model::{Field, FieldSpace};

/// Settings of the section `[epsilon]`: how a radius is estimated where a method has `epsilon = "auto"`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EpsilonConfig {
    /// Neighbours that the curve starts with, the point itself included, 8 to 200. Default 40 (the paper on estimating
    /// epsilon, section 4.2.2).
    pub k: u64,
    /// Points whose neighbours are looked for, at most about; neighbours are always looked for among all points.
    /// 0: every point. Default 2,000,000 (chosen: the standard error is then below a thousandth of the mean).
    pub max_queries: u64,
    /// Decides which points are asked where there are more. Default 1.
    pub seed: u64,
}

impl Default for EpsilonConfig {
    fn default() -> Self {
        Self { k: 40, max_queries: 2_000_000, seed: 1 }
    }
}

impl EpsilonConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// [`ConfigError::Value`] with the key and the range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        if !(8..=200).contains(&self.k) {
            return Err(ConfigError::value("epsilon.k", self.k, "8 to 200 neighbours"));
        }
        Ok(())
    }
}

/// What a method has to know of the whole drive.
#[derive(Debug, Clone, PartialEq)]
pub struct Needs {
    /// Fields that distances are taken in, standardised; empty for x, y and z in metres.
    pub fields: Vec<Field>,
    /// Weight of each field, or nothing where all are 1.
    pub weights: Vec<f64>,
    /// Whether epsilon is to be estimated.
    pub epsilon: bool,
}

/// A method that has to know something of the whole drive; see the module.
pub trait PreparedClusterer: std::fmt::Debug + Send + Sync {
    /// Name in the registry and of the section of its settings.
    fn name(&self) -> &'static str;

    /// What it has to know.
    fn needs(&self) -> &Needs;

    /// Smallest and largest number of points of an object, applied to whole objects.
    fn object_size(&self) -> RangeInclusive<u64>;

    /// The method, now that this is known: the space that distances are taken in, and epsilon in its unit if it was
    /// asked for.
    ///
    /// # Errors
    /// When epsilon is out of range.
    fn prepare(&self, space: &FieldSpace, epsilon: Option<f64>) -> Result<Box<dyn Clusterer>, ConfigError>;
}

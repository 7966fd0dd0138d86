//! Settings of the estimation of epsilon.

use serde::{Deserialize, Serialize};

use super::{LARGEST_K, SMALLEST_K};
use crate::config::ConfigError;

/// Settings of the section `[epsilon]`: how a radius is estimated if a method has `epsilon = "auto"`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EpsilonConfig {
    /// Number of neighbours of the first curve, the point itself included, 8 to 200. Default 40 (Wang et al.
    /// 2019, section 4.2.2).
    pub k: u64,
    /// Approximate largest number of points whose neighbours are searched, at least 0; with 0, every point.
    /// The neighbours are always searched among all points. Default 2,000,000 (chosen: the standard error is
    /// then below a thousandth of the mean).
    pub max_queries: u64,
    /// Seed of the selection of these points by their coordinates, if there are more. At least 0. Default 1.
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
        if !(SMALLEST_K as u64..=LARGEST_K as u64).contains(&self.k) {
            let expected = format!("{SMALLEST_K} to {LARGEST_K} neighbours");
            return Err(ConfigError::value("epsilon.k", self.k, expected));
        }
        Ok(())
    }
}

//! Settings of the estimation of epsilon.

use serde::{Deserialize, Serialize};

use crate::config::ConfigError;

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

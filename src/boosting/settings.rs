//! Settings of learning, with their ranges.

use super::error::BoostingError;
use super::tree::MOST_LEAVES;

/// Settings of [`learn`](super::learn()).
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Rounds, each with a tree per class, 1 to 1000.
    pub rounds: usize,
    /// Largest number of leaves of a tree, 2 to 32.
    pub leaves: usize,
    /// Learning rate: share of the step towards the best value of a leaf that is taken, above 0 to 1.
    pub rate: f64,
    /// Regularisation: added to the curvature of a leaf, 0 to 1,000,000. The mean weight of a sample is 1.
    pub l2: f64,
    /// Smallest number of samples of a leaf, at least 1.
    pub leaf_samples: u64,
    /// Share of the features among which a split chooses, above 0 to 1.
    pub features: f64,
    /// Share of the samples from which a tree learns, above 0 to 1. They are drawn again for each tree
    /// (Friedman 2002, doi:10.1016/S0167-9473(01)00065-2).
    pub subsample: f64,
    /// Largest number of bins of a feature, 2 to 255.
    pub bins: usize,
    /// Seed by which these features and samples are chosen.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Self {
        let leaf_samples = 60;
        let (rate, l2, features, subsample) = (0.15, 1.0, 0.5, 1.0);
        Self { rounds: 60, leaves: 24, rate, l2, leaf_samples, features, subsample, bins: 64, seed: 0 }
    }
}

impl Settings {
    /// Checks every range.
    ///
    /// # Errors
    /// [`BoostingError::Setting`] with the name and the range.
    pub fn validate(&self) -> Result<(), BoostingError> {
        let checks = [
            ("rounds", (1..=1000).contains(&self.rounds), self.rounds.to_string(), "1 to 1000"),
            ("leaves", (2..=MOST_LEAVES).contains(&self.leaves), self.leaves.to_string(), "2 to 32"),
            ("rate", self.rate > 0.0 && self.rate <= 1.0, self.rate.to_string(), "above 0 and at most 1"),
            ("l2", (0.0..=1e6).contains(&self.l2), self.l2.to_string(), "0 to 1,000,000"),
            ("leaf_samples", self.leaf_samples > 0, self.leaf_samples.to_string(), "at least 1"),
            (
                "features",
                self.features > 0.0 && self.features <= 1.0,
                self.features.to_string(),
                "above 0 and at most 1",
            ),
            (
                "subsample",
                self.subsample > 0.0 && self.subsample <= 1.0,
                self.subsample.to_string(),
                "above 0 and at most 1",
            ),
            ("bins", (2..=255).contains(&self.bins), self.bins.to_string(), "2 to 255"),
        ];
        for (key, valid, value, expected) in checks {
            if !valid {
                return Err(BoostingError::Setting { key, value, expected });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_range_are_refused_with_their_name() {
        let default = Settings::default;
        for (settings, says) in [
            (Settings { rounds: 0, ..default() }, "rounds = 0"),
            (Settings { leaves: 33, ..default() }, "leaves = 33"),
            (Settings { rate: 0.0, ..default() }, "rate = 0"),
            (Settings { l2: f64::NAN, ..default() }, "l2 = NaN"),
            (Settings { leaf_samples: 0, ..default() }, "leaf_samples = 0"),
            (Settings { features: 1.5, ..default() }, "features = 1.5"),
            (Settings { subsample: 0.0, ..default() }, "subsample = 0"),
            (Settings { bins: 256, ..default() }, "bins = 256"),
        ] {
            let error = settings.validate().unwrap_err().to_string();
            assert!(error.starts_with(says), "{error}");
        }
        default().validate().unwrap();
    }
}

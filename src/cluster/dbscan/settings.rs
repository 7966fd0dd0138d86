//! Settings of `dbscan`: variant, radius, sizes, and the fields in which distances are measured.

use serde::{Deserialize, Serialize};

use crate::config::ConfigError;
use crate::model::{Field, Lattice, Reach};

/// Name of the method and of its section.
pub(super) const NAME: &str = "dbscan";

/// A radius that is a number, or that is estimated from the drive.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Epsilon {
    /// The radius.
    Given(f64),
    /// Estimated from the points of the drive.
    Estimated(Auto),
}

/// The word that requests an estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Auto {
    /// `auto`.
    #[serde(rename = "auto")]
    Auto,
}

impl Epsilon {
    /// To be estimated.
    pub const AUTO: Self = Self::Estimated(Auto::Auto);
}

impl From<f64> for Epsilon {
    fn from(radius: f64) -> Self {
        Self::Given(radius)
    }
}

impl std::fmt::Display for Epsilon {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Given(radius) => radius.fmt(out),
            Self::Estimated(Auto::Auto) => out.write_str("auto"),
        }
    }
}

/// How points form an object of a drive, or a cluster of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DbscanVariant {
    /// Points connected by steps of at most epsilon. Objects whose number of points is not in range are
    /// dropped: their points are noise.
    Size,
    /// Core points (at least `min_points` points within epsilon, itself included) connected by such steps,
    /// with the border points around them.
    Core,
}

/// Settings of the section `[dbscan]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DbscanConfig {
    /// The variant. Default `size`, the algorithm that Wang et al. 2019 print.
    pub variant: DbscanVariant,
    /// Radius of a neighbourhood in the unit of the fields, inclusive, 0.001 to 10 (metres are rounded to the
    /// lattice), or `auto`. Default 0.3 m (chosen: as `euclidean`).
    pub epsilon: Epsilon,
    /// `size`: points of the smallest object in the whole drive. `core`: points within epsilon of a core
    /// point, itself included. At least 1. Default 50 (chosen: as `euclidean`).
    pub min_points: u64,
    /// Objects with more points, in the whole drive, are dropped; 0: no limit. Default 0.
    pub max_points: u64,
    /// Fields in which distances are measured: x, y and z in metres, or x, y and others (at most 8). In the
    /// second case, the mean over all points of the drive is subtracted from each field, and the difference
    /// is divided by the standard deviation. Default x, y, z.
    pub fields: Vec<Field>,
    /// Weight by which each standardised field is multiplied, above 0. Empty: all are 1. Default empty.
    pub weights: Vec<f64>,
}

/// The fields that give distances in metres.
const METRIC: [Field; 3] = [Field::X, Field::Y, Field::Z];
/// Maximum number of fields.
const MOST_FIELDS: usize = 8;

impl Default for DbscanConfig {
    fn default() -> Self {
        Self {
            variant: DbscanVariant::Size,
            epsilon: Epsilon::Given(0.3),
            min_points: 50,
            max_points: 0,
            fields: METRIC.to_vec(),
            weights: Vec::new(),
        }
    }
}

impl DbscanConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// [`ConfigError::Value`] with the key and the range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        if let Epsilon::Given(epsilon) = self.epsilon {
            check_radius("dbscan.epsilon", epsilon)?;
        }
        if self.min_points == 0 {
            return Err(ConfigError::value("dbscan.min_points", self.min_points, "at least 1 point"));
        }
        if self.max_points != 0 && self.max_points < self.min_points {
            let expected = format!("0 (no limit) or at least min_points = {}", self.min_points);
            return Err(ConfigError::value("dbscan.max_points", self.max_points, expected));
        }
        self.validate_fields()
    }

    fn validate_fields(&self) -> Result<(), ConfigError> {
        let names: Vec<&str> = self.fields.iter().map(|field| field.name()).collect();
        let refused = |expected: &str| Err(ConfigError::value("dbscan.fields", names.join(", "), expected));
        let mut once = self.fields.clone();
        once.sort_unstable();
        once.dedup();
        if once.len() != self.fields.len() || once.len() > MOST_FIELDS {
            return refused("up to 8 different fields");
        }
        if ![Field::X, Field::Y].iter().all(|field| self.fields.contains(field)) {
            return refused("fields with x and y among them, because tiles need them");
        }
        if self.fields.iter().all(|field| field.axis().is_some()) && !self.is_metric() {
            return refused("x, y, z; or x, y and intensity, red, green, blue or nir");
        }
        let weights = &self.weights;
        if !weights.is_empty() && (self.is_metric() || weights.len() != self.fields.len()) {
            let expected = if self.is_metric() { "none for x, y, z in metres" } else { "one for each field" };
            return Err(ConfigError::value("dbscan.weights", format!("{weights:?}"), expected));
        }
        if weights.iter().any(|weight| !(1e-6..=1e6).contains(weight)) {
            return Err(ConfigError::value(
                "dbscan.weights",
                format!("{weights:?}"),
                "numbers of 0.000001 to 1000000",
            ));
        }
        Ok(())
    }

    /// Whether distances are metres.
    pub(super) fn is_metric(&self) -> bool {
        self.fields == METRIC
    }

    /// The reach. `epsilon` is the distance in the plane, in lattice units, within which all points within
    /// epsilon lie. In the variant `core`, the reach is twice this: a point joins a cluster through a core
    /// point within epsilon, and the neighbours that make it a core point are within epsilon of that one.
    pub(super) fn reach(&self, epsilon: i64, lattice: Lattice) -> Reach {
        let units = if self.variant == DbscanVariant::Core { 2 * epsilon } else { epsilon };
        Reach::Exact { metres: lattice.metres(units) }
    }

    /// Smallest and largest number of points of an object.
    pub(super) fn object_size(&self) -> std::ops::RangeInclusive<u64> {
        let max = if self.max_points == 0 { u64::MAX } else { self.max_points };
        match self.variant {
            DbscanVariant::Size => self.min_points..=max,
            DbscanVariant::Core => 1..=max,
        }
    }
}

/// Whether a radius is in range, in metres or standard deviations.
pub(super) fn check_radius(key: &str, epsilon: f64) -> Result<(), ConfigError> {
    if (0.001..=10.0).contains(&epsilon) {
        return Ok(());
    }
    Err(ConfigError::value(
        key,
        epsilon,
        "0.001 to 10 (metres, or standard deviations of the fields), or \"auto\"",
    ))
}

/// The radius, if it is a number.
pub(super) fn given(config: &DbscanConfig) -> Result<f64, ConfigError> {
    match config.epsilon {
        Epsilon::Given(epsilon) => Ok(epsilon),
        Epsilon::Estimated(_) => Err(ConfigError::value("dbscan.epsilon", config.epsilon, "a number here")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config;

    #[test]
    fn the_defaults_are_those_of_the_file() {
        let config = config::Config::resolve(None, &[]).unwrap();
        let section: DbscanConfig = config::section(NAME, &config.method_table(NAME)).unwrap();
        assert_eq!(section, DbscanConfig::default());
        assert_eq!(config.method_table(NAME).len(), 6);
    }

    #[test]
    fn values_out_of_range_are_refused_with_their_key() {
        let default = DbscanConfig::default;
        for (config, key) in [
            (DbscanConfig { epsilon: 0.0.into(), ..default() }, "dbscan.epsilon = 0"),
            (DbscanConfig { epsilon: f64::NAN.into(), ..default() }, "dbscan.epsilon = NaN"),
            (DbscanConfig { min_points: 0, ..default() }, "dbscan.min_points = 0"),
            (DbscanConfig { max_points: 49, ..default() }, "dbscan.max_points = 49"),
            (DbscanConfig { fields: vec![Field::X, Field::Y], ..default() }, "dbscan.fields = x, y"),
            (DbscanConfig { fields: vec![Field::X, Field::Red], ..default() }, "dbscan.fields = x, red"),
            (
                DbscanConfig { weights: vec![1.0; 3], ..default() },
                "dbscan.weights = [1.0, 1.0, 1.0]: must be none",
            ),
        ] {
            let error = config.validate().unwrap_err().to_string();
            assert!(error.starts_with(key), "{error}");
        }
    }
}

//! The clustering method `dbscan` for drives: settings, and reach and sizes of its two variants on x, y and z in metres.
//! Other fields are in `dbscan_fields`.
//!
//! Source: the paper on estimating epsilon, algorithm 1 (variant `size`), and Ester, Kriegel, Sander, Xu, "A density-based algorithm for
//! discovering clusters" (1996) (variant `core`). `size` is single link at epsilon, as `euclidean` is, whose kernel it
//! uses; `core` has its own, see `core_points`. Ours: border points go to the nearest core point, ties to the smaller
//! id, so that no order of points decides.
//!
//! Why `core` is exact over tiles: the region is the core of the tile and all within 2 epsilon. Whether a point within
//! epsilon of the tile's core is a core point is certain. Further out a neighbourhood may be cut off, and a point may
//! only *miss* being a core point: what is joined is always joined truly. Every link has an end in the core of some
//! tile, where both ends are certain. Border points pass nothing on, so they get a label in their own tile alone, where
//! every core point within epsilon of them is known.
//!
//! Known failures: those of single link for `size`; `core` cuts thin parts (wires, sparse crowns) off.

use serde::{Deserialize, Serialize};

mod core_points;
pub mod epsilon;
mod fields;
pub mod rows;

use fields::FieldDbscan;

use super::{ClusterEntry, Clusterer, Method, Needs, PreparedClusterer, euclidean};
use crate::config::{self, ConfigError};
use crate::model::AlgorithmError;
use crate::model::{Field, FieldSpace, Lattice, Reach, TileCloud};

const NAME: &str = "dbscan";

pub(super) const ENTRY: ClusterEntry = ClusterEntry {
    name: NAME,
    summary: "connected points within epsilon, or core points with their border",
    reference: "the paper on estimating epsilon, algorithm 1; Ester et al. 1996",
    build: |table| build(&config::section(NAME, table)?),
};

/// Ready for tiles where epsilon is given in metres, else once something is known of the whole drive.
fn build(config: &DbscanConfig) -> Result<Method, ConfigError> {
    config.validate()?;
    Ok(match config.epsilon {
        Epsilon::Given(_) if config.is_metric() => Method::Local(Box::new(Dbscan::new(config)?)),
        _ => Method::Prepared(Box::new(AwaitingDrive::new(config))),
    })
}

/// A radius that is given, or is to be estimated.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Epsilon {
    /// The radius.
    Given(f64),
    /// Estimated from the points of the drive.
    Estimated(Auto),
}

/// The word that stands for an estimate.
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

/// What makes points an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DbscanVariant {
    /// Points connected by steps of at most epsilon, kept when their number is in range.
    Size,
    /// Core points connected by such steps, with the border points around them.
    Core,
}

/// Settings of the section `[dbscan]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DbscanConfig {
    /// The variant. Default `size`, which is what the paper on estimating epsilon prints.
    pub variant: DbscanVariant,
    /// Radius of a neighbourhood in the unit of the fields, inclusive, 0.001 to 10 (metres are rounded to the lattice), or
    /// `auto`. Default 0.3 m (chosen: as `euclidean`).
    pub epsilon: Epsilon,
    /// `size`: points of the smallest object in the whole drive. `core`: points within epsilon of a core point, itself
    /// included. At least 1. Default 50 (chosen: as `euclidean`).
    pub min_points: u64,
    /// Objects with more points, in the whole drive, are dropped; 0: no limit. Default 0.
    pub max_points: u64,
    /// Fields that distances are taken in: x, y and z in metres; or x, y and others (not more than 8), each minus its mean
    /// over its standard deviation over all points of the drive. Default x, y, z.
    pub fields: Vec<Field>,
    /// Weight that each of them is multiplied with after that, above 0; none where all are 1. Default none.
    pub weights: Vec<f64>,
}

/// Fields whose distances are metres.
const METRIC: [Field; 3] = [Field::X, Field::Y, Field::Z];
/// Fields at most.
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
            return refused("fields with x and y among them: objects are somewhere");
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
    fn is_metric(&self) -> bool {
        self.fields == METRIC
    }

    /// The reach, when points within epsilon are within `epsilon` lattice units in the plane: a point that joins a cluster
    /// by a core point is within twice that of what makes it one.
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
fn check_radius(key: &str, epsilon: f64) -> Result<(), ConfigError> {
    if (0.001..=10.0).contains(&epsilon) {
        return Ok(());
    }
    Err(ConfigError::value(key, epsilon, "0.001 to 10 (metres), or \"auto\""))
}

/// The method before it knows the drive.
#[derive(Debug, Clone)]
struct AwaitingDrive {
    config: DbscanConfig,
    needs: Needs,
}

impl AwaitingDrive {
    fn new(config: &DbscanConfig) -> Self {
        let fields = if config.is_metric() { Vec::new() } else { config.fields.clone() };
        let needs =
            Needs { fields, weights: config.weights.clone(), epsilon: config.epsilon == Epsilon::AUTO };
        Self { config: config.clone(), needs }
    }
}

impl PreparedClusterer for AwaitingDrive {
    fn name(&self) -> &'static str {
        NAME
    }

    fn needs(&self) -> &Needs {
        &self.needs
    }

    fn object_size(&self) -> std::ops::RangeInclusive<u64> {
        self.config.object_size()
    }

    fn prepare(&self, space: &FieldSpace, epsilon: Option<f64>) -> Result<Box<dyn Clusterer>, ConfigError> {
        let config = match epsilon {
            Some(epsilon) => {
                check_radius("dbscan.epsilon, estimated", epsilon)?;
                DbscanConfig { epsilon: Epsilon::Given(epsilon), ..self.config.clone() }
            }
            None => self.config.clone(),
        };
        if config.is_metric() {
            return Ok(Box::new(Dbscan::new(&config)?));
        }
        Ok(Box::new(FieldDbscan::new(&config, given(&config)?, space.clone())))
    }
}

/// The radius, where it is given.
fn given(config: &DbscanConfig) -> Result<f64, ConfigError> {
    match config.epsilon {
        Epsilon::Given(epsilon) => Ok(epsilon),
        Epsilon::Estimated(_) => Err(ConfigError::value("dbscan.epsilon", config.epsilon, "a number here")),
    }
}

/// The method, see the module.
#[derive(Debug, Clone)]
pub struct Dbscan {
    config: DbscanConfig,
    /// Radius in metres.
    epsilon: f64,
}

impl Dbscan {
    /// The method with these settings, on x, y and z with a given epsilon.
    ///
    /// # Errors
    /// Those of [`DbscanConfig::validate`].
    pub fn new(config: &DbscanConfig) -> Result<Self, ConfigError> {
        config.validate()?;
        Ok(Self { config: config.clone(), epsilon: given(config)? })
    }
}

impl Clusterer for Dbscan {
    fn name(&self) -> &'static str {
        NAME
    }

    fn reach(&self, lattice: Lattice) -> Reach {
        self.config.reach(lattice.units(self.epsilon), lattice)
    }

    fn object_size(&self) -> std::ops::RangeInclusive<u64> {
        self.config.object_size()
    }

    fn cluster(&self, cloud: &TileCloud, labels: &mut [u32]) -> Result<u32, AlgorithmError> {
        self.cluster_tile(cloud, &vec![true; cloud.len()], labels)
    }

    fn cluster_tile(
        &self,
        cloud: &TileCloud,
        core: &[bool],
        labels: &mut [u32],
    ) -> Result<u32, AlgorithmError> {
        let reach = cloud.lattice.units(self.epsilon);
        match self.config.variant {
            DbscanVariant::Size => euclidean::single_link(NAME, cloud, reach, labels),
            DbscanVariant::Core => {
                let least = u32::try_from(self.config.min_points).unwrap_or(u32::MAX);
                core_points::cluster(NAME, cloud, core, reach, least, labels)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn core(min_points: u64, points: &[[i64; 3]], own: &[bool]) -> (Vec<u32>, u32) {
        let config = DbscanConfig {
            variant: DbscanVariant::Core,
            epsilon: 0.1.into(),
            min_points,
            ..DbscanConfig::default()
        };
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, points);
        let mut labels = vec![u32::MAX; points.len()];
        let clusters = Dbscan::new(&config).unwrap().cluster_tile(&cloud, own, &mut labels).unwrap();
        (labels, clusters)
    }

    fn line(places: &[i64]) -> Vec<[i64; 3]> {
        places.iter().map(|&x| [x, 0, 0]).collect()
    }

    #[test]
    fn border_points_join_the_nearest_core_point_and_noise_nothing() {
        // Two heaps of five core points, 200 apart. 140 is 100 from 240 (id 0) and from 40 (id 9); 139 only from 40.
        let places = [240, 260, 280, 300, 320, -40, -20, 0, 20, 40, 140, 139, 900];
        let (labels, clusters) = core(5, &line(&places), &[true; 13]);
        assert_eq!((labels, clusters), (vec![1, 1, 1, 1, 1, 2, 2, 2, 2, 2, 1, 2, 0], 2));
    }

    #[test]
    fn border_points_of_other_tiles_have_no_label() {
        let places = [0, 50, 100, 150];
        // Three within 100: 50 and 100 (four), 0 and 150 (three).
        assert_eq!(core(4, &line(&places), &[true; 4]).0, [1, 1, 1, 1]);
        assert_eq!(core(4, &line(&places), &[true, true, false, false]).0, [1, 1, 1, 0]);
    }

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

    #[test]
    fn core_reaches_twice_as_far() {
        for (variant, metres) in [(DbscanVariant::Size, 0.3), (DbscanVariant::Core, 0.6)] {
            let method = Dbscan::new(&DbscanConfig { variant, ..DbscanConfig::default() }).unwrap();
            assert!((method.reach(Lattice::MILLIMETRE).metres() - metres).abs() < 1e-12);
        }
    }
}

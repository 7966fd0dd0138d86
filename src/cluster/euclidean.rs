//! The clustering method `euclidean`: single-link clusters of points within a fixed distance. It does not use
//! sizes or shapes.
//!
//! Source: Guan, Cao, Yu, Li, Liu, Chen, Li, "Street-scene tree segmentation from mobile laser scanning data"
//! (2016), section 3.2. Ours: the default distance, its inclusiveness, and the algorithm (see
//! `linking::single_link`).
//!
//! Known failures: those of single link. Objects that touch become one object (crowns of neighbouring trees,
//! a car at a fence). An object that is scanned more sparsely than `max_gap_m` becomes several objects.

use serde::Deserialize;

use super::linking::single_link;
use super::local::{Clusterer, OneStep};
use super::method::ClusterEntry;
use crate::config::{self, ConfigError};
use crate::model::{AlgorithmError, Lattice, Reach, TileCloud};

const NAME: &str = "euclidean";

pub(super) const ENTRY: ClusterEntry = ClusterEntry {
    name: NAME,
    summary: "single-link clusters of points within a fixed distance",
    reference: "Guan et al. 2016, section 3.2, doi:10.5194/isprs-archives-XLI-B3-221-2016",
    build: |sections| {
        let method = Euclidean::new(&config::section(NAME, &sections(NAME))?)?;
        Ok(Box::new(OneStep::new(method, &["euclidean.*"])))
    },
};

/// Settings of the section `[euclidean]`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EuclideanConfig {
    /// Largest distance of points that are linked to one object, in metres, d_t of the paper, 0.001 to 10.
    /// Default 0.3 (chosen: the 0.15 m of Guan et al. 2016, section 4, splits objects that are further from
    /// the scanner than the width of their avenue).
    pub max_gap_m: f64,
    /// Objects with fewer points, in the whole drive, are dropped; at least 1. Default 50 (chosen; the paper
    /// gives no number).
    pub min_points: u64,
    /// Objects with more points, in the whole drive, are dropped; 0: no limit, else at least `min_points`.
    /// Default 0.
    pub max_points: u64,
}

impl Default for EuclideanConfig {
    fn default() -> Self {
        Self { max_gap_m: 0.3, min_points: 50, max_points: 0 }
    }
}

impl EuclideanConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// [`ConfigError::Value`] with the key and the range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        if !(0.001..=10.0).contains(&self.max_gap_m) {
            return Err(ConfigError::value("euclidean.max_gap_m", self.max_gap_m, "0.001 to 10 metres"));
        }
        if self.min_points == 0 {
            return Err(ConfigError::value("euclidean.min_points", self.min_points, "at least 1 point"));
        }
        if self.max_points != 0 && self.max_points < self.min_points {
            let expected = format!("0 (no limit) or at least min_points = {}", self.min_points);
            return Err(ConfigError::value("euclidean.max_points", self.max_points, expected));
        }
        Ok(())
    }
}

/// The method, see the module.
#[derive(Debug, Clone)]
pub struct Euclidean {
    config: EuclideanConfig,
}

impl Euclidean {
    /// The method with these settings.
    ///
    /// # Errors
    /// Those of [`EuclideanConfig::validate`].
    pub fn new(config: &EuclideanConfig) -> Result<Self, ConfigError> {
        config.validate()?;
        Ok(Self { config: config.clone() })
    }
}

impl Clusterer for Euclidean {
    fn name(&self) -> &'static str {
        NAME
    }

    fn reach(&self, lattice: Lattice) -> Reach {
        Reach::Exact { metres: lattice.metres(lattice.units(self.config.max_gap_m)) }
    }

    fn object_size(&self) -> std::ops::RangeInclusive<u64> {
        let max = if self.config.max_points == 0 { u64::MAX } else { self.config.max_points };
        self.config.min_points..=max
    }

    fn cluster(&self, cloud: &TileCloud, labels: &mut [u32]) -> Result<u32, AlgorithmError> {
        single_link(NAME, cloud, cloud.lattice.units(self.config.max_gap_m), labels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::PointId;

    fn cluster(max_gap_m: f64, points: &[[i64; 3]]) -> (Vec<u32>, u32) {
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, points);
        let mut labels = vec![u32::MAX; points.len()];
        let method = Euclidean::new(&EuclideanConfig { max_gap_m, ..EuclideanConfig::default() }).unwrap();
        let clusters = method.cluster(&cloud, &mut labels).unwrap();
        (labels, clusters)
    }

    #[test]
    fn the_distance_is_inclusive() {
        // 100^2 + 200^2 + 200^2 = 300^2.
        assert_eq!(cluster(0.3, &[[0, 0, 0], [100, 200, 200]]), (vec![1, 1], 1));
        assert_eq!(cluster(0.3, &[[0, 0, 0], [100, 200, 201]]), (vec![1, 2], 2));
        assert_eq!(cluster(0.3, &[[0, 0, 0], [0, 0, 300]]), (vec![1, 1], 1));
        assert_eq!(cluster(0.3, &[[0, 0, 0], [0, 0, 301]]), (vec![1, 2], 2));
        assert_eq!(cluster(0.001, &[[0, 0, 0], [0, 1, 0], [1, 2, 0]]), (vec![1, 1, 2], 2));
    }

    #[test]
    fn chains_are_one_object_and_labels_follow_the_smallest_id() {
        let (labels, clusters) =
            cluster(0.3, &[[5_000, 0, 0], [0, 0, 0], [600, 0, 0], [5_100, 0, 0], [300, 0, 0]]);
        assert_eq!((labels, clusters), (vec![1, 2, 2, 1, 2], 2));
    }

    #[test]
    fn labels_follow_ids_and_not_the_order_of_points() {
        let mut cloud =
            TileCloud::from_lattice_points(Lattice::MILLIMETRE, &[[0; 3], [9_000; 3], [18_000; 3]]);
        cloud.id = [70, 8, 30].map(PointId::new).to_vec();
        let mut labels = [0; 3];
        let method = Euclidean::new(&EuclideanConfig::default()).unwrap();
        assert_eq!(method.cluster(&cloud, &mut labels), Ok(3));
        assert_eq!(labels, [3, 1, 2]);
    }

    #[test]
    fn two_hundred_thousand_points_slightly_too_far_apart_are_two_objects() {
        // Two sheets of 1.2 m x 1.2 m tilted by 45 degrees, 426 / sqrt(2) = 301.2 mm apart. This tests the
        // running time as well: a comparison of all pairs would take minutes.
        let sheet = |lift: i64| {
            (0..100_000_i64).map(move |index| [index % 400 * 3, index / 400 * 5, index % 400 * 3 + lift])
        };
        let points: Vec<[i64; 3]> = sheet(0).chain(sheet(426)).collect();
        let (labels, clusters) = cluster(0.3, &points);
        assert_eq!(clusters, 2);
        assert!(labels[..100_000].iter().all(|&label| label == 1));
        assert_eq!(cluster(0.302, &points).1, 1);
    }

    #[test]
    fn values_out_of_range_are_refused_with_their_key() {
        let default = EuclideanConfig::default;
        for (config, key) in [
            (EuclideanConfig { max_gap_m: 0.0, ..default() }, "euclidean.max_gap_m = 0"),
            (EuclideanConfig { max_gap_m: f64::NAN, ..default() }, "euclidean.max_gap_m = NaN"),
            (EuclideanConfig { min_points: 0, ..default() }, "euclidean.min_points = 0"),
            (EuclideanConfig { max_points: 49, ..default() }, "euclidean.max_points = 49"),
        ] {
            let error = config.validate().unwrap_err().to_string();
            assert!(error.starts_with(key), "{error}");
        }
        default().validate().unwrap();
        let sizes =
            |max_points| Euclidean::new(&EuclideanConfig { max_points, ..default() }).unwrap().object_size();
        assert_eq!(sizes(0), 50..=u64::MAX);
        assert_eq!(sizes(50), 50..=50);
    }
}

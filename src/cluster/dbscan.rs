//! The clustering method `dbscan` for drives, on x, y and z in metres: settings, reach and sizes of its two variants.
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

use super::{ClusterEntry, Clusterer, core_points, euclidean};
use crate::config::{self, ConfigError};
use crate::error::AlgorithmError;
use crate::model::{Lattice, Reach, TileCloud};

const NAME: &str = "dbscan";

pub(super) const ENTRY: ClusterEntry = ClusterEntry {
    name: NAME,
    summary: "connected points within epsilon, or core points with their border",
    reference: "the paper on estimating epsilon, algorithm 1; Ester et al. 1996",
    build: |table| Ok(crate::cluster::Method::Local(Box::new(Dbscan::new(&config::section(NAME, table)?)?))),
};

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
    /// Radius of a neighbourhood in metres, inclusive, 0.001 to 10. Default 0.3 (chosen: as `euclidean`).
    pub epsilon: f64,
    /// `size`: points of the smallest object in the whole drive. `core`: points within epsilon of a core point, itself
    /// included. At least 1. Default 50 (chosen: as `euclidean`).
    pub min_points: u64,
    /// Objects with more points, in the whole drive, are dropped; 0: no limit. Default 0.
    pub max_points: u64,
}

impl Default for DbscanConfig {
    fn default() -> Self {
        Self { variant: DbscanVariant::Size, epsilon: 0.3, min_points: 50, max_points: 0 }
    }
}

impl DbscanConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// [`ConfigError::Value`] with the key and the range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        if !(0.001..=10.0).contains(&self.epsilon) {
            return Err(ConfigError::value("dbscan.epsilon", self.epsilon, "0.001 to 10 metres"));
        }
        if self.min_points == 0 {
            return Err(ConfigError::value("dbscan.min_points", self.min_points, "at least 1 point"));
        }
        if self.max_points != 0 && self.max_points < self.min_points {
            let expected = format!("0 (no limit) or at least min_points = {}", self.min_points);
            return Err(ConfigError::value("dbscan.max_points", self.max_points, expected));
        }
        Ok(())
    }
}

/// The method, see the module.
#[derive(Debug, Clone)]
pub struct Dbscan {
    config: DbscanConfig,
}

impl Dbscan {
    /// The method with these settings.
    ///
    /// # Errors
    /// Those of [`DbscanConfig::validate`].
    pub fn new(config: &DbscanConfig) -> Result<Self, ConfigError> {
        config.validate()?;
        Ok(Self { config: config.clone() })
    }
}

impl Clusterer for Dbscan {
    fn name(&self) -> &'static str {
        NAME
    }

    fn reach(&self, lattice: Lattice) -> Reach {
        let epsilon = lattice.units(self.config.epsilon);
        let units = if self.config.variant == DbscanVariant::Core { 2 * epsilon } else { epsilon };
        Reach::Exact { metres: lattice.metres(units) }
    }

    fn object_size(&self) -> std::ops::RangeInclusive<u64> {
        let max = if self.config.max_points == 0 { u64::MAX } else { self.config.max_points };
        match self.config.variant {
            DbscanVariant::Size => self.config.min_points..=max,
            DbscanVariant::Core => 1..=max,
        }
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
        let reach = cloud.lattice.units(self.config.epsilon);
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
        let config = DbscanConfig { variant: DbscanVariant::Core, epsilon: 0.1, min_points, max_points: 0 };
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
        assert_eq!(config.method_table(NAME).len(), 4);
    }

    #[test]
    fn values_out_of_range_are_refused_with_their_key() {
        let default = DbscanConfig::default;
        for (config, key) in [
            (DbscanConfig { epsilon: 0.0, ..default() }, "dbscan.epsilon = 0"),
            (DbscanConfig { epsilon: f64::NAN, ..default() }, "dbscan.epsilon = NaN"),
            (DbscanConfig { min_points: 0, ..default() }, "dbscan.min_points = 0"),
            (DbscanConfig { max_points: 49, ..default() }, "dbscan.max_points = 49"),
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

//! Settings of `density-peaks`, and the numbers of its stages.

use serde::Deserialize;

use crate::config::ConfigError;

/// Name of the method and of its section.
pub(super) const NAME: &str = "density-peaks";

/// Numbers of the stages, in their order.
pub(super) const STAGE_VOXELS: usize = 0;
pub(super) const STAGE_PEAKS: usize = 1;
pub(super) const STAGE_BORDERS: usize = 2;

/// Settings of the section `[density-peaks]`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DensityPeaksConfig {
    /// Edge of a voxel in metres, 0.05 to 2. Default 0.3: twice the spacing of points on far objects (section
    /// 4.1).
    pub voxel: f64,
    /// Density above which a voxel can be a centre, in voxels, rho_t of the paper, 0 to 1000. Default 4
    /// (Table 2: 1.2 m).
    pub min_density: f64,
    /// Distance from the nearest denser voxel above which a voxel can be a centre, in voxels, delta_t of the
    /// paper, 0 to 100. Default 3 (Table 2: 0.9 m).
    pub min_separation: f64,
    /// Height over ground above which densities are divided by the height, in voxels, d_t of the paper, 0 to
    /// 1000. Default 5 (Table 2: 1.5 m).
    pub scale_above: f64,
    /// Search distance for denser voxels (exclusive), in voxels, d_neighbor of the paper, 1 to 50. Default
    /// 13 (Table 2: 3.9 m).
    pub search_radius: f64,
    /// Distance below which points of two clusters are a pair, in metres, d_th of the paper, 0.01 to 5.
    /// Default 0.5 (equation 11).
    pub pair_gap_m: f64,
    /// Mean curvature over the pairs of two clusters below which they are merged, c_t of the paper, 0 (never)
    /// to 1. Default 0.04: the valley in the histogram of pairs, and better on four drives
    /// (`benches/results/density-peaks-study.md`). The paper found its value "by analyzing thousands of
    /// sample data" and does not print it.
    pub merge_below: f64,
    /// Largest distance at which halo voxels join the nearest segment, in metres, 0.01 to 10. Default 1.5
    /// (chosen; the paper filters out what is "far away from all segments").
    pub reassign: f64,
    /// Number of points of objects in the fullest voxel, to which the number of each voxel is compared (n_max
    /// of equation 3). Default 0: computed from all points that are processed. If a section is processed with
    /// the value of the whole drive, it has the same densities.
    pub most_points: u32,
}

impl Default for DensityPeaksConfig {
    fn default() -> Self {
        Self {
            voxel: 0.3,
            min_density: 4.0,
            min_separation: 3.0,
            scale_above: 5.0,
            search_radius: 13.0,
            pair_gap_m: 0.5,
            merge_below: 0.04,
            reassign: 1.5,
            most_points: 0,
        }
    }
}

impl DensityPeaksConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// [`ConfigError::Value`] with the key and the range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        ConfigError::outside([
            ("density-peaks.voxel", self.voxel, 0.05..=2.0, "metres"),
            ("density-peaks.min_density", self.min_density, 0.0..=1_000.0, "voxels"),
            ("density-peaks.min_separation", self.min_separation, 0.0..=100.0, "voxels"),
            ("density-peaks.scale_above", self.scale_above, 0.0..=1_000.0, "voxels"),
            ("density-peaks.search_radius", self.search_radius, 1.0..=50.0, "voxels"),
            ("density-peaks.pair_gap_m", self.pair_gap_m, 0.01..=5.0, "metres"),
            ("density-peaks.merge_below", self.merge_below, 0.0..=1.0, ""),
            ("density-peaks.reassign", self.reassign, 0.01..=10.0, "metres"),
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_range_are_refused_with_their_key() {
        let default = DensityPeaksConfig::default;
        for (config, key) in [
            (DensityPeaksConfig { voxel: f64::NAN, ..default() }, "density-peaks.voxel = NaN"),
            (DensityPeaksConfig { min_density: -1.0, ..default() }, "density-peaks.min_density = -1"),
            (DensityPeaksConfig { min_separation: 101.0, ..default() }, "density-peaks.min_separation = 101"),
            (DensityPeaksConfig { scale_above: -0.5, ..default() }, "density-peaks.scale_above = -0.5"),
            (DensityPeaksConfig { search_radius: 0.5, ..default() }, "density-peaks.search_radius = 0.5"),
            (DensityPeaksConfig { pair_gap_m: 0.0, ..default() }, "density-peaks.pair_gap_m = 0"),
            (DensityPeaksConfig { merge_below: 1.5, ..default() }, "density-peaks.merge_below = 1.5"),
            (DensityPeaksConfig { reassign: f64::INFINITY, ..default() }, "density-peaks.reassign = inf"),
        ] {
            let error = config.validate().unwrap_err().to_string();
            assert!(error.starts_with(key), "{error}");
        }
        default().validate().unwrap();
    }
}

//! Settings of `normalized-cut`, and the numbers of its steps.

use serde::Deserialize;

use crate::config::ConfigError;

/// Name of the method and of its section.
pub(super) const NAME: &str = "normalized-cut";

/// Numbers of the steps, in their order.
pub(super) const STEP_CLUSTERS: usize = 0;
pub(super) const STEP_CUT: usize = 1;

/// Settings of the section `[normalized-cut]`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NormalizedCutConfig {
    /// Edge of a voxel in metres, w_s of the paper, 0.05 to 2. Default 0.3 (chosen; section 4 has 0.05).
    pub voxel: f64,
    /// Horizontal distance in metres at which a weight falls to 1/e, sigma_H of equation 1, 0.05 to 20.
    /// Default 0.8 (chosen; the paper has no value).
    pub horizontal_scale_m: f64,
    /// Vertical distance in metres at which a weight falls to 1/e, sigma_V of equation 1, 0.05 to 20. Default
    /// 2 (chosen; the paper has no value).
    pub vertical_scale_m: f64,
    /// Largest horizontal distance of linked voxels in metres, d_H of equation 1, 0.1 to 20. Default 1.2
    /// (chosen; the paper has no value).
    pub link_radius_m: f64,
    /// A part is cut in two if Ncut (equation 3) of its best cut is at most this, 0 (never) to 2. Default
    /// 0.08 (chosen; the paper has no value).
    pub stop: f64,
    /// Objects and parts are cut if they are taller than this, in metres, 0 to 100. Default 2.5 (chosen).
    pub tall: f64,
    /// Objects are cut if they are wider than this, in metres, 0 to 1000. Default 3 (chosen).
    pub wide: f64,
    /// Largest number of voxels of a graph, 1000 to 200,000. An object with more voxels is first cut on
    /// voxels of twice the edge, or four times the edge, and so on; its parts are cut again on finer voxels.
    /// Default 20,000. This limits memory independently of the machine.
    pub max_voxels: u64,
}

impl Default for NormalizedCutConfig {
    fn default() -> Self {
        Self {
            voxel: 0.3,
            horizontal_scale_m: 0.8,
            vertical_scale_m: 2.0,
            link_radius_m: 1.2,
            stop: 0.08,
            tall: 2.5,
            wide: 3.0,
            max_voxels: 20_000,
        }
    }
}

impl NormalizedCutConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// [`ConfigError::Value`] with the key and the range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        ConfigError::outside([
            ("normalized-cut.voxel", self.voxel, 0.05..=2.0, "metres"),
            ("normalized-cut.horizontal_scale_m", self.horizontal_scale_m, 0.05..=20.0, "metres"),
            ("normalized-cut.vertical_scale_m", self.vertical_scale_m, 0.05..=20.0, "metres"),
            ("normalized-cut.link_radius_m", self.link_radius_m, 0.1..=20.0, "metres"),
            ("normalized-cut.stop", self.stop, 0.0..=2.0, ""),
            ("normalized-cut.tall", self.tall, 0.0..=100.0, "metres"),
            ("normalized-cut.wide", self.wide, 0.0..=1_000.0, "metres"),
        ])?;
        if !(1_000..=200_000).contains(&self.max_voxels) {
            let key = "normalized-cut.max_voxels";
            return Err(ConfigError::value(key, self.max_voxels, "1000 to 200,000 voxels"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_range_are_refused_with_their_key() {
        let default = NormalizedCutConfig::default;
        for (config, key) in [
            (NormalizedCutConfig { voxel: f64::NAN, ..default() }, "normalized-cut.voxel = NaN"),
            (
                NormalizedCutConfig { horizontal_scale_m: 0.0, ..default() },
                "normalized-cut.horizontal_scale_m = 0",
            ),
            (
                NormalizedCutConfig { vertical_scale_m: f64::INFINITY, ..default() },
                "normalized-cut.vertical_scale_m = inf",
            ),
            (NormalizedCutConfig { link_radius_m: -1.0, ..default() }, "normalized-cut.link_radius_m = -1"),
            (NormalizedCutConfig { stop: 2.5, ..default() }, "normalized-cut.stop = 2.5"),
            (NormalizedCutConfig { tall: -0.1, ..default() }, "normalized-cut.tall = -0.1"),
            (NormalizedCutConfig { wide: 1_001.0, ..default() }, "normalized-cut.wide = 1001"),
            (NormalizedCutConfig { max_voxels: 999, ..default() }, "normalized-cut.max_voxels = 999"),
        ] {
            let error = config.validate().unwrap_err().to_string();
            assert!(error.starts_with(key), "{error}");
        }
        default().validate().unwrap();
    }
}

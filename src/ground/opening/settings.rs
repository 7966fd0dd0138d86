//! Settings of `opening`, with their ranges and defaults.

use serde::Deserialize;

use crate::config::ConfigError;

/// Settings of the section `[opening]`. Defaults are chosen by the study in `benches/results/ground.md`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OpeningConfig {
    /// Edge of a column in metres, 0.05 to 2. Default 0.3, as for the noise, so that both share the voxels.
    pub voxel: f64,
    /// Rank of the point that is the low of a column: 1 is the lowest point, 2 the second lowest. 1 to 100.
    /// Default 2.
    pub lowest_points: u32,
    /// The floor lies below this quantile of the lows around a block, 0 to 0.5. Default 0.1.
    pub low_quantile: f64,
    /// Largest depth of ground below that quantile and below the surface, in metres, 0 to 100. Default 0.3.
    pub depth: f64,
    /// Radius of the disc in metres, 0 to 20. Default 1.2: the disc is wider than a car.
    pub radius: f64,
    /// Largest slope of the ground, 0 to 10 metres per metre. Default 0.8, so that embankments of 1 : 1.5 are
    /// ground.
    pub slope: f64,
    /// Distance over which the slope is limited, in metres, 0 to 50. Default 6.
    pub slope_radius: f64,
    /// Points less than this above the surface are ground, in metres, 0 to 10. Default 0.06.
    pub close: f64,
    /// Points less than this above the surface are ground where nothing stands on them, 0 to 10. Default 0.3.
    pub height: f64,
    /// Nothing stands where the column is empty from `height` up to this above the surface, 0 to 100. Default
    /// 0.7.
    pub clear: f64,
    /// A place is sparse if less than this share of the columns within about 3.75 m has points, 0 to 0.5;
    /// with 0, no place is sparse. In a sparse place, the ground rises by at most 15 %, and `clear` is at
    /// least 6 m. Default 0.2.
    pub sparse: f64,
    /// Largest extent of a room along both axes, in metres, 0 to 20; with 0, there are no rooms. A room is a
    /// flat patch enclosed by walls. Default 7.5.
    pub room: f64,
}

impl Default for OpeningConfig {
    fn default() -> Self {
        Self {
            voxel: 0.3,
            lowest_points: 2,
            low_quantile: 0.1,
            depth: 0.3,
            radius: 1.2,
            slope: 0.8,
            slope_radius: 6.0,
            close: 0.06,
            height: 0.3,
            clear: 0.7,
            sparse: 0.2,
            room: 7.5,
        }
    }
}

impl OpeningConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// [`ConfigError::Value`] with the key and the range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        ConfigError::outside([("opening.lowest_points", self.lowest_points, 1..=100, "points")])?;
        ConfigError::outside([
            ("opening.voxel", self.voxel, 0.05..=2.0, "metres"),
            ("opening.low_quantile", self.low_quantile, 0.0..=0.5, ""),
            ("opening.depth", self.depth, 0.0..=100.0, "metres"),
            ("opening.radius", self.radius, 0.0..=20.0, "metres"),
            ("opening.slope", self.slope, 0.0..=10.0, ""),
            ("opening.slope_radius", self.slope_radius, 0.0..=50.0, "metres"),
            ("opening.close", self.close, 0.0..=10.0, "metres"),
            ("opening.height", self.height, 0.0..=10.0, "metres"),
            ("opening.clear", self.clear, 0.0..=100.0, "metres"),
            ("opening.sparse", self.sparse, 0.0..=0.5, ""),
            ("opening.room", self.room, 0.0..=20.0, "metres"),
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_range_are_refused_with_their_key() {
        let default = OpeningConfig::default;
        for (config, key) in [
            (OpeningConfig { voxel: 0.0, ..default() }, "opening.voxel = 0"),
            (OpeningConfig { lowest_points: 0, ..default() }, "opening.lowest_points = 0"),
            (OpeningConfig { depth: -0.1, ..default() }, "opening.depth = -0.1"),
            (OpeningConfig { slope: f64::NAN, ..default() }, "opening.slope = NaN"),
            (OpeningConfig { slope_radius: 51.0, ..default() }, "opening.slope_radius = 51"),
        ] {
            let error = config.validate().unwrap_err().to_string();
            assert!(error.starts_with(key), "{error}");
        }
        default().validate().unwrap();
    }
}

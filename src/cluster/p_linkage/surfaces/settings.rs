//! Settings of `p-linkage`, the numbers of its steps, and the constants of the paper.

use std::ops::RangeInclusive;

use serde::Deserialize;

use super::cubes;
use crate::config::ConfigError;
use crate::model::Lattice;
use crate::spatial::LARGEST_REACH;

/// Name of the method and of its section.
pub(super) const NAME: &str = "p-linkage";

/// Numbers of the first steps. Contests follow, and `surfaces` is the last.
pub(super) const STEP_LINKS: usize = 0;
pub(super) const STEP_PLANES: usize = 1;
pub(super) const STEP_SLICES: usize = 2;

/// Width of the area around a tile in which the step `links` reads points, in multiples of the reach.
pub(super) const LINKS_REACHES: i64 = 3;
/// Width of the area around a tile in which a contest reads points, in multiples of its zone
/// ([`SurfacesConfig::contest_zone`]): the surfaces of these points decide the surfaces in the zone.
pub(super) const CONTEST_REACHES: i64 = 2;
/// Names of the contests. There are at most this many.
pub(super) const CONTESTS: [&str; 8] =
    ["contest-1", "contest-2", "contest-3", "contest-4", "contest-5", "contest-6", "contest-7", "contest-8"];

/// Smallest number of points of a slice (section 3, slice creating).
pub(super) const SLICE_POINTS: u64 = 10;

/// Settings of the section `[p-linkage]`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SurfacesConfig {
    /// Adjacent slices are merged if the angle between their normals is below this, in degrees: theta of
    /// equation 11, 0 (never) to 90. Default 10 (section 4.2). The larger it is, the more a surface may bend.
    pub angle_deg: f64,
    /// Adjacent slices are merged if the mean distance of their border points from the plane of the other
    /// slice is below this many deviations of the points of the rougher slice. 0 (the paper's rule: only
    /// normals decide) to 100. Default 2.5 (chosen: the score of equation 7 up to which a point is consistent
    /// with a plane).
    pub border_score: f64,
    /// Whether the plane of a slice is fitted once more, to all points that are consistent with it. Default
    /// true (chosen: narrow planes fall apart without it; the paper has no such step).
    pub refit_planes: bool,
    /// Number of contests among surfaces, 0 (as printed) to 8. In each contest, every point goes to the
    /// nearby surface whose local plane fits it best. Default 4 (chosen: with fewer, one of three kerbs at
    /// 2000 points per square metre was in pieces, see `benches/results/surfaces.md`).
    pub contest_rounds: u32,
    /// Number of neighbours of a point, itself included: K of section 3, 8 to 255. Default 50 (chosen, see
    /// `benches/results/surfaces.md`; the paper has no number).
    pub neighbours: u32,
    /// Largest distance of a neighbour in metres, 0.1 to 4. Default 1 (chosen: points of a vehicle scanner on
    /// a facade are closer; the paper has no limit). This distance bounds the halo of a tile.
    pub reach_m: f64,
    /// Surfaces with fewer points, in the whole drive, are dropped; at least 10, which is the smallest slice.
    /// Default 10 (section 3).
    pub min_points: u64,
    /// A slice grows from a point that is flatter than this, in square metres, 0 to 100. Default 0: mean +
    /// standard deviation of all points that are processed (equation 8). If a section is processed with the
    /// value of the whole drive, it has the same slices.
    pub flat_m2: f64,
}

impl Default for SurfacesConfig {
    fn default() -> Self {
        Self {
            angle_deg: 10.0,
            border_score: 2.5,
            refit_planes: true,
            contest_rounds: 4,
            neighbours: 50,
            reach_m: 1.0,
            min_points: SLICE_POINTS,
            flat_m2: 0.0,
        }
    }
}

impl SurfacesConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// [`ConfigError::Value`] with the key and the range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        if !(0.0..=90.0).contains(&self.angle_deg) {
            return Err(ConfigError::value("p-linkage.angle_deg", self.angle_deg, "0 to 90 degrees"));
        }
        if !(0.0..=100.0).contains(&self.border_score) {
            return Err(ConfigError::value(
                "p-linkage.border_score",
                self.border_score,
                "0 to 100 deviations",
            ));
        }
        if self.contest_rounds as usize > CONTESTS.len() {
            return Err(ConfigError::value("p-linkage.contest_rounds", self.contest_rounds, "0 to 8"));
        }
        if !(8..=255).contains(&self.neighbours) {
            return Err(ConfigError::value("p-linkage.neighbours", self.neighbours, "8 to 255 points"));
        }
        if !(0.1..=4.0).contains(&self.reach_m) {
            return Err(ConfigError::value("p-linkage.reach_m", self.reach_m, "0.1 to 4 metres"));
        }
        if !(0.0..=100.0).contains(&self.flat_m2) {
            return Err(ConfigError::value("p-linkage.flat_m2", self.flat_m2, "0 to 100 square metres"));
        }
        if self.min_points < SLICE_POINTS {
            return Err(ConfigError::value("p-linkage.min_points", self.min_points, "at least 10 points"));
        }
        Ok(())
    }

    /// Largest distance of a neighbour in lattice units. On a lattice finer than 0.1 mm it may be less than
    /// `reach_m`.
    pub(super) fn reach(&self, lattice: Lattice) -> i64 {
        lattice.units(self.reach_m).min(LARGEST_REACH)
    }

    /// Distance around a tile within which the surfaces of points after a contest must be known, in lattice
    /// units: the distance of a neighbour, or of the far corner of the cubes around a point if that is
    /// larger.
    pub(super) fn contest_zone(&self, lattice: Lattice) -> i64 {
        // The square root of 8, rounded up: the diagonal of 2 x 2 cubes in the plane.
        let cubes = i64::from(cubes::edge(lattice)) * 2_829 / 1_000 + 1;
        self.reach(lattice).max(cubes)
    }

    /// Sizes of surfaces.
    pub(super) fn sizes(&self) -> RangeInclusive<u64> {
        self.min_points..=u64::MAX
    }

    /// Cosine of the largest angle between normals. The angle is smaller if the absolute value of their
    /// product is larger.
    pub(super) fn cosine(&self) -> f64 {
        cosine(self.angle_deg * (std::f64::consts::PI / 180.0))
    }
}

/// The cosine of an angle from 0 to 90 degrees, by its series, because the functions of platforms differ in
/// the last digit.
fn cosine(angle: f64) -> f64 {
    let squared = angle * angle;
    (1..=14).rev().fold(1.0, |sum, n| 1.0 - sum * squared / f64::from((2 * n - 1) * (2 * n)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_range_are_refused_with_their_key() {
        let default = SurfacesConfig::default;
        for (config, key) in [
            (SurfacesConfig { angle_deg: f64::NAN, ..default() }, "p-linkage.angle_deg = NaN"),
            (SurfacesConfig { angle_deg: 91.0, ..default() }, "p-linkage.angle_deg = 91"),
            (SurfacesConfig { border_score: -1.0, ..default() }, "p-linkage.border_score = -1"),
            (SurfacesConfig { contest_rounds: 9, ..default() }, "p-linkage.contest_rounds = 9"),
            (SurfacesConfig { neighbours: 7, ..default() }, "p-linkage.neighbours = 7"),
            (SurfacesConfig { reach_m: 0.0, ..default() }, "p-linkage.reach_m = 0"),
            (SurfacesConfig { min_points: 9, ..default() }, "p-linkage.min_points = 9"),
        ] {
            let error = config.validate().unwrap_err().to_string();
            assert!(error.starts_with(key), "{error}");
        }
        default().validate().unwrap();
    }

    #[test]
    fn cosines_are_those_of_the_platform_but_for_the_last_digit() {
        for degrees in 0..=90 {
            let angle = f64::from(degrees).to_radians();
            assert!((cosine(angle) - angle.cos()).abs() < 1e-15, "{degrees}");
        }
    }
}

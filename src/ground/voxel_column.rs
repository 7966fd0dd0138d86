//! The ground filter `voxel-column`: low, short columns of voxels are ground. It uses no terrain model.
//!
//! Source: Li, Li, Li, Yang, Liu, "A density-based clustering method for urban scene mobile laser scanning
//! data segmentation" (2017), section 3.1.2 and eq. 2. Ours: voxels lie at multiples of their edge, not at
//! the minimum of the data, so an added file moves nothing; lengths are compared in lattice units, so no
//! rounding decides; the lowest voxel of a column is the lowest with two points, if there is one; the paper
//! does not give the radius of the neighbourhood.
//!
//! The voxels contain all points that are not noise. A *run* is a maximal sequence of occupied voxels of one
//! column with consecutive k. The lowest voxel of a column is ground if its run is shorter than `run_height`,
//! and if it is less than `step` above the lowest voxel of every column within `radius` (distance of the
//! centres, inclusive). Then its whole run is ground, including kerbs and low plants.
//!
//! Cost: O(points + columns * radius / voxel). Memory: five bytes per voxel, 8 per column, beside the voxels
//! themselves. The bench is `benches/kernels.rs`.
//!
//! Known failures: ground that touches an object within a voxel (below cars, hedges, walls) goes to the
//! object; objects lower than `run_height` go to the ground; slopes that rise `step` or more within `radius`
//! (18 degrees by default) are not ground.

use std::f64::consts::SQRT_2;

use serde::Deserialize;

use super::filter::{GroundEntry, GroundFilter};
use super::lowest::{NONE, lowest_within};
use super::visible;
use crate::config::{self, ConfigError};
use crate::model::{AlgorithmError, Lattice, PointClass, Reach};
use crate::spatial::{TileView, VoxelIndex};

const NAME: &str = "voxel-column";

pub(super) const ENTRY: GroundEntry = GroundEntry {
    name: NAME,
    summary: "short columns of voxels that are low among their neighbours",
    reference: "Li et al. 2017, section 3.1.2 and eq. 2, doi:10.3390/rs9040331",
    build: |table| Ok(Box::new(VoxelColumn::new(&config::section(NAME, table)?)?)),
};

/// Settings of the section `[voxel-column]`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VoxelColumnConfig {
    /// Edge of a voxel in metres, 0.02 to 10. Default 0.3: twice the spacing of points on far objects (Li et
    /// al. 2017, section 4.1).
    pub voxel: f64,
    /// A run is ground only when it is shorter than this, in metres, 0.02 to 100. Default 1.0 (Li et al.
    /// 2017, eq. 2).
    pub run_height: f64,
    /// A lowest voxel is ground only when it is less than this above the lowest one nearby, in metres, 0.02
    /// to 100. Default 0.5 (Li et al. 2017, eq. 2).
    pub step: f64,
    /// Columns are nearby if the horizontal distance of their centres is at most this, in metres, 0 to 20.
    /// Default 1.5 (chosen: five voxels, so that the road is near a kerb or a car door beside it).
    pub radius: f64,
    /// The lowest voxel of a column is the lowest with at least this number of points, or the lowest of all
    /// where none has as many; 1 to 100. Default 2 (chosen by the study in benches/results/ground.md; 1 is as
    /// in Li et al. 2017). With 1, a single return below the road removes the road around it from the ground.
    pub lowest_points: u32,
}

impl Default for VoxelColumnConfig {
    fn default() -> Self {
        Self { voxel: 0.3, run_height: 1.0, step: 0.5, radius: 1.5, lowest_points: 2 }
    }
}

impl VoxelColumnConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// [`ConfigError::Value`] with the key and the range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        ConfigError::outside([("voxel-column.lowest_points", self.lowest_points, 1..=100, "points")])?;
        ConfigError::outside([
            ("voxel-column.voxel", self.voxel, 0.02..=10.0, "metres"),
            ("voxel-column.run_height", self.run_height, 0.02..=100.0, "metres"),
            ("voxel-column.step", self.step, 0.02..=100.0, "metres"),
            ("voxel-column.radius", self.radius, 0.0..=20.0, "metres"),
        ])
    }
}

/// The filter, see the module.
#[derive(Debug, Clone)]
pub struct VoxelColumn {
    config: VoxelColumnConfig,
}

impl VoxelColumn {
    /// The filter with these settings.
    ///
    /// # Errors
    /// Those of [`VoxelColumnConfig::validate`].
    pub fn new(config: &VoxelColumnConfig) -> Result<Self, ConfigError> {
        config.validate()?;
        Ok(Self { config: config.clone() })
    }

    /// The voxels of the runs that are ground.
    fn ground_voxels(&self, index: &VoxelIndex, visible: &[u32], lattice: Lattice) -> Vec<bool> {
        let edge = i64::from(index.grid().edge);
        let heights = index.heights();
        let columns = index.columns().len();
        let visible_of = |column| index.column_voxels(column).filter(|&voxel| visible[voxel] > 0);
        let low_of = |column| {
            let sure = visible_of(column).find(|&voxel| visible[voxel] >= self.config.lowest_points);
            sure.or_else(|| visible_of(column).next())
        };
        let lows: Vec<u32> =
            (0..columns).map(|column| low_of(column).map_or(NONE, |voxel| heights[voxel])).collect();
        let lowest = lowest_within(index, lattice.units(self.config.radius), &lows);
        let (run_height, step) = (lattice.units(self.config.run_height), lattice.units(self.config.step));
        let mut ground = vec![false; index.len()];
        for column in 0..columns {
            let low = lows[column];
            if low == NONE || i64::from(low - lowest[column]) * edge >= step {
                continue;
            }
            let run = || {
                visible_of(column)
                    .skip_while(|&voxel| heights[voxel] < low)
                    .zip(low..)
                    .take_while(|&(voxel, k)| heights[voxel] == k)
            };
            let height = run().map(|_| edge).sum::<i64>();
            if height < run_height {
                run().for_each(|(voxel, _)| ground[voxel] = true);
            }
        }
        ground
    }
}

impl GroundFilter for VoxelColumn {
    fn name(&self) -> &'static str {
        NAME
    }

    /// `radius` between the centres, and half the diagonal of a column at both ends: a point may lie at the
    /// far corner of its column, and so may its neighbour.
    fn reach(&self, lattice: Lattice) -> Reach {
        let voxel_m = lattice.metres(lattice.units(self.config.voxel));
        Reach::Exact { metres: self.config.radius + voxel_m * SQRT_2 }
    }

    fn classify(&self, view: &mut TileView<'_>, classes: &mut [PointClass]) -> Result<(), AlgorithmError> {
        visible::classify(NAME, self.config.voxel, view, classes, |index, visible, lattice| {
            self.ground_voxels(index, visible, lattice)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::TileCloud;
    use PointClass::{Ground, LowNoise, Object};

    fn classify(points: &[[i64; 3]], classes: &[PointClass]) -> Vec<PointClass> {
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, points);
        let filter = VoxelColumn::new(&VoxelColumnConfig::default()).unwrap();
        let mut classes = classes.to_vec();
        filter.classify(&mut TileView::new(&cloud), &mut classes).unwrap();
        classes
    }

    /// Points at the centres of the voxels (i, 0, k).
    fn voxels(indices: &[[i64; 2]]) -> Vec<[i64; 3]> {
        indices.iter().map(|[i, k]| [i * 300 + 150, 150, k * 300 + 150]).collect()
    }

    #[test]
    fn a_run_of_three_voxels_is_ground_and_one_of_four_is_not() {
        // 3 * 0.3 m < 1 m <= 4 * 0.3 m. Voxels above a gap do not belong to the run.
        assert_eq!(
            classify(&voxels(&[[0, 0], [0, 1], [0, 2], [0, 4]]), &[Object; 4]),
            [Ground, Ground, Ground, Object]
        );
        assert_eq!(classify(&voxels(&[[0, 0], [0, 1], [0, 2], [0, 3]]), &[Object; 4]), [Object; 4]);
    }

    #[test]
    fn the_lowest_voxel_is_less_than_a_step_above_the_lowest_within_the_radius() {
        // One voxel higher: 0.3 m < 0.5 m. Two: 0.6 m. Five columns are 1.5 m and count, six do not.
        assert_eq!(classify(&voxels(&[[0, 0], [5, 1]]), &[Object; 2]), [Ground, Ground]);
        assert_eq!(classify(&voxels(&[[0, 0], [5, 2]]), &[Object; 2]), [Ground, Object]);
        assert_eq!(classify(&voxels(&[[0, 0], [6, 2]]), &[Object; 2]), [Ground, Ground]);
        // The lowest voxel of a column that is not ground (a wall) counts as well.
        let wall = voxels(&[[0, 0], [0, 1], [0, 2], [0, 3], [1, 2]]);
        assert_eq!(classify(&wall, &[Object; 5]), [Object; 5]);
    }

    #[test]
    fn lengths_equal_to_the_limits_are_not_below_them() {
        let config = VoxelColumnConfig { run_height: 0.6, step: 0.6, ..VoxelColumnConfig::default() };
        let filter = VoxelColumn::new(&config).unwrap();
        for (points, expected) in [
            (voxels(&[[0, 0], [0, 1]]), [Object, Object]),
            (voxels(&[[0, 0], [1, 2]]), [Ground, Object]),
            (voxels(&[[0, 0], [1, 1]]), [Ground, Ground]),
        ] {
            let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, &points);
            let mut classes = [Object; 2];
            filter.classify(&mut TileView::new(&cloud), &mut classes).unwrap();
            assert_eq!(classes, expected, "{points:?}");
        }
    }

    #[test]
    fn noise_is_invisible_and_stays_noise() {
        // Noise below does not lower the lowest voxel; noise in the middle breaks a run of four.
        let points = voxels(&[[0, -9], [0, 0], [0, 1], [0, 2], [0, 3]]);
        assert_eq!(
            classify(&points, &[LowNoise, Object, Object, LowNoise, Object]),
            [LowNoise, Ground, Ground, LowNoise, Object]
        );
        // A voxel with noise and other points counts as occupied, and its noise stays noise.
        let points = [[0, 0, 0], [1, 1, 1]];
        assert_eq!(classify(&points, &[LowNoise, Object]), [LowNoise, Ground]);
    }

    #[test]
    fn a_voxel_of_too_few_points_is_not_the_lowest_and_not_ground() {
        // A return 0.6 m below the road removes the road from the ground, unless a lowest voxel needs two
        // points.
        let mut points = voxels(&[[0, 2], [0, 2], [1, 2], [1, 2], [1, 0]]);
        assert_eq!(classify(&points, &[Object; 5]), [Ground, Ground, Ground, Ground, Object]);
        let config = VoxelColumnConfig { lowest_points: 1, ..VoxelColumnConfig::default() };
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, &points);
        let mut classes = [Object; 5];
        let printed = VoxelColumn::new(&config).unwrap();
        printed.classify(&mut TileView::new(&cloud), &mut classes).unwrap();
        assert_eq!(classes, [Object, Object, Object, Object, Ground]);
        // Noise is not counted. Where no voxel has as many points, the lowest one counts: thin ground is
        // ground.
        assert_eq!(classify(&points[..2], &[Object, LowNoise]), [Ground, LowNoise]);
        assert_eq!(classify(&voxels(&[[0, 2], [0, 5]]), &[Object; 2]), [Ground, Object]);
        // Above the lowest voxel, the run continues however many points its voxels have.
        points = voxels(&[[0, 2], [0, 2], [0, 3]]);
        assert_eq!(classify(&points, &[Object; 3]), [Ground; 3]);
    }

    #[test]
    fn values_out_of_range_are_refused_with_their_key() {
        let default = VoxelColumnConfig::default;
        for (config, key) in [
            (VoxelColumnConfig { voxel: 0.0, ..default() }, "voxel-column.voxel = 0"),
            (VoxelColumnConfig { run_height: f64::INFINITY, ..default() }, "voxel-column.run_height = inf"),
            (VoxelColumnConfig { step: f64::NAN, ..default() }, "voxel-column.step = NaN"),
            (VoxelColumnConfig { lowest_points: 0, ..default() }, "voxel-column.lowest_points = 0"),
            (VoxelColumnConfig { radius: -0.1, ..default() }, "voxel-column.radius = -0.1"),
        ] {
            let error = config.validate().unwrap_err().to_string();
            assert!(error.starts_with(key), "{error}");
        }
        default().validate().unwrap();
    }
}

//! The ground filter `voxel-column`: low, short columns of voxels are ground; it knows no terrain model.
//!
//! Source: paper 000, section 3.1.2 and eq. 2; constants from its Table 2 and text. Ours: voxels are anchored at multiples
//! of their edge, not at the minimum of the data, so that adding a file moves nothing; lengths are compared in lattice
//! units, so that no rounding decides.
//!
//! With the voxels of all points that are not noise, a *run* being a maximal sequence of occupied voxels of one column
//! with consecutive k: the lowest voxel of a column is ground when its run is shorter than `run_height` and when it
//! is less than `step` above the lowest voxel of any column within `radius` (centres, inclusive); then its whole run is
//! ground, kerbs and low growth with it.
//!
//! Cost: O(points + columns * radius / voxel). Memory: one byte per voxel, 8 per column, beside the voxels themselves. The
//! bench is `benches/kernels.rs`.
//!
//! Known failures: ground under a car or a hedge that the voxels of its body touch (the run is too long, so the ground
//! there goes to the object); walls and stems lose what is below `step` nowhere, but objects lower than `run_height`
//! whose voxels reach the ground are ground; slopes steeper than `step` over `radius` (18 degrees) are lost.

use std::f64::consts::SQRT_2;

use serde::Deserialize;

use super::lowest::{NONE, lowest_within};
use super::noise::voxel_edge;
use super::{GroundEntry, GroundFilter};
use crate::config::{self, ConfigError};
use crate::error::AlgorithmError;
use crate::model::{Lattice, PointClass, Reach, TileView, VoxelIndex};

const NAME: &str = "voxel-column";

pub(super) const ENTRY: GroundEntry = GroundEntry {
    name: NAME,
    summary: "short columns of voxels that are low among their neighbours",
    reference: "paper 000, section 3.1.2 and eq. 2",
    build: |table| Ok(Box::new(VoxelColumn::new(&config::section(NAME, table)?)?)),
};

/// Settings of the section `[voxel-column]`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VoxelColumnConfig {
    /// Edge of a voxel in metres, 0.02 to 10. Default 0.3 (paper 000, Table 2).
    pub voxel: f64,
    /// A run is ground only when it is shorter than this, in metres, 0.02 to 100. Default 1.0 (paper 000, section 3.1.2).
    pub run_height: f64,
    /// A lowest voxel is ground only when it is less than this above the lowest one nearby, in metres, 0.02 to 100. Default
    /// 0.5 (paper 000, section 3.1.2).
    pub step: f64,
    /// What nearby means: horizontal distance of the centres of columns in metres, inclusive, 0 to 20. Default 1.5
    /// (paper 000, section 3.1.2).
    pub radius: f64,
}

impl Default for VoxelColumnConfig {
    fn default() -> Self {
        Self { voxel: 0.3, run_height: 1.0, step: 0.5, radius: 1.5 }
    }
}

impl VoxelColumnConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// [`ConfigError::Value`] with the key and the range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let ranges = [
            ("voxel-column.voxel", self.voxel, 0.02..=10.0, "0.02 to 10 metres"),
            ("voxel-column.run_height", self.run_height, 0.02..=100.0, "0.02 to 100 metres"),
            ("voxel-column.step", self.step, 0.02..=100.0, "0.02 to 100 metres"),
            ("voxel-column.radius", self.radius, 0.0..=20.0, "0 to 20 metres"),
        ];
        for (key, value, range, expected) in ranges {
            if !range.contains(&value) {
                return Err(ConfigError::value(key, value, expected));
            }
        }
        Ok(())
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
    fn ground_voxels(&self, index: &VoxelIndex, visible: &[bool], lattice: Lattice) -> Vec<bool> {
        let edge = i64::from(index.grid().edge);
        let heights = index.heights();
        let columns = index.columns().len();
        let visible_of = |column| index.column_voxels(column).filter(|&voxel| visible[voxel]);
        let lows: Vec<u32> = (0..columns)
            .map(|column| visible_of(column).next().map_or(NONE, |voxel| heights[voxel]))
            .collect();
        let lowest = lowest_within(index, lattice.units(self.config.radius), &lows);
        let (run_height, step) = (lattice.units(self.config.run_height), lattice.units(self.config.step));
        let mut ground = vec![false; index.len()];
        for column in 0..columns {
            let low = lows[column];
            if low == NONE || i64::from(low - lowest[column]) * edge >= step {
                continue;
            }
            let run = || visible_of(column).zip(low..).take_while(|&(voxel, k)| heights[voxel] == k);
            if (run().count() as i64) * edge < run_height {
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

    /// `radius`, and a voxel at both ends: a point may lie at the far corner of its column, and so may its neighbour.
    fn reach(&self, lattice: Lattice) -> Reach {
        let voxel_m = lattice.metres(lattice.units(self.config.voxel));
        Reach::Exact { metres: self.config.radius + voxel_m * SQRT_2 }
    }

    fn classify(&self, view: &mut TileView<'_>, classes: &mut [PointClass]) -> Result<(), AlgorithmError> {
        let lattice = view.cloud().lattice;
        let index = view.voxels(NAME, voxel_edge(lattice, self.config.voxel))?;
        let mut visible = vec![false; index.len()];
        for (points, voxel) in index.streaks() {
            if !visible[voxel] {
                visible[voxel] = classes[points].iter().any(|class| !class.is_noise());
            }
        }
        let ground = self.ground_voxels(index, &visible, lattice);
        for (points, voxel) in index.streaks() {
            if ground[voxel] {
                for class in classes[points].iter_mut().filter(|class| !class.is_noise()) {
                    *class = PointClass::Ground;
                }
            }
        }
        Ok(())
    }
}

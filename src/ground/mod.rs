//! Ground: which points are ground and which are isolated noise.
//!
//! A filter is one file here and one line in [`REGISTRY`]. It sees the points of a tile and its own parameters;
//! no files, no paths, no threads, no clock.

mod blocks;
mod lowest;
mod noise;
mod opening;
mod scarce;
mod upward_growing;
mod visible;
mod voxel_column;

use crate::config::ConfigError;
use crate::model::AlgorithmError;
use crate::model::{Lattice, PointClass, Reach};
use crate::spatial::TileView;

pub use noise::{IsolatedNoise, NoiseConfig};
pub use opening::{Opening, OpeningConfig};
pub use scarce::LowPoints;
pub use upward_growing::{UpwardGrowing, UpwardGrowingConfig};
pub use voxel_column::{VoxelColumn, VoxelColumnConfig};

/// A method that tells ground from everything else.
pub trait GroundFilter: std::fmt::Debug + Send + Sync {
    /// Name in the registry and of the section of its settings.
    fn name(&self) -> &'static str;

    /// How far from a point other points matter for its class.
    fn reach(&self, lattice: Lattice) -> Reach;

    /// Sets [`PointClass::Ground`] where a point is ground. `classes` holds [`PointClass::Object`], or noise,
    /// for every point of `view`. Noise points are invisible to the filters of papers and keep their class; a filter
    /// may look at them and find ground among them. Voxels that the view has already are there for a filter with the
    /// same edge.
    ///
    /// # Errors
    /// When the points cannot be indexed, see [`AlgorithmError`].
    fn classify(&self, view: &mut TileView<'_>, classes: &mut [PointClass]) -> Result<(), AlgorithmError>;
}

/// No filter: no point is ground. For drives whose ground has been removed already.
#[derive(Debug, Clone, Copy)]
pub struct NoGround;

impl NoGround {
    /// What stands in the place of a filter's name.
    pub const NAME: &'static str = "none";
}

impl GroundFilter for NoGround {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn reach(&self, _: Lattice) -> Reach {
        Reach::Exact { metres: 0.0 }
    }

    fn classify(&self, _: &mut TileView<'_>, _: &mut [PointClass]) -> Result<(), AlgorithmError> {
        Ok(())
    }
}

/// One line of the registry.
#[derive(Debug, Clone, Copy)]
pub struct GroundEntry {
    /// Name of the filter and of its section in the configuration.
    pub name: &'static str,
    /// What it does, in one line.
    pub summary: &'static str,
    /// Where it is published.
    pub reference: &'static str,
    /// Builds the filter from its section; missing keys have their defaults.
    pub build: fn(&toml::Table) -> Result<Box<dyn GroundFilter>, ConfigError>,
}

/// Every ground filter, in the order in which help lists them.
pub static REGISTRY: &[GroundEntry] = &[voxel_column::ENTRY, upward_growing::ENTRY, opening::ENTRY];

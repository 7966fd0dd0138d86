//! What a ground filter is, and its line of the registry.

use crate::config::ConfigError;
use crate::model::{AlgorithmError, Lattice, PointClass, Reach};
use crate::spatial::TileView;

/// A method that separates the ground from everything else.
pub trait GroundFilter: std::fmt::Debug + Send + Sync {
    /// Name in the registry and of the section of its settings.
    fn name(&self) -> &'static str;

    /// Largest distance from a point to other points that decide its class.
    fn reach(&self, lattice: Lattice) -> Reach;

    /// Processor time per point that a tile reads, in microseconds on the machine of `benches/results`, noise
    /// included, for estimates of the time of a run.
    fn microseconds_per_point(&self) -> f64 {
        1.0
    }

    /// Sets [`PointClass::Ground`] where a point is ground. `classes` holds [`PointClass::Object`], or noise,
    /// for every point of `view`. Noise points are invisible to the filters of papers and keep their class.
    /// Another filter may use them and find ground among them. A filter with the same edge reuses the voxels
    /// of the view.
    ///
    /// # Errors
    /// When the points cannot be indexed, see [`AlgorithmError`].
    ///
    /// # Panics
    /// When there is not one class per point.
    fn classify(&self, view: &mut TileView<'_>, classes: &mut [PointClass]) -> Result<(), AlgorithmError>;
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

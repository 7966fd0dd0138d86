//! Clusters: which of the points that are neither ground nor noise belong to one object.
//!
//! A method is one file here and one line in [`REGISTRY`]. It sees the points of a tile and its own parameters; no
//! files, no paths, no threads, no clock.

pub mod dbscan;
mod density_peaks;
mod euclidean;
pub(crate) mod linking;
pub mod p_linkage;
mod prepared;
mod sliced;
mod staged;

use crate::config::ConfigError;
use crate::model::AlgorithmError;
use crate::model::{Lattice, Reach, TileCloud};

pub use dbscan::{Auto, Dbscan, DbscanConfig, DbscanVariant, Epsilon};
pub use density_peaks::{DensityPeaks, DensityPeaksConfig};
pub use euclidean::{Euclidean, EuclideanConfig};
pub use prepared::{EpsilonConfig, Needs, PreparedClusterer};
pub use staged::{DriveSource, Grouped, Labelled, Mapped, Stage, StagedClusterer, TilePoints, TileSource};

/// A method that joins points to objects, tile by tile.
pub trait Clusterer: std::fmt::Debug + Send + Sync {
    /// Name in the registry and of the section of its settings.
    fn name(&self) -> &'static str;

    /// How far from a point other points matter for what it is joined with.
    fn reach(&self, lattice: Lattice) -> Reach;

    /// Smallest and largest number of points of an object, applied to whole objects after stitching.
    fn object_size(&self) -> std::ops::RangeInclusive<u64>;

    /// Labels the points of `cloud` (objects only, no ground or noise): `labels[i]` in `1..=n`, or 0 for a point
    /// that is in no object whatever its other neighbours are. Returns n. Two points have the same label when they
    /// are connected through points of the cloud; the engine unites labels across tiles.
    ///
    /// # Errors
    /// When the points cannot be indexed, see [`AlgorithmError`].
    fn cluster(&self, cloud: &TileCloud, labels: &mut [u32]) -> Result<u32, AlgorithmError>;

    /// The same for a tile that owns the points where `core` is true. A method whose points can be in an object
    /// without passing the connection on (border points of `dbscan`) gives such points a label only where the tile
    /// owns them: what is around the others may lie outside, and a label they have elsewhere must not unite objects.
    ///
    /// # Errors
    /// Those of [`Clusterer::cluster`].
    fn cluster_tile(
        &self,
        cloud: &TileCloud,
        core: &[bool],
        labels: &mut [u32],
    ) -> Result<u32, AlgorithmError> {
        debug_assert_eq!(core.len(), cloud.len());
        self.cluster(cloud, labels)
    }
}

/// A method, as the engine has to run it.
#[derive(Debug)]
pub enum Method {
    /// In one pass; tiles are stitched at common points.
    Local(Box<dyn Clusterer>),
    /// In several passes with barriers.
    Staged(Box<dyn StagedClusterer>),
    /// In one pass, once something is known of the whole drive.
    Prepared(Box<dyn PreparedClusterer>),
}

impl Method {
    /// Name in the registry and of the section of its settings.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Local(method) => method.name(),
            Self::Staged(method) => method.name(),
            Self::Prepared(method) => method.name(),
        }
    }

    /// How far around a tile points are read, where that is known before anything is known of the drive.
    #[must_use]
    pub fn reach(&self, lattice: Lattice) -> Option<Reach> {
        match self {
            Self::Local(method) => Some(method.reach(lattice)),
            Self::Staged(method) => Some(method.reach(lattice)),
            Self::Prepared(_) => None,
        }
    }

    /// Smallest and largest number of points of an object, applied to whole objects.
    #[must_use]
    pub fn object_size(&self) -> std::ops::RangeInclusive<u64> {
        match self {
            Self::Local(method) => method.object_size(),
            Self::Staged(method) => method.object_size(),
            Self::Prepared(method) => method.object_size(),
        }
    }
}

/// One line of the registry.
#[derive(Debug, Clone, Copy)]
pub struct ClusterEntry {
    /// Name of the method and of its section in the configuration.
    pub name: &'static str,
    /// What it does, in one line.
    pub summary: &'static str,
    /// Where it is published.
    pub reference: &'static str,
    /// Builds the method from its section; missing keys have their defaults.
    pub build: fn(&toml::Table) -> Result<Method, ConfigError>,
}

/// Every clustering method, in the order in which help lists them.
pub static REGISTRY: &[ClusterEntry] = &[euclidean::ENTRY, density_peaks::ENTRY, dbscan::ENTRY];

//! Clusters: which of the points that are neither ground nor noise belong to one object.
//!
//! A method is a file or a folder here and one line in [`REGISTRY`]. It sees points, its own settings, and the drive
//! through windows; no files, no paths, no threads, no clock. A method that looks at one tile at a time implements
//! [`Clusterer`]; one of several steps implements [`Method`].

pub mod dbscan;
mod density_peaks;
mod euclidean;
mod further;
mod linking;
mod local;
mod method;
pub mod p_linkage;
mod sliced;

pub use dbscan::{Auto, Dbscan, DbscanConfig, DbscanVariant, Epsilon};
pub use density_peaks::{DensityPeaks, DensityPeaksConfig};
pub use euclidean::{Euclidean, EuclideanConfig};
pub use local::{Clusterer, OneStep};
pub use method::{
    BytesPer, ClusterEntry, DriveWindow, Figures, Grouped, Labelled, Mapped, Method, Reduced, Repeat,
    Sections, Step, TilePoints, TileWindow,
};

/// Every clustering method, in the order in which help lists them.
pub static REGISTRY: &[ClusterEntry] = &[euclidean::ENTRY, density_peaks::ENTRY, dbscan::ENTRY];

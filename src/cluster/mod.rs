//! Clusters: which points belong to one object. Ground and noise have been excluded before.
//!
//! A method is a file or a folder here and one line in [`REGISTRY`]. It sees points, its own settings, and
//! the drive through windows. It sees no files, no paths, no threads and no clock. A method that processes
//! one tile at a time implements [`Clusterer`]. A method of several steps implements [`Method`].
//!
//! ```
//! use chainage::cluster::{Clusterer, Euclidean, EuclideanConfig};
//! use chainage::model::{Lattice, TileCloud};
//!
//! // Two groups of points in millimetres, 5 m apart.
//! let points = [[0, 0, 0], [0, 0, 200], [0, 0, 400], [5_000, 0, 0], [5_000, 0, 100]];
//! let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, &points);
//! let method = Euclidean::new(&EuclideanConfig { max_gap_m: 0.3, ..EuclideanConfig::default() })?;
//! let mut labels = [0; 5];
//! let clusters = method.cluster(&cloud, &mut labels)?;
//! assert_eq!(clusters, 2);
//! assert_eq!(labels, [1, 1, 1, 2, 2]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod columns;
pub mod dbscan;
mod density_peaks;
mod eigen;
mod euclidean;
mod further;
mod linking;
mod local;
mod method;
mod normalized_cut;
pub mod p_linkage;
mod sliced;
pub(crate) mod street;

pub use dbscan::{Auto, Dbscan, DbscanConfig, DbscanVariant, Epsilon};
pub use density_peaks::{DensityPeaks, DensityPeaksConfig};
pub use euclidean::{Euclidean, EuclideanConfig};
pub use local::{Clusterer, OneStep};
pub use method::{
    BytesPer, ClusterEntry, DriveWindow, Figures, Grouped, Labelled, Mapped, Method, Reduced, Repeat,
    Sections, Step, TilePoints, TileWindow,
};
pub use normalized_cut::{NormalizedCut, NormalizedCutConfig};
pub use street::{Scene, Street, StreetConfig, WantedClass};

/// Names of the charts that methods draw.
pub(crate) fn charts() -> &'static [&'static str] {
    &density_peaks::CHARTS
}

/// Every clustering method, in the order of the help.
pub static REGISTRY: &[ClusterEntry] = &[
    euclidean::ENTRY,
    density_peaks::ENTRY,
    dbscan::ENTRY,
    normalized_cut::ENTRY,
    p_linkage::surfaces::ENTRY,
    street::ENTRY,
];

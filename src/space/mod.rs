//! Clustering of points of 2 to 8 dimensions that are all in memory: `dbscan`, `p-linkage` and the curve that epsilon is
//! estimated from. No files, and no tiles: drives have `cluster`.

mod crowd;
mod dbscan;
mod error;
mod index;
mod labels;
mod p_linkage;
mod points;

pub(crate) use crowd::Neighbours;
pub use dbscan::{Dbscan, DbscanVariant, neighbour_curve};
pub use error::SpaceError;
pub use p_linkage::{Linkage, PLinkage};
pub use points::{DIMENSIONS, Points};

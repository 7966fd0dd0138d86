//! `p-linkage`: pairwise linkage of tables of 2 to 8 dimensions, and surfaces of drives.

mod rows;
pub(super) mod surfaces;

pub use rows::{Linkage, PLinkage};
pub use surfaces::{Surfaces, SurfacesConfig};

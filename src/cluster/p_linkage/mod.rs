//! `p-linkage`: pairwise linkage of tables of 2 to 8 dimensions.

mod rows;

pub use rows::{Linkage, PLinkage};

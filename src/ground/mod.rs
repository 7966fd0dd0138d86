//! Ground: which points are ground and which are isolated noise.
//!
//! A filter is one file here and one line in [`REGISTRY`]. It sees the points of a tile and its own parameters;
//! no files, no paths, no threads, no clock.

mod blocks;
mod filter;
mod lowest;
mod noise;
mod none;
mod opening;
mod scarce;
mod standing;
mod upward_growing;
mod visible;
mod voxel_column;

pub use filter::{GroundEntry, GroundFilter};
pub use noise::{IsolatedNoise, NoiseConfig};
pub use none::NoGround;
pub use opening::{Opening, OpeningConfig};
pub use scarce::LowPoints;
pub use upward_growing::{UpwardGrowing, UpwardGrowingConfig};
pub use voxel_column::{VoxelColumn, VoxelColumnConfig};

/// Every ground filter, in the order in which help lists them.
pub static REGISTRY: &[GroundEntry] = &[voxel_column::ENTRY, upward_growing::ENTRY, opening::ENTRY];

//! Ground: which points are ground and which are isolated noise.
//!
//! A filter is one file here and one line in [`REGISTRY`]. It sees the points of a tile and its own
//! parameters; no files, no paths, no threads, no clock.
//!
//! ```
//! use chainage::ground::REGISTRY;
//! use chainage::model::{Lattice, PointClass, TileCloud};
//! use chainage::spatial::TileView;
//!
//! // 6 m by 6 m of road, a point every 0.1 m, and a post of 2 m on it.
//! let mut points: Vec<[i64; 3]> = (0..3_600).map(|n| [n % 60 * 100, n / 60 * 100, 0]).collect();
//! points.extend((1..=20).map(|step| [3_000, 3_000, 100 * step]));
//! let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, &points);
//! let entry = REGISTRY.iter().find(|entry| entry.name == "voxel-column").expect("is registered");
//! let filter = (entry.build)(&toml::Table::new())?;
//! let mut classes = vec![PointClass::Object; points.len()];
//! filter.classify(&mut TileView::new(&cloud), &mut classes)?;
//! let is_ground = |class: &&PointClass| **class == PointClass::Ground;
//! // All of the road, except points below the post.
//! assert!(classes[..3_600].iter().filter(is_ground).count() > 3_500);
//! assert_eq!(classes[3_605..].iter().filter(is_ground).count(), 0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod blocks;
mod column_points;
mod filter;
mod lowest;
mod noise;
mod none;
mod opening;
mod scarce;
mod standing;
mod stems;
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

/// Every ground filter, in the order of the help.
pub static REGISTRY: &[GroundEntry] = &[voxel_column::ENTRY, upward_growing::ENTRY, opening::ENTRY];

//! The clustering method `street`, our own: it knows what a voxel is before it decides whose it is. A
//! classifier, trained on labelled drives, gives each voxel probabilities of classes. Objects are then
//! separated class by class, from the ground up.
//!
//! Steps. `voxels`: points to voxels of 0.15 m and a ground raster. `classes`: features of each voxel from the
//! voxels within 4 m and the ground within 16 m, probabilities of classes, smoothed. Sums are integers, and
//! eigenvalues follow a fixed sequence of IEEE operations. So a voxel has the same features in every tile
//! that sees its surroundings.

mod classified;
mod settings;
mod stage_voxels;
mod terrain;
mod voxels;

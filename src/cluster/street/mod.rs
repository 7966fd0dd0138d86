//! The clustering method `street`, our own: it knows what a voxel is before it decides whose it is. A
//! classifier, trained on labelled drives, gives each voxel probabilities of classes. Objects are then
//! separated class by class, from the ground up.
//!
//! Steps. `voxels`: points to voxels of 0.15 m and a ground raster. `classes`: features of each voxel from the
//! voxels within 5.4 m (the corner of the largest window) and the ground 12 m around them, probabilities of
//! classes, smoothed. Sums are integers, and eigenvalues follow a fixed sequence of IEEE operations. So a voxel
//! has the same features in every tile that sees its surroundings.

mod classified;
mod features;
mod settings;
mod stage_classes;
mod stage_voxels;
mod terrain;
mod voxels;

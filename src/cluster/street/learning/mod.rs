//! Learning: labelled voxels and objects of drives for the models of `street`.

pub(crate) mod doubts;
pub(crate) mod object_samples;
pub(crate) mod training;
pub(crate) mod truth;

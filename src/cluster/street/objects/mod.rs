//! Steps `leftovers` and `objects`: the voxels that no core reaches, the labels of points, and the names of
//! objects.

pub(crate) mod contacts;
pub(crate) mod figures;
pub(crate) mod fixtures;
pub(crate) mod islands;
pub(crate) mod leaves;
pub(crate) mod stage_leftovers;
pub(crate) mod stage_objects;
pub(crate) mod wholes;

//! Points within a distance, joined exactly: shared by `euclidean`, `dbscan` and tables.

pub(crate) mod closeness;
pub(crate) mod numbering;

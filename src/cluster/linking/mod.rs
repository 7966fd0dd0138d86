//! Points within a distance, joined exactly: shared by `euclidean`, `dbscan` and tables.

pub(crate) mod closeness;
pub(crate) mod numbering;
mod single_link;

pub(crate) use single_link::{LayerStep, cell_side, layers, link_cells, single_link};

//! Stitching: local labels of tiles that share a point are one object. Knows labels and point ids; no coordinates.

mod union_find;

pub use union_find::UnionFind;

//! Joins the labels of all tiles to whole objects with ids.

use std::ops::RangeInclusive;

use crate::model::{ObjectPart, PointId, TileId, in_u32};
use crate::spatial::DisjointSets;
use crate::stitch::LocalObject;

/// Collects the objects of the tiles in tile order, then the links between them.
#[derive(Debug, Default)]
pub struct Stitcher {
    /// Number of labels before each tile's first label.
    first_node: Vec<u32>,
    parts: Vec<ObjectPart>,
    /// Ranges of labels of the tiles outside the section.
    beside: Vec<std::ops::Range<u32>>,
    sets: Option<DisjointSets>,
}

/// The objects of the drive.
#[derive(Debug, Default, PartialEq)]
pub struct Stitched {
    /// Object 1, 2, ... in ascending order of the smallest point id.
    pub objects: Vec<ObjectPart>,
    /// Object id of label 1, 2, ... of each tile. 0 if the whole object is too small or too large.
    pub ids: Vec<Vec<u32>>,
    /// Labels that were united with a label of another tile.
    pub united: u64,
}

impl Stitcher {
    /// Adds the objects of the next tile.
    pub fn tile(&mut self, objects: Vec<LocalObject>) {
        let count = in_u32(self.parts.len(), "labels of all tiles");
        self.first_node.push(count);
        self.parts.extend(objects.into_iter().map(|object| object.part));
    }

    /// Adds the objects of the next tile, which is outside the section that is processed. An object counts
    /// only if it has a part in a tile inside the section.
    pub fn tile_beside(&mut self, objects: Vec<LocalObject>) {
        let first = in_u32(self.parts.len(), "labels of all tiles");
        self.tile(objects);
        self.beside.push(first..in_u32(self.parts.len(), "labels of all tiles"));
    }

    fn node(&self, tile: TileId, label: u32) -> Option<u32> {
        let first = *self.first_node.get(tile.index())?;
        let node = first.checked_add(label.checked_sub(1)?)?;
        let end = self.first_node.get(tile.index() + 1).map_or(self.parts.len(), |&next| next as usize);
        ((node as usize) < end).then_some(node)
    }

    /// Unites two labels of the same point, after all tiles have been added. Returns whether both labels
    /// exist.
    #[must_use]
    pub fn link(&mut self, one: (TileId, u32), other: (TileId, u32)) -> bool {
        let (Some(a), Some(b)) = (self.node(one.0, one.1), self.node(other.0, other.1)) else { return false };
        let len = in_u32(self.parts.len(), "labels of all tiles");
        self.sets.get_or_insert_with(|| DisjointSets::new(len)).union(a, b);
        true
    }

    /// The whole objects whose number of points is in `size`, numbered by smallest point id.
    #[must_use]
    pub fn finish(mut self, size: &RangeInclusive<u64>) -> Stitched {
        let nodes = in_u32(self.parts.len(), "labels of all tiles");
        let mut sets = self.sets.take().unwrap_or_else(|| DisjointSets::new(nodes));
        let mut united = 0;
        let roots: Vec<u32> = (0..nodes).map(|node| sets.find(node)).collect();
        let mut is_inside = vec![false; roots.len()];
        let mut beside = self.beside.iter().cloned().flatten().peekable();
        for (node, &root) in (0..nodes).zip(&roots) {
            let is_beside = beside.next_if_eq(&node).is_some();
            is_inside[root as usize] |= !is_beside && self.parts[node as usize].points > 0;
        }
        let mut whole: Vec<Option<ObjectPart>> = self.parts.into_iter().map(Some).collect();
        for (node, &root) in roots.iter().enumerate().filter(|(node, root)| *node != **root as usize) {
            united += 1;
            if let (Some(part), Some(object)) = (whole[node].take(), &mut whole[root as usize]) {
                object.merge(&part);
            }
        }
        let mut order: Vec<(PointId, usize)> = whole
            .iter()
            .enumerate()
            .filter_map(|(root, object)| {
                object
                    .as_ref()
                    .filter(|object| is_inside[root] && size.contains(&object.points))
                    .map(|object| (object.first_id, root))
            })
            .collect();
        order.sort_unstable();
        let mut id_of_root = vec![0_u32; whole.len()];
        let mut objects = Vec::with_capacity(order.len());
        for (id, (_, root)) in (1_u32..).zip(order) {
            id_of_root[root] = id;
            objects.extend(whole[root].take());
        }
        let id_of_node: Vec<u32> = roots.iter().map(|&root| id_of_root[root as usize]).collect();
        let mut ends: Vec<usize> = self.first_node.iter().skip(1).map(|&first| first as usize).collect();
        ends.push(id_of_node.len());
        let ids = self
            .first_node
            .iter()
            .zip(ends)
            .map(|(&first, end)| id_of_node[first as usize..end].to_vec())
            .collect();
        Stitched { objects, ids, united }
    }
}

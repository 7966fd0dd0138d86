//! The trees that links form from the points of a tile, and the names by which the parts of a tree in
//! different tiles are joined.
//!
//! A link from one tile to another is known in both. The tile that owns the linked point sees the foreign
//! point to which it is linked. The owner of that point knows the links of all points within reach, so it
//! sees the link as well. Both use the id of that point as a name. So parts with an equal name are one tree.

use super::around::Around;
use super::normals::{NONE, Normals};
use crate::model::PointId;

/// A tree, or the part of one that a tile owns.
#[derive(Debug, Default)]
pub(super) struct Tree {
    /// Its points, ascending.
    pub(super) points: Vec<u32>,
    /// Its root, if the tile owns it.
    pub(super) root: Option<u32>,
    /// Points at the ends of links between this tile and others. Empty if the whole tree is in the tile.
    pub(super) names: Vec<PointId>,
}

/// The trees of the points that a tile owns, by their smallest points.
pub(super) fn trees(around: &Around, normals: &Normals) -> Vec<Tree> {
    let mut links = vec![NONE; around.len()];
    let points = normals.points();
    for slot in normals.slots() {
        let point = points[slot];
        if around.repeats(point as usize) {
            // Points in one place form a chain. Otherwise ids would decide which of them is linked to other
            // points.
            links[point as usize] = point - 1;
        } else if let Some(link) = normals.link(slot) {
            links[point as usize] = points[link];
        }
    }
    let ends = ends(around, normals, &links);
    let mut number = vec![NONE; around.len()];
    let mut trees: Vec<Tree> = Vec::new();
    for (point, &end) in (0_u32..).zip(&ends).filter(|(_, end)| **end != NONE) {
        let slot = &mut number[end as usize];
        if *slot == NONE {
            // There are fewer trees than points, so the number fits.
            *slot = u32::try_from(trees.len()).unwrap_or(NONE);
            let (root, names) = match around.is_core(end as usize) {
                true => (Some(end), Vec::new()),
                false => (None, vec![around.id[end as usize]]),
            };
            trees.push(Tree { points: Vec::new(), root, names });
        }
        trees[*slot as usize].points.push(point);
    }
    for (point, &link) in links.iter().enumerate().filter(|(_, link)| **link != NONE) {
        let link = link as usize;
        if !around.is_core(point) && around.is_core(link) {
            trees[number[ends[link] as usize] as usize].names.push(around.id[link]);
        }
    }
    for tree in &mut trees {
        tree.names.sort_unstable();
        tree.names.dedup();
    }
    trees
}

/// Where the links of each point of the tile lead: to a root in the tile, or to the first foreign point.
/// [`NONE`] without a normal.
fn ends(around: &Around, normals: &Normals, links: &[u32]) -> Vec<u32> {
    let mut ends = vec![NONE; around.len()];
    let mut path = Vec::new();
    for point in (0..around.len()).filter(|&point| around.is_core(point) && normals.has(point)) {
        let mut at = point;
        let end = loop {
            if ends[at] != NONE {
                break ends[at];
            }
            path.push(at);
            let link = links[at];
            if link == NONE {
                // A position in `around` fits, as in `links`.
                break u32::try_from(at).unwrap_or(NONE);
            }
            if !around.is_core(link as usize) {
                break link;
            }
            at = link as usize;
        };
        path.drain(..).for_each(|at| ends[at] = end);
    }
    ends
}

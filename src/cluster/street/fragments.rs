//! Fragments of trees: objects that lie in the crown of a larger tree with many of their voxels. They are a
//! part of it.
//!
//! Where a scanner sees a crown through another one, or from far away, the crown falls into pieces: a piece
//! of it is a tree without a stem, or leaves are called a fence or a small thing. A tree of its own touches
//! its neighbour with the rim of its crown, and things that stand below a crown hardly touch it.
//!
//! Tiles count voxels, and counts of all tiles add up. So the decision needs no reach.

use std::collections::BTreeMap;

use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

use super::leftovers::Whole;
use super::shares::{FENCE, POLE, SMALL, TREE};
use super::window::Window;
use crate::model::Lattice;

/// A voxel within so many voxels of a tree, in the plane and in levels, lies in it: 0.45 m.
const IN_TREE: i32 = 3;
/// Objects with more voxels are no fragments.
const MOST: u32 = 800;
/// A tree with a fragment has at least so many halves of the voxels of the fragment.
const LARGER_HALVES: u64 = 3;
/// What a fragment is, by class: the share of its voxels in one tree, in percent, and its lowest height above
/// ground in metres. The study is in `benches/results/street.md`: with less, trees of their own are lost in
/// plantations, and passers-by below crowns.
const FRAGMENTS: [(u8, u64, f64); 4] =
    [(TREE, 35, f64::MIN), (FENCE, 20, 0.3), (SMALL, 35, 0.5), (POLE, 30, 0.8)];

/// What a tile knows of the objects: each with its size, and the voxels that one has in another, which is a
/// tree.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Counts {
    sizes: Vec<(u32, Size)>,
    inside: Vec<(u32, u32, u32)>,
}

/// An object over the voxels of a tile or of the drive.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Size {
    class: u8,
    voxels: u32,
    /// Lowest height above ground, in lattice units.
    lowest: i32,
}

impl Size {
    fn merge(&mut self, other: Self) {
        self.voxels += other.voxels;
        self.lowest = self.lowest.min(other.lowest);
    }
}

/// Counts the voxels that the tile owns.
pub(super) fn count(whole: &Whole) -> Counts {
    let around = &whole.grown.cored.around;
    let voxels = &around.voxels;
    let label = &whole.grown.label;
    let is_tree = |label: u32| whole.class.get(&label) == Some(&TREE);
    let owned = || (0..label.len()).filter(|&voxel| voxels.owned[voxel] && label[voxel] != 0);
    let mut sizes = BTreeMap::<u32, Size>::new();
    for voxel in owned() {
        let Some(&class) = whole.class.get(&label[voxel]) else { continue };
        let one = Size { class, voxels: 1, lowest: around.height[voxel] };
        sizes.entry(label[voxel]).and_modify(|size| size.merge(one)).or_insert(one);
    }
    let may_be = |of: &Size| of.voxels <= MOST && FRAGMENTS.iter().any(|(class, ..)| *class == of.class);
    let mut inside = FxHashMap::<(u32, u32), u32>::default();
    let window = Window::new(IN_TREE, IN_TREE);
    let mut finder = voxels.columns.finder();
    let mut trees = Vec::new();
    for voxel in owned().filter(|&voxel| sizes.get(&label[voxel]).is_some_and(may_be)) {
        let own = label[voxel];
        let [i, j, k] = voxels.key[voxel];
        window.visit(&voxels.columns, &mut finder, [i, j], k, |other| {
            let other = label[other];
            if other != own && other != 0 && !trees.contains(&other) && is_tree(other) {
                trees.push(other);
            }
        });
        for tree in trees.drain(..) {
            *inside.entry((own, tree)).or_default() += 1;
        }
    }
    let mut inside: Vec<(u32, u32, u32)> =
        inside.into_iter().map(|((one, tree), count)| (one, tree, count)).collect();
    inside.sort_unstable();
    Counts { sizes: sizes.into_iter().collect(), inside }
}

/// The objects of the drive that are fragments, each with the tree that it is a part of.
pub(super) fn find(tiles: &[Counts], lattice: Lattice) -> BTreeMap<u32, u32> {
    let mut sizes = BTreeMap::<u32, Size>::new();
    let mut inside = BTreeMap::<(u32, u32), u32>::new();
    for tile in tiles {
        for &(label, size) in &tile.sizes {
            sizes.entry(label).and_modify(|whole| whole.merge(size)).or_insert(size);
        }
        for &(one, tree, count) in &tile.inside {
            *inside.entry((one, tree)).or_default() += count;
        }
    }
    // The tree with most of the voxels of each object. Of two, the one with the smaller label counts.
    let mut most = BTreeMap::<u32, (u32, u32)>::new();
    for ((one, tree), count) in inside {
        let best = most.entry(one).or_insert((count, tree));
        if count > best.0 {
            *best = (count, tree);
        }
    }
    let mut fragments = BTreeMap::new();
    for (one, (count, tree)) in most {
        let (Some(size), Some(of)) = (sizes.get(&one), sizes.get(&tree)) else { continue };
        let is_larger = 2 * u64::from(of.voxels) >= LARGER_HALVES * u64::from(size.voxels);
        let is_fragment = FRAGMENTS.iter().any(|&(class, percent, lowest)| {
            class == size.class
                && 100 * u64::from(count) >= percent * u64::from(size.voxels)
                && lattice.metres(size.lowest.into()) >= lowest
        });
        if size.voxels <= MOST && is_larger && is_fragment {
            fragments.insert(one, tree);
        }
    }
    // A tree may be a fragment of a larger one. Trees get larger on the way, so it ends.
    let whole = |mut tree: u32| {
        while let Some(&next) = fragments.get(&tree) {
            tree = next;
        }
        tree
    };
    fragments.iter().map(|(&one, &tree)| (one, whole(tree))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The fragments among these blocks. Each is a class, a corner and a size, in decimetres.
    fn fragments(blocks: &[(u8, [i64; 3], [i64; 3])]) -> BTreeMap<u32, u32> {
        find(&[count(&Whole::of_blocks(blocks))], Lattice::MILLIMETRE)
    }

    const CROWN: (u8, [i64; 3], [i64; 3]) = (TREE, [0, 0, 20], [40, 40, 30]);

    #[test]
    fn what_lies_in_a_crown_is_a_part_of_the_tree() {
        let sprig = (TREE, [38, 10, 30], [10, 10, 10]);
        let leaves = (SMALL, [40, 30, 30], [4, 4, 4]);
        assert_eq!(fragments(&[CROWN, sprig, leaves]), BTreeMap::from([(2, 1), (3, 1)]));
    }

    #[test]
    fn a_neighbour_that_touches_with_its_rim_and_what_stands_below_are_not() {
        let neighbour = (TREE, [41, 0, 20], [20, 20, 30]);
        let passer_by = (SMALL, [20, 20, 0], [4, 4, 17]);
        let car = (super::super::shares::VEHICLE, [10, 10, 18], [6, 6, 4]);
        assert_eq!(fragments(&[CROWN, neighbour, passer_by, car]), BTreeMap::new());
    }

    #[test]
    fn a_fragment_of_a_fragment_is_a_part_of_the_whole_tree() {
        let branch = (TREE, [38, 10, 30], [10, 10, 10]);
        let twig = (TREE, [47, 12, 32], [4, 4, 4]);
        assert_eq!(fragments(&[CROWN, branch, twig]), BTreeMap::from([(2, 1), (3, 1)]));
    }

    #[test]
    fn of_two_trees_the_larger_one_is_whole_and_of_two_as_large_neither_is_a_fragment() {
        let small = (TREE, [0, 0, 20], [10, 10, 10]);
        let large = (TREE, [10, 0, 20], [10, 10, 16]);
        assert_eq!(fragments(&[small, large]), BTreeMap::from([(1, 2)]));
        let as_large = (TREE, [10, 0, 20], [10, 10, 12]);
        assert_eq!(fragments(&[small, as_large]), BTreeMap::new());
    }

    #[test]
    fn counts_of_tiles_add_up() {
        let part = |voxels, lowest| Counts {
            sizes: vec![
                (1, Size { class: TREE, voxels: 500, lowest: 0 }),
                (2, Size { class: SMALL, voxels, lowest }),
            ],
            inside: vec![(2, 1, 10)],
        };
        let lattice = Lattice::MILLIMETRE;
        assert_eq!(find(&[part(20, 2000), part(20, 600)], lattice), BTreeMap::from([(2, 1)]));
        assert_eq!(find(&[part(20, 2000), part(20, 400)], lattice), BTreeMap::new());
        assert_eq!(find(&[part(20, 2000), part(60, 600)], lattice), BTreeMap::new());
    }
}

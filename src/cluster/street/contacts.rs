//! Contacts of objects: how many voxels of one lie beside a voxel of another. Tiles count the voxels that they
//! own, so the counts of all tiles add up.

use std::collections::BTreeMap;

use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

use super::leftovers::Whole;
use super::window::Window;

/// Of two labels, the voxels of the first that have one of the second among the 26 around them.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Contacts(Vec<(u32, u32, u32)>);

/// Counts the voxels that the tile owns. Labels must be right for their neighbours, too.
pub(super) fn count(whole: &Whole) -> Contacts {
    let voxels = &whole.grown.cored.around.voxels;
    let label = &whole.grown.label;
    let window = Window::square(1);
    let mut finder = voxels.columns.finder();
    let mut counts = FxHashMap::<(u32, u32), u32>::default();
    let mut others = Vec::new();
    for voxel in (0..label.len()).filter(|&voxel| voxels.owned[voxel] && label[voxel] != 0) {
        let own = label[voxel];
        let [i, j, k] = voxels.key[voxel];
        window.visit(&voxels.columns, &mut finder, [i, j], k, |other| {
            let other = label[other];
            if other != own && other != 0 && !others.contains(&other) {
                others.push(other);
            }
        });
        for other in others.drain(..) {
            *counts.entry((own, other)).or_default() += 1;
        }
    }
    let mut counts: Vec<(u32, u32, u32)> =
        counts.into_iter().map(|((own, other), count)| (own, other, count)).collect();
    counts.sort_unstable();
    Contacts(counts)
}

/// The objects that each object touches, with the number of its voxels that do. `whole` is the object of a
/// label.
pub(super) fn of_objects(
    tiles: &[Contacts],
    whole: impl Fn(u32) -> u32,
) -> BTreeMap<u32, BTreeMap<u32, u64>> {
    let mut found = BTreeMap::<u32, BTreeMap<u32, u64>>::new();
    for &(own, other, count) in tiles.iter().flat_map(|tile| &tile.0) {
        let [own, other] = [own, other].map(&whole);
        if own != other {
            *found.entry(own).or_default().entry(other).or_default() += u64::from(count);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::street::shares::{BUILDING, SMALL, TREE};

    #[test]
    fn voxels_beside_those_of_another_object_count_once_per_object() {
        // In decimetres; three voxels on an edge each. The second stands beside the first, the third on both, the
        // last one is 0.3 m away.
        let cube = [4, 4, 4];
        let blocks = [
            (TREE, [0, 0, 0], cube),
            (SMALL, [5, 0, 0], cube),
            (BUILDING, [0, 0, 5], [9, 4, 4]),
            (TREE, [0, 9, 0], cube),
        ];
        let tile = count(&Whole::of_blocks(&blocks));
        let found = of_objects(&[tile], |label| label);
        assert_eq!(found[&1], BTreeMap::from([(2, 9), (3, 9)]));
        assert_eq!(found[&2], BTreeMap::from([(1, 9), (3, 9)]));
        assert_eq!(found[&3].keys().copied().collect::<Vec<_>>(), [1, 2]);
        assert!(!found.contains_key(&4));
    }

    #[test]
    fn tiles_add_up_and_parts_of_an_object_do_not_touch_it() {
        let tiles = [Contacts(vec![(1, 2, 3), (2, 3, 1)]), Contacts(vec![(1, 2, 4), (3, 1, 5)])];
        let found = of_objects(&tiles, |label| if label == 3 { 2 } else { label });
        assert_eq!(found, BTreeMap::from([(1, BTreeMap::from([(2, 7)])), (2, BTreeMap::from([(1, 5)]))]));
    }
}

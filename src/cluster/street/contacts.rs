//! Contacts of objects: how many voxels of a small one lie beside or in another. Tiles count the voxels that
//! they own, so the counts of all tiles add up.

use std::collections::BTreeMap;

use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

use super::leftovers::Whole;
use super::window::Window;

/// A voxel lies beside an object that has a voxel within so many voxels, in the plane and in levels: 0.45 m.
/// Crowns that a scanner sees through others have gaps.
const BESIDE: i32 = 3;

/// Of two labels, the voxels of the first that lie beside the second.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Contacts(Vec<(u32, u32, u32)>);

/// Counts the voxels that the tile owns, of objects with at most so many. Labels must be right for what is
/// beside them, too.
pub(super) fn count(whole: &Whole, most: u64) -> Contacts {
    let voxels = &whole.grown.cored.around.voxels;
    let label = &whole.grown.label;
    let owned = || (0..label.len()).filter(|&voxel| voxels.owned[voxel] && label[voxel] != 0);
    let mut sizes = FxHashMap::<u32, u64>::default();
    owned().for_each(|voxel| *sizes.entry(label[voxel]).or_default() += 1);
    let window = Window::new(BESIDE, BESIDE);
    let mut finder = voxels.columns.finder();
    let mut counts = FxHashMap::<(u32, u32), u32>::default();
    let mut others = Vec::new();
    for voxel in owned().filter(|&voxel| sizes[&label[voxel]] <= most) {
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

/// The objects that each object touches, with the number of its voxels that do.
pub(super) fn of_objects(tiles: &[Contacts]) -> BTreeMap<u32, BTreeMap<u32, u64>> {
    let mut found = BTreeMap::<u32, BTreeMap<u32, u64>>::new();
    for &(own, other, count) in tiles.iter().flat_map(|tile| &tile.0) {
        *found.entry(own).or_default().entry(other).or_default() += u64::from(count);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::street::shares::{BUILDING, SMALL, TREE};

    #[test]
    fn voxels_beside_those_of_another_object_count_once_per_object() {
        // In decimetres; three voxels on an edge each. The second stands beside the first, the third on both,
        // the last one is 0.6 m away.
        let cube = [4, 4, 4];
        let blocks = [
            (TREE, [0, 0, 0], cube),
            (SMALL, [5, 0, 0], cube),
            (BUILDING, [0, 0, 5], [9, 4, 4]),
            (TREE, [0, 12, 0], cube),
        ];
        let whole = Whole::of_blocks(&blocks);
        let found = of_objects(&[count(&whole, 27)]);
        assert_eq!(found[&1], BTreeMap::from([(2, 27), (3, 27)]));
        assert_eq!(found[&2], BTreeMap::from([(1, 27), (3, 27)]));
        assert!(!found.contains_key(&4));
        // The third is too large for this question.
        assert!(!found.contains_key(&3));
        assert_eq!(of_objects(&[count(&whole, 1_000)])[&3].keys().copied().collect::<Vec<_>>(), [1, 2]);
    }

    #[test]
    fn tiles_add_up() {
        let tiles = [Contacts(vec![(1, 2, 3), (2, 3, 1)]), Contacts(vec![(1, 2, 4), (3, 1, 5)])];
        let found = of_objects(&tiles);
        assert_eq!(found[&1], BTreeMap::from([(2, 7)]));
        assert_eq!((found[&2][&3], found[&3][&1]), (1, 5));
    }
}

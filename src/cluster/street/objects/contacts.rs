//! Contacts of objects: the number of voxels of a small object that lie beside or inside another object.
//! Tiles count the voxels that they own, so the counts of all tiles add up.

use std::collections::BTreeMap;

use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

use super::stage_leftovers::Whole;
use crate::cluster::street::window::Window;

/// Largest distance of a voxel to an object that it lies beside, in voxels in the plane and in levels: 0.45
/// m. Crowns that a scanner sees through other crowns have gaps.
const BESIDE: i32 = 3;

/// What a tile knows about the contacts of small objects.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct Contacts {
    /// Voxels of each label.
    sizes: BTreeMap<u32, u64>,
    /// Of two labels, the voxels of the first that lie beside the second.
    beside: Vec<(u32, u32, u64)>,
}

/// Counts the voxels that the tile owns. An object with more than `most` voxels in the tile alone is not
/// small, and has no contacts. Labels must also be right for the voxels beside the owned ones.
pub(crate) fn count(whole: &Whole, most: u64) -> Contacts {
    let voxels = &whole.grown.cored.around.voxels;
    let label = &whole.grown.label;
    let owned = || (0..label.len()).filter(|&voxel| voxels.owned[voxel] && label[voxel] != 0);
    let mut sizes = BTreeMap::<u32, u64>::new();
    owned().for_each(|voxel| *sizes.entry(label[voxel]).or_default() += 1);
    let mut near = Window::new(BESIDE, BESIDE).over(&voxels.columns);
    let mut counts = FxHashMap::<(u32, u32), u64>::default();
    let mut others = Vec::new();
    for voxel in owned().filter(|&voxel| sizes[&label[voxel]] <= most) {
        let own = label[voxel];
        let [i, j, k] = voxels.key[voxel];
        near.visit([i, j], k, |other| {
            let other = label[other];
            if other != own && other != 0 && !others.contains(&other) {
                others.push(other);
            }
        });
        for other in others.drain(..) {
            *counts.entry((own, other)).or_default() += 1;
        }
    }
    let mut beside: Vec<(u32, u32, u64)> =
        counts.into_iter().map(|((own, other), count)| (own, other, count)).collect();
    beside.sort_unstable();
    Contacts { sizes, beside }
}

/// The small objects, each with the objects that it touches and the number of its voxels that touch each. A
/// small object has at most `most` voxels in all tiles together, so it does not matter how tiles cut it.
pub(crate) fn of_objects(tiles: &[Contacts], most: u64) -> BTreeMap<u32, BTreeMap<u32, u64>> {
    let mut sizes = BTreeMap::<u32, u64>::new();
    for (label, voxels) in tiles.iter().flat_map(|tile| &tile.sizes) {
        *sizes.entry(*label).or_default() += voxels;
    }
    sizes.retain(|_, voxels| *voxels <= most);
    let mut found: BTreeMap<u32, BTreeMap<u32, u64>> =
        sizes.into_keys().map(|label| (label, BTreeMap::new())).collect();
    for &(own, other, count) in tiles.iter().flat_map(|tile| &tile.beside) {
        if let Some(touched) = found.get_mut(&own) {
            *touched.entry(other).or_default() += count;
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
        // In decimetres; each block is three voxels high and deep. The second stands beside the first, the
        // third on both, and the last one is 0.6 m away.
        let cube = [4, 4, 4];
        let blocks = [
            (TREE, [0, 0, 0], cube),
            (SMALL, [5, 0, 0], cube),
            (BUILDING, [0, 0, 5], [9, 4, 4]),
            (TREE, [0, 12, 0], cube),
        ];
        let whole = Whole::of_blocks(&blocks);
        let found = of_objects(&[count(&whole, 27)], 27);
        assert_eq!(found[&1], BTreeMap::from([(2, 27), (3, 27)]));
        assert_eq!(found[&2], BTreeMap::from([(1, 27), (3, 27)]));
        assert!(found[&4].is_empty());
        // The third is too large to be small.
        assert!(!found.contains_key(&3));
        let found = of_objects(&[count(&whole, 1_000)], 1_000);
        assert_eq!(found[&3].keys().copied().collect::<Vec<_>>(), [1, 2]);
    }

    #[test]
    fn tiles_add_up_and_an_object_is_small_as_a_whole() {
        let cube = |x: i64| (TREE, [x, 0, 0], [4, 4, 4]);
        let mut whole = Whole::of_blocks(&[cube(0), cube(4), cube(9)]);
        whole.grown.label.iter_mut().filter(|label| **label == 2).for_each(|label| *label = 1);
        let voxels = whole.grown.cored.around.voxels.key.clone();
        // The first object has 45 voxels, and at most 27 in either tile.
        for (most, small) in [(27, vec![3]), (60, vec![1, 3])] {
            whole.grown.cored.around.voxels.owned = vec![true; voxels.len()];
            let untiled = of_objects(&[count(&whole, most)], most);
            assert_eq!(untiled.keys().copied().collect::<Vec<_>>(), small);
            let tiles = [false, true].map(|east| {
                let owned = voxels.iter().map(|key| (key[0] >= 2) == east).collect();
                whole.grown.cored.around.voxels.owned = owned;
                count(&whole, most)
            });
            assert_eq!(of_objects(&tiles, most), untiled);
        }
    }
}

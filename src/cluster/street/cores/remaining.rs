//! The components of a tile that matter in the reduction of step `cores`. The others are dropped when the
//! tile is read, because everything that is kept is in memory for the whole drive.
//!
//! A component is *open* if other tiles may know more about it: it has a voxel that another tile names too,
//! or a chain runs through it. A component that is not open is whole, and the tile knows all components that
//! touch it. It can be judged at once.
#![expect(clippy::cast_possible_truncation, reason = "components of a tile fit u32")]

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use super::arms;
use super::facades::Near;
use super::part::{NO_BAND, Part};
use crate::cluster::street::cores::trees::seeds;
use crate::cluster::street::shares::unites;
use crate::model::Lattice;
use crate::spatial::DisjointSets;

/// The components and pairs of a tile that matter.
#[derive(Debug, Default)]
pub(crate) struct Remaining {
    /// Components with their figures, ascending.
    pub(crate) parts: Vec<(u32, Part)>,
    /// Pairs of low tree components in adjacent bands that touch, the lower first.
    pub(crate) rising: Vec<(u32, u32)>,
    /// Pairs of buildings that are near each other. A tile keeps a pair only if one of the two has voxels in
    /// it. Otherwise another tile has the pair.
    pub(crate) near: Vec<Near>,
}

/// Whether a whole component without a band may be a core. A component that can be united may be one together
/// with others. `keeps` says whether it is one alone.
pub(crate) fn may_be_core(part: &Part, lattice: Lattice, keeps: impl Fn(&Part, Lattice) -> bool) -> bool {
    unites(part.class) || arms::may_be_arm(part, lattice) || keeps(part, lattice)
}

/// The pairs of components of a tile, as its payload has them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pairs<'a> {
    /// Components of low tree voxels in adjacent bands that touch, the lower first.
    pub(crate) rising: &'a [(u32, u32)],
    /// Components of buildings that are near each other.
    pub(crate) near: &'a [Near],
}

/// Low tree voxels that touch, over all bands.
#[derive(Debug, Clone, Copy)]
struct Group {
    voxels: u32,
    lowest: i32,
    is_open: bool,
}

impl Remaining {
    /// `parts` are the components in the payload of the tile. `open` are the open components. `keeps` says
    /// whether a whole component without a band is a core.
    pub(crate) fn of(
        parts: Vec<Option<Part>>,
        Pairs { rising, near }: Pairs<'_>,
        open: impl Iterator<Item = u32>,
        lattice: Lattice,
        keeps: impl Fn(&Part, Lattice) -> bool,
    ) -> Self {
        let mut is_open = vec![false; parts.len()];
        open.for_each(|component| is_open[component as usize] = true);
        let mut joins = vec![false; parts.len()];
        for &Near { of: (one, other), apart } in near {
            joins[one as usize] |= apart.is_some();
            joins[other as usize] |= apart.is_some();
        }
        let mut sets = DisjointSets::new(parts.len() as u32);
        rising.iter().for_each(|&(low, high)| sets.union(low, high));
        let mut groups = vec![Group { voxels: 0, lowest: i32::MAX, is_open: false }; parts.len()];
        for (component, part) in (0_u32..).zip(&parts) {
            let group = &mut groups[sets.find(component) as usize];
            group.is_open |= is_open[component as usize];
            if let Some(part) = part {
                group.voxels += part.voxels;
                group.lowest = group.lowest.min(part.height.0);
            }
        }
        let counts = |component: u32, part: &Part, sets: &mut DisjointSets| {
            if part.band == NO_BAND {
                let is_known = joins[component as usize] || is_open[component as usize];
                return is_known || may_be_core(part, lattice, &keeps);
            }
            let Group { voxels, lowest, is_open } = groups[sets.find(component) as usize];
            is_open || seeds::may_stand(voxels, lowest, lattice)
        };
        let mut remaining = Self::default();
        let owned: Vec<bool> = parts.iter().map(Option::is_some).collect();
        for (component, part) in (0_u32..).zip(parts) {
            let part = part.filter(|part| counts(component, part, &mut sets));
            remaining.parts.extend(part.map(|part| (component, part)));
        }
        let has = |component: u32| remaining.parts.binary_search_by_key(&component, |part| part.0).is_ok();
        // A component without figures belongs to another tile, so it is open.
        let counts = |&&(low, high): &&(u32, u32)| {
            is_open[low as usize] || is_open[high as usize] || (has(low) && has(high))
        };
        remaining.rising = rising.iter().filter(counts).copied().collect();
        // A component that has voxels here and was dropped is not a core.
        let may_count = |component: u32| has(component) || !owned[component as usize];
        let counts = |near: &&Near| {
            let (one, other) = near.of;
            (has(one) || has(other)) && may_count(one) && may_count(other)
        };
        remaining.near = near.iter().filter(counts).copied().collect();
        remaining.parts.shrink_to_fit();
        remaining
    }
}

/// The components of the drive.
#[derive(Default)]
pub(crate) struct Components {
    pub(crate) whole: BTreeMap<u32, Part>,
    /// Components of low tree voxels, ascending. There are many of them, and a list takes half the memory of
    /// a map.
    pub(crate) low: Vec<(u32, Part)>,
    /// Pairs of low tree components in adjacent bands that touch, the lower first.
    pub(crate) rising: Vec<(u32, u32)>,
    /// Pairs of buildings that are near each other.
    pub(crate) near: Vec<Near>,
}

impl Components {
    /// Merges the remaining components of the tiles. `component` has, for each tile, the component of the
    /// drive for each of its components.
    pub(crate) fn merge(component: &[Vec<u32>], remaining: Vec<Remaining>) -> Self {
        let mut all = Self::default();
        for (component, remaining) in component.iter().zip(remaining) {
            let of_drive = |(one, other): (u32, u32)| (component[one as usize], component[other as usize]);
            all.rising.extend(remaining.rising.into_iter().map(of_drive));
            let named = |near: Near| near.renamed(|one| component[one as usize]);
            all.near.extend(remaining.near.into_iter().map(named));
            for (number, part) in remaining.parts {
                let component = component[number as usize];
                if part.band != NO_BAND {
                    all.low.push((component, part));
                    continue;
                }
                match all.whole.entry(component) {
                    Entry::Vacant(entry) => _ = entry.insert(part),
                    Entry::Occupied(mut entry) => entry.get_mut().merge(&part),
                }
            }
        }
        all.low.sort_by_key(|(component, _)| *component);
        all.low.dedup_by(|next, first| {
            let is_same = next.0 == first.0;
            if is_same {
                first.1.merge(&next.1);
            }
            is_same
        });
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::street::shares::{BUILDING, FENCE, SMALL, TREE};

    /// A column of voxels of 0.15 m that begins at a height in metres.
    fn part(class: u8, band: u8, voxels: i32, low_m: f64) -> Option<Part> {
        let low = Lattice::MILLIMETRE.units(low_m) as i32;
        let one = |k: i32| Part::of_voxel(class, band, [0, 0, k], low + 150 * k, [0, 0, 150 * i64::from(k)]);
        let mut all = one(0);
        (1..voxels).for_each(|k| all.merge(&one(k)));
        Some(all)
    }

    fn remaining(
        parts: Vec<Option<Part>>,
        rising: &[(u32, u32)],
        open: &[u32],
    ) -> (Vec<u32>, Vec<(u32, u32)>) {
        let keeps = |part: &Part, _| part.voxels >= 5;
        let pairs = Pairs { rising, near: &[] };
        let found = Remaining::of(parts, pairs, open.iter().copied(), Lattice::MILLIMETRE, keeps);
        (found.parts.into_iter().map(|part| part.0).collect(), found.rising)
    }

    #[test]
    fn leaves_that_can_be_no_stem_are_left_out_with_all_that_they_touch() {
        let leaf = || part(TREE, 3, 2, 1.0);
        // Two touching pieces of two voxels each may be a stem, but one of them alone may not.
        assert_eq!(remaining(vec![leaf(), leaf(), leaf()], &[(0, 2)], &[]), (vec![0, 2], vec![(0, 2)]));
        assert_eq!(remaining(vec![leaf(), leaf(), leaf()], &[], &[]), (vec![], vec![]));
        // All are too high.
        let high = || part(TREE, 5, 4, 1.6);
        assert_eq!(remaining(vec![high(), high()], &[(0, 1)], &[]), (vec![], vec![]));
        // Other tiles may know more about one of them, and so about the other.
        assert_eq!(remaining(vec![high(), high(), high()], &[(0, 1)], &[1]), (vec![0, 1], vec![(0, 1)]));
        // The other one has voxels in another tile only.
        assert_eq!(remaining(vec![high(), None], &[(0, 1)], &[1]), (vec![0], vec![(0, 1)]));
    }

    #[test]
    fn other_classes_are_judged_one_by_one_unless_they_are_open_or_united() {
        let small = |voxels| part(SMALL, NO_BAND, voxels, 0.1);
        assert_eq!(remaining(vec![small(4), small(5), small(4)], &[], &[2]).0, [1, 2]);
        assert_eq!(remaining(vec![part(FENCE, NO_BAND, 1, 0.1), None], &[], &[1]).0, [0]);
    }

    #[test]
    fn a_pair_of_buildings_counts_where_one_of_them_has_voxels_and_both_may_be_cores() {
        let building = |voxels| part(BUILDING, NO_BAND, voxels, 0.1);
        let found = |parts: Vec<Option<Part>>, near: &[(u32, u32)], open: &[u32], apart: Option<u8>| {
            let near: Vec<Near> = near.iter().map(|&of| Near { of, apart }).collect();
            let pairs = Pairs { rising: &[], near: &near };
            let keeps = |part: &Part, _| part.voxels >= 5;
            let found = Remaining::of(parts, pairs, open.iter().copied(), Lattice::MILLIMETRE, keeps);
            found.near.into_iter().map(|near| near.of).collect::<Vec<_>>()
        };
        let near = |parts, near: &[(u32, u32)], open: &[u32]| found(parts, near, open, None);
        let all = [(0, 1), (0, 2), (1, 2)];
        assert_eq!(near(vec![building(5), building(5), building(4)], &all, &[]), [(0, 1)]);
        // Other tiles may know more about the third one.
        assert_eq!(near(vec![building(5), building(5), building(4)], &all, &[2]), all);
        // Neither of the last two has voxels here. The tile that owns them has this pair.
        assert_eq!(near(vec![building(5), None, None], &all, &[1, 2]), [(0, 1), (0, 2)]);
        // A small component that is whole is not a core, and its pairs do not matter.
        assert_eq!(near(vec![building(4), None, None], &all, &[1, 2]), []);
        // But it may be a piece of a facade if it is near enough.
        assert_eq!(found(vec![building(4), None, None], &all, &[1, 2], Some(9)), [(0, 1), (0, 2)]);
    }
}

//! Which chains are parts of one trunk.
//!
//! Undergrowth joins the low pieces of several trunks. Their chains stand apart all the same.

#![expect(clippy::cast_possible_truncation, reason = "chains of a drive fit u32")]

use std::collections::{BTreeMap, BTreeSet};

use crate::model::Lattice;
use crate::spatial::DisjointSets;

/// Distance in the plane within which chains are parts of one trunk, in metres. Chosen: the parts of a trunk
/// that leans, and the stems of a tree that divides near the ground, are nearer.
const ONE_M: f64 = 1.0;

/// The trunks that these chains form: the place of each trunk in metres, and its chains. Chains of one trunk
/// are near each other.
pub(crate) fn trunks(
    chains: &[u32],
    places: &BTreeMap<u32, [i64; 2]>,
    lattice: Lattice,
) -> Vec<([f64; 2], Vec<u32>)> {
    // Sorted by place, because the first chain of a trunk gives its place, which must not depend on numbers
    // of chains.
    let mut known: Vec<(u32, [i64; 2])> =
        chains.iter().filter_map(|chain| Some((*chain, *places.get(chain)?))).collect();
    known.sort_unstable_by_key(|(_, place)| *place);
    let (chains, at): (Vec<u32>, Vec<[f64; 2]>) =
        known.into_iter().map(|(chain, place)| (chain, place.map(|units| lattice.metres(units)))).unzip();
    let mut sets = DisjointSets::new(chains.len() as u32);
    for (one, other) in near_pairs(&at, ONE_M) {
        sets.union(one, other);
    }
    let mut trunks: BTreeMap<u32, ([f64; 2], Vec<u32>)> = BTreeMap::new();
    for (number, (chain, place)) in (0_u32..).zip(chains.into_iter().zip(at)) {
        trunks.entry(sets.find(number)).or_insert((place, Vec::new())).1.push(chain);
    }
    trunks.into_values().collect()
}

/// The nodes in which two or more trunks have voxels. `of_chain` has the nodes of each chain.
pub(crate) fn shared<'a>(
    trunks: impl Iterator<Item = &'a [u32]>,
    of_chain: &BTreeMap<u32, BTreeSet<usize>>,
) -> BTreeSet<usize> {
    let mut seen = BTreeSet::new();
    let mut shared = BTreeSet::new();
    for chains in trunks {
        let nodes: BTreeSet<usize> = chains.iter().flat_map(|chain| &of_chain[chain]).copied().collect();
        shared.extend(nodes.into_iter().filter(|&node| !seen.insert(node)));
    }
    shared
}

/// Pairs of places at most `limit_m` apart.
pub(crate) fn near_pairs(places: &[[f64; 2]], limit_m: f64) -> Vec<(u32, u32)> {
    let mut by_x: Vec<u32> = (0_u32..).zip(places).map(|(number, _)| number).collect();
    by_x.sort_unstable_by(|&a, &b| places[a as usize][0].total_cmp(&places[b as usize][0]).then(a.cmp(&b)));
    let mut pairs = Vec::new();
    for (at, &one) in by_x.iter().enumerate() {
        let [x, y] = places[one as usize];
        for &other in &by_x[at + 1..] {
            let [u, v] = places[other as usize];
            if u - x > limit_m {
                break;
            }
            if (u - x) * (u - x) + (v - y) * (v - y) <= limit_m * limit_m {
                pairs.push((one, other));
            }
        }
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chains_within_a_metre_are_one_trunk() {
        let places = BTreeMap::from([(3, [0, 0]), (5, [900, 0]), (8, [1_800, 300]), (9, [0, 1_001])]);
        let trunks = trunks(&[3, 5, 8, 9, 11], &places, Lattice::MILLIMETRE);
        assert_eq!(trunks, [([0.0, 0.0], vec![3, 5, 8]), ([0.0, 1.001], vec![9])], "11 has no place");
    }
}

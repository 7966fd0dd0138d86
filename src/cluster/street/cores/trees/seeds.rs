//! The stems of trees: where each tree begins near the ground.
//!
//! Low tree voxels are cut into height bands. The components of a band are nodes, and nodes of adjacent bands
//! that touch are edges. A sweep from below joins nodes. Two pieces that have both risen by [`RISE_M`] before
//! they meet stay apart: they are two stems. A piece that has risen less joins the other. This is the
//! persistence of a merge tree. The piece in which stems meet belongs to none of them: it is their crowns,
//! which growth divides. Chains of trunks come from step `chains` and are certain stems. If stems are nearer
//! to each other than trees of their height can be, the more certain one remains.
//!
//! Everything here works on sums over the whole drive, in an order that does not depend on tiles.

#![expect(
    clippy::cast_possible_truncation,
    reason = "components of a drive fit u32, coordinates are within 2^50 lattice units"
)]

use std::collections::{BTreeMap, BTreeSet};

use super::trunks::{near_pairs, shared, trunks};
use crate::cluster::columns::Voxel;
use crate::cluster::street::cores::part::Part;
use crate::model::Lattice;
use crate::spatial::DisjointSets;

/// Height by which a piece must rise before it meets another, in metres.
const RISE_M: f64 = 0.5;
/// Distance in the plane beyond which half of this rise is enough, in metres.
const APART_M: f64 = 1.5;
/// Smallest number of voxels of a stem.
const VOXELS: u32 = 4;
/// Largest height at which a stem begins, in metres. Higher pieces are branches.
const BASE_M: f64 = 1.5;
/// Largest distance between the axes of pieces that are one stem, in metres.
const SAME_M: f64 = 0.5;
/// Largest height at which a stem that stands on the ground begins, in metres.
const GROUNDED_M: f64 = 0.5;
/// Smallest distance of a stem that stands on the ground to another stem, as a fraction of the canopy height.
const SPACING: f64 = 0.3;
/// The same for a stem that does not stand on the ground.
const SPACING_HANGING: f64 = 0.5;
/// Smallest distance of a stem that stands on the ground to a trunk, as a fraction of the canopy height.
const SPACING_TO_TRUNK: f64 = 0.3;
/// The same for a stem that does not stand on the ground.
const SPACING_HANGING_TO_TRUNK: f64 = 0.6;
/// Number of voxels from which a piece is more certain, and the factor that shortens these distances for it.
const SURE_VOXELS: u32 = 120;
const SURE_SPACING: f64 = 0.7;
/// Limits of these distances, in metres.
const SPACING_M: (f64, f64) = (0.8, 4.0);
/// Height of a forest canopy, smallest rise of a stem, and upper limit of these distances in a forest, in
/// metres. Stems stand nearer to each other there. The limit applies to a stem that stands on the ground
/// below such a canopy and has this rise (`benches/results/street.md`, "Forests").
const FOREST_CANOPY_M: f64 = 14.0;
const FOREST_RISE_M: f64 = 1.5;
const FOREST_SPACING_M: f64 = 2.0;
/// Smallest number of voxels of a stem above the ground, and smallest height of the canopy over it, in
/// metres.
const HANGING_VOXELS: u32 = 8;
const HANGING_CANOPY_M: f64 = 0.5;

/// A stem.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Seed {
    /// First voxel in the order (i, j, k).
    pub(crate) first: Voxel,
    /// Where it stands, in lattice units.
    pub(crate) place: [i64; 2],
}

/// The stems of a drive.
#[derive(Debug, Default)]
pub(crate) struct Stems {
    pub(crate) seeds: Vec<Seed>,
    /// Stem of each component of low tree voxels that belongs to a stem.
    pub(crate) components: BTreeMap<u32, u32>,
    /// Stem of each chain.
    pub(crate) chains: BTreeMap<u32, u32>,
}

/// A piece that may be a stem.
#[derive(Debug, Clone)]
struct Candidate {
    nodes: Vec<usize>,
    chains: Vec<u32>,
    first: Voxel,
    /// Mean of its lowest voxels, in metres from the origin of the lattice.
    place: [f64; 2],
    base_m: f64,
    top_m: f64,
    canopy_m: f64,
    voxels: u32,
}

impl Candidate {
    fn rises_in_forest(&self) -> bool {
        self.canopy_m >= FOREST_CANOPY_M && self.top_m - self.base_m >= FOREST_RISE_M
    }
}

/// Finds the stems among the components of low tree voxels, which are in ascending order. `rising` are pairs
/// of components that touch, the lower first. `chains` are pairs of a chain and a component in which it has
/// voxels. `places` has the place of each chain.
pub(crate) fn find(
    nodes: &[(u32, Part)],
    rising: impl Iterator<Item = (u32, u32)>,
    chains: impl Iterator<Item = (u32, Option<u32>)>,
    places: &BTreeMap<u32, [i64; 2]>,
    lattice: Lattice,
) -> Stems {
    let place = |component: u32| nodes.binary_search_by_key(&component, |node| node.0).ok();
    let edges: BTreeSet<(usize, usize)> =
        rising.filter_map(|(low, high)| Some((place(low)?, place(high)?))).collect();
    let parts: Vec<&Part> = nodes.iter().map(|node| &node.1).collect();
    let seed = sweep(&parts, edges.into_iter().collect(), lattice);

    let mut of_chain: BTreeMap<u32, BTreeSet<usize>> = BTreeMap::new();
    for (chain, component) in chains {
        let entry = of_chain.entry(chain).or_default();
        entry.extend(component.and_then(place));
    }
    let candidates = candidates(&parts, &seed, &of_chain, places, lattice);
    let kept = thin_out(candidates);
    let mut stems = Stems::default();
    for (number, candidate) in (0_u32..).zip(kept) {
        for node in candidate.nodes {
            stems.components.insert(nodes[node].0, number);
        }
        for chain in candidate.chains {
            stems.chains.insert(chain, number);
        }
        let place = candidate.place.map(|metres| lattice.units(metres));
        stems.seeds.push(Seed { first: candidate.first, place });
    }
    stems
}

/// A set of nodes during the sweep.
#[derive(Debug, Clone)]
struct Rising {
    /// Height of its lowest voxel, and the first voxel of the node that contains it.
    birth: (i32, Voxel),
    place: [i64; 2],
    voxels: u32,
    /// Whether stems have been found in it.
    split: bool,
    /// Nodes that belong to no stem yet.
    open: Vec<usize>,
}

/// Lengths of the sweep in lattice units.
struct Limits {
    rise: i32,
    apart: i64,
    base: i32,
}

impl Rising {
    /// Whether the set is large and low enough for a stem.
    fn is_grown(&self, limits: &Limits) -> bool {
        is_grown(self.voxels, self.birth.0, limits.base)
    }

    /// Makes its open nodes one stem, named by the first of them.
    fn settle(&mut self, stem: &mut [Option<usize>]) {
        let name = self.open.iter().copied().min();
        for node in self.open.drain(..) {
            stem[node] = name;
        }
    }
}

/// Two sets meet at a height. Settles those that are stems. Returns whether the union is split.
fn meet(
    older: &mut Rising,
    younger: &mut Rising,
    height: i32,
    limits: &Limits,
    stem: &mut [Option<usize>],
) -> bool {
    let [dx, dy] = [0, 1].map(|axis| older.place[axis] - younger.place[axis]);
    let far = dx * dx + dy * dy > limits.apart * limits.apart;
    let risen = height - younger.birth.0;
    let stands = younger.is_grown(limits) && (risen >= limits.rise || (far && 2 * risen >= limits.rise));
    match (older.split, younger.split) {
        (false, false) => {
            let both = stands && older.is_grown(limits);
            if both {
                younger.settle(stem);
                older.settle(stem);
            }
            both
        }
        (true, false) => {
            if stands {
                younger.settle(stem);
            }
            true
        }
        (false, true) => {
            if older.is_grown(limits) && height - older.birth.0 >= limits.rise {
                older.settle(stem);
            }
            true
        }
        (true, true) => true,
    }
}

/// Whether a piece with this number of voxels, the lowest at this height in lattice units, is large and low
/// enough for a stem.
fn is_grown(voxels: u32, lowest: i32, base: i32) -> bool {
    voxels >= VOXELS && lowest <= base
}

/// Whether there may be a stem among pieces that touch each other and no others, if no chain runs through
/// them. Together they have this number of voxels, the lowest at this height in lattice units.
pub(crate) fn may_stand(voxels: u32, lowest: i32, lattice: Lattice) -> bool {
    is_grown(voxels, lowest, lattice.units(BASE_M) as i32)
}

/// The stem of each node. A stem is named by one of its nodes.
fn sweep(parts: &[&Part], mut edges: Vec<(usize, usize)>, lattice: Lattice) -> Vec<Option<usize>> {
    let low = |metres: f64| lattice.units(metres) as i32;
    let limits = Limits { rise: low(RISE_M), apart: lattice.units(APART_M), base: low(BASE_M) };
    edges.sort_unstable_by_key(|&(low, high)| (parts[high].band, parts[high].first, parts[low].first));
    let mut sets = DisjointSets::new(parts.len() as u32);
    let mut rising: Vec<Rising> = parts
        .iter()
        .enumerate()
        .map(|(node, part)| Rising {
            birth: (part.height.0, part.first),
            place: part.centre(),
            voxels: part.voxels,
            split: false,
            open: vec![node],
        })
        .collect();
    let mut stem: Vec<Option<usize>> = vec![None; parts.len()];
    for edges in edges.chunk_by(|a, b| a.1 == b.1) {
        // The sets below the node that meet in it, with the height at which they meet. No set contains the
        // node yet.
        let node = edges[0].1;
        let mut below: BTreeMap<usize, i32> = BTreeMap::new();
        for &(low, _) in edges {
            let height = parts[node].height.0.max(parts[low].height.0);
            let lowest = below.entry(sets.find(low as u32) as usize).or_insert(height);
            *lowest = height.min(*lowest);
        }
        let mut below: Vec<(i32, Rising)> =
            below.into_iter().map(|(root, height)| (height, rising[root].clone())).collect();
        below.sort_unstable_by_key(|(_, set)| set.birth);
        let mut below = below.into_iter();
        let Some((_, mut union)) = below.next() else { continue };
        for (height, mut younger) in below {
            union.split = meet(&mut union, &mut younger, height, &limits, &mut stem);
            union.voxels += younger.voxels;
            union.open.append(&mut younger.open);
            if union.split {
                union.open.clear();
            }
        }
        // Where stems meet, the node is above all of them and belongs to none.
        union.voxels += parts[node].voxels;
        if !union.split {
            union.open.push(node);
        }
        for &(low, _) in edges {
            sets.union(low as u32, node as u32);
        }
        rising[sets.find(node as u32) as usize] = union;
    }
    for (root, set) in rising.iter_mut().enumerate() {
        if sets.find(root as u32) as usize == root && !set.split && set.is_grown(&limits) {
            set.settle(&mut stem);
        }
    }
    stem
}

/// Candidates for stems: pieces of the sweep, joined by the chains through them, and chains without a piece.
fn candidates(
    parts: &[&Part],
    seed: &[Option<usize>],
    of_chain: &BTreeMap<u32, BTreeSet<usize>>,
    places: &BTreeMap<u32, [i64; 2]>,
    lattice: Lattice,
) -> Vec<Candidate> {
    let mut nodes: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (node, seed) in seed.iter().enumerate() {
        if let Some(seed) = seed {
            nodes.entry(*seed).or_default().push(node);
        }
    }
    // Joins pieces with a common chain, and pieces with nearly the same axis.
    let names: Vec<usize> = nodes.keys().copied().collect();
    let number = |name: usize| names.binary_search(&name).ok();
    let mut sets = DisjointSets::new(names.len() as u32);
    let mut chains: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    let mut alone = Vec::new();
    for (&chain, of_chain) in of_chain {
        let pieces: BTreeSet<usize> =
            of_chain.iter().filter_map(|&node| seed[node].and_then(number)).collect();
        let mut pieces = pieces.into_iter();
        let Some(first) = pieces.next() else {
            alone.push((chain, of_chain));
            continue;
        };
        for other in pieces {
            sets.union(first as u32, other as u32);
        }
        chains.entry(first as u32).or_default().push(chain);
    }
    let axes: Vec<[f64; 2]> = nodes.values().map(|nodes| axis(parts, nodes, lattice)).collect();
    for (one, other) in near_pairs(&axes, SAME_M) {
        sets.union(one, other);
    }
    let mut joined: BTreeMap<u32, (Vec<usize>, Vec<u32>)> = BTreeMap::new();
    for (number, members) in (0_u32..).zip(nodes.into_values()) {
        let entry = joined.entry(sets.find(number)).or_default();
        entry.0.extend(members);
        entry.1.extend(chains.remove(&number).unwrap_or_default());
    }
    let mut candidates: Vec<Candidate> = Vec::new();
    for (nodes, chains) in joined.into_values() {
        // Undergrowth may join the pieces of several trunks; each trunk is a stem of its own.
        let trunks = trunks(&chains, places, lattice);
        if trunks.len() < 2 {
            candidates.extend(candidate(parts, nodes, chains, lattice));
            continue;
        }
        for (place, chains) in trunks {
            let nodes: BTreeSet<usize> = chains.iter().flat_map(|chain| &of_chain[chain]).copied().collect();
            let trunk = candidate(parts, nodes.into_iter().collect(), chains, lattice);
            candidates.extend(trunk.map(|trunk| Candidate { place, ..trunk }));
        }
    }
    for (chain, of_chain) in alone {
        let nodes: Vec<usize> = of_chain.iter().copied().collect();
        candidates.extend(candidate(parts, nodes, vec![chain], lattice));
    }
    // A piece through which two trunks run belongs to none of them: growth divides it.
    let shared = shared(candidates.iter().map(|candidate| &candidate.chains[..]), of_chain);
    candidates.iter_mut().for_each(|candidate| candidate.nodes.retain(|node| !shared.contains(node)));
    candidates
}

fn candidate(parts: &[&Part], nodes: Vec<usize>, chains: Vec<u32>, lattice: Lattice) -> Option<Candidate> {
    let metres = |units: i32| lattice.metres(units.into());
    let place = axis(parts, &nodes, lattice);
    let of = |of: fn(&Part) -> i32| nodes.iter().map(move |&node| of(parts[node]));
    let first = nodes.iter().map(|&node| parts[node].first).min()?;
    let base_m = metres(of(|part| part.height.0).min()?);
    let top_m = metres(of(|part| part.height.1).max()?);
    let canopy_m = metres(of(|part| part.canopy).max()?.max(0));
    let voxels = nodes.iter().map(|&node| parts[node].voxels).sum();
    Some(Candidate { nodes, chains, first, place, base_m, top_m, canopy_m, voxels })
}

/// Where a piece stands: the mean of its two lowest bands, in metres.
fn axis(parts: &[&Part], nodes: &[usize], lattice: Lattice) -> [f64; 2] {
    let lowest = nodes.iter().map(|&node| parts[node].band).min().unwrap_or(0);
    let mut sum = [0_i64; 2];
    let mut count = 0;
    for part in nodes.iter().map(|&node| parts[node]).filter(|part| part.band <= lowest + 1) {
        sum = [sum[0] + part.sum[0], sum[1] + part.sum[1]];
        count += i64::from(part.voxels);
    }
    sum.map(|sum| lattice.metres(sum.div_euclid(count.max(1))))
}

/// Keeps the most certain stems that are not too near to each other: trunks first, then pieces that stand on
/// the ground, then those that rise most.
fn thin_out(mut candidates: Vec<Candidate>) -> Vec<Candidate> {
    let steps = |candidate: &Candidate| ((candidate.top_m - candidate.base_m) / 0.3).round();
    let grounded = |candidate: &Candidate| candidate.base_m <= GROUNDED_M;
    candidates.sort_by(|a, b| {
        a.chains
            .is_empty()
            .cmp(&b.chains.is_empty())
            .then(grounded(b).cmp(&grounded(a)))
            .then(steps(b).total_cmp(&steps(a)))
            .then(b.voxels.cmp(&a.voxels))
            .then(a.first.cmp(&b.first))
            .then(a.chains.cmp(&b.chains))
    });
    let (nearest, farthest) = SPACING_M;
    let mut kept: Vec<Candidate> = Vec::new();
    let mut places: BTreeMap<[i64; 2], Vec<usize>> = BTreeMap::new();
    for candidate in candidates {
        let stands = grounded(&candidate);
        let trunk = !candidate.chains.is_empty();
        if !stands
            && !trunk
            && (candidate.voxels < HANGING_VOXELS || candidate.canopy_m < candidate.top_m + HANGING_CANOPY_M)
        {
            continue;
        }
        let in_forest = stands && candidate.rises_in_forest();
        let most = if in_forest { FOREST_SPACING_M } else { farthest };
        let sure = if candidate.voxels >= SURE_VOXELS { SURE_SPACING } else { 1.0 };
        let spacing =
            |part: f64| if trunk { SAME_M } else { (part * sure * candidate.canopy_m).clamp(nearest, most) };
        let to_other = spacing(if stands { SPACING } else { SPACING_HANGING });
        let to_trunk = spacing(if stands { SPACING_TO_TRUNK } else { SPACING_HANGING_TO_TRUNK });
        let [i, j] = candidate.place.map(|metres| (metres / farthest).floor() as i64);
        let around = (i - 1..=i + 1).flat_map(|i| (j - 1..=j + 1).map(move |j| [i, j]));
        let near = around.filter_map(|cell| places.get(&cell)).flatten().any(|&other| {
            let other: &Candidate = &kept[other];
            let limit = if other.chains.is_empty() { to_other } else { to_trunk };
            let [dx, dy] = [0, 1].map(|axis| candidate.place[axis] - other.place[axis]);
            dx * dx + dy * dy < limit * limit
        });
        if !near {
            places.entry([i, j]).or_default().push(kept.len());
            kept.push(candidate);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::street::shares::TREE;

    /// A component of a band, with its lowest voxel at 0.25 m per band.
    fn part(band: u8, x: i32, voxels: u32) -> Part {
        let low = 150 + 250 * i32::from(band);
        let key = [x / 150, 0, low / 150];
        let mut part = Part::of_voxel(TREE, band, key, low, [i64::from(x), 0, i64::from(low)]);
        part.merge(&Part { voxels: voxels - 1, ..part.clone() });
        part.height.1 = low + 240;
        part
    }

    /// Upright stems at these places, each `bands` bands high, and the parts `above` them. Returns the parts
    /// and the edges.
    fn stems(places: &[i32], bands: u8, above: &[Part]) -> (Vec<Part>, Vec<(usize, usize)>) {
        let mut parts = Vec::new();
        let mut edges = Vec::new();
        for &x in places {
            for band in 0..bands {
                if band > 0 {
                    edges.push((parts.len() - 1, parts.len()));
                }
                parts.push(part(band, x, 8));
            }
        }
        let tops: Vec<usize> = (1..=places.len()).map(|stem| stem * usize::from(bands) - 1).collect();
        for part in above {
            let new = parts.len();
            let below = if part.band == bands { tops.clone() } else { vec![new - 1] };
            edges.extend(below.into_iter().map(|low| (low, new)));
            parts.push(part.clone());
        }
        (parts, edges)
    }

    fn swept((parts, edges): &(Vec<Part>, Vec<(usize, usize)>)) -> Vec<Option<usize>> {
        sweep(&parts.iter().collect::<Vec<_>>(), edges.clone(), Lattice::MILLIMETRE)
    }

    #[test]
    fn where_the_crowns_of_two_stems_meet_is_neither_of_them() {
        // The crowns meet 1.25 m above the feet. Above that they are one.
        let met = stems(&[0, 1_800], 5, &[part(5, 900, 90), part(6, 900, 200)]);
        let stem = swept(&met);
        assert_eq!(stem[..5], [Some(0); 5]);
        assert_eq!(stem[5..10], [Some(5); 5]);
        assert_eq!(stem[10..], [None; 2]);
    }

    #[test]
    fn a_stem_alone_takes_all_that_is_above_it() {
        assert_eq!(swept(&stems(&[0], 3, &[part(3, 0, 90), part(4, 0, 200)])), [Some(0); 5]);
    }

    #[test]
    fn trunks_that_undergrowth_joins_are_stems_of_their_own() {
        let nodes = [(7, part(0, 900, 90)), (8, part(1, 0, 8)), (9, part(1, 1_800, 8))];
        let found = |apart: i64| {
            let chains = [(1, Some(7)), (1, Some(8)), (2, Some(7)), (2, Some(9))];
            let places = BTreeMap::from([(1, [0, 0]), (2, [apart, 0])]);
            find(&nodes, [(7, 8), (7, 9)].into_iter(), chains.into_iter(), &places, Lattice::MILLIMETRE)
        };
        let stems = found(1_800);
        assert_eq!(stems.seeds.iter().map(|seed| seed.place).collect::<Vec<_>>(), [[0, 0], [1_800, 0]]);
        assert_eq!(stems.chains, BTreeMap::from([(1, 0), (2, 1)]));
        assert_eq!(stems.components, BTreeMap::from([(8, 0), (9, 1)]), "the undergrowth is divided later");
        // Two chains that are nearer are parts of one trunk.
        let stems = found(400);
        assert_eq!((stems.seeds.len(), stems.components.len()), (1, 3));
    }

    #[test]
    fn feet_that_meet_low_are_one_stem() {
        // They are 0.3 m apart and have risen by 0.25 m.
        assert_eq!(swept(&stems(&[0, 300], 1, &[part(1, 150, 9), part(2, 150, 9)])), [Some(0); 4]);
    }
}

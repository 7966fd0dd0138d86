//! Cuts the voxels of one object by normalized cuts (section 3.2 of the paper; Shi and Malik 2000).
//!
//! At first, the parts are the components of the graph. A part is cut in two where Ncut (equation 3) is
//! smallest: along the eigenvector, at one of 20 quantiles. Both halves are cut again, each as a graph of its
//! own. A part stays whole if Ncut exceeds `stop`, if it is not taller than `tall`, or if it has fewer than
//! 20 voxels.
//!
//! Ours: the numbers of quantiles and of voxels; the k-th quantile has floor(k n / 21) voxels on one side for
//! k up to 10, and on the other side for larger k, so that the sign of the eigenvector does not matter; of
//! cuts with equal Ncut, the more even one is taken. Heights are heights of centroids.
//!
//! An object with more than `max_voxels` voxels is cut on voxels of twice the edge, or four times the edge,
//! and so on. Each resulting part is cut again, on voxels as fine as the limit allows for this part. So a row
//! of a hundred trees is cut into groups first, and the groups into trees.

#![expect(clippy::cast_possible_truncation, reason = "voxels of an object fit u32")]

use super::eigen;
use super::graph::{Graph, Scale};
use super::pieces::Voxels;
use super::settings::NormalizedCutConfig;
use crate::model::Lattice;

/// Number of quantiles of the eigenvector at which a cut is tried.
const QUANTILES: usize = 20;
/// Smallest number of voxels of a part that is cut.
const LEAST_VOXELS: usize = 20;
/// Largest random shift of places in the start vector, as a share of the extent. The shifts make the start
/// vector contain every eigenvector.
const SHIFT: f64 = 0.1;

/// The parts of an object.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Parts {
    /// Part of each voxel, from 0 in the order of their first voxels.
    pub(super) of: Vec<u32>,
    pub(super) count: u32,
    /// Number of eigenvectors that did not reach the tolerance.
    pub(super) unsettled: u32,
    /// Number of doublings of the voxel edge for the first cut.
    pub(super) doublings: u32,
}

/// Cuts an object.
pub(super) fn cut(voxels: &Voxels, config: &NormalizedCutConfig, lattice: Lattice) -> Parts {
    let most = usize::try_from(config.max_voxels).unwrap_or(usize::MAX);
    let mut result = Parts::default();
    let mut open: Vec<Vec<u32>> = vec![(0..voxels.len() as u32).collect()];
    let mut parts: Vec<Vec<u32>> = Vec::new();
    while let Some(members) = open.pop() {
        let doublings = voxels.doublings_for(&members, most);
        result.doublings = result.doublings.max(doublings);
        let (coarse, numbers) = voxels.coarser(&members, doublings);
        let of = cut_level(&coarse, config, lattice, &mut result.unsettled);
        let count = of.iter().max().map_or(0, |last| *last as usize + 1);
        let mut found: Vec<Vec<u32>> = vec![Vec::new(); count];
        for (member, number) in members.iter().zip(numbers) {
            found[of[number as usize] as usize].push(*member);
        }
        // Only parts smaller than the whole can have finer voxels.
        if doublings == 0 || count == 1 { parts.extend(found) } else { open.extend(found) }
    }
    parts.sort_unstable_by_key(|members| members.first().copied());
    result.of = vec![0; voxels.len()];
    for (number, members) in (0_u32..).zip(&parts) {
        members.iter().for_each(|&member| result.of[member as usize] = number);
    }
    result.count = parts.len() as u32;
    result
}

/// Cuts voxels as one graph. There must be few enough for that. Returns the part of each voxel.
fn cut_level(
    voxels: &Voxels,
    config: &NormalizedCutConfig,
    lattice: Lattice,
    unsettled: &mut u32,
) -> Vec<u32> {
    let centroids = voxels.centroids_m(lattice.units_per_m());
    let graph = Graph::of(&voxels.key, &centroids, &Scale::new(config, lattice.metres(voxels.edge)));
    let mut open: Vec<(Graph, Vec<u32>)> = match &graph.components()[..] {
        [one] => vec![(graph, one.clone())],
        several => several.iter().map(|members| (graph.part(members), members.clone())).collect(),
    };
    let mut of = vec![0; voxels.len()];
    let mut parts = 0;
    while let Some((graph, members)) = open.pop() {
        match bisect(&graph, &members, &centroids, config, unsettled) {
            Some(halves) => {
                for half in halves {
                    let global = half.iter().map(|&place| members[place as usize]).collect();
                    open.push((graph.part(&half), global));
                }
            }
            None => {
                members.iter().for_each(|&member| of[member as usize] = parts);
                parts += 1;
            }
        }
    }
    of
}

/// The halves of a part, each with ascending positions in the part. `None` if the part stays whole.
fn bisect(
    graph: &Graph,
    members: &[u32],
    centroids: &[[f64; 3]],
    config: &NormalizedCutConfig,
    unsettled: &mut u32,
) -> Option<[Vec<u32>; 2]> {
    let places: Vec<[f64; 3]> = members.iter().map(|&member| centroids[member as usize]).collect();
    let (low, high) = extent(&places);
    if places.len() < LEAST_VOXELS || high[2] - low[2] <= config.tall {
        return None;
    }
    let degrees = graph.degrees();
    let axis = usize::from(high[1] - low[1] > high[0] - low[0]);
    let along = high[axis] - low[axis];
    let shifted = |(number, place): (u32, &[f64; 3])| place[axis] + SHIFT * along * scatter(number);
    let start: Vec<f64> = (0_u32..).zip(&places).map(shifted).collect();
    let second = eigen::second(graph, &degrees, &start, config.stop)?;
    *unsettled += u32::from(!second.settled);
    let mut order: Vec<u32> = (0..places.len() as u32).collect();
    let value = |place: u32| second.vector[place as usize];
    order.sort_unstable_by(|&a, &b| value(a).total_cmp(&value(b)).then(a.cmp(&b)));
    let (least, size) = best(graph, &degrees, &order)?;
    if least > config.stop {
        return None;
    }
    let mut halves = [order[..size].to_vec(), order[size..].to_vec()];
    halves.iter_mut().for_each(|half| half.sort_unstable());
    Some(halves)
}

/// Smallest and largest coordinates.
fn extent(places: &[[f64; 3]]) -> ([f64; 3], [f64; 3]) {
    let end = |axis: usize, pick: fn(f64, f64) -> f64| {
        places.iter().map(|place| place[axis]).reduce(pick).unwrap_or(0.0)
    };
    ([0, 1, 2].map(|axis| end(axis, f64::min)), [0, 1, 2].map(|axis| end(axis, f64::max)))
}

/// A pseudo-random number from 0 to 1 (the finaliser of Murmur 3).
fn scatter(number: u32) -> f64 {
    let mut hash = number.wrapping_add(0x9e37_79b9);
    hash = (hash ^ (hash >> 16)).wrapping_mul(0x85eb_ca6b);
    hash = (hash ^ (hash >> 13)).wrapping_mul(0xc2b2_ae35);
    f64::from(hash ^ (hash >> 16)) / f64::from(u32::MAX)
}

/// The smallest Ncut over the quantiles of an order of voxels, and the number of voxels before this cut.
/// `None` if no cut has voxels with links on both sides.
fn best(graph: &Graph, degrees: &[f64], order: &[u32]) -> Option<(f64, usize)> {
    let count = order.len();
    let half = QUANTILES / 2;
    let mut sizes: Vec<usize> = (1..=half).map(|k| k * count / (QUANTILES + 1)).collect();
    sizes.extend((1..=half).map(|k| count - k * count / (QUANTILES + 1)));
    sizes.sort_unstable();
    sizes.dedup();
    // Number of cuts before each voxel.
    let mut behind = vec![0_u32; count];
    for (rank, &voxel) in order.iter().enumerate() {
        behind[voxel as usize] = sizes.partition_point(|&size| size <= rank) as u32;
    }
    // A link counts for every cut between its ends: its weight is added at the first one and subtracted after
    // the last one.
    let mut between = vec![0.0; sizes.len() + 1];
    let mut inside = vec![0.0; sizes.len() + 1];
    for voxel in 0..count {
        let low = behind[voxel] as usize;
        inside[low] += degrees[voxel];
        for (other, weight) in graph.links(voxel) {
            let high = behind[other] as usize;
            if low < high {
                between[low] += weight;
                between[high] -= weight;
            }
        }
    }
    let whole: f64 = inside.iter().sum();
    let [mut cut, mut before] = [0.0, 0.0];
    let mut best: Option<(f64, usize, usize)> = None;
    for (number, &size) in sizes.iter().enumerate() {
        cut += between[number];
        before += inside[number];
        let uneven = count.abs_diff(2 * size);
        if size == 0 || size == count || before <= 0.0 || whole - before <= 0.0 {
            continue;
        }
        let ncut = cut / before + cut / (whole - before);
        if best.is_none_or(|best| ncut < best.0 || (ncut <= best.0 && uneven < best.1)) {
            best = Some((ncut, uneven, size));
        }
    }
    best.map(|(ncut, _, size)| (ncut, size))
}

//! The reduction of stage `borders`: merging by curvature, re-assignment of halo voxels, and the figures of all stages.
//! Small numbers only: no points, no voxels.
#![expect(
    clippy::cast_possible_truncation,
    reason = "numbers of clusters and components fit u32, as labels do; a threshold of at most 1 in steps of 2^-40"
)]

use std::collections::BTreeMap;

use serde_json::json;

use super::borders::{self, Halo, PairSum};
use super::columns::join;
use super::curvature::ONE;
use super::peaks::{self, PeaksGlobal};
use super::{STAGE_PEAKS, STAGE_VOXELS, voxelise};
use crate::cluster::{DriveSource, Grouped};
use crate::codec;
use crate::error::Result;
use crate::model::DisjointSets;

/// Width of a class of the histogram of curvatures.
const CURVATURE_CLASS: f64 = 0.005;

/// Halo voxels by what became of them.
#[derive(Debug, Default)]
struct Reassigned {
    joined: u64,
    dropped: u64,
}

/// Which labels are one object.
pub(super) fn group(drive: &dyn DriveSource, threshold: f64) -> Result<Grouped> {
    let global: PeaksGlobal = codec::decode(drive.global(STAGE_PEAKS))?;
    let mut sums = BTreeMap::<(u32, u32), PairSum>::new();
    let (mut borders, mut halos, mut labels) = (Vec::new(), Vec::new(), Vec::new());
    for tile in 0..drive.tiles() {
        let payload = borders::load(drive, tile)?;
        for (one, other, sum) in payload.pairs {
            let total = sums.entry((one, other)).or_default();
            total.pairs += sum.pairs;
            total.curvature += sum.curvature;
        }
        borders.push(payload.border);
        halos.push(payload.halos);
        labels.push(payload.clusters);
    }
    let segments = merge(global.clusters, &sums, threshold);
    let (of_halo, reassigned) = reassign(&join(&borders), &halos, &segments);
    let groups = labels
        .into_iter()
        .zip(of_halo)
        .map(|(clusters, halos)| {
            clusters.iter().map(|&cluster| segments[cluster as usize]).chain(halos).collect()
        })
        .collect();
    let figures = figures(drive, &global, &segments, &sums, threshold, &reassigned)?;
    Ok(Grouped { groups, figures })
}

/// Whether the mean over the pairs of the mean of both curvatures is below the threshold; in exact integers.
fn merges(sum: &PairSum, threshold: f64) -> bool {
    let limit = (threshold * ONE as f64).round() as i128;
    sum.curvature < 2 * i128::from(sum.pairs) * limit
}

/// Segment (from 1) of every cluster (from 1; index 0 is none).
fn merge(clusters: u32, sums: &BTreeMap<(u32, u32), PairSum>, threshold: f64) -> Vec<u32> {
    let mut sets = DisjointSets::new(clusters + 1);
    for (&(one, other), sum) in sums {
        if merges(sum, threshold) {
            sets.union(one, other);
        }
    }
    (0..=clusters).map(|cluster| sets.find(cluster)).collect()
}

/// Segment of every component of halo voxels of every tile, 0 where none is near; `components` names them over the
/// drive.
fn reassign(components: &[Vec<u32>], halos: &[Vec<Halo>], segments: &[u32]) -> (Vec<Vec<u32>>, Reassigned) {
    let mut nearest = BTreeMap::<u32, (i64, u64, u32)>::new();
    let all = || components.iter().flatten().zip(halos.iter().flatten());
    for (&component, halo) in all() {
        if let Some(found) = halo.nearest {
            let best = nearest.entry(component).or_insert(found);
            *best = found.min(*best);
        }
    }
    let segment = |component: &u32| nearest.get(component).map_or(0, |found| segments[found.2 as usize]);
    let mut reassigned = Reassigned::default();
    for (component, halo) in all() {
        if segment(component) == 0 {
            reassigned.dropped += halo.voxels;
        } else {
            reassigned.joined += halo.voxels;
        }
    }
    (components.iter().map(|of_tile| of_tile.iter().map(segment).collect()).collect(), reassigned)
}

/// What the stages came to, for the report.
fn figures(
    drive: &dyn DriveSource,
    global: &PeaksGlobal,
    segments: &[u32],
    sums: &BTreeMap<(u32, u32), PairSum>,
    threshold: f64,
    reassigned: &Reassigned,
) -> Result<serde_json::Value> {
    let (mut points, mut voxels, mut clustered) = (0, 0, 0_u64);
    let mut graph = BTreeMap::<(u32, u32), u64>::new();
    let mut centres: Vec<(f64, u32)> = Vec::new();
    for tile in 0..drive.tiles() {
        let payload = voxelise::load(drive, tile)?;
        points += payload.points;
        voxels += payload.voxels;
        clustered += payload.columns.iter().map(|(_, voxels)| voxels.len() as u64).sum::<u64>();
        let payload = peaks::load(drive, tile)?;
        payload
            .graph
            .iter()
            .for_each(|&(rho, delta, count)| *graph.entry((rho, delta)).or_default() += count);
        centres.extend(payload.centres);
    }
    centres.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(b.1.cmp(&a.1)));
    let mut classes = BTreeMap::<u32, [u64; 2]>::new();
    for sum in sums.values() {
        let mean = sum.curvature as f64 / (2 * sum.pairs) as f64 / ONE as f64;
        #[expect(clippy::cast_sign_loss, reason = "curvatures are not negative")]
        let class = (mean / CURVATURE_CLASS) as u32;
        classes.entry(class).or_default()[usize::from(merges(sum, threshold))] += 1;
    }
    let root = |delta: u32| f64::from(delta).sqrt();
    let components: voxelise::VoxelGlobal = codec::decode(drive.global(STAGE_VOXELS))?;
    let merged = segments
        .iter()
        .enumerate()
        .skip(1)
        .filter(|(cluster, segment)| *cluster == **segment as usize)
        .count();
    let mut distinct: Vec<u32> = components.components.into_iter().flatten().collect();
    distinct.sort_unstable();
    distinct.dedup();
    Ok(json!({
        "points": points,
        "voxels": voxels,
        "compression": 1.0 - voxels as f64 / (points as f64).max(1.0),
        "voxels_of_objects": clustered,
        "most_points_in_a_voxel": components.most,
        "components": distinct.len(),
        "centres": global.clusters,
        "clusters_before_merging": global.clusters,
        "clusters_after_merging": merged,
        "pairs_of_clusters": sums.len(),
        "halo_voxels_reassigned": reassigned.joined,
        "halo_voxels_dropped": reassigned.dropped,
        "decision_graph": {
            "rho_class": 0.25,
            "rho_delta_voxels": graph.into_iter()
                .map(|((rho, delta), count)| json!([f64::from(rho) / 4.0, root(delta), count]))
                .collect::<Vec<_>>(),
            "centres_rho_delta": centres.into_iter().map(|(rho, delta)| json!([rho, root(delta)])).collect::<Vec<_>>(),
        },
        "curvature_of_pairs": {
            "class": CURVATURE_CLASS,
            "from_unmerged_merged": classes.into_iter()
                .map(|(class, [apart, merged])| json!([f64::from(class) * CURVATURE_CLASS, apart, merged]))
                .collect::<Vec<_>>(),
        },
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sum(pairs: u64, mean: f64) -> PairSum {
        PairSum { pairs, curvature: i128::from(2 * pairs) * (mean * ONE as f64) as i128 }
    }

    #[test]
    fn smooth_borders_merge_transitively_and_the_threshold_itself_does_not() {
        let sums =
            BTreeMap::from([((1, 3), sum(10, 0.07)), ((3, 4), sum(1, 0.079)), ((2, 4), sum(5, 0.081))]);
        assert_eq!(merge(5, &sums, 0.08), [0, 1, 2, 1, 1, 5]);
        assert!(!merges(&PairSum { pairs: 3, curvature: 6 * i128::from(ONE / 4) }, 0.25));
        assert!(merges(&PairSum { pairs: 3, curvature: 6 * i128::from(ONE / 4) - 1 }, 0.25));
    }

    #[test]
    fn a_component_of_two_tiles_joins_what_is_nearest_to_either() {
        let halo = |voxels, nearest| Halo { voxels, nearest };
        let halos = [vec![halo(5, Some((90, 7, 2))), halo(1, None)], vec![halo(3, Some((90, 6, 3)))]];
        // Components 0 and 1 of the drive; equally near: the smaller id, cluster 3, which is of segment 1.
        let (groups, reassigned) = reassign(&[vec![0, 1], vec![0]], &halos, &[0, 1, 2, 1]);
        assert_eq!(groups, [vec![1, 0], vec![1]]);
        assert_eq!((reassigned.joined, reassigned.dropped), (8, 1));
    }
}

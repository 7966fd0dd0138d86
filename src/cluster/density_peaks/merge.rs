//! The reduction of stage `borders`: merging by curvature and re-assignment of halo voxels. It works only on
//! sums of pairs and on components, and sees no points and no voxels.

use std::collections::BTreeMap;

use super::figures::{Figures, Reassigned};
use super::settings::{DensityPeaksConfig, STAGE_PEAKS};
use super::stage_borders::{self, Halo, Nearest, PairSum, merges};
use super::stage_peaks;
use crate::cluster::columns::join;
use crate::cluster::{DriveWindow, Grouped};
use crate::error::Result;
use crate::model::TileId;
use crate::spatial::DisjointSets;

/// Which labels are one object.
pub(super) fn group(drive: &dyn DriveWindow, config: &DensityPeaksConfig) -> Result<Grouped> {
    let threshold = config.merge_below;
    let clusters = stage_peaks::clusters(drive.global(STAGE_PEAKS))?;
    let mut sums = BTreeMap::<(u32, u32), PairSum>::new();
    let mut borders = Vec::new();
    let mut halos = Vec::new();
    let mut labels = Vec::new();
    for tile in TileId::first(drive.tiles()) {
        let payload = stage_borders::load(drive, tile)?;
        for (one, other, sum) in payload.pairs {
            let total = sums.entry((one, other)).or_default();
            total.sides += sum.sides;
            total.curvature += sum.curvature;
        }
        borders.push(payload.border);
        halos.push(payload.halos);
        labels.push(payload.clusters);
    }
    let segments = merge(clusters, &sums, threshold);
    let (of_halo, reassigned) = reassign(&join(&borders), &halos, &segments);
    let groups = labels
        .into_iter()
        .zip(of_halo)
        .map(|(clusters, halos)| {
            clusters.iter().map(|&cluster| segments[cluster as usize]).chain(halos).collect()
        })
        .collect();
    let figures = Figures::collect(drive, clusters, &segments, &sums, threshold, reassigned)?;
    let mut named = crate::cluster::Figures::new();
    named.insert("stages".to_owned(), figures.to_json());
    Ok(Grouped { groups, figures: named, charts: figures.charts(config), ..Grouped::default() })
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

/// Segment of every component of halo voxels of every tile; 0 if no segment is near. `components` has the
/// component over the drive of each of them.
fn reassign(components: &[Vec<u32>], halos: &[Vec<Halo>], segments: &[u32]) -> (Vec<Vec<u32>>, Reassigned) {
    let mut nearest = BTreeMap::<u32, Nearest>::new();
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

#[cfg(test)]
mod tests {
    use super::super::curvature::ONE;
    use super::*;

    #[expect(clippy::cast_possible_truncation, reason = "means of at most 1 in steps of 2^-40")]
    fn sum(pairs: u64, mean: f64) -> PairSum {
        PairSum { sides: 2 * pairs, curvature: i128::from(2 * pairs) * (mean * ONE as f64) as i128 }
    }

    #[test]
    fn smooth_borders_merge_transitively_and_the_threshold_itself_does_not() {
        let sums =
            BTreeMap::from([((1, 3), sum(10, 0.07)), ((3, 4), sum(1, 0.079)), ((2, 4), sum(5, 0.081))]);
        assert_eq!(merge(5, &sums, 0.08), [0, 1, 2, 1, 1, 5]);
        assert!(!merges(&PairSum { sides: 6, curvature: 6 * i128::from(ONE / 4) }, 0.25));
        assert!(merges(&PairSum { sides: 6, curvature: 6 * i128::from(ONE / 4) - 1 }, 0.25));
    }

    #[test]
    fn a_component_of_two_tiles_joins_what_is_nearest_to_either() {
        let halo = |voxels, nearest| Halo { voxels, nearest };
        let halos =
            [vec![halo(5, Some((90, [8, 7, 1], 2))), halo(1, None)], vec![halo(3, Some((90, [8, 6, 9], 3)))]];
        // Components 0 and 1 of the drive. Of equally near points the first in the order of places counts:
        // cluster 3, which is in segment 1.
        let (groups, reassigned) = reassign(&[vec![0, 1], vec![0]], &halos, &[0, 1, 2, 1]);
        assert_eq!(groups, [vec![1, 0], vec![1]]);
        assert_eq!((reassigned.joined, reassigned.dropped), (8, 1));
    }
}

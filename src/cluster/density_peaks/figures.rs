//! What the stages came to, one row per drive as in section 4 of the paper; and the two charts by which people choose
//! thresholds (Figure 4 of the paper): the decision graph, and curvatures of merged and unmerged pairs.
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "numbers of clusters fit u32; curvatures are shares"
)]

use std::collections::BTreeMap;

use serde_json::json;

use super::borders::PairSum;
use super::curvature::ONE;
use super::merge::{Reassigned, merges};
use super::peaks::{self, PeaksGlobal};
use super::voxelise::{self, VoxelGlobal};
use super::{DensityPeaksConfig, STAGE_VOXELS};
use crate::cluster::DriveSource;
use crate::codec;
use crate::error::Result;
use crate::model::{Chart, Series};

/// Width of a class of the histogram of curvatures.
const CURVATURE_CLASS: f64 = 0.005;

/// Figures of all stages.
#[derive(Debug, Default)]
pub(super) struct Figures {
    points: u64,
    voxels: u64,
    of_objects: u64,
    most: u32,
    components: usize,
    clusters: u32,
    merged: usize,
    pairs: usize,
    reassigned: Reassigned,
    /// Voxels by density (in quarters) and squared delta.
    graph: BTreeMap<(u32, u32), u64>,
    /// Density and squared delta of every centre.
    centres: Vec<(f64, u32)>,
    /// Pairs of clusters by curvature: unmerged, merged.
    curvatures: BTreeMap<u32, [u64; 2]>,
}

impl Figures {
    /// From what the stages keep.
    pub(super) fn collect(
        drive: &dyn DriveSource,
        global: &PeaksGlobal,
        segments: &[u32],
        sums: &BTreeMap<(u32, u32), PairSum>,
        threshold: f64,
        reassigned: Reassigned,
    ) -> Result<Self> {
        let own_name = |(cluster, segment): &(usize, &u32)| *cluster == **segment as usize;
        let merged = segments.iter().enumerate().skip(1).filter(own_name).count();
        let mut figures =
            Self { clusters: global.clusters, merged, pairs: sums.len(), reassigned, ..Self::default() };
        for tile in 0..drive.tiles() {
            let payload = voxelise::load(drive, tile)?;
            figures.points += payload.points;
            figures.voxels += payload.voxels;
            figures.of_objects += payload.columns.iter().map(|(_, voxels)| voxels.len() as u64).sum::<u64>();
            let payload = peaks::load(drive, tile)?;
            for (rho, delta, count) in payload.graph {
                *figures.graph.entry((rho, delta)).or_default() += count;
            }
            figures.centres.extend(payload.centres);
        }
        // The order of tiles must not show.
        figures.centres.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(b.1.cmp(&a.1)));
        for sum in sums.values() {
            let mean = sum.curvature as f64 / sum.sides as f64 / ONE as f64;
            let class = figures.curvatures.entry((mean / CURVATURE_CLASS) as u32).or_default();
            class[usize::from(merges(sum, threshold))] += 1;
        }
        let voxels: VoxelGlobal = codec::decode(drive.global(STAGE_VOXELS))?;
        figures.most = voxels.most;
        let mut components: Vec<u32> = voxels.components.into_iter().flatten().collect();
        components.sort_unstable();
        components.dedup();
        figures.components = components.len();
        Ok(figures)
    }

    /// For the report.
    pub(super) fn to_json(&self) -> serde_json::Value {
        json!({
            "points": self.points,
            "voxels": self.voxels,
            "compression": 1.0 - self.voxels as f64 / (self.points as f64).max(1.0),
            "voxels_of_objects": self.of_objects,
            "most_points_in_a_voxel": self.most,
            "components": self.components,
            "centres": self.clusters,
            "clusters_before_merging": self.clusters,
            "clusters_after_merging": self.merged,
            "pairs_of_clusters": self.pairs,
            "halo_voxels_reassigned": self.reassigned.joined,
            "halo_voxels_dropped": self.reassigned.dropped,
        })
    }

    /// The decision graph and the histogram of curvatures.
    pub(super) fn charts(&self, config: &DensityPeaksConfig) -> Vec<Chart> {
        let root = |delta: u32| f64::from(delta).sqrt();
        let voxels =
            self.graph.keys().map(|&(rho, delta)| [f64::from(rho) / 4.0 + 0.125, root(delta)]).collect();
        let centres = self.centres.iter().map(|&(rho, delta)| [rho, root(delta)]).collect();
        let decision = Chart {
            name: "density-peaks-decision",
            title: format!("Decision graph: {} voxels, {} centres", self.of_objects, self.clusters),
            x: "local density rho (voxels; classes of 0.25)",
            y: "distance delta to the nearest denser voxel (voxels)",
            series: vec![
                Series::Points { name: "voxels".to_owned(), places: voxels },
                Series::Points { name: "centres".to_owned(), places: centres },
            ],
            x_thresholds: vec![config.rho_t],
            y_thresholds: vec![config.delta_t],
        };
        let left = |class: u32| f64::from(class) * CURVATURE_CLASS;
        let merged = self.curvatures.iter().map(|(&class, n)| [left(class), 0.0, n[1] as f64]);
        let apart =
            self.curvatures.iter().map(|(&class, n)| [left(class), n[1] as f64, (n[0] + n[1]) as f64]);
        let filled = |bars: &mut dyn Iterator<Item = [f64; 3]>| bars.filter(|bar| bar[1] < bar[2]).collect();
        let curvature = Chart {
            name: "density-peaks-curvature",
            title: format!("Mean curvature (CNS) of {} pairs of clusters", self.pairs),
            x: "mean curvature over the pairs of points (share)",
            y: "pairs of clusters",
            series: vec![
                Series::Bars {
                    name: "unmerged".to_owned(),
                    width: CURVATURE_CLASS,
                    bars: filled(&mut { apart }),
                },
                Series::Bars {
                    name: "merged".to_owned(),
                    width: CURVATURE_CLASS,
                    bars: filled(&mut { merged }),
                },
            ],
            x_thresholds: vec![config.c_t],
            y_thresholds: Vec::new(),
        };
        vec![decision, curvature]
    }
}

//! Results of the stages, one row per drive as in section 4 of the paper, and the two charts for the choice
//! of thresholds (Figure 4 of the paper): the decision graph, and the curvatures of merged and unmerged
//! pairs.
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "numbers of clusters fit u32; curvatures are shares"
)]

use std::collections::BTreeMap;

use serde_json::json;

use super::curvature::ONE;
use super::decision::{class_density, density_class};
use super::settings::{DensityPeaksConfig, STAGE_VOXELS};
use super::stage_borders::{PairSum, merges};
use super::stage_peaks;
use super::stage_voxels;
use crate::cluster::DriveWindow;
use crate::error::Result;
use crate::model::{Chart, ChartAxis, Series, TileId};

/// Names of the charts: the decision graph and the histogram of curvatures.
pub(in crate::cluster) const CHARTS: [&str; 2] = ["density-peaks-decision", "density-peaks-curvature"];

/// Width of a class of the histogram of curvatures.
const CURVATURE_CLASS: f64 = 0.005;

/// Numbers of halo voxels that joined a segment or were dropped.
#[derive(Debug, Default)]
pub(super) struct Reassigned {
    pub(super) joined: u64,
    pub(super) dropped: u64,
}

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
    /// Voxels by class of density and squared delta.
    graph: BTreeMap<(u32, u32), u64>,
    /// Density and squared delta of every centre.
    centres: Vec<(f64, u32)>,
    /// Numbers of unmerged and merged pairs of clusters, by class of curvature.
    curvatures: BTreeMap<u32, [u64; 2]>,
}

impl Figures {
    /// Collects the figures from the payloads of the stages.
    pub(super) fn collect(
        drive: &dyn DriveWindow,
        clusters: u32,
        segments: &[u32],
        sums: &BTreeMap<(u32, u32), PairSum>,
        threshold: f64,
        reassigned: Reassigned,
    ) -> Result<Self> {
        let own_name = |(cluster, segment): &(usize, &u32)| *cluster == **segment as usize;
        let merged = segments.iter().enumerate().skip(1).filter(own_name).count();
        let mut figures = Self { clusters, merged, pairs: sums.len(), reassigned, ..Self::default() };
        let voxels = drive.global(STAGE_VOXELS);
        figures.most = stage_voxels::most(voxels)?;
        let mut components: Vec<u32> = Vec::new();
        for tile in TileId::first(drive.tiles()) {
            components.extend(stage_voxels::components(voxels, tile)?);
            let payload = stage_voxels::load(drive, tile)?;
            figures.points += payload.points;
            figures.voxels += payload.voxels;
            figures.of_objects += payload.stored.len() as u64;
            let payload = stage_peaks::load(drive, tile)?;
            for (rho, delta, count) in payload.graph {
                *figures.graph.entry((rho, delta)).or_default() += count;
            }
            figures.centres.extend(payload.centres);
        }
        // Sorted, so that the result does not depend on the order of tiles.
        figures.centres.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(b.1.cmp(&a.1)));
        for sum in sums.values() {
            let mean = sum.curvature as f64 / sum.sides as f64 / ONE as f64;
            let class = figures.curvatures.entry((mean / CURVATURE_CLASS) as u32).or_default();
            class[usize::from(merges(sum, threshold))] += 1;
        }
        components.sort_unstable();
        components.dedup();
        figures.components = components.len();
        Ok(figures)
    }

    /// The figures for the report.
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
        vec![self.decision_graph(config), self.histogram(config)]
    }

    /// Densities span three powers of ten, and most are below the threshold. Therefore the axis is
    /// logarithmic.
    fn decision_graph(&self, config: &DensityPeaksConfig) -> Chart {
        let points = |name: &str, classes: &BTreeMap<(u32, u32), u64>| Series::Points {
            name: name.to_owned(),
            places: classes
                .keys()
                .map(|&(rho, delta)| [class_density(rho), f64::from(delta).sqrt()])
                .collect(),
            counts: classes.values().copied().collect(),
        };
        let mut centres = BTreeMap::new();
        for &(rho, delta) in &self.centres {
            *centres.entry((density_class(rho), delta)).or_default() += 1;
        }
        let farthest = config.search_radius;
        Chart {
            name: CHARTS[0].into(),
            title: format!("Decision graph: {} voxels, {} centres", self.of_objects, self.clusters),
            x: ChartAxis {
                name: "local density rho (voxels)".to_owned(),
                logarithmic: true,
                thresholds: vec![("rho_t".into(), config.min_density)],
            },
            y: ChartAxis {
                name: format!("distance delta to the nearest denser voxel (voxels; {farthest}: none)"),
                logarithmic: false,
                thresholds: vec![("delta_t".into(), config.min_separation)],
            },
            series: vec![points("voxels (1, 10, 100, ...)", &self.graph), points("centres", &centres)],
        }
    }

    /// Numbers of pairs differ by a factor of a hundred. Therefore the axis is logarithmic.
    fn histogram(&self, config: &DensityPeaksConfig) -> Chart {
        let left = |class: u32| f64::from(class) * CURVATURE_CLASS;
        let merged = self.curvatures.iter().map(|(&class, n)| [left(class), 0.0, n[1] as f64]);
        let apart =
            self.curvatures.iter().map(|(&class, n)| [left(class), n[1] as f64, (n[0] + n[1]) as f64]);
        let bars = |name: &str, bars: &mut dyn Iterator<Item = [f64; 3]>| Series::Bars {
            name: name.to_owned(),
            width: CURVATURE_CLASS,
            bars: bars.filter(|bar| bar[1] < bar[2]).collect(),
        };
        Chart {
            name: CHARTS[1].into(),
            title: format!("Mean curvature (CNS) of {} pairs of clusters", self.pairs),
            x: ChartAxis {
                name: format!("mean curvature over the pairs of points (classes of {CURVATURE_CLASS})"),
                logarithmic: false,
                thresholds: vec![("c_t".into(), config.merge_below)],
            },
            y: ChartAxis { name: "pairs of clusters".to_owned(), logarithmic: true, thresholds: Vec::new() },
            series: vec![bars("unmerged", &mut { apart }), bars("merged", &mut { merged })],
        }
    }
}

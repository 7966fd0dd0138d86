//! The clustering method `euclidean`: single-link clusters of points within a fixed distance; it knows no sizes
//! and no shapes.
//!
//! Source: Guan, Cao, Yu, Li, Liu, Chen, Li, "Street-scene tree segmentation from mobile laser scanning data"
//! (2016), section 3.2. Ours: the default distance, that it is inclusive, and how clusters are found: not by a
//! breadth-first search over a kd-tree, but over cells. Points of one cell of side s are within d_t of each
//! other by construction, with the largest s (in lattice units) that has 3 (s - 1)^2 <= d_t^2; so cells are
//! nodes, and two cells are joined when some pair of their points is within d_t. Nearest cells come first and
//! cells that are already united are skipped, so that most pairs of cells are never looked at. Distances are
//! compared as squares of lattice units in i64: exact for any d_t.
//!
//! Cost: O(points + 62 cells) plus the points of neighbouring cells that are *not* of one cluster (see
//! `closeness`). Memory: 12 bytes per point, 12 per streak of consecutive points in a cell and 24 more while
//! sorting, 68 per cell; at worst, with points far apart, every point is a streak and a cell: 92 bytes. The
//! bench is `benches/kernels.rs`.
//!
//! Known failures: those of single link: objects that touch are one (crowns of neighbouring trees, a car at a
//! fence), an object scanned more sparsely than d_t is many.

use serde::Deserialize;

use super::{ClusterEntry, Clusterer, Method};
use crate::cluster::linking::closeness::{Bounds, Point, any_within};
use crate::config::{self, ConfigError};
use crate::model::AlgorithmError;
use crate::model::{Lattice, Reach, TileCloud};
use crate::spatial::{DisjointSets, Linker, VoxelIndex};

const NAME: &str = "euclidean";

pub(super) const ENTRY: ClusterEntry = ClusterEntry {
    name: NAME,
    summary: "single-link clusters of points within a fixed distance",
    reference: "Guan et al. 2016, section 3.2",
    build: |table| Ok(Method::Local(Box::new(Euclidean::new(&config::section(NAME, table)?)?))),
};

/// Settings of the section `[euclidean]`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EuclideanConfig {
    /// Points at most this far apart, in metres, are of one object, 0.001 to 10. Default 0.3 (chosen: the 0.15
    /// m of Guan et al. 2016, section 4, splits what is scanned from further away than their avenue is wide).
    pub d_t: f64,
    /// Objects with fewer points, in the whole drive, are dropped; at least 1. Default 50 (chosen; the paper
    /// gives no number).
    pub min_points: u64,
    /// Objects with more points, in the whole drive, are dropped; 0: no limit, else at least `min_points`.
    /// Default 0.
    pub max_points: u64,
}

impl Default for EuclideanConfig {
    fn default() -> Self {
        Self { d_t: 0.3, min_points: 50, max_points: 0 }
    }
}

impl EuclideanConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// [`ConfigError::Value`] with the key and the range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        if !(0.001..=10.0).contains(&self.d_t) {
            return Err(ConfigError::value("euclidean.d_t", self.d_t, "0.001 to 10 metres"));
        }
        if self.min_points == 0 {
            return Err(ConfigError::value("euclidean.min_points", self.min_points, "at least 1 point"));
        }
        if self.max_points != 0 && self.max_points < self.min_points {
            let expected = format!("0 (no limit) or at least min_points = {}", self.min_points);
            return Err(ConfigError::value("euclidean.max_points", self.max_points, expected));
        }
        Ok(())
    }
}

/// The method, see the module.
#[derive(Debug, Clone)]
pub struct Euclidean {
    config: EuclideanConfig,
}

impl Euclidean {
    /// The method with these settings.
    ///
    /// # Errors
    /// Those of [`EuclideanConfig::validate`].
    pub fn new(config: &EuclideanConfig) -> Result<Self, ConfigError> {
        config.validate()?;
        Ok(Self { config: config.clone() })
    }
}

impl Clusterer for Euclidean {
    fn name(&self) -> &'static str {
        NAME
    }

    fn reach(&self, lattice: Lattice) -> Reach {
        Reach::Exact { metres: lattice.metres(lattice.units(self.config.d_t)) }
    }

    fn object_size(&self) -> std::ops::RangeInclusive<u64> {
        let max = if self.config.max_points == 0 { u64::MAX } else { self.config.max_points };
        self.config.min_points..=max
    }

    fn cluster(&self, cloud: &TileCloud, labels: &mut [u32]) -> Result<u32, AlgorithmError> {
        single_link(NAME, cloud, cloud.lattice.units(self.config.d_t), labels)
    }
}

/// Labels the points with their single-link cluster at a distance of `reach` lattice units, inclusive; returns the
/// number of clusters.
pub(super) fn single_link(
    method: &'static str,
    cloud: &TileCloud,
    reach: i64,
    labels: &mut [u32],
) -> Result<u32, AlgorithmError> {
    let index = VoxelIndex::build(method, cloud, cell_side(reach))?;
    let cells = Cells::gather(&index, cloud);
    let touch = |a: u32, b: u32| cells.touch(a as usize, b as usize, reach.pow(2));
    let mut sets = link_cells(&index, reach, touch);
    let (cell_labels, clusters) = number_by_smallest_id(&index, cloud, &mut sets);
    for (points, cell) in index.streaks() {
        labels[points].fill(cell_labels[cell]);
    }
    Ok(clusters)
}

/// Sets of cells, of those that can hold points within `reach` of each other and that `touch`.
pub(super) fn link_cells(
    index: &VoxelIndex,
    reach: i64,
    touch: impl Fn(u32, u32) -> bool + Copy,
) -> DisjointSets {
    let mut linker = Linker::new(index);
    for layer in layers(reach) {
        for step in layer {
            if step.offset == [0, 0] {
                linker.link_column(step.dk, touch);
            } else {
                linker.link_beside(step.offset, &step.dk, touch);
            }
        }
        linker.find_spans();
    }
    linker.into_sets()
}

/// The largest side s of a cell, in lattice units, with 3 (s - 1)^2 <= reach^2: points of one cell differ by s
/// - 1 at most on each axis.
pub(super) fn cell_side(reach: i64) -> u32 {
    u32::try_from((reach.pow(2) / 3).isqrt() + 1).unwrap_or(u32::MAX)
}

/// Cells at one column offset, and how far up or down.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Step {
    pub(super) offset: [i64; 2],
    pub(super) dk: std::ops::RangeInclusive<i64>,
}

/// Half of the neighbours of a cell that can hold a point within `reach` of one of its own (the other half see
/// it as their neighbour): its own column, then touching columns, then those further out. A cell further than 2
/// away on an axis is beyond reach: its gap is more than 2 s, and s > reach / sqrt(3).
pub(super) fn layers(reach: i64) -> [Vec<Step>; 3] {
    let side = i64::from(cell_side(reach));
    let gap_squared = |d: i64| if d == 0 { 0 } else { ((d.abs() - 1) * side + 1).pow(2) };
    let mut layers = [const { Vec::new() }; 3];
    for di in 0..=2_i64 {
        for dj in -2..=2_i64 {
            let in_reach = |dk: &i64| gap_squared(di) + gap_squared(dj) + gap_squared(*dk) <= reach.pow(2);
            let Some(outermost) = (0..=2).rev().find(in_reach).filter(|_| [di, dj] >= [0, 0]) else {
                continue;
            };
            let lowest = if [di, dj] == [0, 0] { 1 } else { -outermost };
            let layer = if di.max(dj.abs()) == 2 { 2 } else { usize::from([di, dj] != [0, 0]) };
            layers[layer].push(Step { offset: [di, dj], dk: lowest..=outermost });
        }
    }
    layers
}

/// The coordinates of the points, cell by cell.
struct Cells {
    points: Vec<Point>,
    first: Vec<u32>,
    bounds: Vec<Bounds>,
}

impl Cells {
    fn gather(index: &VoxelIndex, cloud: &TileCloud) -> Self {
        let mut cells = Self {
            points: Vec::with_capacity(cloud.len()),
            first: Vec::with_capacity(index.len() + 1),
            bounds: Vec::with_capacity(index.len()),
        };
        for cell in 0..index.len() {
            let first = cells.points.len();
            for range in index.voxel_points(cell) {
                cells.points.extend(range.map(|point| [cloud.x[point], cloud.y[point], cloud.z[point]]));
            }
            cells.first.push(as_u32(first));
            cells.bounds.push(Bounds::of(&cells.points[first..]));
        }
        cells.first.push(as_u32(cloud.len()));
        cells
    }

    fn points(&self, cell: usize) -> (&[Point], &Bounds) {
        let range = self.first[cell] as usize..self.first[cell + 1] as usize;
        (&self.points[range], &self.bounds[cell])
    }

    /// Whether some points of the two cells are at a squared distance of at most `limit`.
    fn touch(&self, a: usize, b: usize, limit: i64) -> bool {
        any_within(self.points(a), self.points(b), limit)
    }
}

/// The label of every cell, and how many there are: sets are numbered from 1 by the smallest id of their
/// points, so that the order of the points does not matter.
fn number_by_smallest_id(index: &VoxelIndex, cloud: &TileCloud, sets: &mut DisjointSets) -> (Vec<u32>, u32) {
    let roots: Vec<u32> = (0..as_u32(index.len())).map(|cell| sets.find(cell)).collect();
    let mut smallest = vec![u64::MAX; index.len()];
    for (points, cell) in index.streaks() {
        let slot = &mut smallest[roots[cell] as usize];
        *slot = cloud.id[points].iter().fold(*slot, |smallest, &id| smallest.min(id));
    }
    let mut order: Vec<(u64, u32)> = roots
        .iter()
        .zip(0..)
        .filter(|&(&root, cell)| root == cell)
        .map(|(_, cell)| (smallest[cell as usize], cell))
        .collect();
    order.sort_unstable();
    let mut label_of_root = vec![0; index.len()];
    for (label, &(_, root)) in (1..).zip(&order) {
        label_of_root[root as usize] = label;
    }
    let labels = roots.into_iter().map(|root| label_of_root[root as usize]).collect();
    (labels, as_u32(order.len()))
}

/// A count of cells or points; `VoxelIndex::build` has checked that they fit.
#[expect(
    clippy::cast_possible_truncation,
    reason = "at most as many cells as points, checked by VoxelIndex::build"
)]
fn as_u32(count: usize) -> u32 {
    count as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cluster(d_t: f64, points: &[[i64; 3]]) -> (Vec<u32>, u32) {
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, points);
        let mut labels = vec![u32::MAX; points.len()];
        let method = Euclidean::new(&EuclideanConfig { d_t, ..EuclideanConfig::default() }).unwrap();
        let clusters = method.cluster(&cloud, &mut labels).unwrap();
        (labels, clusters)
    }

    #[test]
    fn the_distance_is_inclusive() {
        // 100^2 + 200^2 + 200^2 = 300^2.
        assert_eq!(cluster(0.3, &[[0, 0, 0], [100, 200, 200]]), (vec![1, 1], 1));
        assert_eq!(cluster(0.3, &[[0, 0, 0], [100, 200, 201]]), (vec![1, 2], 2));
        assert_eq!(cluster(0.3, &[[0, 0, 0], [0, 0, 300]]), (vec![1, 1], 1));
        assert_eq!(cluster(0.3, &[[0, 0, 0], [0, 0, 301]]), (vec![1, 2], 2));
        assert_eq!(cluster(0.001, &[[0, 0, 0], [0, 1, 0], [1, 2, 0]]), (vec![1, 1, 2], 2));
    }

    #[test]
    fn chains_are_one_object_and_labels_follow_the_smallest_id() {
        let (labels, clusters) =
            cluster(0.3, &[[5_000, 0, 0], [0, 0, 0], [600, 0, 0], [5_100, 0, 0], [300, 0, 0]]);
        assert_eq!((labels, clusters), (vec![1, 2, 2, 1, 2], 2));
    }

    #[test]
    fn labels_follow_ids_and_not_the_order_of_points() {
        let mut cloud =
            TileCloud::from_lattice_points(Lattice::MILLIMETRE, &[[0; 3], [9_000; 3], [18_000; 3]]);
        cloud.id = vec![70, 8, 30];
        let mut labels = [0; 3];
        let method = Euclidean::new(&EuclideanConfig::default()).unwrap();
        assert_eq!(method.cluster(&cloud, &mut labels), Ok(3));
        assert_eq!(labels, [3, 1, 2]);
    }

    #[test]
    fn a_cell_is_as_large_as_it_may_be() {
        for reach in [1, 2, 3, 17, 150, 300, 301, 9_999] {
            let side = i64::from(cell_side(reach));
            assert!(3 * (side - 1).pow(2) <= reach.pow(2), "{reach}");
            assert!(3 * side.pow(2) > reach.pow(2), "{reach}");
        }
        assert_eq!(cell_side(300), 174);
    }

    #[test]
    fn layers_hold_every_neighbour_in_reach_once() {
        for reach in [1, 2, 3, 17, 300] {
            let side = i64::from(cell_side(reach));
            let mut steps: Vec<[i64; 3]> = layers(reach)
                .into_iter()
                .flatten()
                .flat_map(|Step { offset: [di, dj], dk }| dk.map(move |dk| [di, dj, dk]))
                .collect();
            steps.sort_unstable();
            // The smallest distance between points of cells 0 and d on an axis, looked for point by point.
            let gap = |d: i64| {
                (d * side..(d + 1) * side).flat_map(|q| [0, side - 1].map(|p| (q - p).abs())).min().unwrap()
            };
            let gap = |d: i64| if d == 0 { 0 } else { gap(d) };
            let mut expected = Vec::new();
            for di in -4..=4 {
                for dj in -4..=4 {
                    for dk in -4..=4 {
                        let squared = gap(di).pow(2) + gap(dj).pow(2) + gap(dk).pow(2);
                        if squared <= reach.pow(2) && [di, dj, dk] > [0, 0, 0] {
                            expected.push([di, dj, dk]);
                        }
                    }
                }
            }
            assert_eq!(steps, expected, "{reach}");
        }
    }

    #[test]
    fn two_hundred_thousand_points_slightly_too_far_apart_are_two_objects() {
        // Two sheets of 1.2 m x 1.2 m tilted by 45 degrees, 426 / sqrt(2) = 301.2 mm apart. This is a test of
        // time as well: pair by pair, it would take minutes.
        let sheet = |lift: i64| {
            (0..100_000_i64).map(move |index| [index % 400 * 3, index / 400 * 5, index % 400 * 3 + lift])
        };
        let points: Vec<[i64; 3]> = sheet(0).chain(sheet(426)).collect();
        let (labels, clusters) = cluster(0.3, &points);
        assert_eq!(clusters, 2);
        assert!(labels[..100_000].iter().all(|&label| label == 1));
        assert_eq!(cluster(0.302, &points).1, 1);
    }

    #[test]
    fn values_out_of_range_are_refused_with_their_key() {
        let default = EuclideanConfig::default;
        for (config, key) in [
            (EuclideanConfig { d_t: 0.0, ..default() }, "euclidean.d_t = 0"),
            (EuclideanConfig { d_t: f64::NAN, ..default() }, "euclidean.d_t = NaN"),
            (EuclideanConfig { min_points: 0, ..default() }, "euclidean.min_points = 0"),
            (EuclideanConfig { max_points: 49, ..default() }, "euclidean.max_points = 49"),
        ] {
            let error = config.validate().unwrap_err().to_string();
            assert!(error.starts_with(key), "{error}");
        }
        default().validate().unwrap();
        let sizes =
            |max_points| Euclidean::new(&EuclideanConfig { max_points, ..default() }).unwrap().object_size();
        assert_eq!(sizes(0), 50..=u64::MAX);
        assert_eq!(sizes(50), 50..=50);
    }
}

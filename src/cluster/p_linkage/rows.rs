//! `p-linkage` in n dimensions: every point is linked to the closest denser point within a cut-off distance.
//!
//! Source: Lu, Yao, Tu, Li, Li, Liu, "Pairwise linkage for point cloud segmentation" (2016), section 2,
//! equations 1 to 3 and algorithm 1. "The paper" in this file is Lu et al. 2016. Ours: of two points with
//! equal density, the earlier row counts as denser, so repeated points are one cluster. Terms of the density
//! below 1e-12 are left out. Every term is rounded to a multiple of 2^-48, so sums are exact, and the order
//! of rows cannot change which of two points is denser. The rule for merging two clusters uses the clusters
//! before any merging, and merging is transitive.

use std::collections::BTreeMap;
use std::num::NonZero;

use serde::Serialize;

use crate::cluster::linking::numbering as labels;
use crate::spatial::DisjointSets;
use crate::spatial::Index;
use crate::spatial::{Points, SpatialError};

/// Smallest term of the density that counts: exp(-x^2) for x up to 5.26.
const SMALLEST_TERM: f64 = 1e-12;
/// Terms are rounded to multiples of 2^-48, which is finer than the smallest term.
const DENSITY_BITS: i32 = 48;

/// Settings of `p-linkage`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PLinkage {
    /// Ratio of the cut-off distance to the median distance to the nearest neighbour (paper, section 4.1: 5).
    pub scale: f64,
    /// Whether neighbouring clusters of similar density are merged (equation 3), for data of even density.
    pub merge: bool,
}

impl Default for PLinkage {
    fn default() -> Self {
        Self { scale: 5.0, merge: false }
    }
}

/// The result of `p-linkage`.
#[derive(Debug, Clone, PartialEq)]
pub struct Linkage {
    /// Cluster of every point, 0 for outliers.
    pub labels: Vec<u32>,
    /// Number of clusters.
    pub clusters: u32,
    /// The cut-off distance.
    pub cutoff: f64,
    /// Median of the densities. A tree whose root is not denser than this consists of outliers.
    pub median_density: f64,
}

impl PLinkage {
    /// Clusters the points.
    ///
    /// # Errors
    /// [`SpatialError::NoCutoff`], or when the points cannot be indexed.
    pub fn cluster(&self, points: &Points) -> Result<Linkage, SpatialError> {
        if points.len() < 2 {
            return Ok(Linkage {
                labels: vec![0; points.len()],
                clusters: 0,
                cutoff: 0.0,
                median_density: 0.0,
            });
        }
        let index = Index::new(points)?;
        let cutoff = self.scale * median_nearest(&index, points.len());
        if cutoff <= 0.0 {
            return Err(SpatialError::NoCutoff { points: points.len() });
        }
        let density: Vec<f64> = (0..points.len()).map(|point| density(&index, point, cutoff)).collect();
        let median_density = median(density.clone());
        let roots = roots(&links(&index, &density, cutoff), &density);
        let mut names: Vec<Option<u32>> =
            roots.iter().map(|&root| (density[root as usize] > median_density).then_some(root)).collect();
        if self.merge {
            merge(&index, &density, cutoff, &mut names);
        }
        let (labels, clusters) = labels::number(&names, &(1..=u64::MAX));
        Ok(Linkage { labels, clusters, cutoff, median_density })
    }
}

/// Median over all points of the distance to the nearest other point.
fn median_nearest(index: &Index<'_>, len: usize) -> f64 {
    let two = NonZero::<usize>::MIN.saturating_add(1);
    let mut distances = Vec::new();
    let nearest = |point: usize| {
        index.nearest(point, two, &mut distances);
        distances.first().copied().unwrap_or(0.0)
    };
    median((0..len).map(nearest).collect())
}

/// The middle value, or the mean of the two middle ones.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let low = (values.len() - 1) / 2;
    let high = values.len() / 2;
    f64::midpoint(values[low], values[high])
}

/// Density of a point, equation 2.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "terms are 0 to 1 times 2^48")]
fn density(index: &Index<'_>, point: usize, cutoff: f64) -> f64 {
    let reach = cutoff * (-SMALLEST_TERM.ln()).sqrt();
    let unit = f64::from(DENSITY_BITS).exp2();
    let mut sum = 0_u128;
    index.within(point, reach, |other, squared| {
        if other != point {
            sum += u128::from(((-squared / (cutoff * cutoff)).exp() * unit).round() as u64);
        }
    });
    sum as f64 / unit
}

/// The closest denser point within the cut-off distance (exclusive) of every point. Ties go to the smaller
/// row.
fn links(index: &Index<'_>, density: &[f64], cutoff: f64) -> Vec<Option<u32>> {
    let denser = |other: usize, point: usize| {
        density[other].total_cmp(&density[point]).then(point.cmp(&other)).is_gt()
    };
    let link = |point: usize| {
        let mut closest: Option<(f64, usize)> = None;
        index.within(point, cutoff, |other, squared| {
            let near = squared < cutoff * cutoff && closest.is_none_or(|best| (squared, other) < best);
            if near && denser(other, point) {
                closest = Some((squared, other));
            }
        });
        closest.map(|(_, other)| as_u32(other))
    };
    (0..density.len()).map(link).collect()
}

/// The local maximum to which the links of every point lead.
fn roots(links: &[Option<u32>], density: &[f64]) -> Vec<u32> {
    let mut order: Vec<usize> = (0..links.len()).collect();
    order.sort_by(|&a, &b| density[b].total_cmp(&density[a]).then(a.cmp(&b)));
    let mut roots = vec![0; links.len()];
    for point in order {
        roots[point] = links[point].map_or(as_u32(point), |parent| roots[parent as usize]);
    }
    roots
}

/// Mean and population standard deviation.
fn mean_and_deviation(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let count = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / count;
    let variance = values.map(|value| (value - mean).powi(2)).sum::<f64>() / count;
    (mean, variance.sqrt())
}

/// Merges two clusters if the border of each is about as dense as the other cluster, equation 3.
fn merge(index: &Index<'_>, density: &[f64], cutoff: f64, names: &mut [Option<u32>]) {
    let mut members: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    // Points of the first cluster with a point of the second within the cut-off distance.
    let mut borders: BTreeMap<(u32, u32), Vec<usize>> = BTreeMap::new();
    for (point, name) in names.iter().enumerate() {
        let Some(name) = *name else { continue };
        members.entry(name).or_default().push(point);
        let mut beside = Vec::new();
        index.within(point, cutoff, |other, squared| {
            if let Some(other) = names[other].filter(|&other| other != name && squared < cutoff * cutoff) {
                beside.push(other);
            }
        });
        beside.sort_unstable();
        beside.dedup();
        beside.into_iter().for_each(|other| borders.entry((name, other)).or_default().push(point));
    }
    let statistics: BTreeMap<u32, (f64, f64)> = members
        .iter()
        .map(|(&name, points)| (name, mean_and_deviation(points.iter().map(|&point| density[point]))))
        .collect();
    let like = |from: &[usize], other: u32| {
        let (border, _) = mean_and_deviation(from.iter().map(|&point| density[point]));
        statistics.get(&other).is_some_and(|(mean, deviation)| border > mean - deviation)
    };
    let mut sets = DisjointSets::new(as_u32(names.len()));
    for (&(one, other), border) in borders.iter().filter(|((one, other), _)| one < other) {
        // "Within" is mutual, so the other cluster has a border, too.
        if like(border, other) && borders.get(&(other, one)).is_some_and(|border| like(border, one)) {
            sets.union(one, other);
        }
    }
    names.iter_mut().flatten().for_each(|name| *name = sets.find(*name));
}

#[expect(clippy::cast_possible_truncation, reason = "Points has at most 2^32 - 1 points")]
fn as_u32(point: usize) -> u32 {
    point as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cluster(places: &[f64], scale: f64) -> Linkage {
        let points = Points::new(2, places.iter().flat_map(|&x| [x, 0.0]).collect()).unwrap();
        PLinkage { scale, merge: false }.cluster(&points).unwrap()
    }

    #[test]
    fn points_climb_to_the_densest_point_within_the_cutoff() {
        // Nearest neighbours are at a distance of 1, except for the last point: the cut-off is 1.5. The
        // density is 2 exp(-4 / 9) = 1.28 in the middle of a group of three and 0.81 at its sides, which is
        // the median. Point 20 is its own root and less dense.
        let found = cluster(&[0.0, 1.0, 2.0, 9.0, 10.0, 11.0, 20.0], 1.5);
        assert!((found.cutoff - 1.5).abs() < 1e-12, "{}", found.cutoff);
        assert!((found.median_density - 0.810_19).abs() < 1e-4, "{}", found.median_density);
        assert_eq!((found.labels, found.clusters), (vec![1, 1, 1, 2, 2, 2, 0], 2));
    }

    #[test]
    fn medians_are_of_the_middle() {
        let close = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(close(median(vec![3.0, 1.0, 2.0]), 2.0) && close(median(vec![4.0, 1.0, 3.0, 2.0]), 2.5));
        let (mean, deviation) = mean_and_deviation([1.0, 3.0].into_iter());
        assert!(close(mean, 2.0) && close(deviation, 1.0));
    }

    #[test]
    fn repeated_points_are_one_cluster_and_too_many_of_them_an_error() {
        let found = cluster(&[0.0, 0.0, 1.0, 2.0, 8.0], 1.2);
        assert_eq!(found.labels[0], found.labels[1]);
        let points = Points::new(2, vec![0.0; 12]).unwrap();
        assert_eq!(PLinkage::default().cluster(&points), Err(SpatialError::NoCutoff { points: 6 }));
        assert_eq!(
            PLinkage::default().cluster(&Points::new(2, vec![1.0, 2.0]).unwrap()).unwrap().labels,
            [0]
        );
    }
}

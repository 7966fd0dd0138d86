//! `dbscan` in n dimensions, both variants, and the curve for the estimate of epsilon.
//!
//! Source: Wang et al. 2019 (see `dbscan`), algorithm 1 (`size`: single link at epsilon, clusters are kept by
//! their size), and Ester et al. 1996 (`core`). Ours: a border point goes to the cluster of its nearest core
//! point. Of equally near core points, the one with the smaller values counts, compared column by column. So
//! the order of the rows does not matter.

use rayon::prelude::*;
use serde::Serialize;

use super::settings::DbscanVariant;
use crate::cluster::dbscan::epsilon::{Curve, CurveSums};
use crate::cluster::linking::numbering as labels;
use crate::model::PointId;
use crate::spatial::DisjointSets;
use crate::spatial::Index;
use crate::spatial::Neighbours;
use crate::spatial::{Points, SpatialError};

/// Number of leaves that a thread processes at a time: a few thousand points.
const LEAVES_AT_ONCE: usize = 256;

/// Settings of `dbscan`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Dbscan {
    /// The variant.
    pub variant: DbscanVariant,
    /// Radius of a neighbourhood, inclusive, in the unit of the points.
    pub epsilon: f64,
    /// `size`: points of the smallest cluster. `core`: points in the neighbourhood of a core point, itself
    /// included.
    pub min_points: u64,
    /// Points of the largest cluster; larger ones are noise. 0: no limit.
    pub max_points: u64,
}

impl Dbscan {
    /// Labels every point (0 for noise) and returns the number of clusters.
    ///
    /// Cost: one query of radius epsilon per point (`core`: three); memory does not grow with epsilon.
    ///
    /// # Errors
    /// [`SpatialError`] when the points cannot be indexed.
    pub fn cluster(&self, points: &Points) -> Result<(Vec<u32>, u32), SpatialError> {
        let largest = if self.max_points == 0 { u64::MAX } else { self.max_points };
        let names = self.names(points, &vec![true; points.len()])?;
        Ok(match self.variant {
            DbscanVariant::Size => labels::number(&names, &(self.min_points..=largest)),
            DbscanVariant::Core => labels::number(&names, &(1..=largest)),
        })
    }

    /// The same for a part of the points, which is read with its surroundings. Sets of any size are kept, and
    /// border points get a label only if they are `own`. `ids` order the labels.
    ///
    /// # Errors
    /// [`SpatialError`] when the points cannot be indexed.
    pub(crate) fn connected_sets(
        &self,
        points: &Points,
        own: &[bool],
        ids: &[PointId],
    ) -> Result<(Vec<u32>, u32), SpatialError> {
        let names = self.names(points, own)?;
        Ok(labels::number_by_id(&names, ids))
    }

    fn names(&self, points: &Points, own: &[bool]) -> Result<Vec<Option<u32>>, SpatialError> {
        let index = Index::new(points)?;
        Ok(match self.variant {
            DbscanVariant::Size => self.connected(&index, &vec![true; points.len()]),
            DbscanVariant::Core => {
                let core = self.core_points(&index, points.len());
                let mut names = self.connected(&index, &core);
                self.adopt_border((points, &index), &core, own, &mut names);
                names
            }
        })
    }

    /// Which points have `min_points` within epsilon.
    fn core_points(&self, index: &Index<'_>, len: usize) -> Vec<bool> {
        let is_core = |point: usize| {
            let mut count = 0_u64;
            index.within(point, self.epsilon, |_, _| count += 1);
            count >= self.min_points
        };
        (0..len).map(is_core).collect()
    }

    /// Names of the connected sets of the points in `members`.
    fn connected(&self, index: &Index<'_>, members: &[bool]) -> Vec<Option<u32>> {
        let mut sets = DisjointSets::new(as_u32(members.len()));
        for point in (0..members.len()).filter(|&point| members[point]) {
            index.within(point, self.epsilon, |other, _| {
                if other < point && members[other] {
                    sets.union(as_u32(other), as_u32(point));
                }
            });
        }
        (0..members.len()).map(|point| members[point].then(|| sets.find(as_u32(point)))).collect()
    }

    /// Gives the border points that are `own` the name of their nearest core point. Core points in one place
    /// have one name.
    fn adopt_border(
        &self,
        (points, index): (&Points, &Index<'_>),
        core: &[bool],
        own: &[bool],
        names: &mut [Option<u32>],
    ) {
        for point in (0..core.len()).filter(|&point| !core[point] && own[point]) {
            let mut nearest: Option<(f64, &[f64], usize)> = None;
            index.within(point, self.epsilon, |other, squared| {
                let candidate = (squared, points.row(other), other);
                if core[other] && nearest.is_none_or(|best| candidate < best) {
                    nearest = Some(candidate);
                }
            });
            names[point] = nearest.and_then(|(_, _, other)| names[other]);
        }
    }
}

/// Mean distance to the 2nd to `k`-th nearest neighbours over all points. `k` is limited to the number of
/// points.
///
/// # Errors
/// [`SpatialError`] when the points cannot be indexed.
pub fn neighbour_curve(points: &Points, k: usize) -> Result<Curve, SpatialError> {
    let k = k.min(points.len());
    let population = points.len() as u64;
    let none = CurveSums::new(k, points.diagonal());
    if k == 0 {
        return Ok(none.curve(population));
    }
    let neighbours = Neighbours::new(points)?;
    let part = |leaves: &[u32]| {
        let mut sums = none.clone();
        neighbours.each_nearest(leaves, k, &|_| true, &mut |_, squared| {
            sums.add(squared[1..].iter().map(|&bits| f64::from_bits(bits).sqrt()));
        });
        sums
    };
    let add = |mut sums: CurveSums, more: CurveSums| {
        sums.merge(&more);
        sums
    };
    let sums = neighbours.leaves().par_chunks(LEAVES_AT_ONCE).map(part).reduce(|| none.clone(), add);
    Ok(sums.curve(population))
}

#[expect(clippy::cast_possible_truncation, reason = "Points has at most 2^32 - 1 points")]
fn as_u32(point: usize) -> u32 {
    point as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points on a line in the plane.
    fn line(places: &[f64]) -> Points {
        Points::new(2, places.iter().flat_map(|&x| [x, 3.0]).collect()).unwrap()
    }

    fn cluster(variant: DbscanVariant, min_points: u64, max_points: u64, points: &Points) -> Vec<u32> {
        Dbscan { variant, epsilon: 1.0, min_points, max_points }.cluster(points).unwrap().0
    }

    #[test]
    fn size_is_single_link_with_sizes_in_range() {
        let points = line(&[0.0, 1.0, 2.0, 3.5, 4.5, 9.0]);
        assert_eq!(cluster(DbscanVariant::Size, 1, 0, &points), [1, 1, 1, 2, 2, 3]);
        assert_eq!(cluster(DbscanVariant::Size, 2, 2, &points), [0, 0, 0, 1, 1, 0]);
    }

    #[test]
    fn border_points_go_to_the_nearest_core_point_and_ties_to_the_smaller_place() {
        // Core points have 4 points within 1: 0.0 and 0.5 of the left group, 2.0 and 2.5 of the right one.
        // 1.0 is a border point of both groups: core points 0.5 (0.5 away) and 2.0 (1.0 away). 1.25 is 0.75
        // from both 0.5 and 2.0.
        let left = [-0.5, 0.0, 0.5, 0.2];
        let right = [2.0, 2.3, 2.5, 3.0];
        let places: Vec<f64> = right.iter().chain(&left).copied().chain([1.25]).collect();
        let labels = cluster(DbscanVariant::Core, 4, 0, &line(&places));
        assert_eq!(labels, [1, 1, 1, 1, 2, 2, 2, 2, 2]);
        let swapped: Vec<f64> = left.iter().chain(&right).copied().chain([1.25]).collect();
        assert_eq!(cluster(DbscanVariant::Core, 4, 0, &line(&swapped)), [1, 1, 1, 1, 2, 2, 2, 2, 1]);
    }

    #[test]
    fn core_points_without_company_are_noise() {
        assert_eq!(cluster(DbscanVariant::Core, 3, 0, &line(&[0.0, 1.0, 5.0, 6.0, 7.0])), [0, 0, 1, 1, 1]);
        assert_eq!(cluster(DbscanVariant::Core, 3, 2, &line(&[5.0, 6.0, 7.0])), [0, 0, 0]);
    }

    #[test]
    fn the_curve_is_the_mean_distance_to_each_neighbour() {
        // Points 0, 1 and 3: their 2nd neighbours are at 1, 1 and 2, their 3rd at 3, 2 and 3.
        let curve = neighbour_curve(&line(&[0.0, 1.0, 3.0]), 40).unwrap();
        assert_eq!((curve.k(), curve.queries), (3, 3));
        assert!((curve.mean[0] - 4.0 / 3.0).abs() < 1e-9 && (curve.mean[1] - 8.0 / 3.0).abs() < 1e-9);
    }
}

//! Neighbours in n dimensions. Only this file uses the kd-tree crate for them.
//!
//! The tree finds candidates, and [`Points`] decides. Distances are recomputed in one fixed order, so that
//! the arithmetic of the tree (vector instructions, fused additions) never affects a result.

use std::num::NonZero;

use kiddo::{ImmutableKdTree, SquaredEuclidean};

use crate::spatial::{Points, SpatialError};

/// Slack of squared radii: candidates are searched slightly beyond the radius of the decision.
const SLACK: f64 = 1.0 + 1e-12;

/// The queries that methods make to a tree of any dimension.
trait AnyTree {
    /// Calls `visit` for every candidate within a squared distance of about `limit` (> 0) of a point.
    fn candidates(&self, point: usize, limit: f64, visit: &mut dyn FnMut(usize));
    /// Puts the `count` points nearest to a point, itself included, into `found`. Their order is not defined.
    fn nearest(&self, point: usize, count: NonZero<usize>, found: &mut Vec<usize>);
}

struct Tree<const D: usize> {
    tree: ImmutableKdTree<f64, D>,
    rows: Vec<[f64; D]>,
}

impl<const D: usize> AnyTree for Tree<D> {
    fn candidates(&self, point: usize, limit: f64, visit: &mut dyn FnMut(usize)) {
        let query = self.tree.query(&self.rows[point]);
        query.within::<SquaredEuclidean<f64>>(limit).unsorted().visit(|found| visit(found.item as usize));
    }

    fn nearest(&self, point: usize, count: NonZero<usize>, found: &mut Vec<usize>) {
        let query = self.tree.query(&self.rows[point]);
        let items = query.nearest_n::<SquaredEuclidean<f64>>(count).execute();
        found.clear();
        found.extend(items.iter().map(|item| item.item as usize));
    }
}

fn tree<const D: usize>(points: &Points) -> Result<Box<dyn AnyTree>, SpatialError> {
    let row = |row: &[f64]| std::array::from_fn(|axis| row[axis]);
    let rows: Vec<[f64; D]> = points.rows().map(row).collect();
    // Fails only if u32 cannot count the points, but `Points` does not accept that many.
    let tree = ImmutableKdTree::new_from_slice(&rows)
        .map_err(|_| SpatialError::TooManyPoints { points: points.len() })?;
    Ok(Box::new(Tree { tree, rows }))
}

/// Points, indexed for their neighbours.
pub(crate) struct Index<'a> {
    points: &'a Points,
    tree: Box<dyn AnyTree>,
}

impl<'a> Index<'a> {
    pub(crate) fn new(points: &'a Points) -> Result<Self, SpatialError> {
        let tree = match points.dimensions() {
            2 => tree::<2>(points),
            3 => tree::<3>(points),
            4 => tree::<4>(points),
            5 => tree::<5>(points),
            6 => tree::<6>(points),
            7 => tree::<7>(points),
            8 => tree::<8>(points),
            dimensions => Err(SpatialError::Dimensions { dimensions }),
        }?;
        Ok(Self { points, tree })
    }

    /// Calls `visit` with every point within `radius` of `point` (inclusive, and itself) and with the squared
    /// distance. The order is not defined.
    pub(crate) fn within(&self, point: usize, radius: f64, mut visit: impl FnMut(usize, f64)) {
        let limit = radius * radius;
        self.tree.candidates(point, limit * SLACK + f64::MIN_POSITIVE, &mut |other| {
            let squared = self.points.distance_squared(point, other);
            if squared <= limit {
                visit(other, squared);
            }
        });
    }

    /// Distances from `point` to its 2nd to `k`-th nearest points, ascending. The first is the point itself.
    pub(crate) fn nearest(&self, point: usize, k: NonZero<usize>, distances: &mut Vec<f64>) {
        let mut found = Vec::with_capacity(k.get());
        self.tree.nearest(point, k, &mut found);
        distances.clear();
        distances.extend(found.iter().map(|&other| self.points.distance_squared(point, other).sqrt()));
        distances.sort_unstable_by(f64::total_cmp);
        // The point itself or an equal one: 0 in both cases.
        distances.remove(0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::Numbers;

    /// A fixed pseudo-random cloud with repeated points.
    fn cloud(dimensions: usize, count: usize) -> Points {
        let mut numbers = Numbers::new(1);
        let mut next = || f64::from(u32::try_from(numbers.below(40)).unwrap()) / 4.0;
        Points::new(dimensions, (0..count * dimensions).map(|_| next()).collect()).unwrap()
    }

    #[test]
    fn neighbours_are_those_of_brute_force_in_every_dimension() {
        for dimensions in DIMENSIONS_TESTED {
            let points = cloud(dimensions, 300);
            let index = Index::new(&points).unwrap();
            for point in (0..300).step_by(7) {
                let all: Vec<f64> = (0..300).map(|other| points.distance_squared(point, other)).collect();
                for radius in [0.0, 0.25, 5.0, 8.0] {
                    let mut found = Vec::new();
                    index.within(point, radius, |other, squared| found.push((other, squared)));
                    found.sort_unstable_by_key(|entry| entry.0);
                    let expected: Vec<(usize, f64)> = (0..300)
                        .map(|other| (other, all[other]))
                        .filter(|e| e.1 <= radius * radius)
                        .collect();
                    assert_eq!(found, expected, "{dimensions} {point} {radius}");
                }
                let mut sorted: Vec<f64> = all.iter().map(|squared| squared.sqrt()).collect();
                sorted.sort_unstable_by(f64::total_cmp);
                let mut distances = Vec::new();
                index.nearest(point, NonZero::new(41).unwrap(), &mut distances);
                assert_eq!(distances, sorted[1..41], "{dimensions} {point}");
            }
        }
    }

    const DIMENSIONS_TESTED: std::ops::RangeInclusive<usize> = crate::spatial::DIMENSIONS;

    #[test]
    fn ten_thousand_equal_points_are_indexed() {
        let points = Points::new(3, vec![1.5; 30_000]).unwrap();
        let mut count = 0;
        Index::new(&points).unwrap().within(17, 0.0, |_, _| count += 1);
        assert_eq!(count, 10_000);
    }
}

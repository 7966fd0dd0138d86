//! The mean distance to the k-th nearest neighbour, from sums that do not depend on the order of the points.
//!
//! Distances are rounded to multiples of a *quantum* (a power of two) and summed as integers. The sums are
//! exact, so tiles, threads and the order of records do not change them. The quantum is at least 2^-40 of the
//! largest distance, and less than 2^-39. Therefore the error of a mean is at most 1e-12 of that distance,
//! and sums of squares have room for 2^48 points.

use serde::{Deserialize, Serialize};

/// Bits of a distance: a quantum is at least the largest distance divided by 2^40.
const DISTANCE_BITS: i32 = 40;

/// Sums of distances to the k-th nearest neighbours, mergeable in any order.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct CurveSums {
    /// Exponent of the quantum: 2^exponent.
    exponent: i32,
    queries: u64,
    /// For k = 2, 3, ...: sum of the distances, and of their squares, in quanta.
    sums: Vec<[u128; 2]>,
}

impl CurveSums {
    /// Empty sums for k = 2 to `k`. No distance may be larger than `largest_distance`.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "a binary exponent of a float")]
    pub fn new(k: usize, largest_distance: f64) -> Self {
        let exponent = if largest_distance > 0.0 { largest_distance.log2().ceil() as i32 } else { 0 };
        Self { exponent: exponent - DISTANCE_BITS, queries: 0, sums: vec![[0; 2]; k.saturating_sub(1)] }
    }

    /// Number of neighbours per point, the point itself included.
    #[must_use]
    pub fn k(&self) -> usize {
        self.sums.len() + 1
    }

    /// Adds a point: its distances to its neighbours 2, 3, ..., K in ascending order.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "distances are not negative, and at most 2^40 quanta"
    )]
    pub fn add(&mut self, distances: impl IntoIterator<Item = f64>) {
        let per_quantum = f64::from(-self.exponent).exp2();
        self.queries += 1;
        for (sum, distance) in self.sums.iter_mut().zip(distances) {
            // Rounds half up by truncation, because `round` is a function call on old processors.
            let quanta = (distance * per_quantum + 0.5) as u64;
            sum[0] += u128::from(quanta);
            sum[1] += u128::from(quanta) * u128::from(quanta);
        }
    }

    /// Adds the points of sums with the same quantum and the same K.
    pub fn merge(&mut self, other: &Self) {
        debug_assert_eq!((self.exponent, self.k()), (other.exponent, other.k()));
        self.queries += other.queries;
        for (sum, more) in self.sums.iter_mut().zip(&other.sums) {
            sum[0] += more[0];
            sum[1] += more[1];
        }
    }

    /// The means. `population` is the number of points from which the queries were drawn without replacement.
    #[must_use]
    pub fn curve(&self, population: u64) -> Curve {
        let quantum = f64::from(self.exponent).exp2();
        let queries = self.queries.max(1) as f64;
        let unseen = 1.0 - queries.min(population.max(1) as f64) / population.max(1) as f64;
        let mean = |sum: &[u128; 2]| sum[0] as f64 / queries * quantum;
        let error = |sum: &[u128; 2]| {
            if self.queries < 2 {
                return 0.0;
            }
            // Sample variance of the distances over the queries, with the correction for a finite population.
            let mean = sum[0] as f64 / queries;
            let variance = (sum[1] as f64 / queries - mean * mean).max(0.0) * queries / (queries - 1.0);
            (variance / queries * unseen).sqrt() * quantum
        };
        Curve {
            queries: self.queries,
            population,
            mean: self.sums.iter().map(mean).collect(),
            standard_error: self.sums.iter().map(error).collect(),
        }
    }
}

/// Mean distance to the k-th nearest neighbour for k = 2, 3, ..., K; the point itself is k = 1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    /// Number of points whose neighbours were searched.
    pub queries: u64,
    /// Number of points from which they were drawn.
    pub population: u64,
    /// D_2, D_3, ..., D_K in the unit of the distances.
    pub mean: Vec<f64>,
    /// Standard error of each mean; 0 if every point was queried.
    pub standard_error: Vec<f64>,
}

impl Curve {
    /// K, the last k of the curve.
    #[must_use]
    pub fn k(&self) -> usize {
        self.mean.len() + 1
    }

    /// Standard error at a real k, by linear interpolation.
    pub(super) fn standard_error_at(&self, k: f64) -> f64 {
        let at = |index: usize| self.standard_error.get(index).copied().unwrap_or(0.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "2 <= k <= 200")]
        let below = (k.floor() as usize).saturating_sub(2);
        let share = k - k.floor();
        at(below) * (1.0 - share) + at((below + 1).min(self.standard_error.len().saturating_sub(1))) * share
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_and_standard_errors_are_those_worked_by_hand() {
        let mut sums = CurveSums::new(3, 8.0);
        sums.add([1.0, 2.0]);
        sums.add([3.0, 8.0]);
        let whole = sums.curve(2);
        assert_eq!((whole.k(), &whole.mean[..]), (3, &[2.0, 5.0][..]));
        assert_eq!(whole.standard_error, [0.0, 0.0]);
        // The variance is 2 over two queries, and half of the population was not queried: sqrt(2 / 2 / 2).
        let half = sums.curve(4);
        assert!((half.standard_error[0] - 0.5_f64.sqrt()).abs() < 1e-12, "{half:?}");
        assert!((half.standard_error_at(2.5) - (0.5_f64.sqrt() + 4.5_f64.sqrt()) / 2.0).abs() < 1e-12);
    }

    #[test]
    fn the_order_of_points_and_parts_changes_nothing() {
        let distances: Vec<[f64; 2]> = (1..400).map(|i| [0.1 / f64::from(i), f64::from(i).sqrt()]).collect();
        let mut forward = CurveSums::new(3, 20.0);
        distances.iter().for_each(|list| forward.add(*list));
        let mut parts = [CurveSums::new(3, 20.0), CurveSums::new(3, 20.0)];
        for (index, list) in distances.iter().enumerate().rev() {
            parts[index % 2].add(*list);
        }
        let [mut merged, other] = parts;
        merged.merge(&other);
        assert_eq!(merged, forward);
    }
}

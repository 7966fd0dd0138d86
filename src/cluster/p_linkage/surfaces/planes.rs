//! Planes through points by principal components (equations 4 and 5), and the points that are consistent with a
//! plane (equations 6 and 7). Sums of coordinates are exact integers, so their order does not matter.

use serde::{Deserialize, Serialize};

use crate::cluster::eigen::eigen_within;

/// Factor of the median absolute deviation (equation 6): for normal deviations it is their standard deviation.
const MAD_FACTOR: f64 = 1.4826;
/// Points with a robust score below this are consistent (equation 7).
const LARGEST_SCORE: f64 = 2.5;
/// Off-diagonal entries relative to the trace below which a matrix is diagonal. Normals are compared by the cosine of
/// their angle, which has half of the digits of the angle.
const DIAGONAL: f64 = 1e-12;
/// Points are on one line if the middle eigenvalue is at most this times the largest.
const LINE: f64 = 1e-9;

/// Sums over points, counted from any one place: number, coordinates, and products xx, xy, xz, yy, yz, zz.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(super) struct Moments {
    pub(super) points: u64,
    pub(super) sums: [i128; 3],
    pub(super) products: [i128; 6],
}

/// A plane that fits points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fit {
    /// Unit normal, v0.
    pub(super) normal: [f64; 3],
    /// Smallest eigenvalue, lambda0: the mean squared distance from the plane in square lattice units. Never negative.
    pub(super) flatness: f64,
    /// Mean of the points, counted from the place of the moments.
    pub(super) mean: [f64; 3],
}

impl Moments {
    /// The moments of points that are not many and not far away: coordinates are below 2^20, and the points at most 2^20.
    #[inline]
    pub(super) fn of_near(points: impl Iterator<Item = [i32; 3]>) -> Self {
        let mut count = 0;
        let mut sums = [0_i64; 3];
        let mut products = [0_i64; 6];
        for point in points {
            let [x, y, z] = point.map(i64::from);
            count += 1;
            sums = [sums[0] + x, sums[1] + y, sums[2] + z];
            let of_point = [x * x, x * y, x * z, y * y, y * z, z * z];
            products.iter_mut().zip(of_point).for_each(|(sum, product)| *sum += product);
        }
        Self { points: count, sums: sums.map(i128::from), products: products.map(i128::from) }
    }

    /// Adds a point.
    pub(super) fn add(&mut self, point: [i64; 3]) {
        let [x, y, z] = point.map(i128::from);
        self.points += 1;
        self.sums = [self.sums[0] + x, self.sums[1] + y, self.sums[2] + z];
        let of_point = [x * x, x * y, x * z, y * y, y * z, z * z];
        self.products.iter_mut().zip(of_point).for_each(|(sum, product)| *sum += product);
    }

    /// Adds other points, counted from the same place.
    pub(super) fn merge(&mut self, other: &Self) {
        self.points += other.points;
        self.sums.iter_mut().zip(other.sums).for_each(|(sum, other)| *sum += other);
        self.products.iter_mut().zip(other.products).for_each(|(sum, other)| *sum += other);
    }

    /// The plane that fits the points best. `None` if they are fewer than 3, in one place or on one line.
    pub(super) fn fit(&self) -> Option<Fit> {
        if self.points < 3 {
            return None;
        }
        let points = i128::from(self.points);
        let squared = self.points as f64 * self.points as f64;
        let covariance = |product: usize, a: usize, b: usize| {
            (points * self.products[product] - self.sums[a] * self.sums[b]) as f64 / squared
        };
        let [(large, _), (middle, _), (small, normal)] = eigen_within(
            DIAGONAL,
            [
                covariance(0, 0, 0),
                covariance(1, 0, 1),
                covariance(2, 0, 2),
                covariance(3, 1, 1),
                covariance(4, 1, 2),
                covariance(5, 2, 2),
            ],
        );
        let mean = self.sums.map(|sum| sum as f64 / self.points as f64);
        (middle > LINE * large).then_some(Fit { normal, flatness: small.max(0.0), mean })
    }
}

impl Fit {
    /// Distance of a point from the plane, both counted from the place of the moments.
    #[inline]
    pub(super) fn distance(&self, [x, y, z]: [f64; 3]) -> f64 {
        let [a, b, c] = self.normal;
        ((a * x + b * y + c * z) - self.through()).abs()
    }

    /// Position along the normal, from the place of the moments.
    #[inline]
    pub(super) fn through(&self) -> f64 {
        let [a, b, c] = self.normal;
        a * self.mean[0] + b * self.mean[1] + c * self.mean[2]
    }
}

/// The distances of consistent points: robust scores below 2.5 (equation 7).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Consistent {
    median: f64,
    /// Deviations from the median must be below this. `None` if the median deviation is 0: then all are consistent.
    below: Option<f64>,
}

impl Consistent {
    /// From the distances of all points. `scratch` is overwritten.
    pub(super) fn of(distances: &[f64], scratch: &mut Vec<u64>) -> Self {
        let mid = |values: &mut Vec<u64>| {
            if values.is_empty() {
                return 0.0;
            }
            // The bits of numbers that are not negative are ordered like the numbers.
            let high = values.len() / 2;
            let (lower, upper, _) = values.select_nth_unstable(high);
            let upper = f64::from_bits(*upper);
            match lower.iter().max() {
                Some(low) if distances.len().is_multiple_of(2) => f64::midpoint(f64::from_bits(*low), upper),
                _ => upper,
            }
        };
        scratch.clear();
        scratch.extend(distances.iter().map(|distance| distance.to_bits()));
        let median = mid(scratch);
        scratch.clear();
        scratch.extend(distances.iter().map(|distance| (distance - median).abs().to_bits()));
        let mad = MAD_FACTOR * mid(scratch);
        Self { median, below: (mad > 0.0).then_some(LARGEST_SCORE * mad) }
    }

    /// Whether a point at this distance is consistent.
    #[inline]
    pub(super) fn holds(&self, distance: f64) -> bool {
        self.below.is_none_or(|below| (distance - self.median).abs() < below)
    }
}

/// Amount of the product of two unit normals: the cosine of the angle between their planes.
#[inline]
pub(super) fn likeness(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]).abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moments(points: &[[i64; 3]]) -> Moments {
        let mut moments = Moments::default();
        points.iter().for_each(|point| moments.add(*point));
        moments
    }

    #[test]
    fn planes_have_the_normal_and_the_variance_of_their_points() {
        // x + y = const, with a deviation of 2 along (1, 1, 0) / sqrt 2 to both sides, times sqrt 2.
        let points: Vec<[i64; 3]> = (0..400)
            .map(|k| (k % 20 * 10, k / 20 * 10, if (k % 20 + k / 20) % 2 == 0 { 2 } else { -2 }))
            .map(|(along, up, off)| [along + off, off - along, up])
            .collect();
        let fit = moments(&points).fit().unwrap();
        let expected = 0.5_f64.sqrt();
        assert!((likeness(fit.normal, [expected, expected, 0.0]) - 1.0).abs() < 1e-9, "{fit:?}");
        assert!((fit.flatness - 8.0).abs() < 1e-6, "{fit:?}");
        let near: Vec<[i32; 3]> =
            points.iter().take(200).map(|p| p.map(|v| i32::try_from(v).unwrap())).collect();
        assert_eq!(Moments::of_near(near.into_iter()), moments(&points[..200]));
        let mut merged = moments(&points[..150]);
        merged.merge(&moments(&points[150..]));
        assert_eq!(merged, moments(&points));
    }

    #[test]
    fn a_line_and_a_place_have_no_plane() {
        assert_eq!(moments(&[[5, 5, 5]; 40]).fit(), None);
        let line: Vec<[i64; 3]> = (0..40).map(|k| [3 * k, -7 * k, k]).collect();
        assert_eq!(moments(&line).fit(), None);
        assert_eq!(moments(&line[..2]).fit(), None);
        let mut bent = line;
        bent.push([0, 0, 9]);
        assert!(moments(&bent).fit().is_some());
    }

    #[test]
    fn scores_are_those_of_the_paper() {
        // Median 3, deviations 2 1 0 1 97: their median is 1, and 2.5 * 1.4826 = 3.7065.
        let distances = [1.0, 2.0, 3.0, 4.0, 100.0];
        let found = Consistent::of(&distances, &mut Vec::new());
        assert_eq!(found.median.to_bits(), 3.0_f64.to_bits());
        assert!(found.holds(6.7) && !found.holds(6.8) && found.holds(1.0) && !found.holds(100.0));
        // Of four values the median is between the middle ones.
        let found = Consistent::of(&[1.0, 2.0, 4.0, 9.0], &mut Vec::new());
        assert_eq!(found.median.to_bits(), 3.0_f64.to_bits());
        // More than half of the distances are equal: all are consistent.
        let found = Consistent::of(&[0.0, 0.0, 0.0, 50.0], &mut Vec::new());
        assert!(found.holds(50.0));
        assert!(Consistent::of(&[], &mut Vec::new()).holds(1.0));
    }
}

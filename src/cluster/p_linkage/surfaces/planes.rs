//! Planes through points by principal components (equations 4 and 5), and the points that are consistent with
//! a plane (equations 6 and 7). Sums of coordinates are exact integers, so their order does not matter.

use serde::{Deserialize, Serialize};

use super::smallest::{Smallest, smallest};
use crate::spatial::{Columns, median};

/// Factor of the median absolute deviation (equation 6). For normally distributed deviations, the product is
/// their standard deviation.
const MAD_FACTOR: f64 = 1.4826;
/// Robust score below which points are consistent (equation 7).
pub(super) const LARGEST_SCORE: f64 = 2.5;
/// Squared distance within which the sum of 127 products of coordinates fits 31 bits.
const OF_SHORT: f32 = 16_777_216.0;
/// Largest ratio of the middle to the largest eigenvalue for points on one line.
const LINE: f64 = 1e-9;

/// Axes of the products of coordinates, in their order.
const AXES: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// Sums over points, relative to one common place: number, coordinates, and products xx, xy, xz, yy, yz, zz.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(super) struct Moments {
    pub(super) points: u64,
    pub(super) sums: [i128; 3],
    pub(super) products: [i128; 6],
}

/// A plane that is fitted to points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fit {
    /// Unit normal, v0.
    pub(super) normal: [f64; 3],
    /// Smallest eigenvalue, lambda0: the mean squared distance from the plane in square lattice units. Never
    /// negative.
    pub(super) flatness: f64,
    /// Mean of the points, relative to the place of the moments.
    pub(super) mean: [f64; 3],
}

impl Moments {
    /// The moments of at most 2^20 points with coordinates below 2^20.
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

    /// The same for the points at most `limit` away. Coordinates and distances are in whole rows; entries
    /// beyond the points are infinitely far away.
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "only so it has the instructions of the caller")]
    pub(super) fn of_rows([xs, ys, zs]: &[Vec<i32>; 3], distances: &[f32], limit: f32) -> Self {
        let mut count = 0_u64;
        let (mut sums, mut products) = ([0_i64; 3], [0_i64; 6]);
        for (((x, y), z), distance) in xs.iter().zip(ys).zip(zs).zip(distances) {
            // A point that is not near adds 0 instead of being skipped: a branch could not be predicted.
            let is_near = *distance <= limit;
            let mask = -i32::from(is_near);
            count += u64::from(is_near);
            let [x, y, z] = [x & mask, y & mask, z & mask].map(i64::from);
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

    /// Adds the moments of other points, relative to the same place.
    pub(super) fn merge(&mut self, other: &Self) {
        self.points += other.points;
        self.sums.iter_mut().zip(other.sums).for_each(|(sum, other)| *sum += other);
        self.products.iter_mut().zip(other.products).for_each(|(sum, other)| *sum += other);
    }

    /// The plane that fits the points best. `None` if there are fewer than 3 points, or if they are in one
    /// place or on one line.
    pub(super) fn fit(&self) -> Option<Fit> {
        if self.points < 3 {
            return None;
        }
        Fit::of_scaled(self.points as f64, self.sums.map(|sum| sum as f64), self.scaled())
    }
}

impl Moments {
    /// The covariances times the square of the number of points: integers, rounded once.
    fn scaled(&self) -> [f64; 6] {
        // No sum or product of sums is larger than this (Cauchy-Schwarz), so 64 bits mostly suffice.
        let largest = (self.products[0] + self.products[3] + self.products[5])
            .checked_mul(i128::from(self.points))
            .and_then(|largest| i64::try_from(largest).ok());
        #[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "checked above")]
        if largest.is_some() {
            let points = self.points as i64;
            let sums = self.sums.map(|sum| sum as i64);
            let products = self.products.map(|product| product as i64);
            return [0, 1, 2, 3, 4, 5]
                .map(|k| (points * products[k] - sums[AXES[k].0] * sums[AXES[k].1]) as f64);
        }
        let points = i128::from(self.points);
        [0, 1, 2, 3, 4, 5].map(|k| {
            let (a, b) = AXES[k];
            (points * self.products[k] - self.sums[a] * self.sums[b]) as f64
        })
    }

    /// Mean squared distance of the points from a plane. Both are relative to the same place.
    pub(super) fn off_plane(&self, plane: &Fit) -> f64 {
        let squared = self.points as f64 * self.points as f64;
        let spread = self.scaled().into_iter().zip(AXES).map(|(value, (a, b))| {
            let times = if a == b { 1.0 } else { 2.0 };
            times * plane.normal[a] * plane.normal[b] * value / squared
        });
        let mean = self.sums.map(|sum| sum as f64 / self.points as f64);
        spread.sum::<f64>().max(0.0) + plane.distance(mean).powi(2)
    }
}

impl Fit {
    /// The plane of the `count` neighbours of a point within `limit` (squared), relative to the point. Equals
    /// the result of [`Moments::fit`], because coordinates are below 2^16, so every sum is exact.
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "only so it has the instructions of the caller")]
    pub(super) fn of_nearest(near: &Columns, limit: f32, count: usize) -> Option<Self> {
        let [xs, ys, zs] = near.by();
        if near.limit() > OF_SHORT {
            let places = xs.iter().zip(ys).zip(zs).zip(near.squared());
            let places =
                places.filter(|(_, squared)| **squared <= limit).map(|(((x, y), z), _)| [*x, *y, *z]);
            return Moments::of_near(places).fit();
        }
        let (mut sums, mut products) = ([0_i32; 3], [0_i32; 6]);
        for (((x, y), z), squared) in xs.iter().zip(ys).zip(zs).zip(near.squared()) {
            // A point that is not near adds 0 instead of being skipped: a branch could not be predicted.
            let is_near = -i32::from(*squared <= limit);
            let [x, y, z] = [x & is_near, y & is_near, z & is_near];
            sums = [sums[0] + x, sums[1] + y, sums[2] + z];
            let of_point = [x * x, x * y, x * z, y * y, y * z, z * z];
            products.iter_mut().zip(of_point).for_each(|(sum, product)| *sum += product);
        }
        let ([x, y, z], [xx, xy, xz, yy, yz, zz]) = (sums.map(f64::from), products.map(f64::from));
        let points = count as f64;
        let scaled = [
            points * xx - x * x,
            points * xy - x * y,
            points * xz - x * z,
            points * yy - y * y,
            points * yz - y * z,
            points * zz - z * z,
        ];
        Self::of_scaled(points, [x, y, z], scaled)
    }

    /// The plane of some points, from their number, the sums of their coordinates, and their covariances
    /// times the square of their number.
    fn of_scaled(points: f64, sums: [f64; 3], scaled: [f64; 6]) -> Option<Self> {
        let squared = points * points;
        let covariances = scaled.map(|value| value / squared);
        let Smallest { values: [small, middle, large], vector: normal } = smallest(covariances);
        let mean = sums.map(|sum| sum / points);
        (middle > LINE * large).then_some(Self { normal, flatness: small.max(0.0), mean })
    }

    /// The distances of places, see [`Fit::rounded_distance`].
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "only so it has the instructions of the caller")]
    pub(super) fn rounded_distances(&self, [xs, ys, zs]: [&[i32]; 3], distances: &mut Vec<f32>) {
        distances.clear();
        let places = xs.iter().zip(ys).zip(zs).map(|((x, y), z)| [*x, *y, *z].map(f64::from));
        distances.extend(places.map(|place| self.rounded_distance(place)));
    }

    /// Distance of a point from the plane. Both are relative to the place of the moments.
    #[inline]
    pub(super) fn distance(&self, [x, y, z]: [f64; 3]) -> f64 {
        let [a, b, c] = self.normal;
        ((a * x + b * y + c * z) - self.through()).abs()
    }

    /// The distance in single precision.
    #[inline]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "distances are compared, for which its digits suffice"
    )]
    pub(super) fn rounded_distance(&self, at: [f64; 3]) -> f32 {
        self.distance(at) as f32
    }

    /// Position of the plane along its normal, from the place of the moments.
    #[inline]
    pub(super) fn through(&self) -> f64 {
        let [a, b, c] = self.normal;
        a * self.mean[0] + b * self.mean[1] + c * self.mean[2]
    }
}

/// The range of distances of consistent points, whose robust scores are below 2.5 (equation 7). Distances are
/// in single precision, because they are only compared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Consistent {
    median: f32,
    /// Upper bound (exclusive) of the deviation from the median. Infinite if the median deviation is 0: then
    /// all points are consistent.
    below: f32,
}

/// Buffers of [`Consistent::of`].
#[derive(Debug, Default)]
pub(super) struct Scratch {
    deviations: Vec<f32>,
    sorted: Vec<f32>,
}

impl Scratch {
    /// The deviations of distances from their median.
    pub(super) fn deviations(&self) -> &[f32] {
        &self.deviations
    }
}

impl Consistent {
    /// Computes the range from the distances of `len` points, in whole rows. `scratch` is overwritten.
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "only so it has the instructions of the caller")]
    #[expect(clippy::cast_possible_truncation, reason = "a factor in single precision")]
    pub(super) fn of(distances: &[f32], len: usize, scratch: &mut Scratch) -> Self {
        let middle = median(distances, len, &mut scratch.sorted);
        scratch.deviations.clear();
        scratch.deviations.extend(distances.iter().map(|distance| (distance - middle).abs()));
        let deviation = median(&scratch.deviations, len, &mut scratch.sorted);
        let below = (LARGEST_SCORE * MAD_FACTOR) as f32 * deviation;
        Self { median: middle, below: if deviation > 0.0 { below } else { f32::INFINITY } }
    }

    /// The largest deviation from the median of a consistent point.
    pub(super) fn largest_deviation(&self) -> f32 {
        self.below.next_down()
    }

    /// Whether a point at this distance is consistent.
    #[inline]
    pub(super) fn holds(&self, distance: f32) -> bool {
        (distance - self.median).abs() < self.below
    }
}

/// Absolute value of the product of two unit normals: the cosine of the angle between their planes.
#[inline]
pub(super) fn likeness(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]).abs()
}

/// Squared distance of two places.
#[inline]
pub(super) fn squared_distance(a: [i32; 3], b: [i32; 3]) -> u64 {
    (0..3).map(|axis| u64::from(a[axis].abs_diff(b[axis])).pow(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spatial::{KNearest, NO_POINT, fill_up};

    fn moments(points: &[[i64; 3]]) -> Moments {
        let mut moments = Moments::default();
        points.iter().for_each(|point| moments.add(*point));
        moments
    }

    #[test]
    fn planes_have_the_normal_and_the_variance_of_their_points() {
        // Points off the plane x + y = 0 by 2 sqrt(2) to both sides.
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
        assert_eq!(Moments::of_near(near.iter().copied()), moments(&points[..200]));
        let axes = [0, 1, 2].map(|axis| near.iter().map(|place| place[axis]).collect::<Vec<i32>>());
        let apart: Vec<f32> = (0..near.len()).map(|at| (at % 7) as f32).collect();
        let nearest: Vec<[i64; 3]> = (0..200).filter(|at| at % 7 <= 3).map(|at| points[at]).collect();
        assert_eq!(Moments::of_rows(&axes, &apart, 3.0), moments(&nearest));
        let mut merged = moments(&points[..150]);
        merged.merge(&moments(&points[150..]));
        assert_eq!(merged, moments(&points));
    }

    #[test]
    fn the_distance_of_points_from_a_plane_is_that_of_each_of_them() {
        let floor: Vec<[i64; 3]> = (0..400).map(|k| [k % 20 * 10, k / 20 * 10, k % 2]).collect();
        let plane = moments(&floor).fit().unwrap();
        let other: Vec<[i64; 3]> =
            (0..300).map(|k| [500 + k % 17 * 9, k / 17 * 11, 40 + k % 17 * 3 + k % 5]).collect();
        let squares = other.iter().map(|point| plane.distance(point.map(|value| value as f64)).powi(2));
        let mean = squares.sum::<f64>() / other.len() as f64;
        assert!(mean > 2_000.0 && (moments(&other).off_plane(&plane) - mean).abs() < 1e-6 * mean, "{mean}");
        assert!((moments(&floor).off_plane(&plane) - plane.flatness).abs() < 1e-9);
    }

    #[test]
    fn planes_of_neighbours_are_those_of_their_moments_to_the_last_bit() {
        for (spread, reach) in [(7, 40), (300, 1_000), (20_000, 40_000)] {
            let places: Vec<[i32; 3]> = (0..90)
                .map(|n: i32| [n * 7_919 % 101, n * 104_729 % 97, n * 31 % 13].map(|part| part * spread / 50))
                .collect();
            let mut planes = 0;
            let index = KNearest::new(&places, 31);
            let numbers = index.numbers();
            index.each(
                reach,
                |slot| numbers[slot] != NO_POINT,
                |slot, near| {
                    let place = index.place(slot);
                    let half = near.len() / 2;
                    let mut nearest: Vec<(u64, u32)> = near
                        .at()
                        .iter()
                        .map(|at| (squared_distance(index.place(*at as usize), place), numbers[*at as usize]))
                        .collect();
                    nearest.sort_unstable();
                    nearest.truncate(half);
                    let mut expected = Moments::default();
                    for (_, number) in nearest {
                        expected.add([0, 1, 2].map(|k| i64::from(places[number as usize][k] - place[k])));
                    }
                    let limit = near.separate(half, numbers);
                    let (found, expected) = (Fit::of_nearest(near, limit, half), expected.fit());
                    assert_eq!(found, expected);
                    planes += usize::from(found.is_some());
                },
            );
            assert!(planes > 60, "{planes}");
        }
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
        let mut scratch = Scratch::default();
        let mut of = |distances: &[f32]| {
            let mut distances = distances.to_vec();
            let len = fill_up(&mut distances);
            Consistent::of(&distances, len, &mut scratch)
        };
        let found = of(&[1.0, 2.0, 3.0, 4.0, 100.0]);
        assert_eq!(found.median.to_bits(), 3.0_f32.to_bits());
        assert!(found.holds(6.7) && !found.holds(6.8) && found.holds(1.0) && !found.holds(100.0));
        // The median of four values is the mean of the middle ones.
        let found = of(&[1.0, 2.0, 4.0, 9.0]);
        assert_eq!(found.median.to_bits(), 3.0_f32.to_bits());
        // More than half of the distances are equal: all are consistent.
        let found = of(&[0.0, 0.0, 0.0, 50.0]);
        assert!(found.holds(50.0));
        assert!(of(&[]).holds(1.0));
    }
}

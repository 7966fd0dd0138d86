//! The robust plane of a slice (section 3, slice creating, after Nurunnabi, West, Belton, "Outlier detection
//! and robust normal-curvature estimation in mobile laser scanning 3D point cloud data", Pattern Recognition
//! 48, 1404-1419 (2015), doi:10.1016/j.patcog.2014.10.014).
//!
//! A trial takes three points at random, keeps the half of all points that is nearest to their plane, and
//! fits a plane to this half. The flattest of these planes becomes the plane of the slice. There are 69
//! trials: equation 9 with P = 0.9999 and epsilon = 0.5 gives 68.97. (The paper does not print P; 0.999 would
//! give 51.7.) The points are sorted by place, and the random numbers follow from their number. So the plane
//! depends only on the slice, and neither on the order of records, nor on the position of the drive or the
//! resolution of its coordinates.
//!
//! Not in the paper: with `refit_planes`, the plane of the trials is replaced by the plane fitted to all
//! points that are consistent with it. Half of the points of a small slice fit many planes well, and the
//! flattest of these leans, so narrow planes fell apart. One such step is usual after least median estimators
//! (Rousseeuw, Leroy, "Robust regression and outlier detection", 1987, chapter 1).

use serde::{Deserialize, Serialize};

use super::planes::{Consistent, Fit, Moments, Scratch};
use crate::model::Chance;
use crate::spatial::{Loops, ROW, Work, fill_up, run, threshold};

/// Number of trials, I_t of equation 9, rounded up.
const TRIALS: u32 = 69;
/// Upper bound of coordinates, and of the number of points, whose moments are summed in 64 bits.
const SMALL: i64 = 1 << 20;

/// The robust plane of a slice.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct SlicePlane {
    pub(super) normal: [f64; 3],
    /// The lattice point to which the plane is relative: the first point of the slice.
    pub(super) origin: [i64; 3],
    /// Position of the plane along its normal, from `origin`, in lattice units.
    pub(super) through: f64,
    /// Root of the mean squared distance of its consistent points, in lattice units.
    pub(super) deviation: f64,
}

impl SlicePlane {
    /// Distance of a lattice point in lattice units.
    #[inline]
    pub(super) fn distance(&self, at: [i64; 3]) -> f64 {
        let [x, y, z] = [0, 1, 2].map(|axis| (at[axis] - self.origin[axis]) as f64);
        let [a, b, c] = self.normal;
        ((a * x + b * y + c * z) - self.through).abs()
    }
}

/// A slice with a plane.
#[derive(Debug)]
pub(super) struct Slice {
    pub(super) plane: SlicePlane,
    /// Whether each point is consistent with this plane.
    pub(super) consistent: Vec<bool>,
}

/// The search for the flattest plane.
struct Trials<'a> {
    /// The points relative to the first one. `axes` has the same by axis.
    by: &'a [[i64; 3]],
    axes: &'a [Vec<f64>; 3],
    /// Whether coordinates and the number of points are within [`SMALL`].
    small: bool,
}

impl Work for Trials<'_> {
    type Output = Option<Fit>;

    #[inline(always)]
    fn with<L, K>(self, _: &Loops<L, K>) -> Option<Fit> {
        let Self { by, axes, small } = self;
        let half = (by.len() / 2).max(3);
        let mut random = Chance::new(by.len() as u64);
        let mut nearest = Nearest::of(by, small);
        let mut best: Option<Fit> = None;
        for _ in 0..TRIALS {
            let chosen = random.three(by.len());
            let Some(normal) = normal_of(chosen.map(|at| [axes[0][at], axes[1][at], axes[2][at]])) else {
                continue;
            };
            let through = [0, 1, 2].map(|axis| axes[axis][chosen[0]]);
            let Some(fit) = nearest.moments(axes, normal, through, half).fit() else { continue };
            if best.is_none_or(|best| fit.flatness < best.flatness) {
                best = Some(fit);
            }
        }
        best
    }
}

/// The plane of the points of a slice, which must be sorted by place. `None` if no trial finds a plane,
/// because there are fewer than 3 points, or because they are on one line.
pub(super) fn slice(points: &[[i64; 3]], refit_plane: bool) -> Option<Slice> {
    let start = *points.first().filter(|_| points.len() >= 3)?;
    let by: Vec<[i64; 3]> = points.iter().map(|point| [0, 1, 2].map(|k| point[k] - start[k])).collect();
    let small = points.len() <= 1 << 20 && by.iter().flatten().all(|value| value.abs() < SMALL);
    let axes = [0, 1, 2].map(|axis| by.iter().map(|by| by[axis] as f64).collect::<Vec<f64>>());
    let mut fit = run(Trials { by: &by, small, axes: &axes })?;
    let mut distances = distances_from(&axes, &fit);
    fill_up(&mut distances);
    let limits = Consistent::of(&distances, points.len(), &mut Scratch::default());
    distances.truncate(points.len());
    let consistent: Vec<bool> = distances.iter().map(|distance| limits.holds(*distance)).collect();
    let kept = by.iter().zip(&consistent).filter(|(_, holds)| **holds).map(|(by, _)| *by);
    if let Some(better) = moments(kept, small).fit().filter(|_| refit_plane) {
        fit = better;
        distances = distances_from(&axes, &fit);
    }
    let (mut kept, mut squared) = (0_u32, 0.0);
    for (distance, _) in distances.iter().zip(&consistent).filter(|(_, holds)| **holds) {
        kept += 1;
        squared += f64::from(*distance) * f64::from(*distance);
    }
    let deviation = (squared / f64::from(kept.max(1))).sqrt();
    let plane = SlicePlane { normal: fit.normal, origin: start, through: fit.through(), deviation };
    Some(Slice { plane, consistent })
}

/// The moments of points. `small`: coordinates and the number of points are within [`SMALL`].
#[expect(clippy::cast_possible_truncation, reason = "below 2^20")]
fn moments(points: impl Iterator<Item = [i64; 3]>, small: bool) -> Moments {
    if small {
        return Moments::of_near(points.map(|point| point.map(|value| value as i32)));
    }
    let mut moments = Moments::default();
    points.for_each(|point| moments.add(point));
    moments
}

fn distances_from(axes: &[Vec<f64>; 3], fit: &Fit) -> Vec<f32> {
    (0..axes[0].len()).map(|at| fit.rounded_distance([axes[0][at], axes[1][at], axes[2][at]])).collect()
}

/// The unit normal of the plane through three points. `None` if they are on one line.
fn normal_of([a, b, c]: [[f64; 3]; 3]) -> Option<[f64; 3]> {
    let [u, v] = [b, c].map(|to| [0, 1, 2].map(|axis| to[axis] - a[axis]));
    let normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let length = (normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]).sqrt();
    (length > 0.0).then(|| normal.map(|value| value / length))
}

/// The points that are nearest to a plane.
#[derive(Debug)]
struct Nearest<'a> {
    by: &'a [[i64; 3]],
    /// The same by axis, in whole rows, if coordinates are small.
    small: Option<[Vec<i32>; 3]>,
    distances: Vec<f32>,
    keys: Vec<u64>,
}

impl<'a> Nearest<'a> {
    /// A search among these points. `small`: coordinates and the number of points are within [`SMALL`].
    #[expect(clippy::cast_possible_truncation, reason = "below 2^20")]
    fn of(by: &'a [[i64; 3]], small: bool) -> Self {
        let column = |axis: usize| {
            let mut column: Vec<i32> = by.iter().map(|by| by[axis] as i32).collect();
            column.resize(by.len().next_multiple_of(ROW), 0);
            column
        };
        let small = small.then(|| [column(0), column(1), column(2)]);
        Self { by, small, distances: Vec::new(), keys: Vec::new() }
    }

    /// The moments of the `count` points nearest to the plane with this `normal` through the place `through`.
    /// Ordered by distance in single precision, then by position.
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "only so it has the instructions of the caller")]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "an order does not need more digits; positions fit 32 bits"
    )]
    fn moments(
        &mut self,
        axes: &[Vec<f64>; 3],
        normal: [f64; 3],
        through: [f64; 3],
        count: usize,
    ) -> Moments {
        let [a, b, c] = normal;
        let offset = a * through[0] + b * through[1] + c * through[2];
        let [xs, ys, zs] = axes;
        let distances = xs.iter().zip(ys).zip(zs).map(|((x, y), z)| ((a * x + b * y + c * z) - offset).abs());
        self.distances.clear();
        self.distances.extend(distances.map(|distance| distance as f32));
        let len = fill_up(&mut self.distances);
        if let Some(limit) = threshold(&self.distances, len, count) {
            return match &self.small {
                Some(small) => Moments::of_rows(small, &self.distances, limit),
                None => {
                    let near = self.by.iter().zip(&self.distances).filter(|(_, apart)| **apart <= limit);
                    moments(near.map(|(by, _)| *by), false)
                }
            };
        }
        // A key has the bits of the distance above the position: the bits of non-negative numbers are ordered
        // like the numbers.
        let keys = (0_u64..).zip(&self.distances[..len]);
        let keys = keys.map(|(at, distance)| u64::from(distance.to_bits()) << 32 | at);
        self.keys.clear();
        self.keys.extend(keys);
        self.keys.select_nth_unstable(count - 1);
        moments(self.keys[..count].iter().map(|key| self.by[*key as u32 as usize]), self.small.is_some())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::p_linkage::surfaces::planes::likeness;

    #[test]
    fn trials_follow_from_equation_9() {
        let trials = (1.0_f64 - 0.9999).ln() / (1.0 - 0.5_f64.powi(3)).ln();
        assert_eq!(trials.ceil().to_bits(), f64::from(TRIALS).to_bits(), "{trials}");
    }

    #[test]
    fn three_different_points_are_chosen_and_each_triple_is_possible() {
        let mut random = Chance::new(5);
        let mut seen = std::collections::BTreeSet::new();
        for _ in 0..2_000 {
            let [a, b, c] = random.three(4);
            assert!(a != b && b != c && a != c && a.max(b).max(c) < 4);
            seen.insert([a, b, c]);
        }
        assert_eq!(seen.len(), 24);
    }

    #[test]
    fn a_plane_with_outliers_on_one_side_is_found() {
        let mut random = Chance::new(11);
        let mut noise =
            |most: u64| i64::try_from(random.next() % (2 * most + 1)).unwrap() - i64::try_from(most).unwrap();
        let mut points: Vec<[i64; 3]> = (0..70).map(|_| [noise(500), noise(500), noise(4)]).collect();
        points.extend((0..30).map(|_| [noise(500), noise(500), 300 + noise(200)]));
        let found = slice(&points, false).unwrap();
        assert!(likeness(found.plane.normal, [0.0, 0.0, 1.0]) > 0.9999, "{found:?}");
        assert!(found.consistent[70..].iter().all(|consistent| !consistent));
        let refit = slice(&points, true).unwrap();
        let leaning = |normal| 1.0 - likeness(normal, [0.0, 0.0, 1.0]);
        assert!(leaning(refit.plane.normal) < leaning(found.plane.normal), "{refit:?} {found:?}");
        assert_eq!(refit.consistent, found.consistent);
        // Whole numbers from -4 to 4 deviate by 2.58 from their mean.
        assert!((2.5..5.0).contains(&found.plane.deviation), "{found:?}");
        assert!(points[..70].iter().all(|point| found.plane.distance(*point) < 16.0));
        assert!(found.consistent[..70].iter().filter(|consistent| **consistent).count() > 60);
        // If points are far away or spread over kilometres, sums need more bits.
        let far: Vec<[i64; 3]> =
            points.iter().map(|p| [p[0] * 90_000 + (1 << 50), p[1] * 90_000, p[2]]).collect();
        let found = slice(&far, false).unwrap();
        assert!(likeness(found.plane.normal, [0.0, 0.0, 1.0]) > 0.9999, "{found:?}");
    }

    #[test]
    fn points_on_a_line_and_few_points_have_none() {
        let line: Vec<[i64; 3]> = (0..50).map(|k| [k, 2 * k, -k]).collect();
        assert!(slice(&line, false).is_none());
        assert!(slice(&line[..2], false).is_none());
        assert!(slice(&[[4; 3]; 30], false).is_none());
        assert!(slice(&[], false).is_none());
    }
}

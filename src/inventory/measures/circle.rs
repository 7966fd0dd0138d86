//! A circle through points of the plane, some of which belong to something else.
//!
//! The circle has the largest consensus (Fischler and Bolles, "Random sample consensus", Communications of
//! the ACM 24, 381-395, 1981, doi:10.1145/358669.358692) over a fixed sequence of triples. Then least squares
//! of the distances from it refine it (Gauss-Newton). Points inside a stem cannot be seen, so they count
//! against a circle.

use nalgebra::{Matrix3, Vector3};

use crate::model::{Chance, GOLDEN_GAMMA};

/// Radii that a stem or a pole can have, in metres.
const RADII_M: [f64; 2] = [0.015, 0.8];
/// Number of triples that are tried (chosen: with 40 % of the points on the circle, it is missed with
/// probability 3e-9).
const TRIES: usize = 300;
/// Largest number of points from which triples are drawn. More are thinned evenly before.
const MOST_POINTS: usize = 500;
/// A point within this distance of a circle is on it, in metres: three times the range noise of survey
/// scanners.
const TOLERANCE_M: f64 = 0.015;
/// Smallest number of points on a circle.
const LEAST_POINTS: usize = 8;
/// Rounds of least squares.
const ROUNDS: usize = 12;
/// Width of the ring outside a circle whose points count as beside it, in metres. There are the leaves
/// behind a shell of leaves. With 0.06 m, the RMSE of diameters is 1.8 instead of 1.5 cm.
const BESIDE_M: f64 = 0.12;
/// Largest factor by which the cut at [`TOLERANCE_M`] can make a standard error larger, near that of a noise
/// of 20 mm. With more noise, the residuals that are left hardly show how much there is.
const LARGEST_FACTOR: f64 = 6.0;
/// Sectors into which the circumference is divided to measure how much of it was seen.
const SECTORS: usize = 36;

/// A circle, and how well it is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Circle {
    /// Centre in metres.
    pub(crate) centre: [f64; 2],
    /// Radius in metres.
    pub(crate) radius: f64,
    /// Standard error of the radius in metres.
    pub(crate) radius_error: f64,
    /// Factor by which this error is larger because residuals are cut.
    pub(crate) cut_factor: f64,
    /// Points inside the circle and up to 0.12 m outside it, as a share of the points on it. Around a
    /// stem there are few, in leaves many.
    pub(crate) beside: f64,
    /// Part of the circumference on which there are points, in degrees, in steps of 10.
    pub(crate) seen_deg: f64,
}

/// The circle on which most of the points lie. Points are in metres. Their order must be reproducible. `None`
/// if no circle has enough points.
pub(crate) fn fit(points: &[[f64; 2]]) -> Option<Circle> {
    if points.len() < LEAST_POINTS {
        return None;
    }
    let step = points.len().div_ceil(MOST_POINTS);
    let some: Vec<[f64; 2]> = points.iter().copied().step_by(step).collect();
    let mut chance = Chance::new(GOLDEN_GAMMA);
    let mut best: Option<(f64, [f64; 3])> = None;
    for _ in 0..TRIES {
        let triple = [(); 3].map(|()| some[chance.below(some.len())]);
        let Some(circle) = through(triple) else { continue };
        let most = best.map_or(f64::NEG_INFINITY, |(most, _)| most);
        if let Some(score) = better_score(&some, circle, most) {
            best = Some((score, circle));
        }
    }
    let (_, mut circle) = best.filter(|(score, _)| *score > 0.0)?;
    for _ in 0..ROUNDS {
        circle = improved(&on(points, circle), circle)?;
    }
    let on = on(points, circle);
    if on.len() < LEAST_POINTS || !(RADII_M[0]..=RADII_M[1]).contains(&circle[2]) {
        return None;
    }
    let squared: f64 = on.iter().map(|point| away(*point, circle).powi(2)).sum();
    let variance = squared / (on.len() - 3) as f64;
    let covariance = normal(&on, circle).0.try_inverse()?;
    let mut sectors = [false; SECTORS];
    for point in &on {
        let turn = (point[1] - circle[1]).atan2(point[0] - circle[0]) / std::f64::consts::TAU + 0.5;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to 1 times 36")]
        let sector = (turn * SECTORS as f64) as usize;
        sectors[sector.min(SECTORS - 1)] = true;
    }
    let near = points.iter().filter(|point| away(**point, circle) <= BESIDE_M).count();
    let seen = sectors.iter().filter(|seen| **seen).count();
    Some(Circle {
        centre: [circle[0], circle[1]],
        radius: circle[2],
        radius_error: (variance * covariance[(2, 2)]).max(0.0).sqrt(),
        cut_factor: cut_factor(variance),
        beside: (near - on.len()) as f64 / on.len() as f64,
        seen_deg: 360.0 * seen as f64 / SECTORS as f64,
    })
}

/// Length of a vector of metres. `f64::hypot` also works for lengths whose squares overflow, takes several
/// times as long, and its last digit depends on the system's library.
pub(super) fn length([x, y]: [f64; 2]) -> f64 {
    (x * x + y * y).sqrt()
}

/// Signed distance of a point from a circle (x, y, radius); negative inside.
fn away(point: [f64; 2], circle: [f64; 3]) -> f64 {
    length([point[0] - circle[0], point[1] - circle[1]]) - circle[2]
}

/// The circle through three points, if it has a possible radius.
fn through([a, b, c]: [[f64; 2]; 3]) -> Option<[f64; 3]> {
    let [bx, by] = [b[0] - a[0], b[1] - a[1]];
    let [cx, cy] = [c[0] - a[0], c[1] - a[1]];
    let d = 2.0 * (bx * cy - by * cx);
    let b2 = bx * bx + by * by;
    let c2 = cx * cx + cy * cy;
    let x = (cy * b2 - by * c2) / d;
    let y = (bx * c2 - cx * b2) / d;
    let radius = length([x, y]);
    // A division by zero gives a radius that is not in the range.
    (RADII_M[0]..=RADII_M[1]).contains(&radius).then_some([a[0] + x, a[1] + y, radius])
}

/// Score of a circle: points on it minus points inside it; `None` unless it exceeds `most`. Most circles are
/// rejected after a part of the points, because each remaining point adds at most 1.
fn better_score(points: &[[f64; 2]], circle: [f64; 3], most: f64) -> Option<f64> {
    let mut score = 0.0;
    let mut left = points.len();
    for chunk in points.chunks(16) {
        if score + left as f64 <= most {
            return None;
        }
        left -= chunk.len();
        for point in chunk {
            let away = away(*point, circle);
            if away.abs() <= TOLERANCE_M {
                // Nearer points count more, so that the best of many similar circles is taken.
                score += 1.0 - (away / TOLERANCE_M).powi(2) / 2.0;
            } else if away < -TOLERANCE_M {
                score -= 1.0;
            }
        }
    }
    (score > most).then_some(score)
}

/// Factor by which the cut of residuals makes a standard error larger than their variance says. A circle that
/// moves gains points at one edge of the tolerance and loses points at the other, so they hardly hold it
/// where the noise is as large as the tolerance. For normal noise, the factor is the variance of the noise
/// over that of the residuals that are left (from the influence function of a skipped mean; Huber, Annals of
/// Mathematical Statistics 35, 73-101, 1964, doi:10.1214/aoms/1177703732): 1.0, 1.8, 3.4 and 5.8 for a noise
/// of 5, 10, 15 and 20 mm. One less the cube of the variance, as a share of that of evenly spread residuals,
/// gives 1.0, 1.7, 3.0 and 4.9.
fn cut_factor(variance: f64) -> f64 {
    let share = 3.0 * variance / TOLERANCE_M.powi(2);
    (1.0 - share.powi(3)).max(1.0 / LARGEST_FACTOR).recip()
}

fn on(points: &[[f64; 2]], circle: [f64; 3]) -> Vec<[f64; 2]> {
    points.iter().copied().filter(|point| away(*point, circle).abs() <= TOLERANCE_M).collect()
}

/// Normal equations of the distances from a circle.
fn normal(points: &[[f64; 2]], circle: [f64; 3]) -> (Matrix3<f64>, Vector3<f64>) {
    let mut matrix = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for point in points {
        let [x, y] = [point[0] - circle[0], point[1] - circle[1]];
        let distance = length([x, y]).max(1e-9);
        let gradient = Vector3::new(-x / distance, -y / distance, -1.0);
        matrix += gradient * gradient.transpose();
        right -= gradient * (distance - circle[2]);
    }
    (matrix, right)
}

/// One step of least squares. `None` if the points do not determine a circle.
fn improved(points: &[[f64; 2]], circle: [f64; 3]) -> Option<[f64; 3]> {
    if points.len() < LEAST_POINTS {
        return None;
    }
    let (matrix, right) = normal(points, circle);
    let step = matrix.try_inverse()? * right;
    let next = [circle[0] + step[0], circle[1] + step[1], circle[2] + step[2]];
    next.iter().all(|value| value.is_finite()).then_some(next)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Points on an arc, with a pattern of errors of `noise` metres.
    fn arc(circle: [f64; 3], from_deg: f64, to_deg: f64, count: u32, noise: f64) -> Vec<[f64; 2]> {
        (0..count)
            .map(|k| {
                let angle = (from_deg + (to_deg - from_deg) * f64::from(k) / f64::from(count)).to_radians();
                let radius = circle[2] + noise * (f64::from(k * 7 % 5) - 2.0) / 2.0;
                [circle[0] + radius * angle.cos(), circle[1] + radius * angle.sin()]
            })
            .collect()
    }

    #[test]
    fn a_circle_is_found_among_twigs() {
        let mut points = arc([3.0, -2.0, 0.15], 0.0, 180.0, 120, 0.0);
        // Half as many points elsewhere, outside.
        points.extend((0..60).map(|k| [3.3 + 0.002 * f64::from(k), -1.8 + 0.004 * f64::from(k * 13 % 29)]));
        let found = fit(&points).unwrap();
        assert!((found.radius - 0.15).abs() < 1e-3, "{found:?}");
        assert!((found.centre[0] - 3.0).abs() < 1e-3 && (found.centre[1] + 2.0).abs() < 1e-3);
        assert!((170.0..=200.0).contains(&found.seen_deg), "{found:?}");
    }

    #[test]
    fn what_is_no_circle_is_none() {
        assert_eq!(fit(&[]), None);
        assert_eq!(fit(&[[1.0, 1.0]; 50]), None, "one place");
        let line: Vec<[f64; 2]> = (0..100).map(|k| [0.01 * f64::from(k), 0.0]).collect();
        assert_eq!(fit(&line), None, "a straight line");
    }

    #[test]
    fn points_beside_a_circle_are_counted_up_to_12_cm() {
        let mut points = arc([0.0, 0.0, 0.15], 0.0, 180.0, 100, 0.0);
        let ring = |radius, count| arc([0.0, 0.0, radius], 0.0, 180.0, count, 0.0);
        points.extend([ring(0.1, 10), ring(0.2, 20), ring(0.26, 10), ring(0.28, 10)].concat());
        let found = fit(&points).unwrap();
        assert!((found.radius - 0.15).abs() < 1e-3 && (found.beside - 0.4).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn cut_residuals_make_the_error_larger() {
        let factor = |noise| fit(&arc([0.0, 0.0, 0.2], 0.0, 180.0, 200, noise)).unwrap().cut_factor;
        assert!((factor(0.002) - 1.0).abs() < 0.001, "{}", factor(0.002));
        // Residuals of 0, 7 and 14 mm vary more than evenly spread ones.
        assert!(factor(0.014) > 3.0, "{}", factor(0.014));
        // For the residuals of normal noise of 10 mm, and for more than evenly spread ones.
        assert!((cut_factor(0.735 / 3.0 * TOLERANCE_M.powi(2)) - 1.66).abs() < 0.01);
        assert!((cut_factor(TOLERANCE_M.powi(2)) - LARGEST_FACTOR).abs() < 1e-9);
    }

    #[test]
    fn little_of_a_circle_is_less_certain_than_much() {
        let error = |to| fit(&arc([0.0, 0.0, 0.2], 0.0, to, 200, 0.005)).unwrap().radius_error;
        assert!(error(60.0) > 3.0 * error(180.0), "{} {}", error(60.0), error(180.0));
    }

    proptest! {
        #[test]
        fn arcs_of_a_third_give_the_circle(
            x in -3.0..3.0_f64, y in -3.0..3.0_f64, radius in 0.05..0.5_f64, from in 0.0..360.0_f64,
        ) {
            let found = fit(&arc([x, y, radius], from, from + 120.0, 150, 0.002));
            let found = found.unwrap();
            prop_assert!((found.radius - radius).abs() < 0.003, "{:?} for {}", found, radius);
            prop_assert!((found.centre[0] - x).hypot(found.centre[1] - y) < 0.004);
        }
    }
}

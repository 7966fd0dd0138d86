//! From the curve to epsilon: the fit, its goodness, and the point where its slope equals the slope of the
//! chord.

use serde::{Deserialize, Serialize};

use crate::cluster::dbscan::epsilon::{Curve, EpsilonError, LARGEST_K, Polynomial};

/// Degree of the polynomial (paper, section 4: the degree of every printed fit).
const DEGREE: usize = 5;
/// R squared that the fit must reach (paper, section 3.2.3, step 2).
const LEAST_R_SQUARED: f64 = 0.99;

/// An estimate of epsilon, with its curve and its fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The estimate: f(k0), in the unit of the distances.
    pub epsilon: f64,
    /// Standard error of the mean distance at k0; 0 if every point was queried.
    pub standard_error: f64,
    /// The k at which f'(k) K / D_K = 1.
    pub k0: f64,
    /// K, the number of neighbours of the fit, the point itself included.
    pub k: usize,
    /// Mean distance to the K-th neighbour.
    pub d_k: f64,
    /// Share of the variance of the curve that the fit explains.
    pub r_squared: f64,
    /// The fit f.
    pub fit: Polynomial,
    /// The curve, up to K or further.
    pub curve: Curve,
}

/// The result of one attempt.
#[derive(Debug, Clone, PartialEq)]
pub enum Attempt {
    /// An estimate.
    Found(Box<Estimate>),
    /// No K up to the end of the curve gives an estimate. The next attempt needs this many neighbours.
    Longer(usize),
}

/// Estimates epsilon from the first K of `first_k`, `first_k` + 1, ... that gives a good fit with a tangent
/// point. `points` is the number of points that can be neighbours.
///
/// # Errors
/// [`EpsilonError::TooFewPoints`] if there are fewer points than `first_k`. [`EpsilonError::NoTangent`] if no
/// K gives an estimate although the curve has reached [`LARGEST_K`] or the number of points.
pub fn estimate(curve: Curve, first_k: usize, points: u64) -> Result<Attempt, EpsilonError> {
    if points < first_k as u64 {
        return Err(EpsilonError::TooFewPoints { k: first_k, points });
    }
    let mut why = "the curve is flat";
    for k in first_k..=curve.k() {
        match attempt(&curve, k) {
            Ok((fit, r_squared, k0)) => {
                let epsilon = fit.at(k0);
                let d_k = curve.mean[k - 2];
                let standard_error = curve.standard_error_at(k0);
                return Ok(Attempt::Found(Box::new(Estimate {
                    epsilon,
                    standard_error,
                    k0,
                    k,
                    d_k,
                    r_squared,
                    fit,
                    curve,
                })));
            }
            Err(reason) => why = reason,
        }
    }
    let longest = usize::try_from(points).unwrap_or(usize::MAX).min(LARGEST_K);
    if curve.k() < longest {
        Ok(Attempt::Longer(longest))
    } else {
        Err(EpsilonError::NoTangent { curve, why })
    }
}

/// Fit, R squared and k0 over k = 2 to `k`, or the condition that was not met.
fn attempt(curve: &Curve, k: usize) -> Result<(Polynomial, f64, f64), &'static str> {
    let values = &curve.mean[..k - 1];
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let total: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    let d_k = values[values.len() - 1];
    // This form of the condition refuses NaN as well.
    if !(total > 0.0 && d_k > 0.0) {
        return Err("the curve is flat");
    }
    let fit = Polynomial::fit(2, values, DEGREE).ok_or("the curve is too short for a fit of degree 5")?;
    let residual = |(k, value): (u16, &f64)| (value - fit.at(f64::from(k))).powi(2);
    let r_squared = 1.0 - (2..).zip(values).map(residual).sum::<f64>() / total;
    if r_squared < LEAST_R_SQUARED {
        return Err("the fit of degree 5 explains less than 0.99 of the variance");
    }
    let k0 = tangent(&fit, k, d_k).ok_or("the slope never equals that of the chord")?;
    Ok((fit, r_squared, k0))
}

/// The smallest k in [2, K] with f'(k) K / D_K = 1.
fn tangent(fit: &Polynomial, k: usize, d_k: f64) -> Option<f64> {
    let k = k as f64;
    fit.derivative().first_at_value(d_k / k, 2.0, k)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(mean: Vec<f64>) -> Curve {
        Curve { queries: 1_000, population: 1_000, standard_error: vec![0.0; mean.len()], mean }
    }

    /// The polynomials as printed in the paper: coefficients from the constant up, K, D_K, k0 and epsilon. k0
    /// and epsilon were computed from these rounded coefficients with numpy's roots. The paper prints 12.063
    /// and 1.14686, 10.860 and 0.097.
    const PRINTED: [([f64; 6], usize, f64, f64, f64); 2] = [
        ([0.111, 0.140, -6.553e-3, 2.092e-4, -3.569e-6, 2.497e-8], 40, 2.04, 12.006_68, 1.141),
        ([4.393e-2, 8.452e-3, -4.540e-4, 1.382e-5, -2.048e-7, 1.163e-9], 60, 0.148, 11.033_54, 0.0976),
    ];

    #[test]
    fn the_printed_polynomials_have_their_printed_tangent_points() {
        for (coefficients, k, d_k, k0, epsilon) in PRINTED {
            let fit = Polynomial::in_k(coefficients.to_vec());
            let found = tangent(&fit, k, d_k).unwrap();
            assert!((found - k0).abs() < 1e-4, "{found}");
            assert!((fit.at(found) - epsilon).abs() < 5e-4 * epsilon, "{}", fit.at(found));
        }
    }

    #[test]
    fn a_curve_of_the_printed_values_gives_the_printed_estimate() {
        for (coefficients, k, d_k, k0, epsilon) in PRINTED {
            let printed = Polynomial::in_k(coefficients.to_vec());
            let curve = curve((2..=k).map(|k| printed.at(k as f64)).collect());
            let Ok(Attempt::Found(found)) = estimate(curve, k, 1_000) else { panic!("no estimate") };
            // D_K of the rounded coefficients differs by 3 % for the second polynomial: 0.1519 instead of
            // 0.148.
            assert!((found.d_k / d_k - 1.0).abs() < 0.03, "{}", found.d_k);
            assert!(
                (found.k0 - k0).abs() < 0.6 && (found.epsilon / epsilon - 1.0).abs() < 0.015,
                "{found:?}"
            );
            assert!(found.r_squared > 1.0 - 1e-12, "{}", found.r_squared);
        }
    }

    #[test]
    fn k_grows_until_there_is_a_tangent_point() {
        // A straight line up to k = 45, flatter than its chord because of an offset, then a rise.
        let bend = |k: usize| if k <= 45 { 1.0 + k as f64 * 0.01 } else { 1.45 + (k - 45) as f64 * 0.1 };
        let values = |to: usize| curve((2..=to).map(bend).collect());
        assert_eq!(estimate(values(40), 40, 1_000), Ok(Attempt::Longer(200)));
        assert_eq!(estimate(values(40), 40, 90), Ok(Attempt::Longer(90)));
        let Ok(Attempt::Found(found)) = estimate(values(200), 40, 1_000) else { panic!("no estimate") };
        assert!(found.k > 45 && found.r_squared >= LEAST_R_SQUARED, "{found:?}");
    }

    #[test]
    fn a_curve_without_an_answer_is_shown() {
        let line = curve((2..=200).map(|k| 1.0 + f64::from(k) * 0.01).collect());
        let text = estimate(line, 40, 1_000).unwrap_err().to_string();
        assert!(text.contains("the slope never equals that of the chord"), "{text}");
        let text = estimate(curve(vec![0.0; 199]), 40, 1_000).unwrap_err().to_string();
        assert!(text.contains("the curve is flat"), "{text}");
        let error = estimate(curve(vec![0.0; 39]), 40, 39).unwrap_err();
        assert_eq!(error, EpsilonError::TooFewPoints { k: 40, points: 39 });
    }
}

//! Polynomials in a scaled variable: value, derivative, real roots in an interval, least-squares fit.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// c_0 + c_1 t + c_2 t^2 + ... with t = (k - centre) / half.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Polynomial {
    /// c_0, c_1, ...
    pub coefficients: Vec<f64>,
    /// k at which t = 0.
    pub centre: f64,
    /// Distance in k from t = 0 to t = 1.
    pub half: f64,
}

impl Polynomial {
    /// The polynomial of this degree with the least sum of squared residuals over `values` at k = `first`,
    /// `first` + 1, ... The variable t goes from -1 to 1 over these k, so that powers up to the fifth remain
    /// well conditioned. `None` if the values do not determine the polynomial.
    pub(super) fn fit(first: usize, values: &[f64], degree: usize) -> Option<Self> {
        let half = values.len().saturating_sub(1) as f64 / 2.0;
        let centre = first as f64 + half;
        let rows = values.len();
        let columns = degree + 1;
        if rows < columns {
            return None;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "degrees below 10")]
        let power = |row: usize, column: usize| ((row as f64 - half) / half).powi(column as i32);
        let qr = DMatrix::from_fn(rows, columns, power).qr();
        let right = qr.q().transpose() * DVector::from_column_slice(values);
        let solution = qr.r().solve_upper_triangular(&right)?;
        Some(Self { coefficients: solution.as_slice().to_vec(), centre, half })
    }

    /// The value at k.
    #[must_use]
    pub fn at(&self, k: f64) -> f64 {
        horner(&self.coefficients, (k - self.centre) / self.half)
    }

    /// The derivative with respect to k.
    #[must_use]
    pub fn derivative(&self) -> Self {
        let coefficients = differentiate(&self.coefficients).into_iter().map(|c| c / self.half).collect();
        Self { coefficients, centre: self.centre, half: self.half }
    }

    /// The smallest k in [low, high] where the polynomial has the value `value`.
    #[must_use]
    pub fn first_at_value(&self, value: f64, low: f64, high: f64) -> Option<f64> {
        let mut shifted = self.coefficients.clone();
        *shifted.first_mut()? -= value;
        let scaled = |k: f64| (k - self.centre) / self.half;
        let first = roots(&shifted, scaled(low), scaled(high)).into_iter().next()?;
        Some((self.centre + first * self.half).clamp(low, high))
    }
}

fn horner(coefficients: &[f64], t: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |value, c| value * t + c)
}

fn differentiate(coefficients: &[f64]) -> Vec<f64> {
    coefficients.iter().enumerate().skip(1).map(|(power, c)| c * power as f64).collect()
}

/// Real roots in [low, high], ascending. Between two neighbouring extrema a polynomial is monotone, so a
/// change of sign is one root, and bisection finds it. A polynomial that is zero everywhere has no roots
/// here.
fn roots(coefficients: &[f64], low: f64, high: f64) -> Vec<f64> {
    if coefficients.len() < 2 {
        return Vec::new();
    }
    let mut stops = vec![low];
    stops.extend(roots(&differentiate(coefficients), low, high));
    stops.push(high);
    let mut found: Vec<f64> = Vec::new();
    for pair in stops.windows(2) {
        if let Some(root) = root_between(coefficients, pair[0], pair[1])
            && found.last().is_none_or(|last| *last < root)
        {
            found.push(root);
        }
    }
    found
}

/// The root in [low, high]. The polynomial must be monotone there.
fn root_between(coefficients: &[f64], mut low: f64, mut high: f64) -> Option<f64> {
    let at_low = horner(coefficients, low);
    let at_high = horner(coefficients, high);
    let zero = |value: f64| value.abs() < f64::MIN_POSITIVE;
    match (zero(at_low), zero(at_high)) {
        (true, true) => return None,
        (true, false) => return Some(low),
        (false, true) => return Some(high),
        (false, false) if (at_low > 0.0) == (at_high > 0.0) => return None,
        (false, false) => {}
    }
    loop {
        let middle = f64::midpoint(low, high);
        if middle <= low || middle >= high {
            return Some(low);
        }
        if (horner(coefficients, middle) > 0.0) == (at_low > 0.0) {
            low = middle;
        } else {
            high = middle;
        }
    }
}

#[cfg(test)]
impl Polynomial {
    /// Powers of k itself.
    pub(super) fn in_k(coefficients: Vec<f64>) -> Self {
        Self { coefficients, centre: 0.0, half: 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(found: &[f64], expected: &[f64]) {
        let close =
            found.len() == expected.len() && found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(close, "{found:?} and not {expected:?}");
    }

    #[test]
    fn roots_are_found_in_the_interval_in_ascending_order() {
        // (t + 1)(t - 2)(t - 3) = t^3 - 4 t^2 + t + 6.
        near(&roots(&[6.0, 1.0, -4.0, 1.0], -5.0, 5.0), &[-1.0, 2.0, 3.0]);
        near(&roots(&[6.0, 1.0, -4.0, 1.0], 0.0, 2.5), &[2.0]);
        near(&roots(&[6.0, 1.0, -4.0, 1.0], 3.5, 5.0), &[]);
        // Roots on the ends of the interval count.
        near(&roots(&[6.0, 1.0, -4.0, 1.0], 2.0, 3.0), &[2.0, 3.0]);
        // (t - 1)^2 touches; t^2 + 1 never.
        near(&roots(&[1.0, -2.0, 1.0], -3.0, 3.0), &[1.0]);
        near(&roots(&[1.0, 0.0, 1.0], -3.0, 3.0), &[]);
        near(&roots(&[0.0, 0.0], -1.0, 1.0), &[]);
    }

    #[test]
    fn a_polynomial_is_recovered_from_its_values() {
        let printed = Polynomial::in_k(vec![0.111, 0.140, -6.553e-3, 2.092e-4, -3.569e-6, 2.497e-8]);
        let values: Vec<f64> = (2..=40).map(|k| printed.at(f64::from(k))).collect();
        let fitted = Polynomial::fit(2, &values, 5).unwrap();
        for k in [2.0, 7.3, 21.0, 40.0] {
            assert!((fitted.at(k) - printed.at(k)).abs() < 1e-11, "{k}");
            assert!((fitted.derivative().at(k) - printed.derivative().at(k)).abs() < 1e-11, "{k}");
        }
        assert_eq!(Polynomial::fit(2, &values[..5], 5), None);
    }
}

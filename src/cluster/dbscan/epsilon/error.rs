//! Errors of the estimation of epsilon.

use std::borrow::Cow;

use crate::cluster::dbscan::epsilon::{Curve, LARGEST_K};
use crate::error::{ErrorKind, Failure};

/// Epsilon cannot be estimated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EpsilonError {
    /// Not enough points for the first curve.
    #[error("a curve over {k} neighbours needs at least {k} points, but there are {points}")]
    TooFewPoints {
        /// Neighbours per point, the point itself included.
        k: usize,
        /// Number of points.
        points: u64,
    },
    /// No K gives a good fit with a tangent point.
    #[error(
        "no estimate of epsilon up to K = {}: {why}; mean distances D_2 to D_{}: {}",
        curve.k(), curve.k(), values(curve)
    )]
    NoTangent {
        /// The curve up to the last K that was tried.
        curve: Curve,
        /// The condition that the last fit did not meet.
        why: &'static str,
    },
}

/// A curve on one line: every value up to k = 10, then every tenth value.
fn values(curve: &Curve) -> String {
    let shown = |k: usize| k <= 10 || k.is_multiple_of(LARGEST_K / 10) || k == curve.k();
    let entry = |(k, mean): (usize, &f64)| format!("{k}: {mean:.6}");
    let list: Vec<String> = (2..).zip(&curve.mean).filter(|(k, _)| shown(*k)).map(entry).collect();
    list.join(", ")
}

impl Failure for EpsilonError {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Input
    }

    fn hint(&self) -> Option<Cow<'static, str>> {
        Some(match self {
            Self::TooFewPoints { .. } => {
                "choose fewer neighbours with --k, or give epsilon as a number".into()
            }
            Self::NoTangent { .. } => "give epsilon as a number, near the bend of the curve above".into(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_shows_the_curve() {
        let curve = Curve { queries: 9, population: 9, mean: vec![0.5; 29], standard_error: vec![0.0; 29] };
        let text =
            EpsilonError::NoTangent { curve, why: "the slope never equals that of the chord" }.to_string();
        assert!(text.contains("K = 30") && text.contains("2: 0.500000, 3: 0.5"), "{text}");
        assert!(text.ends_with("10: 0.500000, 20: 0.500000, 30: 0.500000"), "{text}");
    }
}

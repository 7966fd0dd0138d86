//! The decimals of a report.

/// Six decimals: one point in a million.
pub(super) fn share(value: Option<f64>) -> Option<f64> {
    // Adding zero turns -0.0 into 0.0.
    value.map(|value| (value * 1e6).round() / 1e6 + 0.0)
}

/// Three decimals of metres.
pub(super) fn millimetres(value_m: f64) -> f64 {
    (value_m * 1e3).round() / 1e3 + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_figure_is_a_negative_zero() {
        for (value, written) in [(-0.0, "0.0"), (-4e-7, "0.0"), (-0.25, "-0.25"), (0.1234567, "0.123457")] {
            assert_eq!(serde_json::to_string(&share(Some(value))).unwrap(), written);
        }
        assert_eq!(serde_json::to_string(&millimetres(-1e-9)).unwrap(), "0.0");
    }
}

//! Common units of length and their names.

use crate::config::{FOOT, US_SURVEY_FOOT};

/// Common units of length: metres, symbol and name. The two feet differ by 2 parts in a million.
const UNITS: [(f64, &str, &str); 3] =
    [(1.0, "m", "metres"), (FOOT, "ft", "feet"), (US_SURVEY_FOOT, "US survey ft", "US survey feet")];

/// The common unit of this many metres, if any. Files state units with different numbers of digits.
fn common_unit(metres: f64) -> Option<(f64, &'static str, &'static str)> {
    UNITS.into_iter().find(|(known, ..)| (metres / known - 1.0).abs() < 1e-7)
}

/// A unit of length, by its metres, in words.
#[must_use]
pub fn unit_in_words(metres: f64) -> String {
    common_unit(metres).map_or_else(|| format!("units of {metres} m"), |(.., name)| name.to_owned())
}

/// The symbol of a unit of length, by its metres.
#[must_use]
pub fn unit_symbol(metres: f64) -> String {
    common_unit(metres).map_or_else(|| format!("units of {metres} m"), |(_, symbol, _)| symbol.to_owned())
}

/// A length unit with a plausible number of metres. Common units are made exact.
pub(super) fn plausible(metres: f64) -> Option<f64> {
    let exact = common_unit(metres).map(|(metres, ..)| metres);
    exact.or_else(|| (metres.is_finite() && (1e-4..=1e4).contains(&metres)).then_some(metres))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_have_their_symbols_and_names() {
        let symbols = [1.0, 0.3048, 0.304_800_6, US_SURVEY_FOOT, 0.5].map(unit_symbol);
        assert_eq!(symbols, ["m", "ft", "US survey ft", "US survey ft", "units of 0.5 m"]);
        assert_eq!([0.304_800_6, 0.5].map(unit_in_words), ["US survey feet", "units of 0.5 m"]);
    }
}

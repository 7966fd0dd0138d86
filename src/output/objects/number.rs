//! Numbers of the table, rounded so that the bytes of every format depend on the values only.

use crate::model::ColumnType;

/// Decimal places of coordinates in outlines. The coordinates are in units of the input: three places are
/// millimetres or less.
pub(super) const OUTLINE_PLACES: u8 = 3;

/// Decimal places of the numbers of a column; none where it has no decimals.
pub(crate) fn places(column_type: ColumnType) -> u8 {
    match column_type {
        ColumnType::Decimal { places } => places,
        _ => 0,
    }
}

/// Rounded to this many places, without a negative zero; `None` for a value that is not finite.
pub(crate) fn rounded(value: f64, places: u8) -> Option<f64> {
    // This is exact. `powi` does not promise that.
    let scale = f64::from(10_u32.saturating_pow(places.into()));
    value.is_finite().then(|| (value * scale).round() / scale + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_rounded_to_the_places_of_their_column() {
        for (value, places, expected) in [
            (530_000.123_4, 3, Some(530_000.123)),
            (3_380_001.000_6, 3, Some(3_380_001.001)),
            (0.25, 1, Some(0.3)),
            (-1.5, 0, Some(-2.0)),
            (f64::NAN, 3, None),
            (f64::INFINITY, 3, None),
        ] {
            assert_eq!(rounded(value, places), expected, "{value}");
        }
        assert!(rounded(-0.000_4, 3).is_some_and(f64::is_sign_positive), "no negative zero");
        assert_eq!((places(ColumnType::Decimal { places: 2 }), places(ColumnType::Text)), (2, 0));
    }
}

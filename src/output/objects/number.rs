//! Numbers of the table, rounded so that the bytes of every format depend on the values only, and lists in
//! one field.

use crate::model::ColumnType;
pub(crate) use crate::model::rounded;

/// Decimal places of coordinates in outlines. The coordinates are in units of the input: three places are
/// millimetres or less.
pub(super) const OUTLINE_PLACES: u8 = 3;

/// Decimal places of the numbers of a column; 0 if it has no decimals.
pub(crate) fn places(column_type: ColumnType) -> u8 {
    match column_type {
        ColumnType::Decimal { places } => places,
        _ => 0,
    }
}

/// A list in one field, joined by `;`. A `;` or `%` in an item is percent-encoded (RFC 3986, section 2.1), so
/// that the list can be split again.
pub(super) fn listed(items: &[impl ToString]) -> String {
    let encoded = |item: String| item.replace('%', "%25").replace(';', "%3B");
    items.iter().map(|item| encoded(item.to_string())).collect::<Vec<_>>().join(";")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_can_be_split_again() {
        assert_eq!(listed(&[3, 14, 15]), "3;14;15");
        assert_eq!(listed(&["a.laz", "b;c 50%.laz"]), "a.laz;b%3Bc 50%25.laz");
        assert_eq!(listed(&[0_u64; 0]), "");
    }

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

//! Directions as they are written.

use crate::model::rounded;

/// A direction in degrees, from 0 up to a whole `turn`, for a column with these decimal places. A whole turn
/// is 0, and so is what would be written as one.
pub(super) fn within_turn(degrees: f64, turn: f64, places: u8) -> f64 {
    if rounded(degrees, places).is_some_and(|written| written >= turn) { 0.0 } else { degrees }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_direction_is_never_written_as_a_whole_turn() {
        for (degrees, turn, places, expected) in [
            (179.994, 180.0, 2, 179.994),
            (179.996, 180.0, 2, 0.0),
            (180.0, 180.0, 2, 0.0),
            (359.94, 360.0, 1, 359.94),
            (359.96, 360.0, 1, 0.0),
            (0.0, 360.0, 1, 0.0),
        ] {
            assert_eq!(within_turn(degrees, turn, places).to_bits(), f64::to_bits(expected), "{degrees}");
        }
    }
}

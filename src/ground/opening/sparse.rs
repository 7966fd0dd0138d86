//! Sparse places: where few columns have points, the lowest points need not be ground.
//!
//! Far from a scanner, its profiles and rings lie metres apart, and the ground between them was not seen. The
//! lowest points there are often a ring on a wall, a hedge or a car. So `opening` is stricter there:
//!
//! * *Slope.* The ground rises by at most 15 %. Such a ring lies a metre above the ground a few metres away,
//!   and the slope of an embankment would allow this. With few exceptions, roads are less steep than 15 %.
//! * *Clear.* The next ring on a wall may be metres above, so a column is clear only if it is empty up to
//!   6 m. That costs ground below crowns.
//!
//! Both were chosen on single sweeps, weighed against the ground lost on steep land:
//! `benches/results/ground.md`.

/// Largest slope of the ground in a sparse place.
const SLOPE: f64 = 0.15;

/// Multiple of the share of a sparse place from which the slope of the settings applies. In between, the
/// slope is interpolated (chosen: otherwise one more column would change the slope from 15 % to 80 %).
const FULL: f64 = 1.5;

/// Height above the surface up to which a column in a sparse place must be empty to be clear, in metres.
pub(super) const CLEAR_M: f64 = 6.0;

/// Which places are sparse.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sparse {
    /// Share of columns with points below which a place is sparse; with 0, no place is sparse.
    pub(super) share: f64,
}

impl Sparse {
    /// Whether a place is sparse, by the share of its columns that have points.
    pub(super) fn is(self, filled: f64) -> bool {
        filled < self.share
    }

    /// The largest slope of a place, at most `slope`.
    pub(super) fn slope(self, filled: f64, slope: f64) -> f64 {
        let full = FULL * self.share;
        if filled >= full || slope <= SLOPE {
            return slope;
        }
        let part = ((filled - self.share) / (full - self.share)).max(0.0);
        SLOPE + part * (slope - SLOPE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_grow_from_sparse_places_to_full_ones() {
        let sparse = Sparse { share: 0.2 };
        for (filled, slope, expected) in [
            (0.0, 0.8, 0.15),
            (0.2, 0.8, 0.15),
            (0.25, 0.8, 0.475),
            (0.31, 0.8, 0.8),
            (1.0, 0.8, 0.8),
            (0.0, 0.1, 0.1), // a smaller setting stays
        ] {
            assert!((sparse.slope(filled, slope) - expected).abs() < 1e-9, "{filled} {slope}");
        }
        assert_eq!([0.19, 0.2].map(|filled| sparse.is(filled)), [true, false]);
        let never = Sparse { share: 0.0 };
        assert!((never.slope(0.0, 0.8) - 0.8).abs() < 1e-9);
        assert!(!never.is(0.0));
    }
}

//! Fields of a point, and exact sums of their values.

use serde::{Deserialize, Serialize};

/// A field of a point that distances may take into account.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Field {
    /// x.
    X,
    /// y.
    Y,
    /// z.
    Z,
    /// Intensity.
    Intensity,
    /// Red.
    Red,
    /// Green.
    Green,
    /// Blue.
    Blue,
    /// Near infrared.
    Nir,
    /// Class in a labelled drive: the extra dimension `gt_class`. It is for learning, not for distances, so
    /// no setting can name it.
    #[serde(skip)]
    Class,
    /// Whether a labelled drive is completely labelled at this point: the extra dimension `gt_core`. For
    /// learning only.
    #[serde(skip)]
    Core,
    /// Number of the object in a labelled drive: the lower 16 bits of the extra dimension `gt_instance`. For
    /// learning only.
    #[serde(skip)]
    Instance,
    /// The upper 16 bits of `gt_instance`, if the dimension has four bytes.
    #[serde(skip)]
    InstanceUpper,
}

impl Field {
    /// The axis of the field (0 for x, 1 for y, 2 for z), if it is a coordinate.
    #[must_use]
    pub fn axis(self) -> Option<usize> {
        match self {
            Self::X => Some(0),
            Self::Y => Some(1),
            Self::Z => Some(2),
            Self::Intensity
            | Self::Red
            | Self::Green
            | Self::Blue
            | Self::Nir
            | Self::Class
            | Self::Core
            | Self::Instance
            | Self::InstanceUpper => None,
        }
    }

    /// Name, as in settings and messages.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::Y => "y",
            Self::Z => "z",
            Self::Intensity => "intensity",
            Self::Red => "red",
            Self::Green => "green",
            Self::Blue => "blue",
            Self::Nir => "nir",
            Self::Class => "gt_class",
            Self::Core => "gt_core",
            Self::Instance | Self::InstanceUpper => "gt_instance",
        }
    }
}

/// Exact sums of one field over points. The order of points and parts does not change a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct FieldSums {
    /// Points.
    pub count: u64,
    /// Sum of the values.
    pub sum: i128,
    /// Sum of their squares.
    pub squares: u128,
}

impl FieldSums {
    /// Adds a value.
    #[inline]
    pub fn add(&mut self, value: i64) {
        let size = u128::from(value.unsigned_abs());
        self.count += 1;
        self.sum += i128::from(value);
        self.squares += size * size;
    }

    /// Adds the points of other sums.
    pub fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.sum += other.sum;
        self.squares += other.squares;
    }

    /// Mean and standard deviation (with n - 1). Computed from exact sums of the differences to the integer
    /// nearest to the mean.
    #[must_use]
    pub fn mean_and_deviation(&self) -> (f64, f64) {
        if self.count == 0 {
            return (0.0, 0.0);
        }
        let count = i128::from(self.count);
        let centre = (2 * self.sum + count).div_euclid(2 * count);
        // With d = value - centre: sum d = sum - n c, and sum d^2 = squares - c (2 sum - n c). Coordinates
        // are below 2^50 with counts below 2^26, or values are below 2^16: no term overflows.
        let rest = self.sum - count * centre;
        let squares = self.squares.cast_signed() - centre * (2 * self.sum - count * centre);
        let n = self.count as f64;
        let mean = centre as f64 + rest as f64 / n;
        let variance = (squares as f64 - (rest as f64).powi(2) / n) / (n - 1.0);
        (mean, variance.max(0.0).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sums(values: &[i64]) -> FieldSums {
        let mut sums = FieldSums::default();
        values.iter().for_each(|&value| sums.add(value));
        sums
    }

    #[test]
    fn mean_and_deviation_are_those_worked_by_hand_however_far_away() {
        // 1, 2, 3, 6: mean 3, squares of differences 4 + 1 + 0 + 9 = 14, over 3.
        for shift in [0, -7, 4_321_000_000_000] {
            let (mean, deviation) = sums(&[1, 2, 3, 6].map(|value| value + shift)).mean_and_deviation();
            assert!(
                (mean - 3.0 - shift as f64).abs() < 1e-3
                    && (deviation - (14.0_f64 / 3.0).sqrt()).abs() < 1e-12
            );
        }
        let mut one = sums(&[1, 6]);
        let two = sums(&[2, 3]);
        one.merge(&two);
        assert_eq!(one, sums(&[1, 2, 3, 6]));
    }
}

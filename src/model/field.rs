//! Fields of a point, and the space of fields in which distances are measured.

use serde::{Deserialize, Serialize};

use crate::model::{Lattice, TileCloud};

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
}

impl Field {
    /// The coordinate that the field is, if it is one.
    #[must_use]
    pub fn axis(self) -> Option<usize> {
        match self {
            Self::X => Some(0),
            Self::Y => Some(1),
            Self::Z => Some(2),
            Self::Intensity | Self::Red | Self::Green | Self::Blue | Self::Nir => None,
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

/// One axis of a space of fields.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FieldAxis {
    /// The field.
    pub field: Field,
    /// The value that maps to 0, in lattice units or as stored in the record.
    pub centre: f64,
    /// Factor from one such unit to the space.
    pub factor: f64,
}

/// The space in which neighbours are searched.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FieldSpace {
    /// Its axes; x and y are among them.
    pub axes: Vec<FieldAxis>,
    /// Factor applied to a distance in this space: metres per lattice unit if the space is that of the
    /// points, else 1.
    pub unit: f64,
}

impl FieldSpace {
    /// x, y and z without a change. Coordinates remain integers, so distances are exact.
    #[must_use]
    pub fn metres(lattice: Lattice) -> Self {
        let axis = |field| FieldAxis { field, centre: 0.0, factor: 1.0 };
        Self { axes: [Field::X, Field::Y, Field::Z].map(axis).to_vec(), unit: lattice.step_m() }
    }

    /// Each field minus its mean, divided by its standard deviation, times its weight (1 if none is given).
    ///
    /// # Errors
    /// The field that has no spread.
    pub fn standardised(fields: &[(Field, FieldSums)], weights: &[f64]) -> Result<Self, Field> {
        let axis = |(at, (field, sums)): (usize, &(Field, FieldSums))| {
            let (centre, deviation) = sums.mean_and_deviation();
            let factor = weights.get(at).copied().unwrap_or(1.0) / deviation;
            if factor.is_finite() && factor > 0.0 {
                Ok(FieldAxis { field: *field, centre, factor })
            } else {
                Err(*field)
            }
        };
        Ok(Self { axes: fields.iter().enumerate().map(axis).collect::<Result<_, _>>()?, unit: 1.0 })
    }

    /// Whether distances are metres.
    #[must_use]
    pub fn is_metric(&self) -> bool {
        self.axes.iter().all(|axis| axis.field.axis().is_some())
    }

    /// The fields that are not coordinates.
    pub fn stored_fields(&self) -> impl Iterator<Item = Field> + '_ {
        self.axes.iter().map(|axis| axis.field).filter(|field| field.axis().is_none())
    }

    /// The places of all points of a cloud, one after the other. A point has the same place in every tile.
    #[must_use]
    pub fn places(&self, cloud: &TileCloud) -> Vec<f64> {
        let mut places = Vec::with_capacity(cloud.len() * self.axes.len());
        let columns: Vec<Option<&[u16]>> = self.axes.iter().map(|axis| cloud.field(axis.field)).collect();
        for point in 0..cloud.len() {
            let at = cloud.lattice_point(point);
            for (axis, column) in self.axes.iter().zip(&columns) {
                let value = match (axis.field.axis(), column) {
                    (Some(axis), _) => at[axis] as f64,
                    (None, Some(column)) => f64::from(column[point]),
                    (None, None) => 0.0,
                };
                places.push((value - axis.centre) * axis.factor);
            }
        }
        places
    }

    /// Largest separation along x or y, in lattice units, of two points within `distance` in this space
    /// (before [`Self::unit`]).
    /// [`Self::unit`]).
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    pub fn horizontal(&self, distance: f64) -> i64 {
        let flat = self.axes.iter().filter(|axis| matches!(axis.field, Field::X | Field::Y));
        let least = flat.map(|axis| axis.factor).fold(f64::INFINITY, f64::min);
        // Rounded up, and by more than the rounding error of the distance.
        (distance / least * (1.0 + 1e-9)).ceil() as i64
    }

    /// An upper bound of the distance between two points of a drive with these corners, before
    /// [`Self::unit`].
    #[must_use]
    pub fn diagonal(&self, (lo, hi): ([i64; 3], [i64; 3])) -> f64 {
        let extent = |axis: &FieldAxis| {
            axis.factor * axis.field.axis().map_or(f64::from(u16::MAX), |axis| (hi[axis] - lo[axis]) as f64)
        };
        self.axes.iter().map(|axis| extent(axis).powi(2)).sum::<f64>().sqrt()
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

    #[test]
    fn standardised_space_bounds_what_is_near_in_the_plane() {
        let fields =
            [(Field::X, sums(&[0, 2_000])), (Field::Y, sums(&[0, 200])), (Field::Intensity, sums(&[0, 20]))];
        let space = FieldSpace::standardised(&fields, &[1.0, 2.0]).unwrap();
        // Deviations 1414.2 and 141.4, the latter over a weight of 2.
        assert_eq!((space.horizontal(0.1), space.is_metric()), (142, false));
        assert_eq!(FieldSpace::standardised(&[(Field::Red, sums(&[7, 7]))], &[]), Err(Field::Red));
        let metres = FieldSpace::metres(Lattice::MILLIMETRE);
        assert_eq!((metres.horizontal(300.0), metres.is_metric()), (301, true));
    }

    #[test]
    fn a_point_has_its_place_whatever_the_origin() {
        let mut cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, &[[5, -7, 9], [1, 1, 1]]);
        cloud.fields = vec![(Field::Red, vec![11, 30])];
        let fields = [(Field::X, sums(&[1, 5])), (Field::Red, sums(&[10, 20]))];
        let space = FieldSpace::standardised(&fields, &[]).unwrap();
        let places = space.places(&cloud);
        let expected =
            [2.0 / 8.0_f64.sqrt(), -4.0 / 50.0_f64.sqrt(), -2.0 / 8.0_f64.sqrt(), 15.0 / 50.0_f64.sqrt()];
        assert!(places.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{places:?}");
    }
}

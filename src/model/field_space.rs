//! The space of fields in which distances between points are measured.

use serde::{Deserialize, Serialize};

use crate::model::{Field, FieldSums, Lattice, TileCloud};

/// One axis of a space of fields.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FieldAxis {
    /// The field.
    pub field: Field,
    /// The value that maps to 0, in lattice units or as stored in the record.
    pub centre: f64,
    /// Factor from this unit to the space.
    pub factor: f64,
}

/// The space in which neighbours are searched.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FieldSpace {
    /// Its axes; x and y are among them.
    pub axes: Vec<FieldAxis>,
    /// Factor applied to a distance in this space: metres per lattice unit if the axes are x, y and z in
    /// lattice units, else 1.
    pub unit: f64,
}

impl FieldSpace {
    /// x, y and z, unchanged. Coordinates remain integers, so distances are exact.
    #[must_use]
    pub fn metres(lattice: Lattice) -> Self {
        let axis = |field| FieldAxis { field, centre: 0.0, factor: 1.0 };
        Self { axes: [Field::X, Field::Y, Field::Z].map(axis).to_vec(), unit: lattice.step_m() }
    }

    /// Each field minus its mean, divided by its standard deviation, times its weight (1 if none is given).
    ///
    /// # Errors
    /// The first field without spread.
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
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    pub fn horizontal(&self, distance: f64) -> i64 {
        let flat = self.axes.iter().filter(|axis| matches!(axis.field, Field::X | Field::Y));
        let least = flat.map(|axis| axis.factor).fold(f64::INFINITY, f64::min);
        // Rounded up by more than the rounding error of the distance.
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

//! Points of n dimensions: rows of numbers, distances, standardisation.

use crate::spatial::dimensions::LARGEST;
use crate::spatial::{DIMENSIONS, SpatialError};

/// Points of n dimensions. A point is identified by its row.
#[derive(Debug, Clone, PartialEq)]
pub struct Points {
    dimensions: usize,
    values: Vec<f64>,
}

impl Points {
    /// Points of `dimensions` numbers each, row by row; an incomplete last row is dropped.
    ///
    /// # Errors
    /// [`SpatialError::Dimensions`], [`SpatialError::TooManyPoints`], [`SpatialError::TooLarge`].
    pub fn new(dimensions: usize, mut values: Vec<f64>) -> Result<Self, SpatialError> {
        if !DIMENSIONS.contains(&dimensions) {
            return Err(SpatialError::Dimensions { dimensions });
        }
        let points = values.len() / dimensions;
        if u32::try_from(points).is_err() {
            return Err(SpatialError::TooManyPoints { points });
        }
        values.truncate(points * dimensions);
        // The square of a distance must be a finite number.
        if let Some(at) = values.iter().position(|value| value.is_nan() || value.abs() > LARGEST) {
            return Err(SpatialError::TooLarge { point: at / dimensions + 1, value: values[at] });
        }
        Ok(Self { dimensions, values })
    }

    /// Numbers per point.
    #[must_use]
    pub fn dimensions(&self) -> usize {
        self.dimensions
    }

    /// Number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.values.len() / self.dimensions
    }

    /// Whether there are no points.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// The numbers of a point.
    #[must_use]
    pub fn row(&self, point: usize) -> &[f64] {
        &self.values[point * self.dimensions..(point + 1) * self.dimensions]
    }

    /// All points in order.
    pub(crate) fn rows(&self) -> impl Iterator<Item = &[f64]> {
        self.values.chunks_exact(self.dimensions)
    }

    /// Squared distance of two points. The squares are added in the order of the dimensions, so that every
    /// code path gives the same bits.
    pub(crate) fn distance_squared(&self, a: usize, b: usize) -> f64 {
        self.row(a).iter().zip(self.row(b)).map(|(p, q)| (p - q) * (p - q)).sum()
    }

    /// Length of the diagonal of the bounding box: no distance is larger.
    pub(crate) fn diagonal(&self) -> f64 {
        let extent = |axis: usize| {
            let (low, high) = self
                .rows()
                .fold((f64::MAX, f64::MIN), |(low, high), row| (low.min(row[axis]), high.max(row[axis])));
            (high - low).max(0.0)
        };
        (0..self.dimensions).map(|axis| extent(axis).powi(2)).sum::<f64>().sqrt()
    }

    /// Subtracts the mean of each dimension, divides by its standard deviation (with n - 1), and multiplies
    /// by a weight (1 if none is given). `dbscan` needs this to combine fields of different units in one
    /// space (Wang et al. 2019, section 3.1).
    ///
    /// # Errors
    /// [`SpatialError::NoSpread`].
    pub fn standardise(&mut self, weights: &[f64]) -> Result<(), SpatialError> {
        let count = self.len() as f64;
        for axis in 0..self.dimensions {
            // Sums in ascending order, so that the order of the rows does not change them.
            let mut values: Vec<f64> = self.rows().map(|row| row[axis]).collect();
            values.sort_unstable_by(f64::total_cmp);
            let mean = values.iter().sum::<f64>() / count;
            let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
            let deviation = (squares / (count - 1.0)).sqrt();
            if deviation.is_nan() || deviation <= 0.0 {
                return Err(SpatialError::NoSpread { dimension: axis + 1 });
            }
            let factor = weights.get(axis).copied().unwrap_or(1.0) / deviation;
            let column = self.values.iter_mut().skip(axis).step_by(self.dimensions);
            column.for_each(|value| *value = (*value - mean) * factor);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dimensions_outside_2_to_8_are_refused() {
        for (dimensions, accepted) in [(0, false), (1, false), (2, true), (8, true), (9, false)] {
            assert_eq!(Points::new(dimensions, vec![0.0; 72]).is_ok(), accepted, "{dimensions}");
        }
    }

    #[test]
    fn numbers_whose_squares_are_not_finite_are_refused() {
        let of = |value: f64| Points::new(2, vec![0.0, 1.0, value, 2.0]);
        assert!(of(-1e150).is_ok());
        for value in [1.1e150, -1e308, f64::INFINITY] {
            assert_eq!(of(value), Err(SpatialError::TooLarge { point: 2, value }));
        }
        assert!(of(f64::NAN).is_err());
    }

    #[test]
    fn standardised_fields_have_mean_0_and_deviation_1_times_the_weight() {
        // Mean 2 and deviation 1; mean 40 and deviation 20.
        let mut points = Points::new(2, vec![1.0, 20.0, 2.0, 40.0, 3.0, 60.0]).unwrap();
        points.standardise(&[1.0, 0.5]).unwrap();
        assert_eq!(points.values, [-1.0, -0.5, 0.0, 0.0, 1.0, 0.5]);
        // The same bits in another order.
        let rows = [0.1, 0.7, 0.2, 1e9, 0.3, -3.3, 0.4, 1e-9];
        let scaled = |order: [usize; 4]| {
            let values = order.iter().flat_map(|&row| rows[2 * row..2 * row + 2].to_vec()).collect();
            let mut points = Points::new(2, values).unwrap();
            points.standardise(&[]).unwrap();
            order.iter().position(|&row| row == 0).map(|at| points.row(at).to_vec())
        };
        assert_eq!(scaled([0, 1, 2, 3]), scaled([3, 1, 0, 2]));
        let mut flat = Points::new(2, vec![1.0, 7.0, 2.0, 7.0]).unwrap();
        assert_eq!(flat.standardise(&[]), Err(SpatialError::NoSpread { dimension: 2 }));
    }
}

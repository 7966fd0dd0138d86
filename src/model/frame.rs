//! Frames: file records, the world in metres, and the integer lattice of the run.
//!
//! Every decision (voxel of a point, comparison of a distance with a radius, cell of the occupancy raster) is
//! made on integers. There is one lattice for the whole run, anchored at multiples of its step and not at the
//! data. A decision therefore depends neither on the tile nor on the file of a point (architecture, section
//! 5).

/// The integer lattice of a run: world coordinate in metres = lattice coordinate * `step_m`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lattice {
    /// Lattice units per metre: 1,000 or 10,000. An integer, because a factor such as 0.001 is not exact.
    units_per_m: u32,
}

impl Lattice {
    /// Step of 1 mm: survey data with a scale of 1 mm or coarser.
    pub const MILLIMETRE: Self = Self { units_per_m: 1_000 };
    /// Step of 0.1 mm: files whose scale is finer than 1 mm. No scanner resolves less.
    pub const TENTH_MILLIMETRE: Self = Self { units_per_m: 10_000 };

    /// The lattice for files whose finest scale is `finest_scale_m` metres.
    #[must_use]
    pub fn for_scale(finest_scale_m: f64) -> Self {
        // The factor 0.999 accepts a scale of 0.001 that was rounded by a conversion through feet or single
        // precision.
        if finest_scale_m < 0.999e-3 { Self::TENTH_MILLIMETRE } else { Self::MILLIMETRE }
    }

    /// Step of the lattice in metres.
    #[must_use]
    pub fn step_m(self) -> f64 {
        1.0 / f64::from(self.units_per_m)
    }

    /// Lattice units per metre.
    #[must_use]
    pub fn units_per_m(self) -> u32 {
        self.units_per_m
    }

    /// A length in metres as lattice units, rounded to the nearest unit.
    ///
    /// ```
    /// use chainage::model::Lattice;
    /// assert_eq!(Lattice::MILLIMETRE.units(0.3), 300);
    /// ```
    #[must_use]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "lengths are validated settings of at most kilometres"
    )]
    pub fn units(self, length_m: f64) -> i64 {
        (length_m * f64::from(self.units_per_m)).round() as i64
    }

    /// A length in metres as lattice units, rounded up: a reach that is not a multiple of the step is never
    /// shortened.
    #[must_use]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "lengths are validated settings of at most kilometres"
    )]
    pub fn units_up(self, length_m: f64) -> i64 {
        (length_m * f64::from(self.units_per_m)).ceil() as i64
    }

    /// A lattice coordinate or length in metres.
    #[must_use]
    pub fn metres(self, units: i64) -> f64 {
        units as f64 / f64::from(self.units_per_m)
    }
}

/// Record coordinate to lattice coordinate, for one axis of one file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AxisTransform {
    /// Scale and offset of the file are multiples of the lattice step: `record * factor + shift`, exactly.
    Integer {
        /// Lattice units per record unit.
        factor: i64,
        /// Lattice coordinate of record 0.
        shift: i64,
    },
    /// All other cases: `round(record * factor + shift)`, a pure function of the record and the file's
    /// header.
    Real {
        /// Lattice units per record unit.
        factor: f64,
        /// Lattice coordinate of record 0.
        shift: f64,
    },
}

impl AxisTransform {
    /// The transform of an axis with the file's `scale` and `offset` in units of `metres_per_unit` metres.
    ///
    /// The caller has checked that all three are finite and that the result fits (see
    /// [`LatticeTransform::LIMIT_UNITS`]).
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "checked against LIMIT_UNITS by the caller")]
    pub fn new(scale: f64, offset: f64, metres_per_unit: f64, lattice: Lattice) -> Self {
        let units = f64::from(lattice.units_per_m()) * metres_per_unit;
        let factor = scale * units;
        let shift = offset * units;
        // A decimal scale in a header, such as 0.01, is a multiple of the step except for rounding in the
        // last digits. The tolerances are far below a lattice unit, even times the largest record value
        // (2^31).
        let near = |value: f64, tolerance: f64| (value - value.round()).abs() <= tolerance;
        if factor >= 0.5 && near(factor, factor * 1e-12) && near(shift, 1e-4) {
            Self::Integer { factor: factor.round() as i64, shift: shift.round() as i64 }
        } else {
            Self::Real { factor, shift }
        }
    }

    /// The lattice coordinate of a record coordinate.
    #[inline]
    #[must_use]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "checked against LIMIT_UNITS when the file was opened"
    )]
    pub fn apply(self, record: i32) -> i64 {
        match self {
            Self::Integer { factor, shift } => i64::from(record) * factor + shift,
            Self::Real { factor, shift } => (f64::from(record) * factor + shift).round() as i64,
        }
    }
}

/// Record coordinates to lattice coordinates, for one file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LatticeTransform {
    /// Transforms of x, y and z.
    pub axes: [AxisTransform; 3],
}

impl LatticeTransform {
    /// Lattice coordinates are below this limit (2^50, about 10^12 m at 1 mm). Every coordinate is then exact
    /// as f64. Squares are summed only over differences that are known to be small.
    pub const LIMIT_UNITS: i64 = 1 << 50;

    /// The lattice coordinates of a record.
    #[inline]
    #[must_use]
    pub fn apply(&self, record: [i32; 3]) -> [i64; 3] {
        [self.axes[0].apply(record[0]), self.axes[1].apply(record[1]), self.axes[2].apply(record[2])]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimal_scales_are_integer_multiples_of_the_lattice() {
        let lattice = Lattice::MILLIMETRE;
        assert_eq!(
            AxisTransform::new(0.01, 4_321_000.0, 1.0, lattice),
            AxisTransform::Integer { factor: 10, shift: 4_321_000_000 }
        );
        assert!(matches!(AxisTransform::new(0.0017, 0.0, 1.0, lattice), AxisTransform::Real { .. }));
        // 0.01 US survey feet are 3.048006 mm.
        assert!(matches!(
            AxisTransform::new(0.01, 0.0, 1200.0 / 3937.0, lattice),
            AxisTransform::Real { .. }
        ));
    }

    #[test]
    fn files_with_other_scale_and_offset_give_the_same_lattice_point() {
        let lattice = Lattice::MILLIMETRE;
        let a = AxisTransform::new(0.001, 651_000.0, 1.0, lattice);
        let b = AxisTransform::new(0.001, 650_999.5, 1.0, lattice);
        let c = AxisTransform::new(0.01, 0.25, 1.0, lattice);
        assert_eq!(a.apply(1_230), 651_001_230);
        assert_eq!(b.apply(1_730), 651_001_230);
        assert_eq!(c.apply(65_100_098), 651_001_230);
    }
}

//! The plane through heights at cells of a raster, by weighted least squares.

/// Distance of the samples from their centre, in cells, below which the slope is damped towards zero. At 1.4
/// times this distance the slope is halved. Without damping, a plane through neighbouring cells would
/// continue a kerb as a ramp.
const LEVER_CELLS: f64 = 1.0;

/// Weighted sums over samples. Heights are relative to the first sample, so that the result does not depend
/// on the elevation of the drive.
#[derive(Debug, Default)]
pub(crate) struct Plane {
    base: Option<i64>,
    w: f64,
    x: f64,
    y: f64,
    z: f64,
    xx: f64,
    xy: f64,
    yy: f64,
    xz: f64,
    yz: f64,
    zz: f64,
}

impl Plane {
    /// Adds the height in lattice units of the cell at an offset.
    pub(crate) fn add(&mut self, [i, j]: [i32; 2], height: i64, weight: f64) {
        let i = f64::from(i);
        let j = f64::from(j);
        let height = (height - *self.base.get_or_insert(height)) as f64;
        self.w += weight;
        self.x += weight * i;
        self.y += weight * j;
        self.z += weight * height;
        self.xx += weight * i * i;
        self.xy += weight * i * j;
        self.yy += weight * j * j;
        self.xz += weight * i * height;
        self.yz += weight * j * height;
        self.zz += weight * height * height;
    }

    /// Sums about the weighted centre: xx, xy, yy, xz and yz.
    fn centred(&self) -> [f64; 5] {
        let Self { w, x, y, z, .. } = *self;
        [
            self.xx - x * x / w,
            self.xy - x * y / w,
            self.yy - y * y / w,
            self.xz - x * z / w,
            self.yz - y * z / w,
        ]
    }

    /// The slope along both axes, in lattice units per cell.
    fn slope(&self) -> [f64; 2] {
        let [xx, xy, yy, xz, yz] = self.centred();
        let lever = LEVER_CELLS * LEVER_CELLS * self.w;
        let (xx, yy) = (xx + lever, yy + lever);
        let determinant = xx * yy - xy * xy;
        [(xz * yy - yz * xy) / determinant, (yz * xx - xz * xy) / determinant]
    }

    /// The height at offset (0, 0), in lattice units. At least one sample must have been added.
    #[expect(clippy::cast_possible_truncation, reason = "heights of a drive in lattice units")]
    pub(crate) fn height(&self) -> i64 {
        let [slope_x, slope_y] = self.slope();
        let Self { w, x, y, z, .. } = *self;
        self.base.unwrap_or(0) + (z / w - slope_x * x / w - slope_y * y / w).round() as i64
    }

    /// The mean squared distance of the samples from the plane along z, in squared lattice units.
    pub(crate) fn residual(&self) -> f64 {
        let [xx, xy, yy, xz, yz] = self.centred();
        let [u, v] = self.slope();
        let zz = self.zz - self.z * self.z / self.w;
        (zz - 2.0 * (u * xz + v * yz) + u * u * xx + 2.0 * u * v * xy + v * v * yy) / self.w
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(samples: &[([i32; 2], i64)]) -> Plane {
        let mut plane = Plane::default();
        samples.iter().for_each(|&(by, height)| plane.add(by, height, 1.0));
        plane
    }

    fn patch(height: impl Fn(i64, i64) -> i64) -> Plane {
        let all = (-6..=6).flat_map(|i| (-6..=6).map(move |j| [i, j]));
        plane(&all.map(|[i, j]| ([i, j], height(i.into(), j.into()))).collect::<Vec<_>>())
    }

    #[test]
    fn a_plane_has_its_height_in_the_middle_and_nearly_no_residual() {
        let tilted = patch(|i, j| 5_000 + 100 * i - 40 * j);
        assert_eq!(tilted.height(), 5_000);
        // The lever takes 1 / 15 of the slope: 15 = (13² - 1) / 12 + 1.
        let left: f64 = 14.0 * (100.0_f64.powi(2) + 40.0_f64.powi(2)) / 15.0_f64.powi(2);
        assert!((tilted.residual() - left).abs() < 1e-6, "{} {left}", tilted.residual());
    }

    #[test]
    fn the_residual_is_what_is_added_to_a_plane() {
        // A chessboard of an odd number of cells is nearly orthogonal to the plane.
        let rough = patch(|i, j| if (i + j) % 2 == 0 { 250 } else { -250 });
        assert!((rough.residual().sqrt() - 250.0).abs() < 1.0, "{}", rough.residual().sqrt());
        assert!(patch(|_, _| 77).residual().abs() < f64::EPSILON);
    }

    #[test]
    fn samples_on_a_line_or_in_one_cell_are_fitted_too() {
        assert_eq!(plane(&[([3, 3], 40)]).height(), 40);
        assert!(plane(&[([3, 3], 40)]).residual().abs() < f64::EPSILON);
        let line = plane(&[([0, 0], 0), ([1, 1], 100), ([2, 2], 200), ([3, 3], 300)]);
        assert!(line.residual().sqrt() < 50.0, "{}", line.residual());
    }
}

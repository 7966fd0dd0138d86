//! The axis of an upright chain: the straight line through its voxels, by least squares of x and y over z.
//! All sums are integers, so the axis does not depend on the order of the voxels.

use serde::{Deserialize, Serialize};

/// Sums over the centres of voxels relative to `from`, in lattice units.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Axis {
    from: [i64; 3],
    count: i64,
    sum: [i64; 3],
    /// Sums of z², xz and yz.
    zz: i64,
    xz: i64,
    yz: i64,
}

impl Axis {
    /// An axis without voxels. Its sums stay far below 2⁶³ if `from` is near the voxels.
    pub(crate) fn new(from: [i64; 3]) -> Self {
        Self { from, count: 0, sum: [0; 3], zz: 0, xz: 0, yz: 0 }
    }

    /// Adds the centre of a voxel.
    pub(crate) fn add(&mut self, centre: [i64; 3]) {
        let [x, y, z] = [0, 1, 2].map(|axis| centre[axis] - self.from[axis]);
        self.count += 1;
        self.sum = [self.sum[0] + x, self.sum[1] + y, self.sum[2] + z];
        self.zz += z * z;
        self.xz += x * z;
        self.yz += y * z;
    }

    /// Adds the voxels of another axis.
    pub(crate) fn merge(&mut self, other: &Self) {
        let [dx, dy, dz] = [0, 1, 2].map(|axis| other.from[axis] - self.from[axis]);
        let [x, y, z] = other.sum;
        let count = other.count;
        self.count += count;
        self.sum = [self.sum[0] + x + count * dx, self.sum[1] + y + count * dy, self.sum[2] + z + count * dz];
        self.zz += other.zz + 2 * dz * z + count * dz * dz;
        self.xz += other.xz + dx * z + dz * x + count * dx * dz;
        self.yz += other.yz + dy * z + dz * y + count * dy * dz;
    }

    /// How far the axis leans: metres in the plane per metre of height. 0 if all voxels have the same height.
    pub(crate) fn slope(&self) -> f64 {
        let [x, y, z] = self.sum.map(|sum| sum as f64);
        let count = self.count as f64;
        let spread = count * self.zz as f64 - z * z;
        if spread <= 0.0 {
            return 0.0;
        }
        let along = [(self.xz, x), (self.yz, y)];
        let [u, v] = along.map(|(product, sum)| (count * product as f64 - sum * z) / spread);
        (u * u + v * v).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Voxels on a line that leans by `lean` millimetres per metre in x, twice as much in y.
    fn leaning(heights: std::ops::Range<i64>, lean: i64) -> Vec<[i64; 3]> {
        heights.map(|step| [7_000 + lean * step / 10, -3_000 + 2 * lean * step / 10, 100 * step]).collect()
    }

    #[test]
    fn the_slope_is_that_of_the_line() {
        for lean in [0, 20, -50] {
            let mut axis = Axis::new([7_000, 0, 900]);
            leaning(0..30, lean).into_iter().for_each(|centre| axis.add(centre));
            let expected = 5_f64.sqrt() * lean.abs() as f64 / 1000.0;
            assert!((axis.slope() - expected).abs() < 1e-3, "{} {expected}", axis.slope());
        }
    }

    #[test]
    fn parts_from_other_places_add_up() {
        let mut whole = Axis::new([0; 3]);
        leaning(0..30, 30).into_iter().for_each(|centre| whole.add(centre));
        let mut parts = Axis::new([6_500, -2_000, 700]);
        leaning(0..11, 30).into_iter().for_each(|centre| parts.add(centre));
        let mut other = Axis::new([7_100, -3_100, 2_000]);
        leaning(11..30, 30).into_iter().for_each(|centre| other.add(centre));
        parts.merge(&other);
        assert!((whole.slope() - parts.slope()).abs() < 1e-9);
    }

    #[test]
    fn voxels_of_one_height_do_not_lean() {
        let mut axis = Axis::new([0; 3]);
        assert!(axis.slope().abs() < 1e-12);
        [[0, 0, 5], [900, 3, 5]].into_iter().for_each(|centre| axis.add(centre));
        assert!(axis.slope().abs() < 1e-12);
    }
}

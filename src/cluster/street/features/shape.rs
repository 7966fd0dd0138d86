//! The shape of what is around a voxel or a cube: sums over the balls around it, and their principal axes.
//!
//! The sums are integers, over differences to the centre of the ball. So neither their order nor the tile
//! changes them. A ball costs the number of its columns plus the number of its members: the columns around a
//! column are found once, and a lower bound moves up with the centre.
#![expect(
    clippy::cast_possible_truncation,
    reason = "isqrt of radii below 10, and features are single precision"
)]

use super::eigen::eigen;
use crate::cluster::columns::{Columns, disc};

/// Number of features of a shape.
pub(super) const COUNT: usize = 7;

/// Sums over the members of a ball: number, first and second moments of the differences to its centre.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(super) struct Moments {
    pub(super) n: i64,
    pub(super) first: [i64; 3],
    /// xx, xy, xz, yy, yz, zz.
    pub(super) second: [i64; 6],
}

impl Moments {
    #[inline]
    fn add(&mut self, [x, y, z]: [i64; 3]) {
        self.n += 1;
        self.first[0] += x;
        self.first[1] += y;
        self.first[2] += z;
        self.second[0] += x * x;
        self.second[1] += x * y;
        self.second[2] += x * z;
        self.second[3] += y * y;
        self.second[4] += y * z;
        self.second[5] += z * z;
    }
}

/// The principal axes of a ball.
#[derive(Debug, Default, Clone, Copy)]
pub(super) struct Shape {
    /// Members.
    n: f32,
    /// (l1 - l2) / l1, (l2 - l3) / l1 and l3 / l1 of the standard deviations along the axes, or -1 if there
    /// are fewer than 3 members.
    linear: f32,
    planar: f32,
    scattered: f32,
    /// |z| of the smallest axis (the normal) and of the largest one, or -1.
    normal_z: f32,
    axis_z: f32,
    /// The normal, or 0.
    normal: [f32; 3],
    /// Component along the normal of the way from the centre of the ball to the mean of its members, in
    /// lattice units.
    offset: f32,
}

impl Shape {
    /// The shape of a ball.
    pub(super) fn of(moments: &Moments) -> Self {
        let n = moments.n;
        if n < 3 {
            let none = -1.0;
            return Self {
                n: n as f32,
                linear: none,
                planar: none,
                scattered: none,
                normal_z: none,
                axis_z: none,
                ..Self::default()
            };
        }
        // n^2 times the covariance, exactly.
        let [x, y, z] = moments.first;
        let products = [x * x, x * y, x * z, y * y, y * z, z * z];
        let mut covariance = [0.0; 6];
        for ((entry, &sum), product) in covariance.iter_mut().zip(&moments.second).zip(products) {
            *entry = (n * sum - product) as f64;
        }
        let [(large, axis), (middle, _), (small, normal)] = eigen(covariance);
        let [l1, l2, l3] = [large, middle, small].map(|value| value.max(0.0).sqrt());
        let l1 = l1.max(1e-9);
        let mean = moments.first.map(|sum| sum as f64 / n as f64);
        Self {
            n: n as f32,
            linear: ((l1 - l2) / l1) as f32,
            planar: ((l2 - l3) / l1) as f32,
            scattered: (l3 / l1) as f32,
            normal_z: normal[2].abs() as f32,
            axis_z: axis[2].abs() as f32,
            normal: normal.map(|part| part as f32),
            offset: (mean[0] * normal[0] + mean[1] * normal[1] + mean[2] * normal[2]) as f32,
        }
    }

    /// The features of a voxel whose centre is `from` away from the centre of the ball, in lattice units. The
    /// last one is its distance to the plane through the mean, in metres.
    pub(super) fn features(&self, from: [i64; 3], step_m: f32) -> [f32; COUNT] {
        let [x, y, z] = from.map(|part| part as f32);
        let along = x * self.normal[0] + y * self.normal[1] + z * self.normal[2];
        let distance = if self.n < 3.0 { -1.0 } else { (self.offset - along).abs() * step_m };
        [self.n, self.linear, self.planar, self.scattered, self.normal_z, self.axis_z, distance]
    }
}

/// Visits each wanted member with the moments of the members whose keys are at most the square root of
/// `radius2` away from its own. `centre` are their positions in lattice units.
pub(super) fn balls(
    columns: &Columns,
    centre: &[[i64; 3]],
    wanted: &[bool],
    radius2: i64,
    mut visit: impl FnMut(usize, &Moments),
) {
    let disc: Vec<([i32; 2], i32)> =
        disc(radius2).into_iter().map(|(square, by)| (by, (radius2 - square).isqrt() as i32)).collect();
    let k = columns.heights();
    let mut finder = columns.finder();
    // First member that may be in the ball, end of its column, half height of the ball there.
    let mut around: Vec<(usize, usize, i32)> = Vec::with_capacity(disc.len());
    for (column, &[i, j]) in columns.cells().iter().enumerate() {
        let members = columns.voxels(column);
        if !wanted[members.clone()].contains(&true) {
            continue;
        }
        around.clear();
        for &([di, dj], half) in &disc {
            let range = finder.column([i + di, j + dj]);
            if !range.is_empty() {
                around.push((range.start, range.end, half));
            }
        }
        for member in members.filter(|&member| wanted[member]) {
            let [x, y, z] = centre[member];
            let mut moments = Moments::default();
            for (low, end, half) in &mut around {
                while low < end && k[*low] < k[member] - *half {
                    *low += 1;
                }
                let mut at = *low;
                while at < *end && k[at] <= k[member] + *half {
                    let other = centre[at];
                    moments.add([other[0] - x, other[1] - y, other[2] - z]);
                    at += 1;
                }
            }
            visit(member, &moments);
        }
    }
}

//! The shape of the surroundings of a voxel or a cube: sums over the balls around it, and their principal
//! axes.
//!
//! The sums are integers over differences to the centre of the ball. So they depend neither on their order
//! nor on the tile. The cost of a ball is the number of its columns plus the number of its members: the
//! columns around a column are found once, and a lower bound moves up with the centre.
#![expect(
    clippy::cast_possible_truncation,
    reason = "isqrt of radii below 10, and features are single precision"
)]

use crate::cluster::columns::{Columns, disc};
use crate::cluster::eigen::eigen;

/// Number of features of a shape.
pub(crate) const COUNT: usize = 7;

/// Sums over the members of a ball: first and second moments of the differences to its centre. They are
/// integers in double precision: below 2^53 every sum and product is exact, in any order, and two fit a
/// vector register of every processor.
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct Moments {
    /// x, y, z and the number of members.
    pub(crate) first: [f64; 4],
    /// xx, xy, yy, yz, zz, zx.
    pub(crate) second: [f64; 6],
}

impl Moments {
    #[inline]
    fn add(&mut self, [x, y, z]: [f64; 3]) {
        for (sum, value) in self.first.iter_mut().zip([x, y, z, 1.0]) {
            *sum += value;
        }
        let left = [x, x, y, y, z, z];
        let right = [x, y, y, z, z, x];
        for ((sum, left), right) in self.second.iter_mut().zip(left).zip(right) {
            *sum += left * right;
        }
    }
}

/// The principal axes of a ball.
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct Shape {
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
    /// Component along the normal of the vector from the centre of the ball to the mean of its members, in
    /// lattice units.
    offset: f32,
}

impl Shape {
    /// The shape of a ball.
    pub(crate) fn of(moments: &Moments) -> Self {
        let [x, y, z, n] = moments.first;
        if n < 3.0 {
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
        let [xx, xy, yy, yz, zz, zx] = moments.second;
        let covariance =
            [n * xx - x * x, n * xy - x * y, n * zx - x * z, n * yy - y * y, n * yz - y * z, n * zz - z * z];
        let [(large, axis), (middle, _), (small, normal)] = eigen(covariance);
        let [l1, l2, l3] = [large, middle, small].map(|value| value.max(0.0).sqrt());
        let l1 = l1.max(1e-9);
        let mean = [x / n, y / n, z / n];
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
    pub(crate) fn features(&self, from: [i64; 3], step_m: f32) -> [f32; COUNT] {
        let [x, y, z] = from.map(|part| part as f32);
        let along = x * self.normal[0] + y * self.normal[1] + z * self.normal[2];
        let distance = if self.n < 3.0 { -1.0 } else { (self.offset - along).abs() * step_m };
        [self.n, self.linear, self.planar, self.scattered, self.normal_z, self.axis_z, distance]
    }
}

/// Visits each wanted member with the moments of the members whose keys are at most the square root of
/// `radius2` away from its own. `centre` are their positions in lattice units.
pub(crate) fn balls(
    columns: &Columns,
    centre: &[[i64; 3]],
    wanted: &[bool],
    radius2: i64,
    mut visit: impl FnMut(usize, &Moments),
) {
    let disc: Vec<([i32; 2], i32)> =
        disc(radius2).into_iter().map(|(square, by)| (by, (radius2 - square).isqrt() as i32)).collect();
    // Exact: lattice coordinates are below 2^50.
    let centre: Vec<[f64; 3]> = centre.iter().map(|centre| centre.map(|value| value as f64)).collect();
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
            let level = k[member];
            let mut moments = Moments::default();
            for (low, end, half) in &mut around {
                let column = &k[..*end];
                while *low < *end && column[*low] < level - *half {
                    *low += 1;
                }
                let members = column[*low..].iter().zip(&centre[*low..*end]);
                for (_, other) in members.take_while(|(at, _)| **at <= level + *half) {
                    moments.add([other[0] - x, other[1] - y, other[2] - z]);
                }
            }
            visit(member, &moments);
        }
    }
}

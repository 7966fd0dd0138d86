//! The plane of a surface: where it is, its normal, and coordinates in it.

use serde::{Deserialize, Serialize};

/// A plane through a lattice point, with figures of the points to which it is fitted.
///
/// ```
/// use chainage::model::Plane;
///
/// // A wall along the x axis: u goes along it, and v up.
/// let centre = [1_000, 500, 2_000];
/// let wall = Plane { centre, normal: [0.0, 1.0, 0.0], flatness_units2: 4.0, points: 80 };
/// let place = wall.local([1_250, 503, 2_100]);
/// assert_eq!(place.map(i64::abs), [250, 100]);
/// assert_eq!(wall.lattice_point(place), [1_250.0, 500.0, 2_100.0]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Plane {
    /// Mean of the fitted points, rounded to the lattice. The plane goes through it.
    pub centre: [i64; 3],
    /// Unit normal. Its z is positive; if that is 0, its y; if both are 0, its x.
    pub normal: [f64; 3],
    /// Mean squared distance of the fitted points from the plane, in square lattice units.
    pub flatness_units2: f64,
    /// Number of fitted points.
    pub points: u64,
}

impl Plane {
    /// Two unit vectors in the plane, at right angles to each other: u is horizontal, and u, v, normal are
    /// right-handed. u is the x axis if the plane is horizontal.
    fn axes(&self) -> [[f64; 3]; 2] {
        let [x, y, z] = self.normal;
        let level = (x * x + y * y).sqrt();
        let u = if level > 1e-9 { [-y / level, x / level, 0.0] } else { [1.0, 0.0, 0.0] };
        let v = [y * u[2] - z * u[1], z * u[0] - x * u[2], x * u[1] - y * u[0]];
        [u, v]
    }

    /// Coordinates (u, v) of the projection of a lattice point onto the plane, relative to the centre of the
    /// plane, in lattice units.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "not longer than the distance of two lattice points")]
    pub fn local(&self, point: [i64; 3]) -> [i64; 2] {
        let by = [0, 1, 2].map(|axis| (point[axis] - self.centre[axis]) as f64);
        self.axes().map(|along| (by[0] * along[0] + by[1] * along[1] + by[2] * along[2]).round() as i64)
    }

    /// The lattice coordinates of a place (u, v) in the plane.
    #[must_use]
    pub fn lattice_point(&self, place: [i64; 2]) -> [f64; 3] {
        let [u, v] = self.axes();
        let [by_u, by_v] = place.map(|value| value as f64);
        [0, 1, 2].map(|axis| self.centre[axis] as f64 + (by_u * u[axis] + by_v * v[axis]))
    }

    /// A normal with the sign that this type requires.
    #[must_use]
    pub fn upward(normal: [f64; 3]) -> [f64; 3] {
        let decides = if normal[2].abs() > 0.0 { 2 } else { usize::from(normal[1].abs() > 0.0) };
        let sign = if normal[decides] < 0.0 { -1.0 } else { 1.0 };
        // Plus 0, so that no coordinate is -0.
        normal.map(|value| sign * value + 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(normal: [f64; 3]) -> Plane {
        let length = normal.iter().map(|value| value * value).sum::<f64>().sqrt();
        let normal = Plane::upward(normal.map(|value| value / length));
        Plane { centre: [7, -9, 11], normal, flatness_units2: 0.0, points: 3 }
    }

    #[test]
    #[expect(clippy::cast_possible_truncation, reason = "places of a few metres")]
    fn places_in_the_plane_come_back() {
        for normal in [[0.0, 0.0, 1.0], [0.0, 0.0, -2.0], [1.0, 0.0, 0.0], [-3.0, 2.0, 0.0], [1.0, -2.0, 0.5]]
        {
            let plane = plane(normal);
            for place in [[0, 0], [4_000, 0], [-1_234, 567], [0, -1]] {
                let point = plane.lattice_point(place).map(|value| value.round() as i64);
                let back = plane.local(point);
                assert!(
                    (0..2).all(|axis| (back[axis] - place[axis]).abs() <= 1),
                    "{normal:?} {place:?} {back:?}"
                );
            }
        }
    }

    #[test]
    fn axes_are_right_handed_and_u_is_level() {
        for normal in [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [-3.0, 2.0, 0.0], [1.0, -2.0, 0.5]] {
            let plane = plane(normal);
            let [u, v] = plane.axes();
            assert!(u[2].abs() < 1e-15);
            let cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            assert!(
                (0..3).all(|axis| (cross[axis] - plane.normal[axis]).abs() < 1e-12),
                "{normal:?} {cross:?}"
            );
        }
    }

    #[test]
    fn normals_point_up_or_north_or_east() {
        for (normal, expected) in [
            ([0.5, 0.5, -0.7], [-0.5, -0.5, 0.7]),
            ([1.0, -2.0, 0.0], [-1.0, 2.0, 0.0]),
            ([-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
        ] {
            assert_eq!(Plane::upward(normal).map(f64::to_bits), expected.map(f64::to_bits));
        }
        assert!(Plane::upward([-1.0, 0.0, 0.0]).iter().all(|value| value.is_sign_positive()));
    }
}

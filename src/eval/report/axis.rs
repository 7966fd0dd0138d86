//! Positions along the drive: chainage along a trajectory, or along the principal axis of the objects.

use std::path::Path;

use crate::eval::error::EvalError;
use crate::input::InputError;

/// Smallest distance between vertices of a trajectory, metres; closer ones are skipped. 1 m is finer than
/// anyone needs to find an object. A trajectory at 200 Hz has a hundred times more vertices.
const SPACING_M: f64 = 1.0;

/// A line in the plane that gives a position its chainage in metres.
#[derive(Debug, Clone, PartialEq)]
pub enum Axis {
    /// A polyline of the plane with the distance along it at every vertex.
    Trajectory {
        /// x, y and distance along the line, in metres.
        vertices: Vec<[f64; 3]>,
    },
    /// A straight line.
    Principal {
        /// A point on it, x and y in metres; its chainage is 0.
        origin: [f64; 2],
        /// Unit vector along it.
        direction: [f64; 2],
    },
}

impl Axis {
    /// Reads a trajectory: CSV with a header that names the columns `x` and `y` (metres), rows in driving
    /// order.
    ///
    /// # Errors
    /// [`InputError::Read`] when the file cannot be read, [`EvalError::Trajectory`] when a line is not as
    /// expected.
    pub fn read(path: &Path) -> crate::Result<Self> {
        let text = fs_err::read_to_string(path)
            .map_err(|source| InputError::Read { path: path.to_owned(), source })?;
        Ok(Self::parse(&text).map_err(|(line, expected)| EvalError::Trajectory {
            path: path.to_owned(),
            line,
            expected,
        })?)
    }

    fn parse(text: &str) -> Result<Self, (usize, &'static str)> {
        let mut lines = text.lines().enumerate();
        let header: Vec<&str> = lines.next().map_or("", |first| first.1).split(',').map(str::trim).collect();
        let column = |name: &str| header.iter().position(|title| title.eq_ignore_ascii_case(name));
        let columns = column("x").zip(column("y")).ok_or((1, "a header with the columns x and y"))?;
        let mut points = Vec::new();
        for (index, line) in lines.filter(|line| !line.1.trim().is_empty()) {
            let fields: Vec<&str> = line.split(',').collect();
            let number = |at: usize| fields.get(at)?.trim().parse().ok().filter(|n: &f64| n.is_finite());
            let point = number(columns.0).zip(number(columns.1));
            let (x, y) = point.ok_or((index + 1, "finite numbers in the columns x and y"))?;
            points.push([x, y]);
        }
        if points.len() < 2 {
            return Err((text.lines().count(), "at least two positions"));
        }
        Ok(Self::polyline(&points))
    }

    /// The axis through `points` in the plane, in metres.
    fn polyline(points: &[[f64; 2]]) -> Self {
        let mut vertices: Vec<[f64; 3]> = Vec::new();
        for (index, &[x, y]) in points.iter().enumerate() {
            match vertices.last() {
                None => vertices.push([x, y, 0.0]),
                Some(&[x0, y0, along]) => {
                    let step = (x - x0).hypot(y - y0);
                    if step >= SPACING_M || (index + 1 == points.len() && step > 0.0) {
                        vertices.push([x, y, along + step]);
                    }
                }
            }
        }
        Self::Trajectory { vertices }
    }

    /// The axis along the largest spread of `positions` in the plane, towards larger x (or y, if it is
    /// steep). Chainage 0 is at the first position along the axis.
    #[must_use]
    pub fn principal(positions: &[[f64; 3]]) -> Self {
        let n = positions.len().max(1) as f64;
        let mean = [0, 1].map(|axis| positions.iter().map(|at| at[axis]).sum::<f64>() / n);
        let moment = |a: usize, b: usize| {
            positions.iter().map(|at| (at[a] - mean[a]) * (at[b] - mean[b])).sum::<f64>()
        };
        // Angle of the larger eigenvector of a symmetric 2 x 2 matrix.
        let angle = 0.5 * (2.0 * moment(0, 1)).atan2(moment(0, 0) - moment(1, 1));
        let (sin, cos) = angle.sin_cos();
        let direction = if cos.abs() >= sin.abs() && cos < 0.0 || sin.abs() > cos.abs() && sin < 0.0 {
            [-cos, -sin]
        } else {
            [cos, sin]
        };
        let through_mean = Self::Principal { origin: mean, direction };
        let first = positions.iter().map(|at| through_mean.chainage_m(*at)).reduce(f64::min).unwrap_or(0.0);
        let origin = [0, 1].map(|axis| mean[axis] + first * direction[axis]);
        Self::Principal { origin, direction }
    }

    /// Distance along the axis, in metres, to the point of the axis that is nearest to `at` in the plane.
    #[must_use]
    pub fn chainage_m(&self, at: [f64; 3]) -> f64 {
        match self {
            Self::Principal { origin, direction } => {
                (at[0] - origin[0]) * direction[0] + (at[1] - origin[1]) * direction[1]
            }
            Self::Trajectory { vertices } => {
                let mut best = (f64::INFINITY, 0.0);
                for pair in vertices.windows(2) {
                    let candidate = nearest_on_segment(pair[0], pair[1], at);
                    if candidate.0 < best.0 {
                        best = candidate;
                    }
                }
                best.1
            }
        }
    }
}

/// Squared distance to the segment and chainage of its nearest point.
fn nearest_on_segment(from: [f64; 3], to: [f64; 3], at: [f64; 3]) -> (f64, f64) {
    let dx = to[0] - from[0];
    let dy = to[1] - from[1];
    // Neighbouring vertices are never at the same place, because closer ones were skipped.
    let share = (((at[0] - from[0]) * dx + (at[1] - from[1]) * dy) / (dx * dx + dy * dy)).clamp(0.0, 1.0);
    let x = from[0] + share * dx - at[0];
    let y = from[1] + share * dy - at[1];
    (x * x + y * y, from[2] + share * (to[2] - from[2]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trajectory_is_followed_round_the_corner() {
        let text = "gps_time,x,y,z\n0,0,0,9\n1,0.2,0,9\n2,10,0,9\n\n3,10,20,9\n";
        let axis = Axis::parse(text).unwrap();
        for (at, expected) in [([4.0, 3.0, 0.0], 4.0), ([13.0, 5.0, 0.0], 15.0), ([-5.0, 1.0, 0.0], 0.0)] {
            assert!((axis.chainage_m(at) - expected).abs() < 1e-9, "{at:?}");
        }
        assert!((axis.chainage_m([10.0, 99.0, 0.0]) - 30.0).abs() < 1e-9);
    }

    #[test]
    fn a_wrong_line_is_named() {
        for (text, line) in
            [("t,x,z\n", 1), ("x,y\n1,2\n3\n", 3), ("x,y\n1,2\n3,inf\n", 3), ("x,y\n1,2\n", 2), ("", 0)]
        {
            let found = Axis::parse(text).unwrap_err().0;
            assert_eq!(found, if text.is_empty() { 1 } else { line }, "{text}");
        }
        let still = Axis::parse("x,y\n1,2\n1,2\n").unwrap();
        assert_eq!(still.chainage_m([5.0, 5.0, 0.0]).to_bits(), 0.0_f64.to_bits());
    }

    #[test]
    fn the_principal_axis_starts_at_the_first_object() {
        let axis = Axis::principal(&[[30.0, 43.0, 0.0], [0.0, 3.0, 0.0], [15.0, 23.0, 9.0]]);
        // Direction (3, 4) / 5; the objects are 0, 25 and 50 m along it.
        for (at, expected) in [([0.0, 3.0, 0.0], 0.0), ([15.0, 23.0, 0.0], 25.0), ([30.0, 43.0, 0.0], 50.0)] {
            assert!((axis.chainage_m(at) - expected).abs() < 1e-9, "{at:?}");
        }
        assert!((Axis::principal(&[[7.0, 7.0, 7.0]]).chainage_m([7.0, 7.0, 0.0])).abs() < 1e-9);
        assert!(Axis::principal(&[]).chainage_m([1.0, 0.0, 0.0]).is_finite());
    }
}

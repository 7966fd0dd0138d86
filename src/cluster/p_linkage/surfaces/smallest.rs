//! The smallest eigenvalue of a covariance matrix, its unit vector, and the two other eigenvalues. Newton's
//! method on the characteristic polynomial takes a third of the time of rotations. Only +, -, *, / and the
//! square root are used, in a fixed sequence, so the result is the same on every platform.

use crate::cluster::eigen::{Symmetric, eigen_within};

/// Size of off-diagonal entries, relative to the trace, below which a matrix is diagonal. Normals are
/// compared by the cosine of their angle, which has half of the digits of the angle.
const DIAGONAL: f64 = 1e-12;
/// Product of the distances of the smallest eigenvalue from the others, relative to the square of the trace,
/// above which Newton's method is exact to about 12 digits. Below it, rotations are still exact, but this
/// method is not.
const APART: f64 = 1e-4;
/// Largest number of steps of Newton's method. It approaches the smallest root from below, quadratically; 3
/// to 5 suffice.
const STEPS: usize = 8;
/// Step, relative to the trace, below which the root is exact enough.
const SMALL_STEP: f64 = 1e-9;

/// Eigenvalues in ascending order, and the unit vector of the smallest.
#[derive(Debug, Clone, Copy)]
pub(super) struct Smallest {
    pub(super) values: [f64; 3],
    pub(super) vector: [f64; 3],
}

/// The eigenvalues of a symmetric matrix without negative eigenvalues.
pub(super) fn smallest(matrix: Symmetric) -> Smallest {
    newton(matrix).unwrap_or_else(|| {
        let [(large, _), (middle, _), (small, vector)] = eigen_within(DIAGONAL, matrix);
        Smallest { values: [small, middle, large], vector }
    })
}

/// Newton's method. `None` if the smallest eigenvalue is not well separated from the others.
fn newton(matrix: Symmetric) -> Option<Smallest> {
    let trace = matrix[0] + matrix[3] + matrix[5];
    let [xx, xy, xz, yy, yz, zz] = matrix.map(|value| value / trace);
    let minors = (xx * yy - xy * xy) + (xx * zz - xz * xz) + (yy * zz - yz * yz);
    let determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
    let (mut root, mut slope) = (0.0_f64, minors);
    let mut settled = false;
    for _ in 0..STEPS {
        let value = ((root - 1.0) * root + minors) * root - determinant;
        slope = (3.0 * root - 2.0) * root + minors;
        // A trace of 0 gives NaN.
        if slope.is_nan() || slope < APART {
            return None;
        }
        let step = value / slope;
        root -= step;
        if step.abs() < SMALL_STEP {
            settled = true;
            break;
        }
    }
    if !settled || slope < APART {
        return None;
    }
    let [a, b, c] = [[xx - root, xy, xz], [xy, yy - root, yz], [xz, yz, zz - root]];
    // The rows span the plane of the other two eigenvectors. The longest of their cross products is the most
    // exact.
    let mut longest = (0.0, [0.0; 3]);
    for product in [cross(a, b), cross(a, c), cross(b, c)] {
        let squared = product[0] * product[0] + product[1] * product[1] + product[2] * product[2];
        if squared > longest.0 {
            longest = (squared, product);
        }
    }
    let length = longest.0.sqrt();
    let (sum, product) = (1.0 - root, minors - root * (1.0 - root));
    let apart = (sum * sum - 4.0 * product).max(0.0).sqrt();
    let large = (sum + apart) / 2.0;
    let values = [root, product / large, large].map(|value| value * trace);
    (length > 0.0).then(|| Smallest { values, vector: longest.1.map(|part| part / length) })
}

fn cross(u: [f64; 3], v: [f64; 3]) -> [f64; 3] {
    [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::Numbers;

    #[test]
    fn values_and_vectors_are_those_of_rotations() {
        let mut numbers = Numbers::new(3);
        let mut next = || (numbers.bits() >> 40) as f64 / f64::from(1 << 24) - 0.5;
        let mut by_newton = 0;
        for round in 0..2_000 {
            let flat = [1.0, 0.1, 1e-3, 1e-6][round % 4];
            let vectors =
                [1.0, 0.6, flat].map(|scale| [next() * scale, next() * scale, next() * scale * flat]);
            let sum = |a: usize, b: usize| vectors.iter().map(|v| v[a] * v[b]).sum::<f64>() * 1e4;
            let matrix = [sum(0, 0), sum(0, 1), sum(0, 2), sum(1, 1), sum(1, 2), sum(2, 2)];
            let [(large, _), (middle, _), (small, vector)] = eigen_within(1e-15, matrix);
            let trace = large + middle + small;
            let found = smallest(matrix);
            by_newton += u32::from(newton(matrix).is_some());
            for (value, expected) in found.values.into_iter().zip([small, middle, large]) {
                assert!((value - expected).abs() < 1e-10 * trace, "{matrix:?}: {found:?}");
            }
            if middle - small > 1e-3 * trace {
                let cosine: f64 = found.vector.iter().zip(vector).map(|(a, b)| a * b).sum();
                assert!((cosine.abs() - 1.0).abs() < 1e-12, "{matrix:?}: {found:?} {vector:?}");
            }
        }
        assert!(by_newton > 1_000, "{by_newton}");
    }

    #[test]
    fn a_level_plane_is_exactly_flat_and_no_matrix_fails() {
        let level = smallest([40.0, 7.0, 0.0, 30.0, 0.0, 0.0]);
        assert_eq!(level.values[0].to_bits() << 1, 0, "{level:?}");
        assert_eq!(level.vector.map(f64::abs).map(f64::to_bits), [0.0_f64, 0.0, 1.0].map(f64::to_bits));
        for matrix in [[0.0; 6], [1.0, 0.0, 0.0, 1.0, 0.0, 1.0], [5.0, 5.0, 5.0, 5.0, 5.0, 5.0]] {
            let found = smallest(matrix);
            assert!(found.values.iter().chain(&found.vector).all(|value| value.is_finite()), "{found:?}");
        }
    }
}

//! Eigenvalues and eigenvectors of a symmetric 3 x 3 matrix by Jacobi rotations. Only +, -, *, / and the
//! square root are used, in a fixed sequence. IEEE 754 defines each of them to the last bit, so the result is
//! the same on every platform.

/// Largest number of sweeps over the three off-diagonal entries. Convergence is quadratic: 3 to 4 sweeps
/// reach the threshold.
const SWEEPS: usize = 12;

/// Sum of the absolute off-diagonal entries, relative to the trace, below which the matrix is diagonal. The
/// remaining entries change eigenvalues by at most the square of this divided by the distance of the
/// eigenvalues. Features need 4 to 5 digits.
const DIAGONAL: f64 = 1e-6;

/// A symmetric matrix: xx, xy, xz, yy, yz, zz.
pub(crate) type Symmetric = [f64; 6];

/// Eigenvalues in descending order with their unit vectors. Equal eigenvalues keep the order of the axes from
/// which the rotations began.
pub(crate) fn eigen(matrix: Symmetric) -> [(f64, [f64; 3]); 3] {
    eigen_within(DIAGONAL, matrix)
}

/// The same. `diagonal` is the sum of the absolute off-diagonal entries, relative to the trace, below which
/// the matrix is diagonal.
pub(crate) fn eigen_within(diagonal: f64, [xx, xy, xz, yy, yz, zz]: Symmetric) -> [(f64, [f64; 3]); 3] {
    let mut a = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    // Row n is the vector of eigenvalue n.
    let mut v = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let least = diagonal * (xx + yy + zz);
    for _ in 0..SWEEPS {
        if a[0][1].abs() + a[0][2].abs() + a[1][2].abs() <= least {
            break;
        }
        rotate(&mut a, &mut v, 0, 1, 2);
        rotate(&mut a, &mut v, 0, 2, 1);
        rotate(&mut a, &mut v, 1, 2, 0);
    }
    let mut pairs = [(a[0][0], v[0]), (a[1][1], v[1]), (a[2][2], v[2])];
    // Three exchanges of neighbours, stable.
    for (low, high) in [(0, 1), (1, 2), (0, 1)] {
        if pairs[high].0 > pairs[low].0 {
            pairs.swap(low, high);
        }
    }
    pairs
}

/// Makes the entry (p, q) zero by a rotation; `r` is the third axis.
fn rotate(a: &mut [[f64; 3]; 3], v: &mut [[f64; 3]; 3], p: usize, q: usize, r: usize) {
    let apq = a[p][q];
    if apq.abs() <= 0.0 {
        return;
    }
    let theta = (a[q][q] - a[p][p]) / (2.0 * apq);
    let root = theta.abs() + (theta * theta + 1.0).sqrt();
    let t = if theta < 0.0 { -1.0 / root } else { 1.0 / root };
    let c = 1.0 / (t * t + 1.0).sqrt();
    let s = t * c;
    a[p][p] -= t * apq;
    a[q][q] += t * apq;
    let arp = c * a[r][p] - s * a[r][q];
    let arq = s * a[r][p] + c * a[r][q];
    a[p][q] = 0.0;
    a[q][p] = 0.0;
    a[r][p] = arp;
    a[p][r] = arp;
    a[r][q] = arq;
    a[q][r] = arq;
    let [vp, vq] = [v[p], v[q]];
    v[p] = [0, 1, 2].map(|axis| c * vp[axis] - s * vq[axis]);
    v[q] = [0, 1, 2].map(|axis| s * vp[axis] + c * vq[axis]);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn product([xx, xy, xz, yy, yz, zz]: Symmetric, v: [f64; 3]) -> [f64; 3] {
        [
            xx * v[0] + xy * v[1] + xz * v[2],
            xy * v[0] + yy * v[1] + yz * v[2],
            xz * v[0] + yz * v[1] + zz * v[2],
        ]
    }

    #[test]
    fn vectors_are_stretched_by_their_values() {
        for matrix in [
            [4.0, 1.0, -2.0, 2.0, 0.5, 3.0],
            [1.0, 1.0, 1.0, 1.0, 1.0, 1.0],
            [2.0, 0.0, 0.0, 2.0, 0.0, 2.0],
            [1e6, 3.0, 5e2, 1e-3, 0.01, 7.0],
            [0.0; 6],
            [5.0, 5.0, 0.0, 5.0, 0.0, 0.0],
        ] {
            let scale = matrix[0] + matrix[3] + matrix[5];
            let pairs = eigen(matrix);
            assert!(pairs[0].0 >= pairs[1].0 && pairs[1].0 >= pairs[2].0, "{pairs:?}");
            for (value, vector) in pairs {
                let length: f64 = vector.iter().map(|part| part * part).sum();
                assert!((length - 1.0).abs() < 1e-12);
                let stretched = product(matrix, vector);
                for axis in 0..3 {
                    assert!((stretched[axis] - value * vector[axis]).abs() <= 2e-6 * scale, "{matrix:?}");
                }
            }
        }
    }
}

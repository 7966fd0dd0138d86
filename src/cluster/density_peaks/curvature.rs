//! Curvature at a point from the points around it (equation 12 of the paper). The result is the same to the
//! last bit wherever it is computed: sums are exact integers, and eigenvalues come from a fixed sequence of
//! correctly rounded operations.

use crate::cluster::eigen::eigen_within;

/// Rotations end when the matrix is diagonal to the last bit: a curvature has 12 digits.
const DIAGONAL: f64 = 0.0;
/// The curvature 1. Curvatures are counted in steps of 2^-40, so that their sums are exact in any order.
pub(super) const ONE: i64 = 1 << 40;

/// e3 / (e1 + e2 + e3) of the covariance of `places` (relative to any place of the lattice), in steps of
/// 2^-40. 0 if all places are equal.
pub(super) fn curvature(places: &[[i64; 3]]) -> i64 {
    // Most neighbours are near: 64 bits are enough for 20 of them within 30 km at 1 mm. Others need 128 bits.
    let small = places.len() <= 20 && places.iter().flatten().all(|value| value.unsigned_abs() < SMALL);
    let moment = |a: usize, b: usize| if small { moment_64(places, a, b) } else { moment_128(places, a, b) };
    let xy = moment(0, 1);
    let xz = moment(0, 2);
    let yz = moment(1, 2);
    let matrix = [moment(0, 0), xy, xz, moment(1, 1), yz, moment(2, 2)];
    let trace = matrix[0] + matrix[3] + matrix[5];
    if trace <= 0.0 {
        return 0;
    }
    let [_, _, (smallest, _)] = eigen_within(DIAGONAL, matrix);
    let share = smallest.max(0.0) / trace;
    #[expect(clippy::cast_possible_truncation, reason = "a share of at most a third")]
    let steps = (share * ONE as f64).round() as i64;
    steps
}

/// Below this limit, sums of products fit 64 bits: 20 * 20 * (2^25)^2 < 2^59.
const SMALL: u64 = 1 << 25;

/// n times the sum of the products of two coordinates, minus the product of their sums. This is n^2 times the
/// covariance.
fn moment_64(places: &[[i64; 3]], a: usize, b: usize) -> f64 {
    let mut count = 0_i64;
    let mut products = 0;
    let mut of_a = 0;
    let mut of_b = 0;
    for place in places {
        count += 1;
        products += place[a] * place[b];
        of_a += place[a];
        of_b += place[b];
    }
    (count * products - of_a * of_b) as f64
}

/// The same for coordinates of any size.
fn moment_128(places: &[[i64; 3]], a: usize, b: usize) -> f64 {
    let sum = |of: &dyn Fn(&[i64; 3]) -> i128| places.iter().map(of).sum::<i128>();
    let products = sum(&|place| i128::from(place[a]) * i128::from(place[b]));
    let sums = [a, b].map(|axis| sum(&|place| i128::from(place[axis])));
    (places.len() as i128 * products - sums[0] * sums[1]) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_lines_and_piles_have_none_and_a_cube_has_a_third() {
        let tilted: Vec<[i64; 3]> =
            (0..20).map(|n| [n % 5 * 10, n / 5 * 10, n % 5 * 20 - n / 5 * 30]).collect();
        assert_eq!(curvature(&tilted), 0);
        assert_eq!(curvature(&(0..20).map(|n| [n, 2 * n, -n]).collect::<Vec<_>>()), 0);
        assert_eq!(curvature(&[[7, 8, 9]; 20]), 0);
        let cube: Vec<[i64; 3]> = (0..8).map(|n| [n & 1, n >> 1 & 1, n >> 2]).collect();
        assert!((curvature(&cube) - ONE / 3).abs() <= 1);
        // Variances 1, 4 and 9 along the axes: 1 / 14.
        let axes = [[1, 0, 0], [-1, 0, 0], [0, 2, 0], [0, -2, 0], [0, 0, 3], [0, 0, -3]];
        assert!((curvature(&axes) - ONE / 14).abs() <= 1);
    }

    #[test]
    fn both_widths_give_the_same_moments() {
        let places: Vec<[i64; 3]> = (0..20).map(|n| [n * n % 17 - 3, n * 7 % 13, -n * n * n % 11]).collect();
        for (a, b) in [(0, 0), (0, 1), (1, 2), (2, 2)] {
            assert_eq!(moment_64(&places, a, b).to_bits(), moment_128(&places, a, b).to_bits());
        }
    }

    #[test]
    fn where_the_places_are_measured_from_changes_nothing() {
        let places: Vec<[i64; 3]> = (0..20).map(|n| [n * n % 17, n * 7 % 13, n * n * n % 11]).collect();
        let far: Vec<[i64; 3]> = places.iter().map(|p| [p[0] + 9_000_000, p[1] - 7, p[2] + 12_345]).collect();
        assert_eq!(curvature(&places), curvature(&far));
    }
}

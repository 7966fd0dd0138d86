//! The eigenvector of the second smallest eigenvalue of (D - W) y = lambda D y by the method of Lanczos
//! (1950). W is the matrix of the weights of a graph, and D the diagonal matrix of their sums by voxel (Shi
//! and Malik 2000, equations 6 to 11).
//!
//! With z = D^(1/2) y, this is the second largest eigenvalue mu = 1 - lambda of D^(-1/2) W D^(-1/2). The
//! largest eigenvalue is 1. Its vector D^(1/2) 1 is known, and every vector of the basis is made orthogonal
//! to it. Each new vector is orthogonalised against the whole basis. A full basis is restarted from its best
//! vector. The search is complete when the residual is small. Start, tolerance and the order of operations
//! are fixed: the same graph gives the same bits.
//!
//! Libraries were examined in November 2026. `faer` 0.24 has a Lanczos solver with a start vector, but the
//! order of its sums follows the vector width of the processor, so its bits differ between machines.
//! `lanczos` 0.2 has neither a start vector nor a tolerance. `arpack` wraps a library in Fortran and returns
//! one eigenpair, the smallest. `eigenvalues` 0.4 needs `nalgebra` below 0.25.

use super::graph::Graph;

/// Largest number of vectors of a basis before it is restarted (chosen: rows of trees of 60 m need 60 to
/// 120).
const MOST_VECTORS: usize = 120;
/// Largest number of restarts before the search ends without convergence (chosen).
const MOST_RESTARTS: usize = 20;
/// Residual up to which an eigenvector is accepted. Eigenvalues are below 1. The error of the vector is the
/// residual divided by the distance to the next eigenvalue, which is about 1e-3 in rows of trees.
const TOLERANCE: f64 = 1e-7;
/// Number of steps between two checks of the residual.
const STEPS: usize = 4;
/// Length, relative to 1, up to which the rest of a vector counts as 0. The vector then lies in the span of
/// the basis, which contains the solution.
const DEPENDENT: f64 = 1e-12;

/// A solution.
#[derive(Debug, Clone)]
pub(super) struct Second {
    /// The eigenvector y, by voxel.
    pub(super) vector: Vec<f64>,
    /// Whether the residual is below the tolerance.
    pub(super) settled: bool,
}

/// Solves the problem for a graph of two voxels or more, from the vector `start`. `None` if the eigenvalue is
/// above `stop`: Ncut of every cut is at least the eigenvalue, so no cut is good enough.
pub(super) fn second(graph: &Graph, degrees: &[f64], start: &[f64], stop: f64) -> Option<Second> {
    let problem = Problem::new(graph, degrees);
    let mut vector: Vec<f64> = start.iter().zip(&problem.roots).map(|(value, root)| value * root).collect();
    let mut settled = false;
    for _ in 0..=MOST_RESTARTS {
        match problem.improve(vector, stop) {
            Improved::Above => return None,
            Improved::Settled(found) => {
                (vector, settled) = (found, true);
                break;
            }
            Improved::Full(found) => vector = found,
        }
    }
    vector.iter_mut().zip(&problem.inverse_roots).for_each(|(value, inverse)| *value *= inverse);
    Some(Second { vector, settled })
}

/// The result of one basis.
enum Improved {
    /// The eigenvalue is certainly above the limit.
    Above,
    /// The eigenvector.
    Settled(Vec<f64>),
    /// The best vector of a full basis.
    Full(Vec<f64>),
}

/// The symmetric problem D^(-1/2) W D^(-1/2) z = mu z.
struct Problem<'a> {
    graph: &'a Graph,
    roots: Vec<f64>,
    /// 0 for a voxel without links. Such a voxel has the eigenvalue mu = 0 and does not affect the others.
    inverse_roots: Vec<f64>,
    /// The vector of the largest eigenvalue.
    first: Vec<f64>,
}

impl<'a> Problem<'a> {
    fn new(graph: &'a Graph, degrees: &[f64]) -> Self {
        let roots: Vec<f64> = degrees.iter().map(|degree| degree.sqrt()).collect();
        let inverse = |root: &f64| if *root > 0.0 { 1.0 / root } else { 0.0 };
        let inverse_roots = roots.iter().map(inverse).collect();
        let mut first = roots.clone();
        normalise(&mut first);
        Self { graph, roots, inverse_roots, first }
    }

    /// The product of the matrix and a vector.
    fn product(&self, vector: &[f64], scratch: &mut [f64]) -> Vec<f64> {
        for ((scratch, value), inverse) in scratch.iter_mut().zip(vector).zip(&self.inverse_roots) {
            *scratch = value * inverse;
        }
        let mut result = vec![0.0; vector.len()];
        self.graph.product(scratch, &mut result);
        result.iter_mut().zip(&self.inverse_roots).for_each(|(value, inverse)| *value *= inverse);
        result
    }

    /// Makes a vector orthogonal to the first eigenvector and to the basis.
    fn orthogonalise(&self, vector: &mut [f64], basis: &[Vec<f64>]) {
        for other in std::iter::once(&self.first).chain(basis) {
            let along = dot(vector, other);
            vector.iter_mut().zip(other).for_each(|(value, other)| *value -= along * other);
        }
    }

    /// Builds one basis from a start vector until it gives a result.
    fn improve(&self, mut vector: Vec<f64>, stop: f64) -> Improved {
        self.orthogonalise(&mut vector, &[]);
        let mut scratch = vec![0.0; vector.len()];
        let mut basis: Vec<Vec<f64>> = Vec::new();
        let mut tridiagonal = Tridiagonal::default();
        let mut beside = normalise(&mut vector);
        loop {
            if beside <= DEPENDENT {
                // The basis spans every eigenvector that the start vector contains, so its best vector is
                // exact.
                return match tridiagonal.largest() {
                    Some((mu, _)) if 1.0 - mu > stop => Improved::Above,
                    Some((_, shares)) => Improved::Settled(combine(&basis, &shares)),
                    None => Improved::Above,
                };
            }
            let mut next = self.product(&vector, &mut scratch);
            let along = dot(&next, &vector);
            tridiagonal.diagonal.push(along);
            // The two components that the theory predicts are removed first, so that one round against all
            // vectors is enough.
            next.iter_mut().zip(&vector).for_each(|(value, other)| *value -= along * other);
            if let Some(before) = basis.last() {
                next.iter_mut().zip(before).for_each(|(value, other)| *value -= beside * other);
            }
            basis.push(vector);
            self.orthogonalise(&mut next, &basis);
            beside = normalise(&mut next);
            vector = next;
            let full = basis.len() == MOST_VECTORS;
            let look = full || basis.len().is_multiple_of(STEPS);
            if let Some((mu, shares)) = look.then(|| tridiagonal.largest()).flatten() {
                let residual = beside * shares.last().map_or(0.0, |share| share.abs());
                if 1.0 - mu - residual > stop {
                    return Improved::Above;
                }
                if residual <= TOLERANCE {
                    return Improved::Settled(combine(&basis, &shares));
                }
                if full {
                    return Improved::Full(combine(&basis, &shares));
                }
            }
            tridiagonal.beside.push(beside);
        }
    }
}

/// A symmetric tridiagonal matrix.
#[derive(Debug, Default)]
struct Tridiagonal {
    diagonal: Vec<f64>,
    /// Entries beside the diagonal. One entry more than needed is ignored.
    beside: Vec<f64>,
}

impl Tridiagonal {
    /// Whether an eigenvalue is above `value`, by the signs of the pivots of T - value (Sturm).
    fn is_above(&self, value: f64) -> bool {
        let mut pivot = 1.0_f64;
        for (row, diagonal) in self.diagonal.iter().enumerate() {
            let before = if row == 0 { 0.0 } else { self.beside[row - 1] };
            pivot = diagonal - value - before * before / pivot;
            if pivot > 0.0 {
                return true;
            }
            pivot = pivot.min(-f64::MIN_POSITIVE);
        }
        false
    }

    /// The largest eigenvalue with its unit vector: by bisection, then by inverse iteration from just above
    /// it, where all pivots are positive. `None` for the empty matrix.
    fn largest(&self) -> Option<(f64, Vec<f64>)> {
        let size = self.diagonal.len();
        let beside = |row: usize| if row + 1 < size { self.beside[row].abs() } else { 0.0 };
        let before = |row: usize| if row == 0 { 0.0 } else { self.beside[row - 1].abs() };
        let radius = |row: usize| before(row) + beside(row);
        let mut low = self.diagonal.iter().copied().reduce(f64::max)?;
        let mut high = (0..size).map(|row| self.diagonal[row] + radius(row)).reduce(f64::max)?;
        for _ in 0..64 {
            let middle = low + (high - low) / 2.0;
            if self.is_above(middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        let shift = high + 4.0 * f64::EPSILON;
        let mut pivots = Vec::with_capacity(size);
        for row in 0..size {
            let last = pivots.last().copied().unwrap_or(1.0);
            let pivot: f64 = shift - self.diagonal[row] - before(row) * before(row) / last;
            pivots.push(pivot.max(f64::EPSILON));
        }
        let mut vector = vec![1.0; size];
        for _ in 0..4 {
            for row in 1..size {
                vector[row] += self.beside[row - 1] * vector[row - 1] / pivots[row - 1];
            }
            vector[size - 1] /= pivots[size - 1];
            for row in (0..size - 1).rev() {
                vector[row] = (vector[row] + self.beside[row] * vector[row + 1]) / pivots[row];
            }
            normalise(&mut vector);
        }
        Some((high, vector))
    }
}

/// The sum of the vectors of a basis, each times its share.
fn combine(basis: &[Vec<f64>], shares: &[f64]) -> Vec<f64> {
    let mut sum = vec![0.0; basis.first().map_or(0, Vec::len)];
    for (vector, share) in basis.iter().zip(shares) {
        sum.iter_mut().zip(vector).for_each(|(sum, value)| *sum += share * value);
    }
    sum
}

/// The scalar product, in eight fixed parts.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a, a_rest) = a.as_chunks::<8>();
    let (b, b_rest) = b.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for (a, b) in a.iter().zip(b) {
        for part in 0..8 {
            sums[part] += a[part] * b[part];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}

/// Scales a vector to length 1, and returns its former length. A zero vector stays as it is.
fn normalise(vector: &mut [f64]) -> f64 {
    let length = dot(vector, vector).sqrt();
    if length > 0.0 {
        vector.iter_mut().for_each(|value| *value /= length);
    }
    length
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::normalized_cut::graph::Scale;
    use crate::cluster::normalized_cut::settings::NormalizedCutConfig;

    /// The graph of points on a line, in metres.
    #[expect(clippy::cast_possible_truncation, reason = "a few metres")]
    fn line(places: &[f64]) -> Graph {
        let keys: Vec<[i32; 3]> = places.iter().map(|x| [(x / 0.3).floor() as i32, 0, 0]).collect();
        let centroids: Vec<[f64; 3]> = places.iter().map(|x| [*x, 0.1, 0.1]).collect();
        Graph::of(&keys, &centroids, &Scale::new(&NormalizedCutConfig::default(), 0.3))
    }

    /// Solves a problem. Checks the equation itself, and that no smaller eigenvalue except 0 was missed.
    fn check(graph: &Graph, start: &[f64]) -> Vec<f64> {
        let degrees = graph.degrees();
        let found = second(graph, &degrees, start, 2.0).unwrap();
        assert!(found.settled);
        let mut product = vec![0.0; graph.len()];
        graph.product(&found.vector, &mut product);
        let above: f64 =
            (0..graph.len()).map(|v| found.vector[v] * (degrees[v] * found.vector[v] - product[v])).sum();
        let below: f64 = (0..graph.len()).map(|v| degrees[v] * found.vector[v] * found.vector[v]).sum();
        let lambda = above / below;
        for voxel in 0..graph.len() {
            let left = degrees[voxel] * found.vector[voxel] - product[voxel];
            assert!((left - lambda * degrees[voxel] * found.vector[voxel]).abs() < 1e-6, "voxel {voxel}");
        }
        let dense = nalgebra::DMatrix::from_fn(graph.len(), graph.len(), |a, b| {
            graph
                .links(a)
                .find(|link| link.0 == b)
                .map_or(0.0, |link| link.1 / (degrees[a] * degrees[b]).sqrt())
        });
        let mut values: Vec<f64> = dense.symmetric_eigenvalues().iter().map(|mu| 1.0 - mu).collect();
        values.sort_by(f64::total_cmp);
        assert!(values[0].abs() < 1e-6 && (values[1] - lambda).abs() < 1e-6, "{lambda} {values:?}");
        found.vector
    }

    #[test]
    fn two_groups_have_different_signs() {
        let places: Vec<f64> = (0..12).map(|n| 0.3 * f64::from(n) + if n < 6 { 0.0 } else { 0.6 }).collect();
        let start: Vec<f64> = (0..12).map(|n| f64::from(n * 7 % 12)).collect();
        let vector = check(&line(&places), &start);
        assert!((0..12).all(|n| (vector[n] > 0.0) == ((vector[0] > 0.0) == (n < 6))));
    }

    #[test]
    fn long_lines_and_two_voxels_are_solved() {
        let places: Vec<f64> = (0..150).map(|n| 0.3 * f64::from(n) + f64::from(n * 5 % 7) * 0.04).collect();
        let start: Vec<f64> = (0..150).map(|n| f64::from(n * 11 % 150)).collect();
        let vector = check(&line(&places), &start);
        assert!(vector.windows(2).all(|pair| (pair[0] < pair[1]) == (vector[0] < vector[1])));
        check(&line(&[0.0, 0.35]), &[1.0, 0.0]);
    }

    #[test]
    fn an_eigenvalue_above_the_limit_is_refused_and_a_voxel_without_links_takes_no_part() {
        let graph = line(&[0.0, 0.35, 0.7]);
        let degrees = graph.degrees();
        assert!(second(&graph, &degrees, &[1.0, 0.5, 0.0], 0.15).is_none());
        let graph = line(&[0.0, 0.35, 9.0, 18.0, 18.35]);
        let found = second(&graph, &graph.degrees(), &[1.0, 0.2, 0.7, 0.1, 0.4], 0.15).unwrap();
        assert!(found.settled && found.vector[2].abs() < 1e-12);
        assert!(found.vector[0] * found.vector[3] < 0.0);
    }

    #[test]
    fn the_largest_eigenvalue_of_a_small_matrix() {
        let matrix = Tridiagonal { diagonal: vec![2.0, 2.0, 2.0], beside: vec![1.0, 1.0, 9.0] };
        let (value, vector) = matrix.largest().unwrap();
        assert!((value - (2.0 + 2.0_f64.sqrt())).abs() < 1e-12);
        for (found, expected) in vector.iter().zip([0.5, 0.5_f64.sqrt(), 0.5]) {
            assert!((found - expected).abs() < 1e-9, "{vector:?}");
        }
        assert!(Tridiagonal::default().largest().is_none());
    }
}

//! Convex hulls in the plane, in exact integers.

/// Twice the signed area of the triangle: positive when `a`, `b`, `c` turn left. Exact, because differences
/// of lattice coordinates are below 2^51 and their products below 2^102.
fn turn(a: [i64; 2], b: [i64; 2], c: [i64; 2]) -> i128 {
    let minus = |p: [i64; 2], q: [i64; 2]| [i128::from(p[0] - q[0]), i128::from(p[1] - q[1])];
    let u = minus(b, a);
    let v = minus(c, a);
    u[0] * v[1] - u[1] * v[0]
}

/// The convex hull of `points`: counter-clockwise from the smallest (x, y), not closed, no three vertices on
/// a line. It has one or two vertices when the points are in one place or on one line. Sorts `points`.
/// Andrew's monotone chain (1979).
pub(crate) fn convex_hull(points: &mut Vec<[i64; 2]>) -> Vec<[i64; 2]> {
    points.sort_unstable();
    points.dedup();
    if points.len() < 3 {
        return points.clone();
    }
    let mut hull = Vec::new();
    extend_chain(&mut hull, 0, points.iter());
    let largest = hull.len() - 1;
    extend_chain(&mut hull, largest, points.iter().rev().skip(1));
    // The smallest point is the first of the lower chain and the last of the upper one.
    hull.pop();
    hull
}

/// Adds `points` in their order, dropping vertices after position `fixed` at which the chain does not turn
/// left.
fn extend_chain<'a>(hull: &mut Vec<[i64; 2]>, fixed: usize, points: impl Iterator<Item = &'a [i64; 2]>) {
    for &point in points {
        while hull.len() > fixed + 1 && turn(hull[hull.len() - 2], hull[hull.len() - 1], point) <= 0 {
            hull.pop();
        }
        hull.push(point);
    }
}

/// Drops points that cannot be on the hull: those strictly inside the hull of the extreme points in eight
/// directions (Akl and Toussaint, 1978). A few per cent of the points of a round object remain. Does nothing
/// when a coordinate is 2^30 or larger, so that 64 bits are enough for the products.
pub(super) fn without_inner_points(points: &mut Vec<[i64; 2]>) {
    if points.iter().flatten().any(|value| value.abs() >= 1 << 30) {
        return;
    }
    let directions: [fn(&[i64; 2]) -> i64; 4] = [|p| p[0], |p| p[1], |p| p[0] + p[1], |p| p[0] - p[1]];
    let mut extremes = Vec::with_capacity(8);
    for direction in directions {
        extremes.extend(points.iter().min_by_key(|point| direction(point)));
        extremes.extend(points.iter().max_by_key(|point| direction(point)));
    }
    let inner = convex_hull(&mut extremes);
    if inner.len() < 3 {
        return;
    }
    // A point is left of the edge from a to b when left[0] x + left[1] y is larger there than at a.
    let edges: Vec<([i64; 2], i64)> = (0..inner.len())
        .map(|index| {
            let a = inner[index];
            let b = inner[(index + 1) % inner.len()];
            let left = [a[1] - b[1], b[0] - a[0]];
            (left, left[0] * a[0] + left[1] * a[1])
        })
        .collect();
    points.retain(|point| edges.iter().any(|&(left, at)| left[0] * point[0] + left[1] * point[1] <= at));
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn hulls_start_at_the_smallest_point_and_skip_collinear_ones() {
        let cases: [[&[[i64; 2]]; 2]; 6] = [
            [&[], &[]],
            [&[[3, 4], [3, 4]], &[[3, 4]]],
            [&[[2, 2], [0, 0], [1, 1], [3, 3]], &[[0, 0], [3, 3]]],
            [&[[0, 5], [0, 1], [0, 3]], &[[0, 1], [0, 5]]],
            [&[[2, 2], [0, 2], [2, 0], [0, 0], [1, 0], [1, 1], [2, 1]], &[[0, 0], [2, 0], [2, 2], [0, 2]]],
            [&[[0, 0], [4, 1], [1, 4], [2, 1]], &[[0, 0], [4, 1], [1, 4]]],
        ];
        for [points, expected] in cases {
            assert_eq!(convex_hull(&mut points.to_vec()), expected, "{points:?}");
        }
    }

    #[test]
    fn hulls_are_exact_at_the_edge_of_the_lattice() {
        let far = 1_i64 << 50;
        let square = [[-far, -far], [far, -far], [far, far], [-far, far]];
        assert_eq!(convex_hull(&mut [&square[..], &[[0, 0]]].concat()), square);
    }

    proptest! {
        /// Vertices are points, each turn is to the left, and no point is to the right of an edge. Only the
        /// hull has these properties.
        #[test]
        fn hulls_are_convex_and_hold_every_point(
            points in prop::collection::vec([-30..30_i64, -30..30_i64], 3..150),
        ) {
            let hull = convex_hull(&mut points.clone());
            prop_assert_eq!(hull.first(), points.iter().min());
            prop_assert!(hull.iter().all(|vertex| points.contains(vertex)));
            let next = |index: usize| hull[(index + 1) % hull.len()];
            for index in 0..hull.len() {
                let a = hull[index];
                let b = next(index);
                prop_assert!(points.iter().all(|&point| turn(a, b, point) >= 0));
                prop_assert!(hull.len() < 3 || turn(a, b, next(index + 1)) > 0);
            }
        }

        #[test]
        fn dropping_inner_points_changes_no_hull(
            points in prop::collection::vec([-30..30_i64, -30..30_i64], 1..150),
        ) {
            let mut fewer = points.clone();
            without_inner_points(&mut fewer);
            prop_assert_eq!(convex_hull(&mut fewer), convex_hull(&mut points.clone()));
        }
    }
}

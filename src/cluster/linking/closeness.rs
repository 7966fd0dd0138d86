//! Whether any point of one set is within a distance of any point of another, exactly, in integers.
//!
//! This is not a search for the closest pair: it ends at the first pair within the distance. Small sets are
//! compared pair by pair. Large sets are first reduced to the points near the box of the other set. Then they
//! are halved along the longest side of a box, nearer half first, until boxes decide or sets are small. The
//! box is halved in its middle, independently of the points. Therefore the number of levels is at most the
//! number of bits of a coordinate. A set of equal points has a box of size 0, which always decides. Two
//! parallel sheets of n points each, slightly too far apart, cost about n times the few hundred points that
//! are nearly opposite, not n * n comparisons.

/// A point in local lattice units.
pub(crate) type Point = [i32; 3];

/// Largest number of pairs that are compared one by one, because halving would cost more (measured with
/// `benches/kernels.rs`).
const FEW_PAIRS: usize = 1_024;

/// The bounding box of points, in local lattice units, both corners inclusive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Bounds {
    low: Point,
    high: Point,
}

impl Bounds {
    /// The bounding box of `points`. There must be at least one point.
    pub(crate) fn of(points: &[Point]) -> Self {
        let mut bounds = Self { low: [i32::MAX; 3], high: [i32::MIN; 3] };
        for point in points {
            for (axis, &value) in point.iter().enumerate() {
                bounds.low[axis] = bounds.low[axis].min(value);
                bounds.high[axis] = bounds.high[axis].max(value);
            }
        }
        bounds
    }

    /// Squared distance between the nearest points of two boxes.
    fn nearest(&self, other: &Self) -> i64 {
        let gap = |axis: usize| {
            let above = i64::from(self.low[axis]) - i64::from(other.high[axis]);
            let below = i64::from(other.low[axis]) - i64::from(self.high[axis]);
            above.max(below).max(0)
        };
        gap(0).pow(2) + gap(1).pow(2) + gap(2).pow(2)
    }

    /// Squared distance between the farthest points of two boxes.
    fn farthest(&self, other: &Self) -> i64 {
        let span = |axis: usize| {
            let up = i64::from(self.high[axis]) - i64::from(other.low[axis]);
            let down = i64::from(other.high[axis]) - i64::from(self.low[axis]);
            up.max(down)
        };
        span(0).pow(2) + span(1).pow(2) + span(2).pow(2)
    }

    /// Squared distance from the box to a point.
    pub(crate) fn nearest_to(&self, point: &Point) -> i64 {
        self.nearest(&Self { low: *point, high: *point })
    }

    /// Squared distance from `point` to the farthest point of the box.
    pub(crate) fn farthest_from(&self, point: &Point) -> i64 {
        self.farthest(&Self { low: *point, high: *point })
    }

    /// The longest side and its axis.
    fn longest(&self) -> (i64, usize) {
        let side = |axis: usize| (i64::from(self.high[axis]) - i64::from(self.low[axis]), axis);
        side(0).max(side(1)).max(side(2))
    }
}

pub(crate) fn squared_distance(a: &Point, b: &Point) -> i64 {
    let delta = |axis: usize| i64::from(a[axis]) - i64::from(b[axis]);
    delta(0).pow(2) + delta(1).pow(2) + delta(2).pow(2)
}

/// Whether some point of `a` and some point of `b`, with these boxes, are at a squared distance of at most
/// `limit`.
///
/// Neither set may be empty. Coordinates must differ by less than 2^30, so that the sum of three squares fits
/// i64. The points of neighbouring cells meet this, because the side of a cell is at most 10 m.
pub(crate) fn any_within(a: (&[Point], &Bounds), b: (&[Point], &Bounds), limit: i64) -> bool {
    let (a, a_bounds) = a;
    let (b, b_bounds) = b;
    if a_bounds.nearest(b_bounds) > limit {
        return false;
    }
    if a.len() * b.len() <= FEW_PAIRS {
        return a.iter().any(|p| b.iter().any(|q| squared_distance(p, q) <= limit));
    }
    if a_bounds.farthest(b_bounds) <= limit {
        return true;
    }
    // In dense neighbouring cells, the very first points often decide.
    if squared_distance(&a[0], &b[0]) <= limit {
        return true;
    }
    halve(&mut a.to_vec(), &mut b.to_vec(), limit)
}

fn halve(a: &mut [Point], b: &mut [Point], limit: i64) -> bool {
    let a = keep_near(a, &Bounds::of(b), limit);
    if a.is_empty() {
        return false;
    }
    let a_bounds = Bounds::of(a);
    let b = keep_near(b, &a_bounds, limit);
    if b.is_empty() {
        return false;
    }
    let b_bounds = Bounds::of(b);
    if a_bounds.nearest(&b_bounds) > limit {
        return false;
    }
    if a_bounds.farthest(&b_bounds) <= limit {
        return true;
    }
    if a.len() * b.len() <= FEW_PAIRS {
        return a.iter().any(|p| b.iter().any(|q| squared_distance(p, q) <= limit));
    }
    // If boxes do not decide, at least one of them is larger than 0. So the longer side is at least 1, and
    // both halves get points.
    let (cut, other) = if a_bounds.longest() >= b_bounds.longest() { (a, b) } else { (b, a) };
    let bounds = Bounds::of(cut);
    let (side, axis) = bounds.longest();
    let middle = i64::from(bounds.low[axis]) + (side - 1) / 2;
    let lower = partition(cut, |point| i64::from(point[axis]) <= middle);
    let (low, high) = cut.split_at_mut(lower);
    let other_bounds = Bounds::of(other);
    let (first, second) = if Bounds::of(low).nearest(&other_bounds) <= Bounds::of(high).nearest(&other_bounds)
    {
        (low, high)
    } else {
        (high, low)
    };
    halve(first, other, limit) || halve(second, other, limit)
}

/// Moves the points within `limit` (squared) of `bounds` to the front and returns them.
fn keep_near<'a>(points: &'a mut [Point], bounds: &Bounds, limit: i64) -> &'a mut [Point] {
    let near = partition(points, |point| bounds.nearest_to(point) <= limit);
    &mut points[..near]
}

/// Moves the points that satisfy `front` to the front and returns their number. The order changes.
fn partition(points: &mut [Point], front: impl Fn(&Point) -> bool) -> usize {
    let mut kept = 0;
    for index in 0..points.len() {
        if front(&points[index]) {
            points.swap(index, kept);
            kept += 1;
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    fn search(a: &[Point], b: &[Point], distance_squared: i64) -> bool {
        any_within((a, &Bounds::of(a)), (b, &Bounds::of(b)), distance_squared)
    }

    /// A sheet of n x n points every 2 units, tilted: z = x.
    fn sheet(n: i32, lift: i32) -> Vec<Point> {
        (0..n * n).map(|index| [index % n * 2, index / n * 2, index % n * 2 + lift]).collect()
    }

    #[test]
    fn few_points_are_compared_exactly() {
        assert!(search(&[[0, 0, 0]], &[[100, 200, 200]], 300 * 300));
        assert!(!search(&[[0, 0, 0]], &[[100, 200, 201]], 300 * 300));
        assert!(search(&[[0, 0, 0], [9, 9, 9]], &[[9, 9, 10], [50, 0, 0]], 1));
    }

    #[test]
    fn tilted_sheets_are_as_far_apart_as_they_are() {
        // Planes z = x and z = x + 40 are 40 / sqrt(2) apart, and lattice points reach this: (20, 0, -20),
        // squared 800.
        let a = sheet(60, 0);
        let b = sheet(60, 40);
        assert!(a.len() * b.len() > FEW_PAIRS);
        assert!(search(&a, &b, 800));
        assert!(!search(&a, &b, 799));
        assert!(search(&b, &a, 800));
        assert!(!search(&b, &a, 799));
    }

    #[test]
    fn piles_of_equal_points_are_decided_at_once() {
        let pile = |x: i32| vec![[x, 0, 0]; 200_000];
        assert!(search(&pile(0), &pile(300), 300 * 300));
        assert!(!search(&pile(0), &pile(301), 300 * 300));
        assert!(search(&[[7, 7, 7]], &[[7, 7, 7]], 0));
        // Many equal points, and two far points, one of them within reach.
        let mut mixed = pile(400);
        mixed.push([-300, 1, 0]);
        assert!(!search(&pile(0), &mixed, 300 * 300));
        mixed.push([-300, 0, 0]);
        assert!(search(&pile(0), &mixed, 300 * 300));
    }
}

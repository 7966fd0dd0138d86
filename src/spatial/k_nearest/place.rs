//! The point nearest to any place. Distances are exact integers. Of equally near points, the first by x, then
//! y, then z is found. So the result depends neither on the shape of the tree nor on the order of the points.

use super::KNearest;
use crate::spatial::k_nearest::tree::{NO_POINT, Node};
use crate::spatial::vectors::LANES;

/// A point: its squared distance, its place and its number.
type Found = (u64, [i32; 3], u32);

/// The squared distance of two places. It fits 64 bits, because coordinates are not negative.
fn squared(a: [i32; 3], b: [i32; 3]) -> u64 {
    (0..3).map(|axis| u64::from(a[axis].abs_diff(b[axis])).pow(2)).sum()
}

/// The squared distance from a place to a box.
fn squared_to(node: &Node, place: [i32; 3]) -> u64 {
    squared(place, [0, 1, 2].map(|axis| place[axis].clamp(node.low[axis], node.high[axis])))
}

impl KNearest {
    /// The point nearest to a place, at a squared distance of at most `limit`. Coordinates of the place are
    /// not negative. If several points are in the place found, any one of them is returned.
    ///
    /// The nearer half of a box is searched first, so that the limit shrinks early.
    pub(crate) fn nearest_to(&self, place: [i32; 3], limit: u64) -> Option<(u64, u32)> {
        let tree = &self.tree;
        let mut best: Option<Found> = None;
        let mut limit = limit;
        let mut stack: Vec<(u64, u32)> = Vec::with_capacity(64);
        stack.extend(tree.nodes.first().map(|root| (squared_to(root, place), 0)));
        while let Some((apart, node)) = stack.pop() {
            // A box that is as far away as the best point may contain one that comes before it.
            if apart > limit {
                continue;
            }
            let node = &tree.nodes[node as usize];
            if !node.is_leaf() {
                let half = |half: u32| (squared_to(&tree.nodes[half as usize], place), half);
                let (one, other) = (half(node.lower), half(node.upper));
                stack.extend(if one.0 > other.0 { [one, other] } else { [other, one] });
                continue;
            }
            for block in node.blocks() {
                for slot in block * LANES..block * LANES + tree.blocks[block].len as usize {
                    let there = tree.place(slot);
                    let found = (squared(there, place), there, tree.number[slot]);
                    debug_assert_ne!(found.2, NO_POINT);
                    if found.0 <= limit && best.is_none_or(|best| found < best) {
                        limit = found.0;
                        best = Some(found);
                    }
                }
            }
        }
        best.map(|(squared, _, number)| (squared, number))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::Numbers;

    /// A fixed pseudo-random number below `most`.
    fn numbers() -> impl FnMut(i32) -> i32 {
        let mut numbers = Numbers::new(5);
        move |most| i32::try_from(numbers.next()).unwrap() % most
    }

    #[test]
    fn the_nearest_point_is_that_of_brute_force_whatever_the_order() {
        let mut below = numbers();
        // Few steps make many equally near points, and many points in one place.
        for (count, steps) in [(1, 4), (17, 4), (900, 6), (900, 40), (3_000, 5_000), (500, i32::MAX)] {
            let places: Vec<[i32; 3]> = (0..count).map(|_| [(); 3].map(|()| below(steps))).collect();
            let reversed: Vec<[i32; 3]> = places.iter().rev().copied().collect();
            for k in [1, 3] {
                let index = KNearest::new(&places, k);
                let other = KNearest::new(&reversed, k);
                for _ in 0..200 {
                    let place = [(); 3].map(|()| below(steps));
                    let nearest = places.iter().map(|there| (squared(*there, place), *there)).min().unwrap();
                    for limit in [u64::MAX, nearest.0] {
                        let found = index.nearest_to(place, limit).unwrap();
                        assert_eq!((found.0, places[found.1 as usize]), nearest, "{count} {steps}");
                        let found = other.nearest_to(place, limit).unwrap();
                        assert_eq!((found.0, reversed[found.1 as usize]), nearest, "{count} {steps}");
                    }
                    if let Some(less) = nearest.0.checked_sub(1) {
                        assert_eq!(index.nearest_to(place, less), None);
                    }
                }
            }
        }
        assert_eq!(KNearest::new(&[], 1).nearest_to([0; 3], u64::MAX), None);
    }

    #[test]
    fn very_many_points_in_one_place_are_quick() {
        let index = KNearest::new(&vec![[7; 3]; 300_000], 1);
        assert!((0..300_000).all(|x| index.nearest_to([x, 7, 7], u64::MAX).is_some()));
    }
}

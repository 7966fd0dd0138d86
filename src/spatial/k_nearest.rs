//! The K nearest points of many points of one cloud, by number, within a largest distance. Coordinates are
//! integers, and ties go to the smaller number, so the neighbours do not depend on the shape of the tree.
//!
//! One look-up serves all points of a leaf of a kd-tree, as in `all_nearest`: they need nearly the same
//! neighbours. The distance from the middle of a leaf to its K-th neighbour bounds that of each of its points
//! (triangle inequality).
//!
//! Of the points in one place only the K with the smallest numbers can be among the K nearest of any point.
//! The tree leaves the others out, so that very many points in one place cost no more than a few.

use crate::spatial::ranks::threshold;

/// Number of points of a leaf that is not one place. Chosen: with fewer there are more look-ups, with more
/// there are more useless distances.
const LEAF_POINTS: usize = 16;
/// Slack of bounds from the triangle inequality, far above the rounding error of a few operations.
const SLACK: f64 = 1.0 + 1e-9;
/// Largest reach in units: the square of a distance must fit 31 bits.
pub(crate) const LARGEST_REACH: i64 = 46_340;

/// A neighbour: the squared distance in the upper 32 bits, the number of the point in the lower. So
/// neighbours are ordered by their distances, and equally near ones by their numbers.
type Near = u64;

/// The number of a neighbour.
#[inline]
#[expect(clippy::cast_possible_truncation, reason = "the lower half of the key")]
pub(crate) fn number_of(near: Near) -> u32 {
    near as u32
}

/// The squared distance of a neighbour.
#[inline]
fn squared_of(near: Near) -> u64 {
    near >> 32
}

/// Moves the `count` nearest to the front. `scratch` is overwritten.
pub(crate) fn nearest_first(near: &mut [Near], count: usize, scratch: &mut Scratch) {
    if count == 0 || count >= near.len() {
        return;
    }
    scratch.squared.clear();
    // Rounding keeps the order, so a threshold that leaves `count` of the rounded squares leaves the same
    // points.
    scratch.squared.extend(near.iter().map(|near| rounded(*near)));
    let Some(limit) = threshold(&scratch.squared, count) else {
        near.select_nth_unstable(count - 1);
        return;
    };
    scratch.others.resize(near.len(), 0);
    let (mut front, mut back) = (0, 0);
    for at in 0..near.len() {
        // Both are always written, and one is counted: a branch could not be predicted.
        let (value, is_near) = (near[at], scratch.squared[at] <= limit);
        near[front] = value;
        scratch.others[back] = value;
        front += usize::from(is_near);
        back += usize::from(!is_near);
    }
    near[front..].copy_from_slice(&scratch.others[..back]);
}

/// Room for [`nearest_first`].
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    squared: Vec<f32>,
    others: Vec<Near>,
}

#[inline]
#[expect(clippy::cast_possible_truncation, reason = "31 bits")]
fn rounded(near: Near) -> f32 {
    squared_of(near) as i32 as f32
}

/// A box of the tree and its points.
#[derive(Debug, Clone, Copy)]
struct Node {
    low: [i32; 3],
    high: [i32; 3],
    first: u32,
    end: u32,
    /// Its halves, as positions in the list of nodes; 0 for a leaf.
    lower: u32,
    upper: u32,
}

impl Node {
    fn gap(&self, low: [i32; 3], high: [i32; 3]) -> u64 {
        let along = |axis: usize| {
            let below = i64::from(self.low[axis]) - i64::from(high[axis]);
            let above = i64::from(low[axis]) - i64::from(self.high[axis]);
            below.max(above).max(0).unsigned_abs()
        };
        (0..3).map(|axis| along(axis).pow(2)).fold(0, u64::saturating_add)
    }

    fn points(&self) -> std::ops::Range<usize> {
        self.first as usize..self.end as usize
    }

    fn is_leaf(&self) -> bool {
        self.upper == 0
    }
}

/// Points, indexed for their K nearest neighbours.
#[derive(Debug)]
pub(crate) struct KNearest {
    /// Number of neighbours, the point itself included.
    k: usize,
    /// Coordinates of the points, leaf by leaf.
    axes: [Vec<i32>; 3],
    /// Number of each of them.
    number: Vec<u32>,
    nodes: Vec<Node>,
    /// Points that are left out, each with one in the same place that is not.
    repeated: Vec<(u32, u32)>,
}

/// The nearest points so far.
struct Smallest {
    k: usize,
    /// Room for three times K, plus one leaf.
    slots: Vec<Near>,
    len: usize,
    /// A larger squared distance cannot be among the smallest any more. At most 32 bits.
    limit: u64,
    scratch: Scratch,
}

impl Smallest {
    fn begin(&mut self, limit: u64) {
        self.len = 0;
        self.limit = limit;
    }

    /// Keeps the K smallest, if there are that many.
    fn cut(&mut self) {
        if self.len >= self.k {
            nearest_first(&mut self.slots[..self.len], self.k, &mut self.scratch);
            self.len = self.k;
            let largest = self.slots[..self.k].iter().map(|near| squared_of(*near)).max();
            self.limit = self.limit.min(largest.unwrap_or(u64::MAX));
        }
    }
}

impl KNearest {
    /// Indexes points for `k` (> 0) neighbours. A point is identified by its position, which fits 32 bits.
    /// Coordinates are not negative.
    #[expect(clippy::cast_possible_truncation, reason = "positions fit 32 bits")]
    pub(crate) fn new(places: &[[i32; 3]], k: usize) -> Self {
        let mut order: Vec<([i32; 3], u32)> =
            places.iter().enumerate().map(|(number, place)| (*place, number as u32)).collect();
        let mut index = Self {
            k: k.max(1),
            axes: [const { Vec::new() }; 3],
            number: Vec::with_capacity(order.len()),
            nodes: Vec::with_capacity(order.len() / (LEAF_POINTS / 4) + 1),
            repeated: Vec::new(),
        };
        index.axes.iter_mut().for_each(|axis| axis.reserve_exact(order.len()));
        if !order.is_empty() {
            index.split(&mut order);
        }
        index
    }

    /// Adds the node of these points, and the nodes below it. Returns its position.
    #[expect(clippy::cast_possible_truncation, reason = "there are fewer nodes than points")]
    fn split(&mut self, points: &mut [([i32; 3], u32)]) -> u32 {
        let mut low = [i32::MAX; 3];
        let mut high = [i32::MIN; 3];
        for (place, _) in &*points {
            for axis in 0..3 {
                low[axis] = low[axis].min(place[axis]);
                high[axis] = high[axis].max(place[axis]);
            }
        }
        let node = self.nodes.len();
        let first = self.number.len() as u32;
        self.nodes.push(Node { low, high, first, end: first, lower: 0, upper: 0 });
        if points.len() <= LEAF_POINTS {
            self.fill(points);
        } else if low == high {
            points.sort_unstable_by_key(|point| point.1);
            let (kept, others) = points.split_at(self.k.min(points.len()));
            self.repeated.extend(others.iter().map(|(_, number)| (*number, kept[0].1)));
            self.fill(kept);
        } else {
            let side = |axis: usize| i64::from(high[axis]) - i64::from(low[axis]);
            let longest = (0..3).max_by_key(|axis| side(*axis)).unwrap_or(0);
            // A multiple of the size of a leaf, so that leaves are full.
            let half = (points.len() / 2).next_multiple_of(LEAF_POINTS).min(points.len() - 1);
            points.select_nth_unstable_by_key(half, |point| point.0[longest]);
            let (one, other) = points.split_at_mut(half);
            let lower = self.split(one);
            let upper = self.split(other);
            self.nodes[node].lower = lower;
            self.nodes[node].upper = upper;
        }
        self.nodes[node].end = self.number.len() as u32;
        node as u32
    }

    fn fill(&mut self, points: &[([i32; 3], u32)]) {
        for (place, number) in points {
            self.axes.iter_mut().zip(place).for_each(|(axis, value)| axis.push(*value));
            self.number.push(*number);
        }
    }

    fn place(&self, at: usize) -> [i32; 3] {
        [0, 1, 2].map(|axis| self.axes[axis][at])
    }

    /// Calls `visit` for every `wanted` point with its nearest points within `reach` units (inclusive, at
    /// most [`LARGEST_REACH`]), itself included unless K others are in its place. They are the K nearest, or
    /// all if there are fewer, in no particular order.
    pub(crate) fn each(
        &self,
        reach: i64,
        wanted: impl Fn(u32) -> bool,
        mut visit: impl FnMut(u32, &mut [Near]),
    ) {
        let farthest = reach.clamp(0, LARGEST_REACH).unsigned_abs().pow(2);
        let mut smallest =
            Smallest { k: self.k, slots: Vec::new(), len: 0, limit: 0, scratch: Scratch::default() };
        smallest.slots.resize(3 * self.k + LEAF_POINTS.max(self.k), 0);
        let mut near: Vec<(u64, u32)> = Vec::new();
        let mut repeated: Vec<(u32, u32)> = self
            .repeated
            .iter()
            .filter(|(point, _)| wanted(*point))
            .map(|(point, kept)| (*kept, *point))
            .collect();
        repeated.sort_unstable();
        for leaf in self.nodes.iter().filter(|node| node.is_leaf()) {
            let in_place = |number: u32| {
                let from = repeated.partition_point(|(kept, _)| *kept < number);
                repeated[from..].iter().take_while(move |(kept, _)| *kept == number).map(|(_, point)| *point)
            };
            let asked = |at: &usize| {
                let number = self.number[*at];
                wanted(number) || (!repeated.is_empty() && in_place(number).next().is_some())
            };
            let mut asking = leaf.points().filter(asked).peekable();
            if asking.peek().is_none() {
                continue;
            }
            let centre = [0, 1, 2].map(|axis| i32::midpoint(leaf.low[axis], leaf.high[axis]));
            let about_centre = self.kth(centre, farthest, &mut smallest);
            let within = |apart: f64| match about_centre {
                Some(about) => farthest.min(squared_up(about + apart)),
                None => farthest,
            };
            let corner = root_of_squared(centre, leaf.high).max(root_of_squared(centre, leaf.low));
            near.clear();
            self.leaves_within(leaf, within(corner), &mut near);
            near.sort_unstable();
            for at in asking {
                let place = self.place(at);
                smallest.begin(within(root_of_squared(place, centre)));
                for &(apart, other) in &near {
                    if apart > smallest.limit {
                        break;
                    }
                    let other = &self.nodes[other as usize];
                    if other.gap(place, place) <= smallest.limit {
                        self.look(place, other, &mut smallest);
                    }
                }
                smallest.cut();
                let found = smallest.len;
                let number = self.number[at];
                if wanted(number) {
                    visit(number, &mut smallest.slots[..found]);
                }
                in_place(number).for_each(|point| visit(point, &mut smallest.slots[..found]));
            }
        }
    }

    /// Adds the points of a leaf.
    fn look(&self, place: [i32; 3], leaf: &Node, smallest: &mut Smallest) {
        let range = leaf.points();
        let [x, y, z] = [0, 1, 2].map(|axis| &self.axes[axis][range.clone()]);
        let numbers = &self.number[range];
        let mut len = smallest.len;
        let limit = smallest.limit;
        let square = |value: i32, axis: usize| u64::from(value.abs_diff(place[axis])).pow(2);
        for (((&x, &y), &z), &number) in x.iter().zip(y).zip(z).zip(numbers) {
            // Always written, and counted only if it is near: a branch could not be predicted.
            let squared = square(x, 0) + square(y, 1) + square(z, 2);
            smallest.slots[len] = squared << 32 | u64::from(number);
            len += usize::from(squared <= limit);
        }
        smallest.len = len;
        if len >= 3 * smallest.k {
            smallest.cut();
        }
    }

    /// Distance from a place to its K-th nearest point. `None` if fewer are within the limit (squared).
    fn kth(&self, place: [i32; 3], limit: u64, smallest: &mut Smallest) -> Option<f64> {
        smallest.begin(limit);
        let mut stack: Vec<(u64, u32)> = Vec::with_capacity(64);
        stack.extend((!self.nodes.is_empty()).then_some((0, 0)));
        while let Some((apart, node)) = stack.pop() {
            if apart > smallest.limit {
                continue;
            }
            let node = &self.nodes[node as usize];
            if node.is_leaf() {
                self.look(place, node, smallest);
                if smallest.len >= 2 * smallest.k {
                    smallest.cut();
                }
                continue;
            }
            let halves =
                [node.lower, node.upper].map(|half| (self.nodes[half as usize].gap(place, place), half));
            let [far, near] = if halves[0].0 > halves[1].0 { halves } else { [halves[1], halves[0]] };
            stack.extend([far, near]);
        }
        smallest.cut();
        (smallest.len >= smallest.k).then(|| (smallest.limit as f64).sqrt())
    }

    /// The leaves whose box is within `limit` (squared) of the box of `leaf`, with their squared distances.
    fn leaves_within(&self, leaf: &Node, limit: u64, near: &mut Vec<(u64, u32)>) {
        let mut stack = vec![0_u32];
        while let Some(number) = stack.pop() {
            let node = &self.nodes[number as usize];
            let apart = node.gap(leaf.low, leaf.high);
            if apart > limit {
                continue;
            }
            if node.is_leaf() {
                near.push((apart, number));
            } else {
                stack.extend([node.lower, node.upper]);
            }
        }
    }
}

/// The square of a distance, rounded up with slack.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "of distances within the reach of tiles"
)]
fn squared_up(distance: f64) -> u64 {
    (distance * SLACK).powi(2).ceil() as u64 + 1
}

fn root_of_squared(a: [i32; 3], b: [i32; 3]) -> f64 {
    (0..3).map(|axis| (f64::from(a[axis]) - f64::from(b[axis])).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A fixed pseudo-random cloud with repeated points; a fifth of it is ten times denser.
    fn cloud(count: usize, steps: i32) -> Vec<[i32; 3]> {
        let mut state = 7_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            i32::try_from(state >> 33).unwrap() % steps
        };
        (0..count).map(|row| [(); 3].map(|()| next() / if row % 5 == 0 { 10 } else { 1 })).collect()
    }

    fn brute(places: &[[i32; 3]], at: usize, k: usize, reach: i64) -> Vec<u64> {
        let squared =
            |a: [i32; 3], b: [i32; 3]| (0..3).map(|axis| u64::from(a[axis].abs_diff(b[axis])).pow(2)).sum();
        let mut all: Vec<u64> = (0_u64..)
            .zip(places)
            .map(|(number, place)| (squared(*place, places[at]), number))
            .filter(|(squared, _): &(u64, u64)| *squared <= reach.unsigned_abs().pow(2))
            .map(|(squared, number)| squared << 32 | number)
            .collect();
        all.sort_unstable();
        all.truncate(k);
        all
    }

    #[test]
    fn neighbours_are_those_of_brute_force() {
        for (count, steps, k, reach) in [
            (1, 9, 3, 5),
            (30, 9, 40, 100),
            (700, 1, 40, 10),
            (700, 5, 7, 3),
            (900, 2_000, 40, LARGEST_REACH),
            (900, 2_000, 40, 250),
            (400, 60, 200, 30),
        ] {
            let places = cloud(count, steps);
            let index = KNearest::new(&places, k);
            let mut seen = vec![0; count];
            index.each(
                reach,
                |point| point % 3 != 1,
                |point, found| {
                    seen[point as usize] += 1;
                    found.sort_unstable();
                    assert_eq!(
                        found,
                        brute(&places, point as usize, k, reach),
                        "{count} {steps} {k} {reach}: {point}"
                    );
                },
            );
            assert!(seen.iter().enumerate().all(|(point, times)| *times == usize::from(point % 3 != 1)));
        }
    }

    #[test]
    fn very_many_points_in_one_place_are_quick() {
        let mut places = vec![[5; 3]; 300_000];
        places.extend(cloud(1_000, 100));
        let index = KNearest::new(&places, 20);
        let mut sum = 0_u64;
        index.each(
            50,
            |_| true,
            |_, found| sum += found.iter().map(|near| u64::from(number_of(*near))).sum::<u64>(),
        );
        assert!(sum > 300_000 * 190, "the 20 first of one place: {sum}");
    }

    #[test]
    fn far_coordinates_do_not_overflow() {
        let places = [[0; 3], [i32::MAX; 3], [i32::MAX - 1, i32::MAX, i32::MAX]];
        let mut found = Vec::new();
        KNearest::new(&places, 2).each(3, |_| true, |point, near| found.push((point, near.len())));
        found.sort_unstable();
        assert_eq!(found, [(0, 1), (1, 2), (2, 2)]);
    }
}

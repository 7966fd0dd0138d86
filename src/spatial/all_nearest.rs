//! Distances from very many points of one cloud to their K nearest neighbours, for the curve from which
//! epsilon is estimated. This index has its own tree, because one look-up then serves all points of a leaf,
//! which saves most look-ups. Its benchmark is `curve` of `benches/kernels.rs`;
//! `scripts/compare_speed_dbscan.py` compares it with the kd-tree of scipy.
//!
//! The kd-tree splits the points at the median of the longest side until a leaf has at most [`LEAF_POINTS`].
//! Points of a leaf are close together, so they need nearly the same neighbours. The distance from the centre
//! of the leaf to its K-th neighbour bounds the distances of each point of the leaf to its own K neighbours
//! (triangle inequality). The leaves within this bound are searched once for all points of the leaf. A
//! squared distance is the sum of squared exact differences, in the order of the axes. So no result depends
//! on the shape of the tree, nor on which other points are present.

use std::cmp::Ordering;

use crate::spatial::{Points, SpatialError};

/// Largest number of points in a leaf. Chosen: fewer points cost more look-ups, more points cost more useless
/// distances.
const LEAF_POINTS: usize = 16;
/// Slack of bounds from the triangle inequality, far above the rounding error of a few operations.
const SLACK: f64 = 1.0 + 1e-9;

/// A node of the tree: its box and its points.
struct Node<const D: usize> {
    low: [f64; D],
    high: [f64; D],
    first: u32,
    end: u32,
    /// Positions of its halves in the list of nodes; 0 for a leaf.
    lower: u32,
    upper: u32,
}

/// Points, indexed for distances to their nearest neighbours.
struct Crowd<const D: usize> {
    /// The points, leaf by leaf.
    places: Vec<[f64; D]>,
    /// The number of each point.
    number: Vec<u32>,
    nodes: Vec<Node<D>>,
}

fn squared<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
    (0..D).map(|axis| (a[axis] - b[axis]) * (a[axis] - b[axis])).sum()
}

impl<const D: usize> Node<D> {
    fn squared_to_box(&self, low: &[f64; D], high: &[f64; D]) -> f64 {
        let gap = |axis: usize| (self.low[axis] - high[axis]).max(low[axis] - self.high[axis]).max(0.0);
        (0..D).map(|axis| gap(axis) * gap(axis)).sum()
    }

    fn squared_to(&self, place: &[f64; D]) -> f64 {
        self.squared_to_box(place, place)
    }

    fn is_leaf(&self) -> bool {
        self.upper == 0
    }
}

/// The smallest squared distances so far, as bits. The bits of non-negative numbers are ordered like the
/// numbers.
struct Smallest {
    k: usize,
    /// Room for three times K, plus one leaf.
    slots: Vec<u64>,
    /// Slots in use.
    len: usize,
    /// A squared distance above this cannot be among the smallest any more.
    limit: f64,
}

impl Smallest {
    fn new(k: usize) -> Self {
        Self { k, slots: vec![0; 3 * k + LEAF_POINTS], len: 0, limit: f64::INFINITY }
    }

    fn begin(&mut self, limit: f64) {
        self.len = 0;
        self.limit = limit;
    }

    /// Adds the points of one leaf.
    fn add<const D: usize>(&mut self, place: &[f64; D], others: &[[f64; D]]) {
        let mut len = self.len;
        let limit = self.limit;
        for other in others {
            // Every point is written, but counted only if it is near: a branch could not be predicted.
            let squared = squared(place, other);
            self.slots[len] = squared.to_bits();
            len += usize::from(squared <= limit);
        }
        self.len = len;
        if len >= 3 * self.k {
            self.cut();
        }
    }

    /// Keeps the K smallest, if there are that many.
    fn cut(&mut self) {
        if self.len >= self.k {
            let (_, largest, _) = self.slots[..self.len].select_nth_unstable(self.k - 1);
            self.limit = self.limit.min(f64::from_bits(*largest));
            self.len = self.k;
        }
    }

    /// The K smallest, ascending.
    fn finish(&mut self) -> &[u64] {
        self.cut();
        let found = &mut self.slots[..self.len];
        found.sort_unstable();
        found
    }
}

impl<const D: usize> Crowd<D> {
    /// Indexes the points. A point is identified by its position in the list, which must fit u32.
    fn new(rows: impl Iterator<Item = [f64; D]>) -> Self {
        let mut items: Vec<([f64; D], u32)> = rows.zip(0..).collect();
        let mut nodes = Vec::with_capacity(items.len() / (LEAF_POINTS / 4) + 1);
        if !items.is_empty() {
            split(&mut items, 0, &mut nodes);
        }
        let (places, number) = items.into_iter().unzip();
        Self { places, number, nodes }
    }

    fn points(&self, node: &Node<D>) -> std::ops::Range<usize> {
        node.first as usize..node.end as usize
    }

    /// Squared distances from each `wanted` point of the `leaves` to its `k` nearest points, itself included,
    /// ascending. If there are fewer than `k` points, to all of them.
    fn each_nearest(&self, leaves: &[u32], k: usize, wanted: Wanted<'_>, visit: &mut Visit<'_>) {
        let mut smallest = Smallest::new(k);
        let mut near: Vec<(f64, u32)> = Vec::new();
        for leaf in leaves.iter().map(|&leaf| &self.nodes[leaf as usize]) {
            let mut asking = self.points(leaf).filter(|&at| wanted(self.number[at] as usize)).peekable();
            if asking.peek().is_none() {
                continue;
            }
            let centre: [f64; D] = std::array::from_fn(|axis| f64::midpoint(leaf.low[axis], leaf.high[axis]));
            let about_centre = self.kth(&centre, &mut smallest).sqrt();
            let corner = squared(&centre, &leaf.high).sqrt();
            near.clear();
            self.leaves_within(leaf, ((about_centre + corner) * SLACK).powi(2), &mut near);
            near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            for at in asking {
                let place = &self.places[at];
                let off_centre = squared(place, &centre).sqrt();
                smallest.begin(((about_centre + off_centre) * SLACK).powi(2));
                for &(apart, other) in &near {
                    if apart > smallest.limit {
                        break;
                    }
                    let other = &self.nodes[other as usize];
                    if other.squared_to(place) <= smallest.limit {
                        smallest.add(place, &self.places[self.points(other)]);
                    }
                }
                visit(self.number[at] as usize, smallest.finish());
            }
        }
    }

    /// Squared distances from any place to its `k` nearest points within `limit` (squared), ascending.
    fn nearest(&self, place: &[f64; D], k: usize, limit: f64) -> Vec<u64> {
        let mut smallest = Smallest::new(k);
        smallest.begin(limit);
        self.search(place, &mut smallest);
        smallest.finish().to_vec()
    }

    /// Squared distance to the K-th nearest point; infinite if there are fewer.
    fn kth(&self, place: &[f64; D], smallest: &mut Smallest) -> f64 {
        smallest.begin(f64::INFINITY);
        self.search(place, smallest);
        smallest.cut();
        smallest.limit
    }

    /// Visits the nearer half first, so that the limit shrinks early.
    fn search(&self, place: &[f64; D], smallest: &mut Smallest) {
        let mut stack: Vec<(f64, u32)> = Vec::with_capacity(64);
        stack.extend((!self.nodes.is_empty()).then_some((0.0, 0)));
        while let Some((apart, node)) = stack.pop() {
            if apart > smallest.limit {
                continue;
            }
            let node = &self.nodes[node as usize];
            if node.is_leaf() {
                smallest.add(place, &self.places[self.points(node)]);
                if smallest.len >= 2 * smallest.k {
                    smallest.cut();
                }
                continue;
            }
            let halves =
                [node.lower, node.upper].map(|half| (self.nodes[half as usize].squared_to(place), half));
            let [far, near] = if halves[0].0 > halves[1].0 { halves } else { [halves[1], halves[0]] };
            stack.extend([far, near]);
        }
    }

    /// The leaves whose box is within `limit` (squared) of the box of `leaf`, with their distances.
    fn leaves_within(&self, leaf: &Node<D>, limit: f64, near: &mut Vec<(f64, u32)>) {
        let mut stack = vec![0_u32];
        while let Some(number) = stack.pop() {
            let node = &self.nodes[number as usize];
            let apart = node.squared_to_box(&leaf.low, &leaf.high);
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

/// Queries for points of any dimension; see [`Crowd`].
trait Nearest: Send + Sync {
    fn leaves(&self) -> Vec<u32>;
    fn each_nearest(&self, leaves: &[u32], k: usize, wanted: Wanted<'_>, visit: &mut Visit<'_>);
    fn nearest(&self, place: &[f64], k: usize, limit: f64) -> Vec<u64>;
}

type Wanted<'a> = &'a dyn Fn(usize) -> bool;
type Visit<'a> = dyn FnMut(usize, &[u64]) + 'a;

impl<const D: usize> Nearest for Crowd<D> {
    fn leaves(&self) -> Vec<u32> {
        (0_u32..).zip(&self.nodes).filter(|(_, node)| node.is_leaf()).map(|(node, _)| node).collect()
    }

    fn each_nearest(&self, leaves: &[u32], k: usize, wanted: Wanted<'_>, visit: &mut Visit<'_>) {
        Crowd::each_nearest(self, leaves, k, wanted, visit);
    }

    fn nearest(&self, place: &[f64], k: usize, limit: f64) -> Vec<u64> {
        Crowd::nearest(self, &std::array::from_fn(|axis| place[axis]), k, limit)
    }
}

/// Points of 2 to 8 dimensions, indexed for distances to their nearest neighbours.
pub(crate) struct Neighbours(Box<dyn Nearest>);

impl Neighbours {
    /// Indexes the points.
    ///
    /// # Errors
    /// [`SpatialError::Dimensions`].
    pub(crate) fn new(points: &Points) -> Result<Self, SpatialError> {
        fn crowd<const D: usize>(points: &Points) -> Box<dyn Nearest> {
            Box::new(Crowd::new(
                points.rows().map(|row| -> [f64; D] { std::array::from_fn(|axis| row[axis]) }),
            ))
        }
        Ok(Self(match points.dimensions() {
            2 => crowd::<2>(points),
            3 => crowd::<3>(points),
            4 => crowd::<4>(points),
            5 => crowd::<5>(points),
            6 => crowd::<6>(points),
            7 => crowd::<7>(points),
            8 => crowd::<8>(points),
            dimensions => return Err(SpatialError::Dimensions { dimensions }),
        }))
    }

    /// The leaves, ordered so that consecutive leaves are mostly close together.
    pub(crate) fn leaves(&self) -> Vec<u32> {
        self.0.leaves()
    }

    /// For each `wanted` row in some `leaves`: the row, and the squared distances to its `k` nearest points,
    /// itself included, ascending. If there are fewer than `k` points, all of them. Distances are given as
    /// bits, which are ordered like the numbers.
    pub(crate) fn each_nearest(
        &self,
        leaves: &[u32],
        k: usize,
        wanted: &dyn Fn(usize) -> bool,
        visit: &mut dyn FnMut(usize, &[u64]),
    ) {
        self.0.each_nearest(leaves, k, wanted, visit);
    }

    /// The same for any place, restricted to points within `limit` (squared).
    pub(crate) fn nearest(&self, place: &[f64], k: usize, limit: f64) -> Vec<u64> {
        self.0.nearest(place, k, limit)
    }
}

/// Adds the node of `items`, which begin at `first`, and the nodes below it. Returns its position.
#[expect(clippy::cast_possible_truncation, reason = "there are at most 2^32 - 1 points, and fewer nodes")]
fn split<const D: usize>(items: &mut [([f64; D], u32)], first: usize, nodes: &mut Vec<Node<D>>) -> u32 {
    let mut low = [f64::INFINITY; D];
    let mut high = [f64::NEG_INFINITY; D];
    for (place, _) in &*items {
        for axis in 0..D {
            low[axis] = low[axis].min(place[axis]);
            high[axis] = high[axis].max(place[axis]);
        }
    }
    let node = nodes.len();
    let first_point = first as u32;
    let end = (first + items.len()) as u32;
    nodes.push(Node { low, high, first: first_point, end, lower: 0, upper: 0 });
    if items.len() > LEAF_POINTS {
        let side = |axis: usize| high[axis] - low[axis];
        let longest = (0..D).max_by(|&a, &b| side(a).total_cmp(&side(b))).unwrap_or(0);
        // A multiple of the leaf size, so that leaves are full.
        let half = (items.len() / 2).next_multiple_of(LEAF_POINTS).min(items.len() - 1);
        let order =
            |a: &([f64; D], u32), b: &([f64; D], u32)| -> Ordering { a.0[longest].total_cmp(&b.0[longest]) };
        items.select_nth_unstable_by(half, order);
        let (one, other) = items.split_at_mut(half);
        nodes[node].lower = split(one, first, nodes);
        nodes[node].upper = split(other, first + half, nodes);
    }
    node as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::Numbers;

    /// A fixed pseudo-random cloud with repeated points; a fifth of it is ten times denser.
    fn cloud<const D: usize>(count: usize, steps: u32) -> Vec<[f64; D]> {
        let mut numbers = Numbers::new(7);
        let mut next = || f64::from(u32::try_from(numbers.next()).unwrap() % steps);
        (0..count)
            .map(|row| std::array::from_fn(|_| next() / if row % 5 == 0 { 10.0 } else { 1.0 }))
            .collect()
    }

    fn brute<const D: usize>(rows: &[[f64; D]], place: &[f64; D], k: usize) -> Vec<u64> {
        let mut all: Vec<u64> = rows.iter().map(|row| squared(place, row).to_bits()).collect();
        all.sort_unstable();
        all.truncate(k);
        all
    }

    fn check<const D: usize>(count: usize, steps: u32, k: usize) {
        let rows = cloud::<D>(count, steps);
        let crowd = Crowd::new(rows.iter().copied());
        let mut seen = vec![0; count];
        crowd.each_nearest(&crowd.leaves(), k, &|row| row % 3 != 1, &mut |row, found| {
            seen[row] += 1;
            assert_eq!(found, brute(&rows, &rows[row], k), "{D} {count} {steps} {k}: {row}");
        });
        assert!(seen.iter().enumerate().all(|(row, &times)| times == usize::from(row % 3 != 1)));
        for place in cloud::<D>(20, 3 * steps) {
            assert_eq!(crowd.nearest(&place, k, f64::INFINITY), brute(&rows, &place, k));
        }
    }

    #[test]
    fn neighbours_are_those_of_brute_force() {
        for (count, steps, k) in
            [(1, 9, 3), (30, 9, 40), (700, 1, 40), (700, 5, 7), (900, 2_000, 40), (400, 60, 200)]
        {
            check::<2>(count, steps, k);
            check::<3>(count, steps, k);
            check::<6>(count, steps, k);
        }
    }

    #[test]
    fn nothing_beyond_the_limit_is_found() {
        let crowd = Crowd::new([[0.0, 0.0], [3.0, 4.0], [6.0, 8.0]].into_iter());
        assert_eq!(crowd.nearest(&[0.0, 0.0], 5, 25.0), [0.0_f64, 25.0].map(f64::to_bits));
        assert_eq!(Crowd::<2>::new(std::iter::empty()).nearest(&[0.0, 0.0], 5, 25.0), Vec::<u64>::new());
    }
}

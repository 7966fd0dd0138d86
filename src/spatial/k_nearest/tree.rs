//! The kd-tree of an index of neighbours. Its leaves are whole blocks of points.

use std::ops::Range;

use crate::spatial::vectors::{Block, LANES};

/// Largest number of points of a leaf, unless they are all in one place. Chosen: fewer points cost more
/// look-ups, more points cost more useless distances.
const LEAF_POINTS: usize = 16;
/// Stored in a slot without a point.
pub(crate) const NO_POINT: u32 = u32::MAX;

/// A node of the tree: its box and its points.
#[derive(Debug, Clone, Copy)]
pub(super) struct Node {
    pub(super) low: [i32; 3],
    pub(super) high: [i32; 3],
    first: u32,
    end: u32,
    /// Positions of its halves in the list of nodes; 0 for a leaf.
    pub(super) lower: u32,
    pub(super) upper: u32,
}

impl Node {
    /// The squared distance between two boxes, rounded.
    #[inline]
    pub(super) fn gap(&self, low: [i32; 3], high: [i32; 3]) -> f32 {
        let along =
            |axis: usize| (self.low[axis] - high[axis]).max(low[axis] - self.high[axis]).max(0) as f32;
        let [x, y, z] = [along(0), along(1), along(2)];
        x * x + y * y + z * z
    }

    /// Its middle, rounded down.
    pub(super) fn centre(&self) -> [i32; 3] {
        [0, 1, 2].map(|axis| i32::midpoint(self.low[axis], self.high[axis]))
    }

    pub(super) fn slots(&self) -> Range<usize> {
        self.first as usize..self.end as usize
    }

    /// The blocks of a leaf.
    pub(super) fn blocks(&self) -> Range<usize> {
        self.first as usize / LANES..self.end as usize / LANES
    }

    pub(super) fn is_leaf(&self) -> bool {
        self.upper == 0
    }
}

/// The tree. Of more than `k` points in one place, it contains only `k`.
#[derive(Debug)]
pub(super) struct Tree {
    k: usize,
    /// The points, leaf by leaf, then those that are left out.
    pub(super) blocks: Vec<Block>,
    /// The lower and the upper corner of each block.
    pub(super) boxes: Vec<[[i32; 3]; 2]>,
    /// Number of the point in each slot, [`NO_POINT`] for none.
    pub(super) number: Vec<u32>,
    /// The nodes; the first is the root.
    pub(super) nodes: Vec<Node>,
    /// Points that are left out, as pairs: the slot of a point of the tree in the same place, then the slot
    /// of the point.
    pub(super) repeated: Vec<(u32, u32)>,
}

impl Tree {
    /// The tree of points with their numbers.
    #[expect(clippy::cast_possible_truncation, reason = "there are fewer than 2^32 points")]
    pub(super) fn new(mut points: Vec<([i32; 3], u32)>, k: usize) -> Self {
        let blocks = points.len() / LANES + 1;
        let mut tree = Self {
            k,
            blocks: Vec::with_capacity(blocks),
            boxes: Vec::with_capacity(blocks),
            number: Vec::with_capacity(blocks * LANES),
            nodes: Vec::with_capacity(points.len() / (LEAF_POINTS / 4) + 1),
            repeated: Vec::new(),
        };
        if !points.is_empty() {
            tree.split(&mut points);
        }
        let first = tree.number.len() as u32;
        let others: Vec<([i32; 3], u32)> =
            tree.repeated.iter().map(|(kept, number)| (tree.place(*kept as usize), *number)).collect();
        tree.fill(&others);
        tree.repeated.iter_mut().zip(first..).for_each(|(repeated, slot)| repeated.1 = slot);
        tree
    }

    /// Adds the node of these points, and the nodes below it. Returns its position.
    #[expect(clippy::cast_possible_truncation, reason = "there are fewer nodes than points")]
    fn split(&mut self, points: &mut [([i32; 3], u32)]) -> u32 {
        let (low, high) = box_of(points);
        let node = self.nodes.len();
        let first = self.number.len() as u32;
        self.nodes.push(Node { low, high, first, end: first, lower: 0, upper: 0 });
        if points.len() <= LEAF_POINTS {
            if points.len() > LANES {
                points.select_nth_unstable_by_key(LANES, |point| point.0[longest(low, high)]);
            }
            self.fill(points);
        } else if low == high {
            points.sort_unstable_by_key(|point| point.1);
            let (kept, others) = points.split_at(self.k.min(points.len()));
            self.repeated.extend(others.iter().map(|(_, number)| (first, *number)));
            self.fill(kept);
        } else {
            let longest = longest(low, high);
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

    /// Adds blocks of these points.
    #[expect(clippy::cast_possible_truncation, reason = "a block has at most 8 points")]
    fn fill(&mut self, points: &[([i32; 3], u32)]) {
        for points in points.chunks(LANES) {
            let (low, high) = box_of(points);
            // Unused lanes have the place of the first point, and do not count.
            let mut block = Block { axes: points[0].0.map(|value| [value; LANES]), len: points.len() as u32 };
            for (lane, (place, _)) in points.iter().enumerate() {
                block.axes.iter_mut().zip(place).for_each(|(axis, value)| axis[lane] = *value);
            }
            self.blocks.push(block);
            self.boxes.push([low, high]);
            self.number.extend(points.iter().map(|point| point.1));
            self.number.resize(self.blocks.len() * LANES, NO_POINT);
        }
    }

    /// The place of the point in a slot.
    #[inline]
    pub(super) fn place(&self, slot: usize) -> [i32; 3] {
        self.blocks[slot / LANES].axes.map(|axis| axis[slot % LANES])
    }

    /// The slots of a leaf that have points.
    pub(super) fn slots(&self, leaf: &Node) -> impl Iterator<Item = usize> {
        leaf.slots().filter(|slot| self.number[*slot] != NO_POINT)
    }
}

/// The lower and the upper corner of points.
fn box_of(points: &[([i32; 3], u32)]) -> ([i32; 3], [i32; 3]) {
    let mut low = [i32::MAX; 3];
    let mut high = [i32::MIN; 3];
    for (place, _) in points {
        for axis in 0..3 {
            low[axis] = low[axis].min(place[axis]);
            high[axis] = high[axis].max(place[axis]);
        }
    }
    (low, high)
}

/// The axis along which a box is longest.
fn longest(low: [i32; 3], high: [i32; 3]) -> usize {
    let side = |axis: usize| i64::from(high[axis]) - i64::from(low[axis]);
    (0..3).max_by_key(|axis| side(*axis)).unwrap_or(0)
}

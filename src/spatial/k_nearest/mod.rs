//! The K nearest points of many points of one cloud, within a largest distance. Coordinates are integers, and
//! ties go to the smaller number, so the neighbours do not depend on the shape of the tree.
//!
//! One look-up serves all points of a leaf of a kd-tree, as in `all_nearest`: they need nearly the same
//! neighbours. The distance from the middle of a leaf to its K-th neighbour bounds the distances of each
//! point of the leaf to its own K neighbours (triangle inequality). The points of all leaves within this
//! bound are listed once, and each point of the leaf searches this list, several points at a time
//! (`vectors`).
//!
//! Of many points in one place, only the K with the smallest numbers can be among the K nearest of any point.
//! The tree leaves the others out, so that very many points in one place cost no more than a few.
//!
//! The index also finds the one point nearest to a place that need not be a point (`place`).
//!
//! Every point has a slot in the index: first the points of the tree, leaf by leaf, then the points that are
//! left out. Values stored by slot are close together in memory if the points are close together in space.

mod place;
mod tree;

pub(crate) use self::tree::NO_POINT;
use self::tree::{Node, Tree};
use crate::spatial::ranks::{ROW, fill_up, threshold};
use crate::spatial::vectors::{self, Block, Boxes, Columns, EXACT, LANES, Look, Loops, MOST, Work};

/// Slack of bounds from the triangle inequality, far above the rounding error of a few operations in single
/// precision.
const SLACK: f32 = 1.0 + 1e-5;
/// Largest number of neighbours.
const LARGEST_K: usize = (MOST - LANES) / 3;
/// Largest reach in units: the square of a distance must fit 31 bits.
pub(crate) const LARGEST_REACH: i64 = 46_340;

/// Points, indexed for their K nearest neighbours.
#[derive(Debug)]
pub(crate) struct KNearest {
    /// Number of neighbours, the point itself included.
    k: usize,
    tree: Tree,
}

/// Buffers of a search.
struct Room {
    /// Leaves near a leaf: the upper half has the bits of the squared distance, the lower half the number.
    leaves: Vec<u64>,
    /// The boxes of their blocks. `ends` has the end of the boxes of each leaf.
    boxes: Boxes,
    ends: Vec<usize>,
    found: Box<Columns>,
    stack: Vec<(f32, u32)>,
    squared: Vec<f32>,
}

impl Room {
    fn new() -> Self {
        Self {
            leaves: Vec::new(),
            boxes: Boxes::default(),
            ends: Vec::new(),
            found: Box::default(),
            stack: Vec::with_capacity(64),
            squared: Vec::new(),
        }
    }
}

impl KNearest {
    /// Indexes points for `k` neighbours, 1 to 338. A point is identified by its position in `places`, which
    /// fits 32 bits. Coordinates are not negative.
    pub(crate) fn new(places: &[[i32; 3]], k: usize) -> Self {
        Self::of(places.iter().copied().zip(0..).collect(), k)
    }

    /// The same for points that are identified by numbers.
    pub(crate) fn of(points: Vec<([i32; 3], u32)>, k: usize) -> Self {
        let k = k.clamp(1, LARGEST_K);
        Self { k, tree: Tree::new(points, k) }
    }

    /// The number of the point in each slot, [`NO_POINT`] for none.
    pub(crate) fn numbers(&self) -> &[u32] {
        &self.tree.number
    }

    /// The place of the point in a slot.
    #[inline]
    pub(crate) fn place(&self, slot: usize) -> [i32; 3] {
        self.tree.place(slot)
    }

    /// Calls `visit` with the slot of every `wanted` point and its nearest points within `reach` units
    /// (inclusive, at most [`LARGEST_REACH`]): the K nearest, or all if there are fewer, in no particular
    /// order. The point itself is included unless K others are in its place.
    pub(crate) fn each(
        &self,
        reach: i64,
        wanted: impl Fn(usize) -> bool,
        visit: impl FnMut(usize, &mut Columns),
    ) {
        struct Each<'a, A, V>(&'a KNearest, i64, A, V);
        impl<A: Fn(usize) -> bool, V: FnMut(usize, &mut Columns)> Work for Each<'_, A, V> {
            type Output = ();

            #[inline(always)]
            fn with<L, K>(self, loops: &Loops<L, K>)
            where
                L: Fn(&[Block], &Boxes, Look, &mut Columns) -> usize,
                K: Fn(&mut Columns, f32),
            {
                self.0.each_by(loops, self.1, self.2, self.3);
            }
        }
        vectors::run(Each(self, reach, wanted, visit));
    }

    /// The same with the loops of a processor.
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "only so it has the instructions of the caller")]
    pub(crate) fn each_by<L, K>(
        &self,
        loops: &Loops<L, K>,
        reach: i64,
        wanted: impl Fn(usize) -> bool,
        mut visit: impl FnMut(usize, &mut Columns),
    ) where
        L: Fn(&[Block], &Boxes, Look, &mut Columns) -> usize,
        K: Fn(&mut Columns, f32),
    {
        let farthest = reach.clamp(0, LARGEST_REACH).unsigned_abs().pow(2);
        let mut room = Room::new();
        let repeated: Vec<(u32, u32)> =
            self.tree.repeated.iter().copied().filter(|(_, at)| wanted(*at as usize)).collect();
        let in_place = |at: usize| {
            let from = repeated.partition_point(|(kept, _)| (*kept as usize) < at);
            repeated[from..].iter().take_while(move |(kept, _)| *kept as usize == at).map(|(_, at)| *at)
        };
        for leaf in self.tree.nodes.iter().filter(|node| node.is_leaf()) {
            let asked = |at: &usize| wanted(*at) || (!repeated.is_empty() && in_place(*at).next().is_some());
            let mut asking = self.tree.slots(leaf).filter(asked).peekable();
            if asking.peek().is_none() {
                continue;
            }
            let centre = leaf.centre();
            let about_centre = self.kth(centre, farthest, &mut room);
            let within = |apart: f64| match about_centre {
                Some(about) => farthest.min(squared_up(about + apart)),
                None => farthest,
            };
            let corner = root_of_squared(centre, leaf.high);
            let limit = within(corner);
            self.leaves_within(leaf, limit, &mut room);
            // The coordinates of the leaf are exact in single precision, too.
            let exact = limit < EXACT && corner < 1e6;
            if exact {
                self.list(centre, &mut room);
            }
            for at in asking {
                let place = self.place(at);
                let limit = within(root_of_squared(place, centre));
                room.found.begin(limit as f32);
                if exact {
                    self.look(loops, [place, centre], limit, &mut room);
                } else {
                    self.look_far(loops, place, limit, &mut room);
                }
                if room.found.len() > self.k {
                    let limit = room.found.separate(self.k, &self.tree.number);
                    (loops.keep)(&mut room.found, limit);
                }
                // Points in the same place have the same neighbours.
                let is_repeated = !repeated.is_empty() && in_place(at).next().is_some();
                let found = is_repeated.then(|| room.found.clone());
                let others = in_place(at).map(|at| at as usize);
                for asking in std::iter::once(at).filter(|at| wanted(*at)).chain(others) {
                    visit(asking, &mut room.found);
                    if let Some(found) = &found {
                        room.found.clone_from(found);
                    }
                }
            }
        }
    }

    /// Lists the blocks of the near leaves, with coordinates relative to `centre`.
    #[expect(clippy::cast_possible_truncation, reason = "there are fewer blocks than points")]
    fn list(&self, centre: [i32; 3], room: &mut Room) {
        let Room { leaves, boxes, ends, .. } = room;
        boxes.clear();
        ends.clear();
        for leaf in leaves {
            for block in self.tree.nodes[number_of(*leaf)].blocks() {
                let [low, high] = self.tree.boxes[block];
                boxes.push(block as u32, low, high, centre);
            }
            ends.push(boxes.len());
        }
        boxes.end();
    }

    /// Searches the listed blocks.
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "only so it has the instructions of the caller")]
    fn look<L, K>(&self, loops: &Loops<L, K>, [place, origin]: [[i32; 3]; 2], limit: u64, room: &mut Room)
    where
        L: Fn(&[Block], &Boxes, Look, &mut Columns) -> usize,
        K: Fn(&mut Columns, f32),
    {
        let Room { leaves, boxes, ends, found, .. } = room;
        // Exact, because it is below 2^24.
        let mut limit = limit as f32;
        let most = 3 * self.k;
        let mut first = 0;
        let mut end = boxes.len();
        loop {
            first = (loops.look)(
                &self.tree.blocks,
                boxes,
                Look { first, end, place, origin, limit, most },
                found,
            );
            if found.len() > most {
                limit = found.separate(self.k, &self.tree.number);
                (loops.keep)(found, limit);
                let near = leaves.partition_point(|leaf| apart_of(*leaf) <= limit);
                end = near.checked_sub(1).map_or(0, |last| ends[last]);
            }
            if first >= end {
                return;
            }
        }
    }

    /// Searches the points of the near leaves where distances in single precision are not exact: on very fine
    /// lattices, and where points are kilometres apart.
    #[expect(clippy::cast_possible_truncation, reason = "slots fit 32 bits")]
    fn look_far<L, K>(&self, loops: &Loops<L, K>, place: [i32; 3], limit: u64, room: &mut Room)
    where
        K: Fn(&mut Columns, f32),
    {
        let Room { leaves, found, .. } = room;
        let mut below = f32::INFINITY;
        for leaf in leaves.iter() {
            if apart_of(*leaf) > limit as f32 * SLACK {
                return;
            }
            for at in self.tree.slots(&self.tree.nodes[number_of(*leaf)]) {
                let there = self.place(at);
                let squared =
                    (0..3).map(|axis| u64::from(there[axis].abs_diff(place[axis])).pow(2)).sum::<u64>();
                if squared <= limit && squared as f32 <= below {
                    found.push(squared as f32, sub(there, place), at as u32);
                }
                if found.len() > 3 * self.k {
                    below = found.separate(self.k, &self.tree.number);
                    (loops.keep)(found, below);
                }
            }
        }
    }

    /// An upper bound of the distance from a place to its K-th nearest point. `None` if fewer than K points
    /// are within the limit (squared). Distances are in single precision, so the bound only applies with
    /// [`SLACK`].
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "only so it has the instructions of the caller")]
    fn kth(&self, place: [i32; 3], limit: u64, room: &mut Room) -> Option<f64> {
        let Room { stack, squared, .. } = room;
        let mut limit = limit as f32;
        squared.clear();
        stack.clear();
        stack.extend((!self.tree.nodes.is_empty()).then_some((0.0, 0)));
        while let Some((apart, node)) = stack.pop() {
            if apart > limit {
                continue;
            }
            let node = &self.tree.nodes[node as usize];
            if node.is_leaf() {
                for Block { axes, len } in &self.tree.blocks[node.blocks()] {
                    let by = [0, 1, 2].map(|axis| axes[axis].map(|value| (value - place[axis]) as f32));
                    let row: [f32; ROW] =
                        std::array::from_fn(|lane| by.iter().map(|by| by[lane] * by[lane]).sum());
                    let mut kept = squared.len();
                    squared.extend_from_slice(&row);
                    for value in &row[..*len as usize] {
                        // Every value is written, but counted only if it is near: a branch could not be
                        // predicted.
                        squared[kept] = *value;
                        kept += usize::from(*value <= limit);
                    }
                    squared.truncate(kept);
                }
                if squared.len() >= 2 * self.k {
                    limit = cut(squared, self.k);
                }
                continue;
            }
            let halves =
                [node.lower, node.upper].map(|half| (self.tree.nodes[half as usize].gap(place, place), half));
            let [far, near] = if halves[0].0 > halves[1].0 { halves } else { [halves[1], halves[0]] };
            stack.extend([far, near]);
        }
        (squared.len() >= self.k).then(|| f64::from(cut(squared, self.k)).sqrt())
    }

    /// Finds the leaves whose box is within `limit` (squared) of the box of `leaf`, the nearest first.
    fn leaves_within(&self, leaf: &Node, limit: u64, room: &mut Room) {
        let Room { leaves, stack, .. } = room;
        // With slack, because distances are rounded.
        let limit = limit as f32 * SLACK;
        leaves.clear();
        stack.clear();
        stack.push((0.0, 0));
        while let Some((apart, number)) = stack.pop() {
            let node = &self.tree.nodes[number as usize];
            if node.is_leaf() {
                // The bits of non-negative numbers are ordered like the numbers.
                leaves.push(u64::from(apart.to_bits()) << 32 | u64::from(number));
                continue;
            }
            for half in [node.lower, node.upper] {
                let apart = self.tree.nodes[half as usize].gap(leaf.low, leaf.high);
                if apart <= limit {
                    stack.push((apart, half));
                }
            }
        }
        leaves.sort_unstable();
    }
}

/// Keeps the `count` smallest values; there must be at least as many. Returns the largest of them, or a value
/// between it and the others.
#[inline(always)]
#[expect(clippy::inline_always, reason = "only so it has the instructions of the caller")]
fn cut(values: &mut Vec<f32>, count: usize) -> f32 {
    let len = fill_up(values);
    let limit = threshold(values, len, count)
        .unwrap_or_else(|| *values.select_nth_unstable_by(count - 1, f32::total_cmp).1);
    let mut end = 0;
    for at in 0..values.len() {
        values[end] = values[at];
        end += usize::from(values[end] <= limit);
    }
    values.truncate(end.min(count));
    limit
}

/// The squared distance of an entry of [`Room::leaves`].
#[inline]
fn apart_of(leaf: u64) -> f32 {
    f32::from_bits((leaf >> 32) as u32)
}

/// The number of the leaf of an entry of [`Room::leaves`].
#[inline]
#[expect(clippy::cast_possible_truncation, reason = "the lower half")]
fn number_of(leaf: u64) -> usize {
    leaf as u32 as usize
}

/// The vector from one place to another. Coordinates are not negative.
#[inline]
fn sub(to: [i32; 3], from: [i32; 3]) -> [i32; 3] {
    [0, 1, 2].map(|axis| to[axis] - from[axis])
}

/// The square of a distance, rounded up with slack.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "of distances within the reach of tiles"
)]
fn squared_up(distance: f64) -> u64 {
    (distance * f64::from(SLACK)).powi(2).ceil() as u64 + 1
}

fn root_of_squared(a: [i32; 3], b: [i32; 3]) -> f64 {
    (0..3).map(|axis| (f64::from(a[axis]) - f64::from(b[axis])).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::Numbers;

    /// A fixed pseudo-random cloud with repeated points; a fifth of it is ten times denser.
    fn cloud(count: usize, steps: i32) -> Vec<[i32; 3]> {
        let mut numbers = Numbers::new(7);
        let mut next = || i32::try_from(numbers.next()).unwrap() % steps;
        (0..count).map(|row| [(); 3].map(|()| next() / if row % 5 == 0 { 10 } else { 1 })).collect()
    }

    fn brute(places: &[[i32; 3]], at: usize, k: usize, reach: i64) -> Vec<u32> {
        let squared =
            |a: [i32; 3], b: [i32; 3]| (0..3).map(|axis| u64::from(a[axis].abs_diff(b[axis])).pow(2)).sum();
        let mut all: Vec<(u64, u32)> = (0_u32..)
            .zip(places)
            .map(|(number, place)| (squared(*place, places[at]), number))
            .filter(|(squared, _)| *squared <= reach.unsigned_abs().pow(2))
            .collect();
        all.sort_unstable();
        all.truncate(k);
        let mut numbers: Vec<u32> = all.into_iter().map(|(_, number)| number).collect();
        numbers.sort_unstable();
        numbers
    }

    #[test]
    fn neighbours_are_those_of_brute_force() {
        for (count, steps, k, reach) in [
            (1, 9, 3, 5),
            (30, 9, 40, 100),
            (700, 1, 40, 10),
            (700, 5, 7, 3),
            (900, 2_000, 40, LARGEST_REACH),
            // Too far for distances in single precision.
            (900, 50_000, 40, LARGEST_REACH),
            (900, 50_000, 200, LARGEST_REACH),
            (900, 900_000_000, 40, LARGEST_REACH),
            // Very different densities, so that the search stops in between.
            (3_000, 1_000, 9, 900),
            (900, 2_000, 40, 250),
            (400, 60, 200, 30),
        ] {
            let places = cloud(count, steps);
            let index = KNearest::new(&places, k);
            let mut seen = vec![0; count];
            let numbers = index.numbers();
            let wanted = |slot: usize| numbers[slot] != NO_POINT && numbers[slot] % 3 != 1;
            index.each(reach, wanted, |slot, near| {
                let point = numbers[slot] as usize;
                seen[point] += 1;
                assert_eq!(index.place(slot), places[point]);
                let mut found: Vec<u32> = near.at().iter().map(|slot| numbers[*slot as usize]).collect();
                found.sort_unstable();
                assert_eq!(found, brute(&places, point, k, reach), "{count} {steps} {k} {reach}: {point}");
            });
            assert!(seen.iter().enumerate().all(|(point, times)| *times == usize::from(point % 3 != 1)));
        }
    }

    #[test]
    fn very_many_points_in_one_place_are_quick() {
        let mut places = vec![[5; 3]; 300_000];
        places.extend(cloud(1_000, 100));
        let index = KNearest::new(&places, 20);
        let mut sum = 0_u64;
        let numbers = index.numbers();
        let is_point = |slot: usize| numbers[slot] != NO_POINT;
        index.each(50, is_point, |_, near| {
            sum += near.at().iter().map(|slot| u64::from(numbers[*slot as usize])).sum::<u64>();
        });
        assert!(sum > 300_000 * 190, "the 20 first of one place: {sum}");
    }

    #[test]
    fn far_coordinates_do_not_overflow() {
        let places = [[0; 3], [i32::MAX; 3], [i32::MAX - 1, i32::MAX, i32::MAX]];
        let mut found = Vec::new();
        let index = KNearest::new(&places, 2);
        let numbers = index.numbers();
        let is_point = |slot: usize| numbers[slot] != NO_POINT;
        index.each(3, is_point, |slot, near| found.push((numbers[slot], near.len())));
        found.sort_unstable();
        assert_eq!(found, [(0, 1), (1, 2), (2, 2)]);
    }
}

//! Least paths from cores over the graph of a tile: every vertex takes the label of the core with the least
//! path cost to it.
//!
//! Costs are integers. A vertex takes the smallest (cost, label) over its edges. All costs are positive, so
//! exactly one assignment satisfies this for all vertices, in whatever order they are computed. The cost of
//! an edge depends on the label. So a better value of a vertex may mean a worse one further on: if a value
//! changes, all values that came from it are found anew. That makes it possible to start from an earlier
//! assignment: only what has changed is computed, and the result is that of a computation from nothing.
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "vertices fit u32; costs of an edge are positive and below 2^24"
)]

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

use super::classified::Shares;
use super::cores::Core;
use super::graph::Graph;
use super::settings::{CLASSES, EDGE_M};
use super::shares::{GROUND, POLE, TREE};
use crate::model::Lattice;

/// Smallest share of a class that opens a voxel to it, by class.
const OPEN: [u8; CLASSES] = [255, 5, 127, 25, 13, 51, 51, 26];
/// How much dearer an edge is to a voxel that is of another class.
const OTHER_CLASS: f64 = 8.0;
/// How much dearer an edge is that leads straight down, for trees.
const DOWN: f64 = 3.0;
/// Cost of a voxel's edge of distance from the stem in the plane, for trees.
const AWAY: f64 = 0.5;
/// Cost of a square metre of the square of this distance. Between two crowns that touch, it moves the
/// boundary towards the middle between their stems, however much denser one of them was seen.
const AWAY_SQUARE: f64 = 10.0;
/// Cost of an edge of the length of a voxel.
const UNIT: f64 = 256.0;

/// Label and cost of a voxel. Label 0: no core reaches it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Reached {
    pub(super) label: u32,
    pub(super) cost: u32,
}

/// The value of a voxel that no core reaches. Its cost is greater than any other.
pub(super) const NOWHERE: Reached = Reached { label: 0, cost: u32::MAX };

/// Whether a voxel can belong to an object.
pub(super) fn open(shares: &Shares) -> bool {
    shares[usize::from(GROUND)] <= 127
}

/// The share of a class for growth. A tree may also grow over voxels that look like poles: most of them are
/// trunks and branches, and poles are cores.
fn share_for(shares: &Shares, class: u8) -> u8 {
    let share = shares[usize::from(class)];
    if class == TREE { share.saturating_add(shares[usize::from(POLE)]) } else { share }
}

/// Costs of edges in lattice units of one drive.
struct Costs {
    edge: f64,
    metre: f64,
}

impl Costs {
    /// Cost of the edge from one voxel to another for a core of a class that stands at `place`.
    fn edge(&self, from: [i32; 3], to: [i32; 3], class: u8, place: [i64; 2], share: u8) -> u32 {
        let [dx, dy, dz] = [0, 1, 2].map(|axis| f64::from(to[axis] - from[axis]));
        let length = (dx * dx + dy * dy + dz * dz).sqrt();
        let ratio = length / self.edge;
        let mut cost = ratio * ratio.sqrt();
        if class == TREE {
            if dz < 0.0 {
                cost *= 1.0 - DOWN * dz / length;
            }
            let from_stem = |at: [i32; 3]| {
                let ([x, y], [u, v]) = ([i64::from(at[0]), i64::from(at[1])], place);
                (((x - u) * (x - u) + (y - v) * (y - v)) as f64).sqrt()
            };
            let (start, end) = (from_stem(from), from_stem(to));
            if end > start {
                let square_m2 = (end * end - start * start) / (self.metre * self.metre);
                cost += AWAY * (end - start) / self.edge + AWAY_SQUARE * square_m2;
            }
        }
        let other = 1.0 - f64::from(share) / 255.0;
        (UNIT * cost * (1.0 + OTHER_CLASS * other) + 0.5).max(1.0) as u32
    }
}

/// The values of the vertices of a graph, in progress.
pub(super) struct Paths<'a> {
    graph: &'a Graph,
    cores: &'a FxHashMap<u32, Core>,
    costs: Costs,
    reached: Vec<Reached>,
    /// Whether the value of a vertex is given: cores, and vertices of other tiles.
    given: Vec<bool>,
    /// Whether the value of a vertex has been passed on to its neighbours.
    passed: Vec<bool>,
    queue: BinaryHeap<Reverse<(u32, u32, u32)>>,
}

impl<'a> Paths<'a> {
    /// The values that are given. `outside` are those of the vertices of other tiles.
    pub(super) fn new(
        graph: &'a Graph,
        cores: &'a FxHashMap<u32, Core>,
        outside: &[Option<Reached>],
        lattice: Lattice,
    ) -> Self {
        let costs = Costs { edge: lattice.units(EDGE_M) as f64, metre: lattice.units(1.0) as f64 };
        let mut reached = vec![NOWHERE; graph.len()];
        for (vertex, reached) in reached.iter_mut().enumerate() {
            let label = graph.label(vertex);
            if label != 0 && open(&graph.shares(vertex)) {
                *reached = Reached { label, cost: 0 };
            }
        }
        for (vertex, value) in (graph.own()..).zip(outside) {
            reached[vertex] = value.unwrap_or(reached[vertex]);
        }
        let given =
            (0..graph.len()).map(|vertex| vertex >= graph.own() || reached[vertex].label != 0).collect();
        let passed = vec![false; graph.len()];
        Self { graph, cores, costs, reached, given, passed, queue: BinaryHeap::new() }
    }

    /// The values of the voxels of the tile.
    pub(super) fn found(mut self) -> Vec<Reached> {
        for vertex in 0..self.graph.len() {
            self.enqueue(vertex);
        }
        self.run()
    }

    /// The same, starting from the values that were found when the vertices of other tiles had other values.
    pub(super) fn changed_from(mut self, earlier: &[Reached]) -> Vec<Reached> {
        for (vertex, &value) in earlier.iter().enumerate() {
            self.reached[vertex] = value;
            self.passed[vertex] = value.label != 0;
        }
        for &vertex in self.graph.at_border() {
            let vertex = vertex as usize;
            let value = self.reached[vertex];
            if !self.given[vertex] && value.label != 0 && !self.supported(vertex) {
                self.reached[vertex] = NOWHERE;
                self.passed[vertex] = false;
                self.find_anew(vertex, value, true);
            }
        }
        for vertex in self.graph.own()..self.graph.len() {
            self.enqueue(vertex);
        }
        self.run()
    }

    fn enqueue(&mut self, vertex: usize) {
        let Reached { label, cost } = self.reached[vertex];
        if label != 0 {
            self.queue.push(Reverse((cost, label, vertex as u32)));
        }
    }

    /// Passes values on in the order of their costs until none changes.
    fn run(mut self) -> Vec<Reached> {
        while let Some(Reverse((cost, label, vertex))) = self.queue.pop() {
            let vertex = vertex as usize;
            let value = Reached { label, cost };
            if self.reached[vertex] != value {
                continue;
            }
            self.passed[vertex] = true;
            let graph = self.graph;
            for other in graph.neighbours(vertex) {
                // Every edge costs something, so the cheaper end cannot gain by it.
                if self.given[other] || self.reached[other].cost <= cost {
                    continue;
                }
                let Some(found) = self.over_edge(vertex, value, other) else { continue };
                let before = self.reached[other];
                if (found.cost, found.label) < (before.cost, before.label) {
                    self.reached[other] = found;
                    self.enqueue(other);
                    if std::mem::replace(&mut self.passed[other], false) {
                        self.find_anew(other, before, false);
                    }
                }
            }
        }
        self.reached.truncate(self.graph.own());
        self.reached
    }

    /// What a vertex with this value offers to a neighbour. `None` if the neighbour is closed to the core.
    fn over_edge(&self, vertex: usize, value: Reached, other: usize) -> Option<Reached> {
        let core = self.cores.get(&value.label)?;
        let shares = self.graph.shares(other);
        let share = share_for(&shares, core.class);
        if share < OPEN[usize::from(core.class)] || !open(&shares) {
            return None;
        }
        let (from, to) = (self.graph.centre(vertex), self.graph.centre(other));
        let start = self.graph.start();
        let place = [core.place[0] - start[0], core.place[1] - start[1]];
        let step = self.costs.edge(from, to, core.class, place, share);
        Some(Reached { label: value.label, cost: value.cost.saturating_add(step) })
    }

    /// Whether the value of a vertex comes from a neighbour whose value is given or was passed on. Another
    /// value may still change, and nobody would take back then what seemed to come from it.
    fn supported(&self, vertex: usize) -> bool {
        let value = self.reached[vertex];
        self.graph.neighbours(vertex).any(|other| {
            let offer = self.reached[other];
            let lasts = self.given[other] || self.passed[other];
            lasts && offer.label == value.label && self.over_edge(other, offer, vertex) == Some(value)
        })
    }

    /// Takes back all values that came from this value, which a vertex no longer has, and finds others for
    /// them; for the vertex itself too if it is `bare`.
    fn find_anew(&mut self, vertex: usize, before: Reached, bare: bool) {
        let graph = self.graph;
        let mut stack = vec![(vertex, before)];
        let mut bare: Vec<usize> = if bare { vec![vertex] } else { Vec::new() };
        while let Some((vertex, before)) = stack.pop() {
            for other in graph.neighbours(vertex) {
                let value = self.reached[other];
                if self.given[other]
                    || value.label != before.label
                    || self.over_edge(vertex, before, other) != Some(value)
                {
                    continue;
                }
                self.reached[other] = NOWHERE;
                bare.push(other);
                if std::mem::replace(&mut self.passed[other], false) {
                    stack.push((other, value));
                }
            }
        }
        for vertex in bare {
            // Neighbours whose value was not passed on yet will offer it.
            let best = graph
                .neighbours(vertex)
                .filter(|&other| self.passed[other])
                .filter_map(|other| self.over_edge(other, self.reached[other], vertex))
                .min_by_key(|offer| (offer.cost, offer.label));
            if let Some(best) = best {
                self.reached[vertex] = best;
                self.enqueue(vertex);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::SplitMix64;

    use super::*;
    use crate::cluster::street::shares::{FENCE, VEHICLE};

    fn core(label: u32) -> (u32, Core) {
        let class = [TREE, VEHICLE, FENCE][label as usize % 3];
        (label, Core { label, class, place: [i64::from(label) * 400, 300] })
    }

    /// Vertices in a box, of which the last tenth are another tile's; edges between those that are near.
    fn graph(random: &mut SplitMix64) -> Graph {
        let centre: Vec<[i64; 3]> =
            (0..300).map(|_| [2_000, 1_000, 1_000].map(|most| random.random_range(0..most))).collect();
        let own = 270_u32;
        let near =
            |a: [i64; 3], b: [i64; 3]| (0..3).map(|k| (a[k] - b[k]).pow(2)).sum::<i64>() < 240_i64.pow(2);
        let pairs: Vec<(u32, u32)> = (0..own)
            .flat_map(|a| (a + 1..300).map(move |b| (a, b)))
            .filter(|&(a, b)| near(centre[a as usize], centre[b as usize]))
            .collect();
        let mut label = vec![0; centre.len()];
        for core in 1..=3 {
            label[random.random_range(0..own as usize)] = core;
        }
        Graph::of(own, &centre, [20, 60, 10, 60, 10, 60, 35, 0], &label, &pairs)
    }

    /// The least costs by repeated passes over all edges, from nothing (Bellman and Ford, by value and not by
    /// improvement).
    fn by_repetition(paths: &Paths<'_>) -> Vec<Reached> {
        let graph = paths.graph;
        let mut reached = paths.reached.clone();
        loop {
            let next: Vec<Reached> = (0..graph.len())
                .map(|vertex| {
                    if paths.given[vertex] {
                        return reached[vertex];
                    }
                    let offers = graph.neighbours(vertex);
                    let offers = offers.filter_map(|other| paths.over_edge(other, reached[other], vertex));
                    offers.min_by_key(|offer| (offer.cost, offer.label)).unwrap_or(NOWHERE)
                })
                .collect();
            if next == reached {
                reached.truncate(graph.own());
                return reached;
            }
            reached = next;
        }
    }

    #[test]
    fn paths_from_an_earlier_result_are_those_from_nothing() {
        let mut random = SplitMix64::seed_from_u64(7);
        let mut changed = 0;
        for _ in 0..40 {
            let graph = graph(&mut random);
            let cores: FxHashMap<u32, Core> = (1..=6).map(core).collect();
            let mut outside = vec![None; graph.outside().len()];
            let paths =
                |outside: &[Option<Reached>]| Paths::new(&graph, &cores, outside, Lattice::MILLIMETRE);
            let mut earlier = paths(&outside).found();
            for _ in 0..20 {
                for _ in 0..random.random_range(1..5) {
                    let value =
                        Reached { label: random.random_range(1..7), cost: random.random_range(0..9_000) };
                    let at = random.random_range(0..outside.len());
                    outside[at] = random.random_bool(0.75).then_some(value);
                }
                let expected = by_repetition(&paths(&outside));
                assert_eq!(paths(&outside).found(), expected);
                let found = paths(&outside).changed_from(&earlier);
                assert_eq!(found, expected);
                changed += found.iter().zip(&earlier).filter(|(now, before)| now != before).count();
                earlier = found;
            }
        }
        assert!(changed > 20_000, "{changed} values changed");
    }

    #[test]
    fn a_value_that_loses_its_way_is_taken_back() {
        // Two vertices in a row, and one of another tile that first has a value and then none.
        let graph = Graph::of(
            2,
            &[[0, 0, 0], [150, 0, 0], [300, 0, 0]],
            [0, 255, 0, 0, 0, 0, 0, 0],
            &[0; 3],
            &[(0, 1), (1, 2)],
        );
        let cores: FxHashMap<u32, Core> = [core(3)].into_iter().collect();
        let paths = |outside: Option<Reached>| Paths::new(&graph, &cores, &[outside], Lattice::MILLIMETRE);
        let found = paths(Some(Reached { label: 3, cost: 5 })).found();
        assert_eq!(found.iter().map(|value| value.label).collect::<Vec<_>>(), [3, 3]);
        assert!(5 < found[1].cost && found[1].cost < found[0].cost);
        assert_eq!(paths(None).changed_from(&found), [NOWHERE; 2]);
    }

    /// Vertex 1 loses its value, and the core beside it would offer it one that fits the value of vertex 2 by
    /// chance. But then another tile offers vertex 1 a better one.
    #[test]
    fn a_value_that_is_not_passed_on_yet_supports_no_other() {
        let centre = [[6_000, 500, 0], [6_000, 300, 0], [6_150, 300, 0], [6_100, 300, 0], [6_150, 400, 0]];
        let edges = [(0, 1), (1, 2), (1, 3), (2, 4)];
        let graph = Graph::of(3, &centre, [20, 60, 10, 60, 10, 60, 35, 0], &[1, 0, 0, 0, 0], &edges);
        let (vehicle, tree) = (1, 3);
        let cores: FxHashMap<u32, Core> = [core(vehicle), core(tree)].into_iter().collect();
        let paths = |outside: [Option<Reached>; 2]| Paths::new(&graph, &cores, &outside, Lattice::MILLIMETRE);
        let from_core = paths([None; 2]).found()[2];
        let step = paths([None; 2]).over_edge(4, Reached { label: vehicle, cost: 0 }, 2).unwrap().cost;
        let same = Reached { label: vehicle, cost: from_core.cost - step };
        let tree_at = |cost: u32| Some(Reached { label: tree, cost });
        let earlier = paths([tree_at(0), Some(same)]).found();
        assert_eq!((earlier[1].label, earlier[2]), (tree, from_core));
        let expected = paths([tree_at(1), None]).found();
        assert_eq!((expected[1].label, expected[2].label), (tree, tree));
        assert_eq!(paths([tree_at(1), None]).changed_from(&earlier), expected);
    }
}

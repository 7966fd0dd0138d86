//! Least paths from cores over the graph of a tile: every vertex takes the label of the core with the least
//! path cost to it.
//!
//! Costs are integers. A vertex takes the smallest (cost, label) over its edges. All costs are positive, so
//! exactly one assignment satisfies this for all vertices, in whatever order they are computed. The cost of
//! an edge depends on the label. So a better value of a vertex may mean a worse one further on: if a value
//! changes, all values that came from it are computed again. Growth can therefore start from an earlier
//! assignment: it computes only the changes, and the result is the same as from scratch.
//!
//! A path may leave the tile and come back. The value of a vertex of another tile then comes from a vertex of
//! this tile. If that vertex has another value by now, the value is a stale echo, and two tiles would pass it
//! to each other without end. So such a value is valid only while the vertex that it came through still has
//! the value that it came from.
#![expect(clippy::cast_possible_truncation, reason = "vertices fit u32")]

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

use super::costs::{self, Costs};
use super::graph::Graph;
use crate::cluster::street::cores::stage_cores::Core;
use crate::model::Lattice;

/// Label and cost of a voxel. Label 0: no core reaches it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Reached {
    pub(crate) label: u32,
    pub(crate) cost: u32,
}

/// The value of a vertex of another tile.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Offer {
    pub(crate) value: Reached,
    /// The last voxel of this tile on its path, and the cost there; `None` if the path was never in this
    /// tile, or has passed through another one since.
    pub(crate) through: Option<(u32, u32)>,
}

impl Offer {
    /// Whether it comes from a vertex with this value.
    fn comes_from(&self, vertex: usize, value: Reached) -> bool {
        self.value.label == value.label && self.through == Some((vertex as u32, value.cost))
    }
}

/// The result for the voxels of a tile.
pub(crate) struct Found {
    pub(crate) reached: Vec<Reached>,
    /// For each voxel at the border, the number of the vertex of another tile from which its path entered
    /// this tile; `None` if the path began in this tile.
    pub(crate) through: Vec<Option<usize>>,
}

/// The value of a voxel that no core reaches. Its cost is greater than any other.
pub(crate) const NOWHERE: Reached = Reached { label: 0, cost: u32::MAX };

/// The values of the vertices of a graph, in progress.
pub(crate) struct Paths<'a> {
    graph: &'a Graph,
    cores: &'a FxHashMap<u32, Core>,
    costs: Costs,
    reached: Vec<Reached>,
    /// Whether the value of a vertex is given: cores, and vertices of other tiles.
    given: Vec<bool>,
    /// Whether the value of a vertex has been passed on to its neighbours.
    passed: Vec<bool>,
    queue: BinaryHeap<Reverse<(u32, u32, u32)>>,
    outside: &'a [Option<Offer>],
    /// Vertices of other tiles, by the vertices of this one that their values came through.
    echoes: FxHashMap<usize, Vec<usize>>,
}

impl<'a> Paths<'a> {
    /// Starts with the given values. `outside` has the values of the vertices of other tiles.
    pub(crate) fn new(
        graph: &'a Graph,
        cores: &'a FxHashMap<u32, Core>,
        outside: &'a [Option<Offer>],
        lattice: Lattice,
    ) -> Self {
        let mut reached = vec![NOWHERE; graph.len()];
        for (vertex, reached) in reached.iter_mut().enumerate() {
            let label = graph.label(vertex);
            if label != 0 && costs::is_open(&graph.shares(vertex)) {
                *reached = Reached { label, cost: 0 };
            }
        }
        let mut echoes: FxHashMap<usize, Vec<usize>> = FxHashMap::default();
        for (vertex, offer) in (graph.own()..).zip(outside) {
            let Some(offer) = offer else { continue };
            match offer.through {
                None => reached[vertex] = offer.value,
                Some((through, _)) => {
                    reached[vertex] = NOWHERE;
                    echoes.entry(through as usize).or_default().push(vertex);
                }
            }
        }
        let given =
            (0..graph.len()).map(|vertex| vertex >= graph.own() || reached[vertex].label != 0).collect();
        let passed = vec![false; graph.len()];
        let costs = Costs::new(lattice);
        Self { graph, cores, costs, reached, given, passed, queue: BinaryHeap::new(), outside, echoes }
    }

    /// The values of the voxels of the tile, computed from scratch.
    pub(crate) fn found(mut self) -> Found {
        for vertex in 0..self.graph.len() {
            self.enqueue(vertex);
        }
        self.run()
    }

    /// The same, from earlier values, which were found when the vertices of other tiles had other values.
    pub(crate) fn changed_from(mut self, earlier: &[Reached]) -> Found {
        for (vertex, &value) in earlier.iter().enumerate() {
            self.reached[vertex] = value;
            self.passed[vertex] = value.label != 0;
        }
        for (vertex, offer) in (self.graph.own()..).zip(self.outside) {
            if let Some(Offer { value, through: Some((voxel, cost)) }) = *offer
                && earlier[voxel as usize] == (Reached { label: value.label, cost })
            {
                self.reached[vertex] = value;
            }
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

    /// The vertices of other tiles whose values come from this value of a vertex.
    fn echoes_of(&self, vertex: usize, value: Reached) -> Vec<(usize, Reached)> {
        let echo = |&echo: &usize| {
            let offer = self.outside[echo - self.graph.own()].filter(|offer| offer.comes_from(vertex, value));
            Some((echo, offer?.value))
        };
        self.echoes.get(&vertex).into_iter().flatten().filter_map(echo).collect()
    }

    fn enqueue(&mut self, vertex: usize) {
        let Reached { label, cost } = self.reached[vertex];
        if label != 0 {
            self.queue.push(Reverse((cost, label, vertex as u32)));
        }
    }

    /// Passes values on in the order of their costs until none changes.
    fn run(mut self) -> Found {
        while let Some(Reverse((cost, label, vertex))) = self.queue.pop() {
            let vertex = vertex as usize;
            let value = Reached { label, cost };
            if self.reached[vertex] != value {
                continue;
            }
            self.passed[vertex] = true;
            for (echo, value) in self.echoes_of(vertex, value) {
                if self.reached[echo] != value {
                    self.reached[echo] = value;
                    self.enqueue(echo);
                }
            }
            let graph = self.graph;
            for other in graph.neighbours(vertex) {
                // Every edge has a positive cost, so it cannot improve the cheaper end.
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
        let through = self.through();
        self.reached.truncate(self.graph.own());
        Found { reached: self.reached, through }
    }

    /// See [`Found::through`]. Of several vertices that a value can come from, the first one is taken.
    fn through(&self) -> Vec<Option<usize>> {
        let mut known: FxHashMap<usize, Option<usize>> = FxHashMap::default();
        let mut of_vertex = |vertex: &u32| {
            let mut path = Vec::new();
            let mut at = *vertex as usize;
            let through = loop {
                if let Some(&through) = known.get(&at) {
                    break through;
                }
                path.push(at);
                if self.given[at] || self.reached[at].label == 0 {
                    break None;
                }
                match self.graph.neighbours(at).find(|&other| self.supports(other, at)) {
                    Some(other) if other >= self.graph.own() => break Some(other),
                    Some(other) => at = other,
                    None => break None,
                }
            };
            known.extend(path.into_iter().map(|at| (at, through)));
            through
        };
        self.graph.at_border().iter().map(&mut of_vertex).collect()
    }

    /// Whether the value of a vertex comes from the value of another.
    fn supports(&self, other: usize, vertex: usize) -> bool {
        let (value, offer) = (self.reached[vertex], self.reached[other]);
        offer.label == value.label && self.over_edge(other, offer, vertex) == Some(value)
    }

    /// What a vertex with this value offers to a neighbour. `None` if the neighbour is closed to the core.
    fn over_edge(&self, vertex: usize, value: Reached, other: usize) -> Option<Reached> {
        let core = self.cores.get(&value.label)?;
        let share = costs::share(&self.graph.shares(other), core.class)?;
        let (from, to) = (self.graph.centre(vertex), self.graph.centre(other));
        let start = self.graph.start();
        let place = [core.place[0] - start[0], core.place[1] - start[1]];
        let step = self.costs.edge(from, to, core.class, place, share);
        Some(Reached { label: value.label, cost: value.cost.saturating_add(step) })
    }

    /// Whether the value of a vertex comes from a neighbour whose value is given or was passed on. Any other
    /// value may still change, and then nothing would invalidate a value that seemed to come from it.
    fn supported(&self, vertex: usize) -> bool {
        let mut neighbours = self.graph.neighbours(vertex);
        neighbours.any(|other| (self.given[other] || self.passed[other]) && self.supports(other, vertex))
    }

    /// Invalidates all values that came from this value, which a vertex no longer has, and finds new ones for
    /// them. If `bare`, it also finds one for the vertex itself.
    fn find_anew(&mut self, vertex: usize, before: Reached, bare: bool) {
        let graph = self.graph;
        let mut stack = vec![(vertex, before)];
        let mut bare: Vec<usize> = if bare { vec![vertex] } else { Vec::new() };
        while let Some((vertex, before)) = stack.pop() {
            for (echo, value) in self.echoes_of(vertex, before) {
                // Values that were found earlier may come from this value although it was not passed on yet.
                if self.reached[echo] == value {
                    self.reached[echo] = NOWHERE;
                    self.passed[echo] = false;
                    stack.push((echo, value));
                }
            }
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
            // Neighbours whose value was not passed on yet will offer it later.
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
    use crate::cluster::street::shares::{FENCE, TREE, VEHICLE};

    fn offer(value: Reached) -> Option<Offer> {
        Some(Offer { value, through: None })
    }

    fn paths<'a>(
        graph: &'a Graph,
        cores: &'a FxHashMap<u32, Core>,
        outside: &'a [Option<Offer>],
    ) -> Paths<'a> {
        Paths::new(graph, cores, outside, Lattice::MILLIMETRE)
    }

    fn core(label: u32) -> (u32, Core) {
        let class = [TREE, VEHICLE, FENCE][label as usize % 3];
        (label, Core { label, class, place: [i64::from(label) * 400, 300] })
    }

    /// Vertices in a box, the last tenth of them in another tile, with edges between near ones.
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
        Graph::of(own, &centre, &[[20, 60, 10, 60, 10, 60, 35, 0]], &label, &pairs)
    }

    /// The least costs from scratch, by repeated passes over all edges (Bellman and Ford, but each pass
    /// computes every value again instead of improving it).
    fn by_repetition(paths: &Paths<'_>) -> Vec<Reached> {
        let graph = paths.graph;
        let mut reached = paths.reached.clone();
        loop {
            let next: Vec<Reached> = (0..graph.len())
                .map(|vertex| {
                    if let Some(Offer { value, through: Some((voxel, cost)) }) =
                        vertex.checked_sub(graph.own()).and_then(|at| paths.outside[at])
                    {
                        let lasts = reached[voxel as usize] == Reached { label: value.label, cost };
                        return if lasts { value } else { NOWHERE };
                    }
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
            let mut earlier = paths(&graph, &cores, &outside).found().reached;
            for _ in 0..20 {
                for _ in 0..random.random_range(1..5) {
                    let value =
                        Reached { label: random.random_range(1..7), cost: random.random_range(0..9_000) };
                    let at = random.random_range(0..outside.len());
                    // Some values come from a voxel of the tile, often with the cost that the voxel has.
                    let voxel = random.random_range(0..graph.own());
                    let before = earlier[voxel];
                    let echo = Reached { label: before.label, cost: before.cost.saturating_add(value.cost) };
                    let through = Some((voxel as u32, before.cost));
                    outside[at] = match random.random_range(0..4) {
                        0 => None,
                        1 if before.label != 0 => Some(Offer { value: echo, through }),
                        _ => offer(value),
                    };
                }
                let paths = || paths(&graph, &cores, &outside);
                let expected = by_repetition(&paths());
                assert_eq!(paths().found().reached, expected);
                let found = paths().changed_from(&earlier).reached;
                assert_eq!(found, expected);
                changed += found.iter().zip(&earlier).filter(|(now, before)| now != before).count();
                earlier = found;
            }
        }
        assert!(changed > 20_000, "{changed} values changed");
    }

    #[test]
    fn a_value_that_loses_its_way_is_taken_back() {
        // Two vertices in a row, and a vertex of another tile that first has a value and then none.
        let graph = Graph::of(
            2,
            &[[0, 0, 0], [150, 0, 0], [300, 0, 0]],
            &[[0, 255, 0, 0, 0, 0, 0, 0]],
            &[0; 3],
            &[(0, 1), (1, 2)],
        );
        let cores: FxHashMap<u32, Core> = [core(3)].into_iter().collect();
        let offers = [offer(Reached { label: 3, cost: 5 })];
        let found = paths(&graph, &cores, &offers).found().reached;
        assert_eq!(found.iter().map(|value| value.label).collect::<Vec<_>>(), [3, 3]);
        assert!(5 < found[1].cost && found[1].cost < found[0].cost);
        let without = paths(&graph, &cores, &[None]).changed_from(&found);
        assert_eq!(without.reached, [NOWHERE; 2]);
    }

    /// Vertex 1 loses its value. The core beside it would offer a value that fits vertex 2 by chance. But
    /// then another tile offers vertex 1 a better value.
    #[test]
    fn a_value_that_is_not_passed_on_yet_supports_no_other() {
        let centre = [[6_000, 500, 0], [6_000, 300, 0], [6_150, 300, 0], [6_100, 300, 0], [6_150, 400, 0]];
        let edges = [(0, 1), (1, 2), (1, 3), (2, 4)];
        let graph = Graph::of(3, &centre, &[[20, 60, 10, 60, 10, 60, 35, 0]], &[1, 0, 0, 0, 0], &edges);
        let (vehicle, tree) = (1, 3);
        let cores: FxHashMap<u32, Core> = [core(vehicle), core(tree)].into_iter().collect();
        let nothing = [None; 2];
        let from_core = paths(&graph, &cores, &nothing).found().reached[2];
        let start = Reached { label: vehicle, cost: 0 };
        let step = paths(&graph, &cores, &nothing).over_edge(4, start, 2).unwrap().cost;
        let same = Reached { label: vehicle, cost: from_core.cost - step };
        let tree_at = |cost: u32| offer(Reached { label: tree, cost });
        let before = [tree_at(0), offer(same)];
        let earlier = paths(&graph, &cores, &before).found().reached;
        assert_eq!((earlier[1].label, earlier[2]), (tree, from_core));
        let after = [tree_at(1), None];
        let expected = paths(&graph, &cores, &after).found().reached;
        assert_eq!((expected[1].label, expected[2].label), (tree, tree));
        assert_eq!(paths(&graph, &cores, &after).changed_from(&earlier).reached, expected);
    }

    /// A vehicle grows from vertex 0 over 1 to the vertex of another tile, and from there back to 2. Then a
    /// fence takes vertex 1 but cannot grow further, so the path is cut. The tiles must not keep passing the
    /// values beyond the cut to each other.
    #[test]
    fn an_echo_ends() {
        let (vehicle, fence) = (1, 2);
        let cores: FxHashMap<u32, Core> = [core(vehicle), core(fence)].into_iter().collect();
        let [first, gate, back, beyond, beside] =
            [[0, 0, 0], [150, 0, 0], [300, 150, 0], [300, 0, 0], [150, 100, 0]];
        let [vehicles, both] = [[0, 0, 0, 255, 0, 0, 0, 0], [0, 0, 0, 127, 0, 127, 0, 0]];
        let here = Graph::of(
            3,
            &[first, gate, back, beyond, beside],
            &[vehicles, both, vehicles, vehicles, both],
            &[vehicle, 0, 0, 0, 0],
            &[(0, 1), (1, 3), (2, 3), (1, 4)],
        );
        let there =
            Graph::of(1, &[beyond, gate, back], &[vehicles, both, vehicles], &[0; 3], &[(0, 1), (0, 2)]);
        assert_eq!((here.at_border(), there.at_border()), ([1, 2].as_slice(), [0].as_slice()));
        let find = |graph: &Graph, offers: &[Option<Offer>]| paths(graph, &cores, offers).found();
        // Vertices 1 and 2 of `there` are vertices of `here`. Vertex 3 of `here` is vertex 0 of `there`, and
        // vertex 4 of `here` belongs to a third tile.
        let rounds = |tells_through: bool| {
            let mut offers = (vec![None; 2], vec![None; 2]);
            let mut found = (find(&here, &offers.0), find(&there, &offers.1));
            let mut labels = Vec::new();
            for round in 0..8 {
                let passed_on = |value: Reached, through: Option<(u32, Option<Offer>)>| {
                    let through = through.filter(|_| tells_through);
                    let through = through.and_then(|(number, offer)| Some((number, offer?.value.cost)));
                    (value.label != 0).then_some(Offer { value, through })
                };
                let of_there = found.1.through[0].map(|vertex| (vertex as u32, offers.1[vertex - 1]));
                let of_here = |at: usize| {
                    let through = found.0.through[at].filter(|&vertex| vertex == 3);
                    passed_on(found.0.reached[at + 1], through.map(|_| (0, offers.0[0])))
                };
                let fence = if round < 4 { None } else { offer(Reached { label: fence, cost: 1 }) };
                let next =
                    (vec![passed_on(found.1.reached[0], of_there), fence], vec![of_here(0), of_here(1)]);
                found = (find(&here, &next.0), find(&there, &next.1));
                offers = next;
                labels.push([found.0.reached[1].label, found.1.reached[0].label, found.0.reached[2].label]);
            }
            labels
        };
        let labels = rounds(true);
        assert_eq!(labels[3], [vehicle; 3]);
        assert_eq!(labels[4..], [[fence, vehicle, 0], [fence, 0, 0], [fence, 0, 0], [fence, 0, 0]]);
        assert_eq!(rounds(false)[4..], [[fence, vehicle, vehicle]; 4], "each tile believes the other");
    }
}

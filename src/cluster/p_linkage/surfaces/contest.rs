//! The contest among surfaces: each point goes to the surface, among those of its neighbours, whose local
//! plane suits it best; and which surfaces touch after this and agree.
//!
//! This is not in the paper. Where a plane is about as narrow as a neighbourhood, as a kerb is, many normals
//! mix two planes, and their points make slices that lean. Such slices lie between those of the narrow plane,
//! which therefore are not adjacent. A local plane is fitted to many points, so it leans less than a normal:
//! leaning slices lose their points to it, and the pieces of the narrow plane touch.
//!
//! A point is decided by its neighbours and by the local planes in its cube, so by the points within a fixed
//! distance. Scores that are equal, as without noise, are decided by the nearer neighbour and its id.

use std::cell::OnceCell;

use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

use super::around::{Around, Zone};
use super::border::steps;
use super::cubes::{Cubes, LocalPlane, SumsOfCubes};
use super::planes::{LARGEST_SCORE, likeness};
use crate::spatial::{KNearest, number_of};

/// The points of a tile and around it.
pub(super) struct Arena<'a> {
    around: &'a Around,
    cubes: Cubes,
    /// Number of neighbours of a point, itself included, and how far they may be.
    neighbours: usize,
    reach: i64,
    /// Only where a point needs its neighbours.
    index: OnceCell<KNearest>,
}

/// The surfaces of points after a contest. Only points that are at most [`Zone::Linked`] are known.
#[derive(Debug)]
pub(super) struct Contested {
    /// The surface of each point, 0 for none.
    pub(super) surfaces: Vec<u32>,
    /// Whether each point is consistent with the local plane of its surface.
    pub(super) on_plane: Vec<bool>,
    /// Whether it is consistent with the local plane of no other surface, wherever the other one's points are.
    pub(super) alone: Vec<bool>,
    /// Sums over the points of surfaces after the contest.
    sums: SumsOfCubes,
}

/// Points of two surfaces that have each other among their neighbours, as seen from either.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(super) struct Touching {
    /// Number of pairs seen from the surface with the smaller number, and from the other.
    seen: [u64; 2],
    /// Sum of the distances of both points of a pair from the local planes of the other surface, in steps.
    distances: u64,
    /// Sum of the larger deviation of both planes, in steps.
    deviations: u64,
}

impl Touching {
    /// Adds other pairs of the same surfaces.
    pub(super) fn merge(&mut self, other: &Self) {
        self.seen = [self.seen[0] + other.seen[0], self.seen[1] + other.seen[1]];
        self.distances += other.distances;
        self.deviations += other.deviations;
    }

    /// Whether both surfaces have the other among their neighbours (equation 10, for surfaces instead of
    /// points), and whether the mean distance is below `score` deviations. A score of 0 demands no distance.
    pub(super) fn agrees(&self, score: f64) -> bool {
        let near = (self.distances as f64) < 2.0 * score * self.deviations as f64;
        self.seen.iter().all(|seen| *seen > 0) && (score <= 0.0 || near)
    }
}

/// Deviation plus half the distance; infinite beyond 2.5 deviations (equation 7).
fn score(plane: &LocalPlane, by: [i32; 3]) -> f64 {
    let distance = plane.distance(by);
    if distance < LARGEST_SCORE * plane.deviation { plane.deviation + distance / 2.0 } else { f64::INFINITY }
}

impl<'a> Arena<'a> {
    /// Cubes have edges of `edge` lattice units.
    pub(super) fn new(around: &'a Around, edge: u32, neighbours: usize, reach: i64) -> Self {
        let cubes = Cubes::new(&around.places, around.origin, edge);
        Self { around, cubes, neighbours, reach, index: OnceCell::new() }
    }

    /// The points that are asked for, with the distance and number of their neighbours.
    fn each(&self, asked: &[bool], visit: impl FnMut(u32, &mut [u64])) {
        if asked.iter().any(|asked| *asked) {
            let index = self.index.get_or_init(|| KNearest::new(&self.around.places, self.neighbours));
            index.each(self.reach, |point| asked[point as usize], visit);
        }
    }

    /// The contest. `before` has the surface of each point, 0 for none.
    pub(super) fn contest(&self, before: &[u32]) -> Contested {
        let Self { around, cubes, .. } = self;
        let known = |point: usize| around.zone[point] <= Zone::Linked;
        let sums = cubes.sums(&around.places, before);
        let planes = cubes.planes(&sums, 1, known);
        let by = |point: usize| cubes.from_corner(cubes.of(point), around.places[point]);
        let own_score = |point: usize, by: [i32; 3]| {
            let own = planes.of(cubes.of(point)).iter().find(|plane| plane.surface == before[point]);
            own.map_or(f64::INFINITY, |plane| score(plane, by))
        };
        let mut found = Contested {
            surfaces: before.to_vec(),
            on_plane: vec![false; before.len()],
            alone: vec![false; before.len()],
            sums,
        };
        // A point that no other plane suits better keeps its surface, and needs no neighbours.
        let mut asked = vec![false; before.len()];
        for cube in (0..cubes.len()).filter(|cube| !planes.of(*cube).is_empty()) {
            for point in cubes.points(cube).iter().map(|point| *point as usize).filter(|point| known(*point))
            {
                let by = by(point);
                let own = own_score(point, by);
                found.on_plane[point] = own.is_finite();
                let (mut consistent, mut better) = (0, false);
                for score in planes.of(cube).iter().map(|plane| score(plane, by)) {
                    consistent += u32::from(score.is_finite());
                    // Its own plane is not better than itself.
                    better |= score < own;
                }
                found.alone[point] = consistent == 1;
                asked[point] = better;
            }
        }
        let mut rivals: Vec<(u32, f64)> = Vec::new();
        self.each(&asked, |number, near| {
            let point = number as usize;
            let by = by(point);
            let own = own_score(point, by);
            let scores = planes.of(cubes.of(point)).iter().map(|plane| (plane.surface, score(plane, by)));
            rivals.clear();
            rivals.extend(scores.filter(|(_, score)| *score < own));
            // Score, distance and id of the neighbour, and its surface.
            let mut best = (own, 0, before[point]);
            for near in &*near {
                let surface = before[number_of(*near) as usize];
                if let Some((_, score)) = rivals.iter().find(|rival| rival.0 == surface)
                    && (*score, *near) < (best.0, best.1)
                {
                    best = (*score, *near, surface);
                }
            }
            if best.2 != before[point] {
                cubes.take(&mut found.sums, point, around.places[point], before[point], best.2);
            }
            found.surfaces[point] = best.2;
            found.on_plane[point] = best.0.is_finite();
        });
        found
    }

    /// The touching surfaces whose local planes deviate by less than the angle with this `cosine`, in
    /// ascending order, from the points that the tile owns. With a `border_score` above 0, points further
    /// than twice this many deviations from the other plane are not looked at: a facade has many points near
    /// panes that lie behind it.
    pub(super) fn touching(
        &self,
        now: &Contested,
        cosine: f64,
        border_score: f64,
    ) -> Vec<((u32, u32), Touching)> {
        let Self { around, cubes, .. } = self;
        let ends = |point: usize| around.is_core(point) && now.on_plane[point];
        let planes = cubes.planes(&now.sums, 2, ends);
        let own = |point: usize| {
            planes.of(cubes.of(point)).iter().find(|plane| plane.surface == now.surfaces[point])
        };
        // Whether a point of one plane may touch another one.
        let may_touch = |own: &LocalPlane, other: &LocalPlane, by: [i32; 3]| {
            let deviation = own.deviation.max(other.deviation);
            own.surface != other.surface
                && likeness(own.normal, other.normal) > cosine
                && (border_score <= 0.0 || other.distance(by) < 2.0 * border_score * deviation)
        };
        let mut asked = vec![false; around.len()];
        for cube in (0..cubes.len()).filter(|cube| planes.of(*cube).len() > 1) {
            for point in cubes.points(cube).iter().map(|point| *point as usize).filter(|point| ends(*point)) {
                let by = cubes.from_corner(cube, around.places[point]);
                asked[point] = own(point)
                    .is_some_and(|own| planes.of(cube).iter().any(|other| may_touch(own, other, by)));
            }
        }
        let mut found: FxHashMap<(u32, u32), Touching> = FxHashMap::default();
        self.each(&asked, |number, near| {
            let point = number as usize;
            let cube = cubes.of(point);
            let by = cubes.from_corner(cube, around.places[point]);
            let Some(own) = own(point) else { return };
            for other in planes.of(cube).iter().filter(|other| may_touch(own, other, by)) {
                let mut pairs = Touching::default();
                let (here, deviation) =
                    (steps(other.distance(by)), steps(own.deviation.max(other.deviation)));
                for at in near.iter().map(|near| number_of(*near) as usize) {
                    if now.surfaces[at] == other.surface && now.on_plane[at] {
                        let there = own.distance(cubes.from_corner(cube, around.places[at]));
                        pairs.seen[usize::from(own.surface > other.surface)] += 1;
                        pairs.distances += here + steps(there);
                        pairs.deviations += deviation;
                    }
                }
                if pairs != Touching::default() {
                    let pair = (own.surface.min(other.surface), own.surface.max(other.surface));
                    found.entry(pair).or_default().merge(&pairs);
                }
            }
        });
        let mut found: Vec<_> = found.into_iter().collect();
        found.sort_unstable_by_key(|touching| touching.0);
        found
    }
}

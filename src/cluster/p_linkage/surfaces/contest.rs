//! The contest among surfaces. Each point goes to that surface of its neighbours whose local plane fits it
//! best. Then the surfaces that touch and agree are found.
//!
//! This is not in the paper. If a plane is about as narrow as a neighbourhood, for example a kerb, many
//! normals mix two planes, and their points form slices that lean. Such slices lie between the slices of the
//! narrow plane, which therefore are not adjacent. A local plane is fitted to many points, so it leans less
//! than a normal. Leaning slices lose their points to it, and the pieces of the narrow plane touch.
//!
//! The surface of a point depends on its neighbours and on the local planes in its cube, so only on points
//! within a fixed distance. If scores are equal, for example without noise, the nearest neighbour decides,
//! and then the place of the neighbour.

use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

use super::around::{Around, Zone};
use super::border::steps;
use super::cubes::{Cubes, LocalPlane, LocalPlanes, SumsOfCubes};
use super::planes::{LARGEST_SCORE, likeness, squared_distance};
use crate::spatial::KNearest;

/// Number of local planes above which a cube contains noise. Then the neighbours of every point are searched.
/// Chosen: the distances from 2000 planes take as long as the search for the neighbours of a point.
const MANY_PLANES: usize = 1_000;

/// The points of a tile and around it.
pub(super) struct Arena<'a> {
    around: &'a Around,
    cubes: Cubes,
    /// Number of neighbours of a point, itself included. `reach` is their largest distance.
    neighbours: usize,
    reach: i64,
    /// [`MANY_PLANES`], except in tests.
    many_planes: usize,
}

/// The surfaces of points after a contest. They are known only for points up to [`Zone::Linked`].
#[derive(Debug)]
pub(super) struct Contested {
    /// The surface of each point, 0 for none.
    pub(super) surfaces: Vec<u32>,
    /// Whether each point is consistent with the local plane of its surface.
    pub(super) on_plane: Vec<bool>,
    /// For a point that the tile owns: whether it is also away from the edges of its surface. Such a point is
    /// neither consistent with nor beyond any local plane in its cube that deviates from its own.
    pub(super) amid: Vec<bool>,
    /// Sums over the points of surfaces after the contest.
    sums: SumsOfCubes,
}

/// Pairs of points of two surfaces. One point of a pair is a neighbour of the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(super) struct Touching {
    pairs: u64,
    /// Sum over the pairs of the distances of both points from the local plane of the other surface, in
    /// steps.
    distances: u64,
    /// Sum over the pairs of the larger deviation of both planes, in steps.
    deviations: u64,
}

impl Touching {
    /// One pair.
    #[cfg(test)]
    pub(super) fn one() -> Self {
        Self { pairs: 1, ..Self::default() }
    }

    /// Number of pairs.
    pub(super) fn pairs(&self) -> u64 {
        self.pairs
    }

    /// Adds other pairs of the same surfaces.
    pub(super) fn merge(&mut self, other: &Self) {
        self.pairs += other.pairs;
        self.distances += other.distances;
        self.deviations += other.deviations;
    }

    /// Whether the mean distance is below `score` deviations. A score of 0 requires nothing. Pairs need not
    /// be mutual, unlike pairs of slices (equation 10). The end of a piece of a kerb may lean, so that its
    /// local plane agrees with the plane of the next piece on one side only.
    pub(super) fn agrees(&self, score: f64) -> bool {
        score <= 0.0 || (self.distances as f64) < 2.0 * score * self.deviations as f64
    }
}

/// Score of a local plane for a point: deviation plus half the distance, infinite beyond 2.5 deviations
/// (equation 7). The lowest score wins.
fn score(plane: &LocalPlane, by: [i32; 3]) -> f64 {
    let distance = plane.distance(by);
    if distance < LARGEST_SCORE * plane.deviation { plane.deviation + distance / 2.0 } else { f64::INFINITY }
}

impl<'a> Arena<'a> {
    /// The arena with cubes of `edge` lattice units.
    pub(super) fn new(around: &'a Around, edge: u32, neighbours: usize, reach: i64) -> Self {
        let cubes = Cubes::new(&around.places, around.origin, edge);
        Self { around, cubes, neighbours, reach, many_planes: MANY_PLANES }
    }

    /// Whether the condition `is` may apply to one of the planes of a cube. If so, the caller searches the
    /// neighbours of the point. With many planes it applies to one of them in most cases, and a point has few
    /// neighbours. So the answer is yes without a test, and the time does not grow with the number of planes.
    #[inline]
    fn one_may_be(&self, planes: &[LocalPlane], is: impl Fn(&LocalPlane) -> bool) -> bool {
        planes.len() > self.many_planes || planes.iter().any(is)
    }

    /// Visits the `asked` points with their neighbours. They are few, so only the points in the cubes around
    /// them are indexed.
    fn each(&self, asked: &[bool], mut visit: impl FnMut(usize, &mut dyn Iterator<Item = usize>)) {
        let Self { around, cubes, .. } = self;
        let asking =
            (0..cubes.len()).filter(|cube| cubes.points(*cube).iter().any(|point| asked[*point as usize]));
        let near = cubes.within(self.reach, asking);
        let cubes = (0..cubes.len()).filter(|cube| near[*cube]).flat_map(|cube| cubes.points(cube));
        let points = cubes.map(|point| (around.places[*point as usize], *point)).collect();
        let index = KNearest::of(points, self.neighbours);
        let numbers = index.numbers();
        let is_asked = |slot: usize| asked.get(numbers[slot] as usize).is_some_and(|asked| *asked);
        index.each(self.reach, is_asked, |slot, near| {
            visit(numbers[slot] as usize, &mut near.at().iter().map(|slot| numbers[*slot as usize] as usize));
        });
    }

    /// The contest. `before` has the surface of each point, 0 for none. Two planes are alike if the angle
    /// between them has a larger cosine than `cosine`.
    pub(super) fn contest(&self, before: &[u32], cosine: f64) -> Contested {
        let Self { around, cubes, .. } = self;
        let known = |point: usize| around.zone[point] <= Zone::Linked;
        let sums = cubes.sums(before);
        let planes = cubes.planes(&sums, 1, known);
        let own_score = |point: usize, by: [i32; 3]| {
            let own = planes.find(cubes.of(point), before[point]);
            own.map_or(f64::INFINITY, |plane| score(plane, by))
        };
        let mut found = Contested {
            surfaces: before.to_vec(),
            on_plane: vec![false; before.len()],
            amid: vec![false; before.len()],
            sums,
        };
        // A point keeps its surface if no other plane has a better score. Then it needs no neighbours.
        let mut asked = vec![false; before.len()];
        for cube in (0..cubes.len()).filter(|cube| !planes.of(*cube).is_empty()) {
            for (point, by) in cubes.placed(cube).filter(|(point, _)| known(*point)) {
                let own = own_score(point, by);
                found.on_plane[point] = own.is_finite();
                // Its own plane is not better than itself.
                asked[point] = self.one_may_be(planes.of(cube), |plane| score(plane, by) < own);
            }
        }
        // Surfaces of neighbours, and the scores of their planes for the point.
        let mut rivals: Vec<(u32, f64)> = Vec::new();
        self.each(&asked, |point, near| {
            let cube = cubes.of(point);
            let by = cubes.in_cube(cube, around.places[point]);
            rivals.clear();
            // The plane of its own surface is not better than itself, and surface 0 (none) has no plane.
            rivals.extend([(before[point], f64::INFINITY), (0, f64::INFINITY)]);
            // Score, squared distance and number of the neighbour, and its surface.
            let mut best = (own_score(point, by), 0, 0, before[point]);
            for near in near {
                let surface = before[near];
                let known = rivals.iter().find(|rival| rival.0 == surface).map(|rival| rival.1);
                let score = known.unwrap_or_else(|| {
                    let plane = planes.find(cube, surface);
                    let score = plane.map_or(f64::INFINITY, |plane| score(plane, by));
                    rivals.push((surface, score));
                    score
                });
                if score > best.0 || score.is_infinite() {
                    continue;
                }
                let apart = squared_distance(around.places[point], around.places[near]);
                if (score, apart, near) < (best.0, best.1, best.2) {
                    best = (score, apart, near, surface);
                }
            }
            if best.3 != before[point] {
                cubes.take(&mut found.sums, point, around.places[point], before[point], best.3);
            }
            found.surfaces[point] = best.3;
            found.on_plane[point] = best.0.is_finite();
        });
        self.amid(&planes, cosine, &mut found);
        found
    }

    /// Finds the points of the tile that are away from the edges of their surfaces.
    fn amid(&self, planes: &LocalPlanes, cosine: f64, found: &mut Contested) {
        let Self { around, cubes, .. } = self;
        for cube in (0..cubes.len()).filter(|cube| !planes.of(*cube).is_empty()) {
            let of_cube = planes.of(cube);
            // The plane that put the latest point at an edge. It is tried first, because in noise there are
            // thousands of planes, and almost every point is at the edge to one of them.
            let mut latest = 0;
            let may_be_amid = |point: usize| around.is_core(point) && found.on_plane[point];
            for (point, by) in cubes.placed(cube).filter(|(point, _)| may_be_amid(*point)) {
                let Some(own) = planes.find(cube, found.surfaces[point]) else { continue };
                let at = |other: &LocalPlane| {
                    likeness(own.normal, other.normal) <= cosine
                        && (score(other, by).is_finite() || !own.is_beside(other, by))
                };
                if !at(&of_cube[latest]) {
                    match of_cube.iter().position(at) {
                        Some(other) => latest = other,
                        None => found.amid[point] = true,
                    }
                }
            }
        }
    }

    /// The touching surfaces in ascending order, from the points that the tile owns. The angle between their
    /// local planes has a larger cosine than `cosine`. With a `border_score` above 0, points farther than
    /// twice this many deviations from the other plane are ignored: a facade has many points near panes that
    /// lie behind it.
    pub(super) fn touching(
        &self,
        now: &Contested,
        cosine: f64,
        border_score: f64,
    ) -> Vec<((u32, u32), Touching)> {
        let Self { around, cubes, .. } = self;
        let ends = |point: usize| around.is_core(point) && now.on_plane[point];
        let planes = cubes.planes(&now.sums, 2, ends);
        let own = |point: usize| planes.find(cubes.of(point), now.surfaces[point]);
        // Whether a point of one plane may touch another one.
        let may_touch = |own: &LocalPlane, other: &LocalPlane, by: [i32; 3]| {
            let deviation = own.deviation.max(other.deviation);
            own.surface != other.surface
                && likeness(own.normal, other.normal) > cosine
                && (border_score <= 0.0 || other.distance(by) < 2.0 * border_score * deviation)
        };
        let mut asked = vec![false; around.len()];
        for cube in (0..cubes.len()).filter(|cube| planes.of(*cube).len() > 1) {
            for (point, by) in cubes.placed(cube).filter(|(point, _)| ends(*point)) {
                asked[point] = own(point)
                    .is_some_and(|own| self.one_may_be(planes.of(cube), |other| may_touch(own, other, by)));
            }
        }
        let mut found: FxHashMap<(u32, u32), Touching> = FxHashMap::default();
        // Surfaces of neighbours, each with its local plane if the point may touch it, and with the pairs.
        let mut beside: Vec<(u32, Option<&LocalPlane>, Touching)> = Vec::new();
        self.each(&asked, |point, near| {
            beside.clear();
            let cube = cubes.of(point);
            let by = cubes.in_cube(cube, around.places[point]);
            let Some(own) = own(point) else { return };
            for at in near.filter(|at| now.on_plane[*at] && now.surfaces[*at] != own.surface) {
                let surface = now.surfaces[at];
                let known = beside.iter().position(|beside| beside.0 == surface).unwrap_or_else(|| {
                    let other = planes.find(cube, surface).filter(|other| may_touch(own, other, by));
                    beside.push((surface, other, Touching::default()));
                    beside.len() - 1
                });
                let (_, other, pairs) = &mut beside[known];
                if let Some(other) = other {
                    let there = own.distance(cubes.in_cube(cube, around.places[at]));
                    pairs.pairs += 1;
                    pairs.distances += steps(other.distance(by)) + steps(there);
                    pairs.deviations += steps(own.deviation.max(other.deviation));
                }
            }
            for (surface, _, pairs) in beside.iter().filter(|beside| beside.2.pairs > 0) {
                let pair = (own.surface.min(*surface), own.surface.max(*surface));
                found.entry(pair).or_default().merge(pairs);
            }
        });
        let mut found: Vec<_> = found.into_iter().collect();
        found.sort_unstable_by_key(|touching| touching.0);
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::PointId;
    use crate::numbers::Numbers;

    /// Surfaces of points, and points.
    type Scene = (Vec<u32>, Vec<[i32; 3]>);

    /// Adds a square of 1 m with a point every 20 mm from a corner, off the plane by up to `noise` mm.
    fn square(scene: &mut Scene, surface: u32, corner: [i32; 3], axes: [usize; 2], noise: i32) {
        for n in 0..2_500 {
            let mut place = corner;
            place[axes[0]] += n % 50 * 20;
            place[axes[1]] += n / 50 * 20;
            place[3 - axes[0] - axes[1]] += (n * 7_919 % 101 - 50) * noise / 50;
            scene.0.push(surface);
            scene.1.push(place);
        }
    }

    fn around(places: &[[i32; 3]]) -> Around {
        Around {
            origin: [-70, 1_234, 9],
            places: places.to_vec(),
            id: (0..places.len()).map(PointId::at).collect(),
            zone: vec![Zone::Core; places.len()],
        }
    }

    const COSINE: f64 = 0.985;

    #[test]
    fn a_point_goes_to_the_plane_on_which_it_lies_if_a_neighbour_is_of_it() {
        let mut scene = Scene::default();
        square(&mut scene, 5, [1_000, 1_000, 1_000], [0, 1], 6);
        square(&mut scene, 2, [1_000, 1_000, 1_000], [0, 2], 6);
        let (mut surfaces, mut places) = scene;
        // Floor points with the surface of the wall, too few for a local plane of their own, and one point
        // without a surface.
        let patch: Vec<usize> = (0..2_500).filter(|n| n % 50 > 46 && n / 50 > 46).collect();
        patch.iter().for_each(|point| surfaces[*point] = 2);
        let unlabelled = 30 * 50 + 10;
        surfaces[unlabelled] = 0;
        // In the plane of the floor behind the wall, above the floor, and above both.
        places.extend([[1_500, 600, 1_000], [1_500, 1_500, 1_100], [1_500, 1_500, 1_500]]);
        surfaces.extend([0, 2, 9]);
        let around = around(&places);
        let now = Arena::new(&around, 500, 20, 200).contest(&surfaces, COSINE);
        for point in patch {
            assert_eq!((now.surfaces[point], now.on_plane[point]), (5, true), "{:?}", places[point]);
        }
        assert_eq!(now.surfaces[unlabelled], 5);
        assert_eq!((&now.surfaces[5_000..], &now.on_plane[5_000..]), (&[0, 2, 9][..], &[false; 3][..]));
        // Points away from the edge are amid, points at the edge are not.
        assert!(now.amid[25 * 50 + 25] && now.amid[2_500 + 25 * 50 + 25]);
        assert!(!now.amid[25] && !now.amid[2_525] && !now.amid[5_001]);
    }

    #[test]
    fn without_noise_a_point_of_an_edge_keeps_its_surface_or_takes_that_of_its_neighbour() {
        let mut scene = Scene::default();
        square(&mut scene, 5, [1_000, 1_000, 1_000], [0, 1], 0);
        square(&mut scene, 2, [1_000, 1_000, 1_000], [0, 2], 0);
        let (mut surfaces, mut places) = scene;
        places.extend([[1_503, 1_000, 1_000], [1_505, 1_000, 1_000]]);
        surfaces.extend([0, 2]);
        let around = around(&places);
        let now = Arena::new(&around, 500, 20, 200).contest(&surfaces, COSINE);
        assert_eq!(now.surfaces[..5_000], surfaces[..5_000]);
        // The place next to the first one has point 25 of the floor and point 2525 of the wall.
        assert_eq!(now.surfaces[5_000..], [2, 2]);
        surfaces[5_001] = 0;
        let now = Arena::new(&around, 500, 20, 200).contest(&surfaces, COSINE);
        assert_eq!(now.surfaces[5_000..], [5, 5]);
    }

    /// Points at random in a box of 0.3 m over an edge of cubes, in surfaces that lean in all directions.
    fn noise() -> (Vec<u32>, Vec<[i32; 3]>) {
        let mut numbers = Numbers::new(7);
        let mut below = |most: u64| i32::try_from(numbers.below(most)).unwrap();
        (0..6_000)
            .map(|_| {
                let [x, y, z] = [(); 3].map(|()| below(300) + 1_300);
                let along =
                    [x + y, x - y, y + z, y - z, z + x, z - x][usize::try_from(below(6)).unwrap()] / 60;
                (u32::try_from(along + 50).unwrap() % 37, [x, y, z])
            })
            .unzip()
    }

    /// As [`Arena::contest`] is meant: every point is compared with all planes of its cube.
    fn surfaces_by_all_planes(arena: &Arena<'_>, before: &[u32]) -> Vec<u32> {
        let Arena { around, cubes, neighbours, reach, .. } = arena;
        let planes = cubes.planes(&cubes.sums(before), 1, |_| true);
        let nearest = |point: usize| {
            let squared = |other: usize| squared_distance(around.places[point], around.places[other]);
            let mut near: Vec<(u64, usize)> = (0..around.len()).map(|at| (squared(at), at)).collect();
            near.sort_unstable();
            near.truncate(*neighbours);
            near.retain(|near| near.0 <= reach.unsigned_abs().pow(2));
            near
        };
        let surface = |point: usize| {
            let by = cubes.in_cube(cubes.of(point), around.places[point]);
            let of = |surface: u32| {
                let plane = planes.of(cubes.of(point)).iter().find(|plane| plane.surface == surface);
                plane.map_or(f64::INFINITY, |plane| score(plane, by))
            };
            let mut best = (of(before[point]), before[point]);
            for (_, near) in nearest(point) {
                if of(before[near]) < best.0 {
                    best = (of(before[near]), before[near]);
                }
            }
            best.1
        };
        (0..around.len()).map(surface).collect()
    }

    #[test]
    fn among_many_planes_points_ask_their_neighbours_and_find_the_same() {
        let (surfaces, places) = noise();
        let around = around(&places);
        let mut arena = Arena::new(&around, 500, 20, 200);
        let few = arena.contest(&surfaces, COSINE);
        let touching = arena.touching(&few, COSINE, 2.5);
        assert_eq!(few.surfaces, surfaces_by_all_planes(&arena, &surfaces));
        let changed = few.surfaces.iter().zip(&surfaces).filter(|(now, before)| now != before).count();
        assert!(changed > 1_000 && touching.len() > 20, "{changed} {}", touching.len());
        arena.many_planes = 0;
        let many = arena.contest(&surfaces, COSINE);
        assert_eq!((&many.surfaces, &many.on_plane), (&few.surfaces, &few.on_plane));
        assert_eq!(many.amid, few.amid);
        assert_eq!(arena.touching(&many, COSINE, 2.5), touching);
        assert_eq!(arena.touching(&many, COSINE, 0.0), arena.touching(&few, COSINE, 0.0));
    }

    #[test]
    fn halves_of_a_plane_touch_and_agree_and_steps_and_corners_do_not() {
        let mut scene = Scene::default();
        square(&mut scene, 7, [1_000, 1_000, 1_000], [0, 1], 6);
        square(&mut scene, 3, [2_000, 1_000, 1_000], [0, 1], 6);
        square(&mut scene, 4, [1_000, 2_000, 1_012], [0, 1], 6);
        square(&mut scene, 5, [1_000, 3_000, 1_112], [0, 1], 6);
        square(&mut scene, 6, [1_000, 1_000, 1_000], [1, 2], 6);
        let (surfaces, places) = scene;
        let around = around(&places);
        let arena = Arena::new(&around, 500, 20, 200);
        let now = arena.contest(&surfaces, COSINE);
        let touching = arena.touching(&now, COSINE, 2.5);
        let pairs: Vec<((u32, u32), bool)> =
            touching.iter().map(|(pair, touching)| (*pair, touching.agrees(2.5))).collect();
        // At 12 mm, which is 3.5 deviations, they touch but do not agree. At 100 mm, no point has a point of
        // the other surface as a neighbour.
        assert_eq!(pairs, [((3, 7), true), ((4, 7), false)]);
        // If only normals decide, all surfaces agree that have points of each other among their neighbours.
        let touching = arena.touching(&now, COSINE, 0.0);
        let agreeing: Vec<(u32, u32)> =
            touching.iter().filter(|found| found.1.agrees(0.0)).map(|found| found.0).collect();
        assert_eq!(agreeing, [(3, 7), (4, 7)]);
    }

    #[test]
    fn pairs_agree_that_are_near_in_the_mean() {
        let one = Touching { pairs: 3, distances: 60, deviations: 12 };
        let mut both = Touching { pairs: 1, distances: 19, deviations: 4 };
        both.merge(&one);
        assert_eq!(both, Touching { pairs: 4, distances: 79, deviations: 16 });
        // Four pairs: the mean distance of their two points is 79 / 8, the mean deviation 16 / 4.
        assert!(both.agrees(2.5) && !both.agrees(2.4) && both.agrees(0.0));
    }
}

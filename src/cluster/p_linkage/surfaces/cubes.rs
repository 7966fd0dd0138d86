//! Cubes of 0.5 m on the lattice of the drive, and the local plane of each surface in each cube: the plane
//! fitted to its points in the cube and in the 26 cubes around it.
//!
//! Sums are integers relative to the corner of the cube, so a local plane is the same in every tile, to the
//! last bit.

use std::ops::Range;

use rustc_hash::FxHashMap;

use super::border::LEAST_DEVIATION;
use super::planes::{Fit, Moments};
use crate::model::{Lattice, VoxelGrid, in_u32};

/// Edge of a cube in metres. Chosen: a local plane covers 1.5 m, over which a road or a facade hardly bends.
const EDGE_M: f64 = 0.5;
/// Largest edge in lattice units: the sums of 2^31 points then fit 64 bits.
const LARGEST_EDGE: i64 = 1 << 15;
/// Smallest number of points of a local plane. Chosen: planes of fewer points lean. A kerb of 0.12 m has this
/// many in 1.5 m from 280 points per square metre.
pub(super) const LOCAL_POINTS: u64 = 50;

/// Edge of a cube in lattice units.
pub(super) fn edge(lattice: Lattice) -> u32 {
    in_u32(lattice.units(EDGE_M).clamp(1, LARGEST_EDGE), "lattice units of a cube")
}

/// Sums over the points of a surface in a cube, relative to the corner of a cube.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    points: i64,
    sums: [i64; 3],
    products: [i64; 6],
}

impl Sums {
    /// Adds a point, or removes it if `sign` is -1.
    #[inline]
    fn add(&mut self, [x, y, z]: [i64; 3], sign: i64) {
        self.points += sign;
        let [a, b, c] = [x, y, z].map(|value| sign * value);
        self.sums = [self.sums[0] + a, self.sums[1] + b, self.sums[2] + c];
        let of_point = [a * x, a * y, a * z, b * y, b * z, c * z];
        self.products.iter_mut().zip(of_point).for_each(|(sum, product)| *sum += product);
    }

    /// Adds the sums of a cube whose corner lies `by` further.
    fn add_from(&mut self, Self { points, sums, products }: &Self, by: [i64; 3]) {
        const AXES: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
        for (at, (a, b)) in AXES.into_iter().enumerate() {
            self.products[at] += products[at] + by[a] * sums[b] + by[b] * sums[a] + points * by[a] * by[b];
        }
        for axis in 0..3 {
            self.sums[axis] += sums[axis] + points * by[axis];
        }
        self.points += points;
    }

    fn fit(&self) -> Option<Fit> {
        let (sums, products) = (self.sums.map(i128::from), self.products.map(i128::from));
        Moments { points: self.points.unsigned_abs(), sums, products }.fit()
    }
}

/// The plane of a surface in a cube and around it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LocalPlane {
    pub(super) surface: u32,
    /// Root of the mean squared distance of its points, in lattice units, at least 1.
    pub(super) deviation: f64,
    pub(super) normal: [f64; 3],
    /// Position of the plane along its normal, from the corner of the cube.
    through: f64,
    /// Mean of its points, from the corner of the cube.
    mean: [f64; 3],
}

impl LocalPlane {
    /// Distance of a place from the plane. The place is relative to the corner of the cube.
    #[inline]
    pub(super) fn distance(&self, by: [i32; 3]) -> f64 {
        self.beyond(by.map(f64::from)).abs()
    }

    /// Signed distance of a place from the plane. The sign gives the side.
    #[inline]
    fn beyond(&self, [x, y, z]: [f64; 3]) -> f64 {
        let [a, b, c] = self.normal;
        (a * x + b * y + c * z) - self.through
    }

    /// Whether a place is on the same side of `other`, another plane of the cube, as the mean of the points
    /// of this plane.
    pub(super) fn is_beside(&self, other: &Self, by: [i32; 3]) -> bool {
        (other.beyond(by.map(f64::from)) > 0.0) == (other.beyond(self.mean) > 0.0)
    }
}

/// The local planes in each cube.
#[derive(Debug)]
pub(super) struct LocalPlanes {
    /// Range in `planes` of each cube.
    ranges: Vec<Range<usize>>,
    planes: Vec<LocalPlane>,
}

impl LocalPlanes {
    /// The local planes in a cube, in ascending order of surfaces.
    #[inline]
    pub(super) fn of(&self, cube: usize) -> &[LocalPlane] {
        &self.planes[self.ranges[cube].clone()]
    }

    /// The local plane of a surface in a cube.
    #[inline]
    pub(super) fn find(&self, cube: usize, surface: u32) -> Option<&LocalPlane> {
        let of_cube = self.of(cube);
        of_cube.binary_search_by_key(&surface, |plane| plane.surface).ok().map(|at| &of_cube[at])
    }
}

/// Reference to the sums of a surface in one of the 27 cubes around a cube: the surface, the cube, its
/// offset, and the position of the sums in the list of the cube.
type Near = (u32, u32, [i8; 3], usize);

/// The sums of each surface in each cube, in ascending order of surfaces for a fast search: in noise, a cube
/// has thousands.
#[derive(Debug, Clone)]
pub(super) struct SumsOfCubes(Vec<Vec<(u32, Sums)>>);

impl SumsOfCubes {
    /// The sums of a surface in a cube.
    fn of(&mut self, cube: usize, surface: u32) -> &mut Sums {
        let of_cube = &mut self.0[cube];
        let at = of_cube.binary_search_by_key(&surface, |entry| entry.0).unwrap_or_else(|at| {
            of_cube.insert(at, (surface, Sums::default()));
            at
        });
        &mut of_cube[at].1
    }
}

/// Points in cubes.
#[derive(Debug)]
pub(super) struct Cubes {
    edge: u32,
    index: Vec<[u32; 3]>,
    by_index: FxHashMap<[u32; 3], u32>,
    /// Local coordinates of the corner of each cube.
    corner: Vec<[i32; 3]>,
    /// The cube of each point.
    of_point: Vec<u32>,
    /// Range in `members` and `places` of each cube.
    ranges: Vec<Range<usize>>,
    members: Vec<u32>,
    /// Places relative to the corner of the cube. They are stored cube by cube, because they are read so.
    places: Vec<[i32; 3]>,
}

impl Cubes {
    /// The cubes of points in local coordinates, which are relative to `origin` and not negative.
    #[expect(clippy::cast_possible_wrap, reason = "below an edge, which is at most 2^15")]
    pub(super) fn new(places: &[[i32; 3]], origin: [i64; 3], edge: u32) -> Self {
        let grid = VoxelGrid::new(origin, edge);
        let mut index: Vec<[u32; 3]> = Vec::new();
        let mut by_index: FxHashMap<[u32; 3], u32> = FxHashMap::default();
        let mut corner = Vec::new();
        let mut of_point = Vec::with_capacity(places.len());
        let mut counts: Vec<usize> = Vec::new();
        // Consecutive points are mostly in one cube.
        let mut latest = ([u32::MAX; 3], 0);
        for place in places {
            let at = [0, 1, 2].map(|axis| grid.index(axis, place[axis]));
            if at != latest.0 {
                let number = *by_index.entry(at).or_insert_with(|| {
                    index.push(at);
                    corner.push([0, 1, 2].map(|axis| {
                        place[axis] - (grid.position(axis, place[axis]) - at[axis] * edge) as i32
                    }));
                    counts.push(0);
                    in_u32(counts.len() - 1, "cubes of a tile")
                });
                latest = (at, number);
            }
            counts[latest.1 as usize] += 1;
            of_point.push(latest.1);
        }
        let mut end = 0;
        let mut ranges: Vec<Range<usize>> = Vec::with_capacity(counts.len());
        for count in counts {
            ranges.push(end..end);
            end += count;
        }
        let mut members = vec![0; places.len()];
        let mut in_cubes = vec![[0; 3]; places.len()];
        for ((point, cube), place) in (0_u32..).zip(&of_point).zip(places) {
            let corner = corner[*cube as usize];
            let range = &mut ranges[*cube as usize];
            members[range.end] = point;
            in_cubes[range.end] = [0, 1, 2].map(|axis| place[axis] - corner[axis]);
            range.end += 1;
        }
        Self { edge, index, by_index, corner, of_point, ranges, members, places: in_cubes }
    }

    /// Number of cubes.
    pub(super) fn len(&self) -> usize {
        self.index.len()
    }

    /// The cube of a point.
    #[inline]
    pub(super) fn of(&self, point: usize) -> usize {
        self.of_point[point] as usize
    }

    /// The points of a cube, ascending.
    pub(super) fn points(&self, cube: usize) -> &[u32] {
        &self.members[self.ranges[cube].clone()]
    }

    /// The points of a cube, ascending, and their places relative to its corner.
    pub(super) fn placed(&self, cube: usize) -> impl Iterator<Item = (usize, [i32; 3])> {
        let range = self.ranges[cube].clone();
        let points = self.members[range.clone()].iter().map(|point| *point as usize);
        points.zip(self.places[range].iter().copied())
    }

    /// Whether each cube can have a place that is at most `reach` units from a place in one of the given
    /// `cubes`.
    pub(super) fn within(&self, reach: i64, cubes: impl Iterator<Item = usize>) -> Vec<bool> {
        // If two cubes are n steps apart, n - 1 cubes lie between them, so their places are more than n - 1
        // edges apart.
        let steps = i32::try_from((reach - 1).max(0) / i64::from(self.edge) + 1).unwrap_or(i32::MAX);
        let mut found = vec![false; self.len()];
        for cube in cubes {
            let [x, y, z] = self.index[cube];
            for (dx, dy) in (-steps..=steps).flat_map(|dx| (-steps..=steps).map(move |dy| (dx, dy))) {
                for dz in -steps..=steps {
                    let near =
                        [x.wrapping_add_signed(dx), y.wrapping_add_signed(dy), z.wrapping_add_signed(dz)];
                    if let Some(near) = self.by_index.get(&near) {
                        found[*near as usize] = true;
                    }
                }
            }
        }
        found
    }

    /// A place in local coordinates, converted to coordinates relative to the corner of a cube.
    #[inline]
    pub(super) fn in_cube(&self, cube: usize, place: [i32; 3]) -> [i32; 3] {
        let corner = self.corner[cube];
        [0, 1, 2].map(|axis| place[axis] - corner[axis])
    }

    /// The sums of all surfaces. `surfaces` has the surface of each point, 0 for none.
    pub(super) fn sums(&self, surfaces: &[u32]) -> SumsOfCubes {
        let mut sums = SumsOfCubes(vec![Vec::new(); self.len()]);
        let mut here: Vec<u32> = Vec::new();
        for cube in 0..self.len() {
            here.clear();
            here.extend(self.points(cube).iter().map(|point| surfaces[*point as usize]));
            // Most points of a cube belong to one surface and are consecutive.
            here.dedup();
            here.sort_unstable();
            here.dedup();
            sums.0[cube] =
                here.iter().filter(|surface| **surface != 0).map(|of| (*of, Sums::default())).collect();
            let mut latest = (0, Sums::default());
            for (point, place) in self.placed(cube) {
                let surface = surfaces[point];
                if surface != latest.0 {
                    if latest.0 != 0 {
                        *sums.of(cube, latest.0) = latest.1;
                    }
                    latest = (surface, if surface == 0 { Sums::default() } else { *sums.of(cube, surface) });
                }
                latest.1.add(place.map(i64::from), 1);
            }
            if latest.0 != 0 {
                *sums.of(cube, latest.0) = latest.1;
            }
        }
        sums
    }

    /// Moves a point from one surface to another one; 0 is none.
    pub(super) fn take(&self, sums: &mut SumsOfCubes, point: usize, place: [i32; 3], from: u32, to: u32) {
        let cube = self.of(point);
        let by = self.in_cube(cube, place).map(i64::from);
        for (surface, sign) in [(from, -1), (to, 1)] {
            if surface != 0 {
                sums.of(cube, surface).add(by, sign);
            }
        }
    }

    /// The local planes in the cubes with a `wanted` point. A cube has none unless at least `fewest` surfaces
    /// have enough points for a local plane there.
    pub(super) fn planes(
        &self,
        sums: &SumsOfCubes,
        fewest: usize,
        wanted: impl Fn(usize) -> bool,
    ) -> LocalPlanes {
        let mut found = LocalPlanes { ranges: Vec::with_capacity(self.len()), planes: Vec::new() };
        let mut near: Vec<Near> = Vec::new();
        for cube in 0..self.len() {
            let start = found.planes.len();
            if self.points(cube).iter().any(|point| wanted(*point as usize)) {
                self.gather(cube, sums, &mut near);
                let points = |near: &[Near]| near.iter().map(|near| sums_of(sums, near).points).sum::<i64>();
                let enough = |near: &&[Near]| points(near).unsigned_abs() >= LOCAL_POINTS;
                let of_surfaces = || near.chunk_by(|a, b| a.0 == b.0).filter(enough);
                if fewest < 2 || of_surfaces().count() >= fewest {
                    found.planes.extend(of_surfaces().filter_map(|near| self.plane(near, sums)));
                }
            }
            found.ranges.push(start..found.planes.len());
        }
        found
    }

    /// Lists the sums in a cube and around it, by surface.
    fn gather(&self, cube: usize, sums: &SumsOfCubes, near: &mut Vec<Near>) {
        near.clear();
        for by in (0..27).map(|n| [n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1]) {
            let index = [0, 1, 2].map(|axis| self.index[cube][axis].wrapping_add_signed(i32::from(by[axis])));
            if let Some(&other) = self.by_index.get(&index) {
                let of_cube = sums.0[other as usize].iter().enumerate();
                near.extend(of_cube.map(|(at, entry)| (entry.0, other, by, at)));
            }
        }
        near.sort_unstable();
    }

    /// The local plane of one surface.
    fn plane(&self, near: &[Near], sums: &SumsOfCubes) -> Option<LocalPlane> {
        let mut all = Sums::default();
        for one in near {
            all.add_from(sums_of(sums, one), one.2.map(|step| i64::from(step) * i64::from(self.edge)));
        }
        let fit = all.fit()?;
        let deviation = fit.flatness.sqrt().max(LEAST_DEVIATION);
        let Fit { normal, mean, .. } = fit;
        Some(LocalPlane { surface: near[0].0, deviation, normal, through: fit.through(), mean })
    }
}

fn sums_of<'a>(sums: &'a SumsOfCubes, near: &Near) -> &'a Sums {
    &sums.0[near.1 as usize][near.3].1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::p_linkage::surfaces::planes::likeness;
    use crate::numbers::Numbers;

    /// Points of two surfaces and of none, in a box of 3 m around a negative corner.
    fn scene() -> (Vec<[i32; 3]>, [i64; 3], Vec<u32>) {
        let mut numbers = Numbers::new(5);
        let mut below = |most: u64| i32::try_from(numbers.below(most)).unwrap();
        let mut places = Vec::new();
        let mut surfaces = Vec::new();
        for _ in 0..900 {
            let (x, y, surface) = (below(3_000), below(3_000), u32::try_from(below(3)).unwrap());
            places.push([x, y, [below(3_000), x / 3 + below(30), y / 2 + below(50)][surface as usize]]);
            surfaces.push([0, 7, 3][surface as usize]);
        }
        (places, [-4_321, 777, -1_250], surfaces)
    }

    #[test]
    fn a_local_plane_fits_all_points_of_its_surface_in_27_cubes() {
        let (places, origin, surfaces) = scene();
        let cubes = Cubes::new(&places, origin, 500);
        let planes = cubes.planes(&cubes.sums(&surfaces), 1, |_| true);
        let cube_of = |point: usize| {
            [0, 1, 2].map(|axis| (origin[axis] + i64::from(places[point][axis])).div_euclid(500))
        };
        let mut fitted = 0;
        for (point, place) in places.iter().enumerate() {
            let cube = cubes.of(point);
            let corner = cube_of(point).map(|index| index * 500);
            let by = cubes.in_cube(cube, *place).map(i64::from);
            assert_eq!([0, 1, 2].map(|axis| corner[axis] + by[axis] - origin[axis]), place.map(i64::from));
            assert!(cubes.points(cube).iter().any(|member| *member as usize == point));
            for surface in [3, 7] {
                let mut moments = Moments::default();
                for other in (0..places.len()).filter(|other| surfaces[*other] == surface) {
                    let near = (0..3).all(|axis| cube_of(other)[axis].abs_diff(cube_of(point)[axis]) <= 1);
                    if near {
                        moments.add([0, 1, 2].map(|k| origin[k] + i64::from(places[other][k]) - corner[k]));
                    }
                }
                let found = planes.of(cube).iter().find(|plane| plane.surface == surface);
                assert_eq!(found.is_some(), moments.points >= LOCAL_POINTS);
                if let Some(plane) = found {
                    let fit = moments.fit().unwrap();
                    assert_eq!(plane.normal.map(f64::to_bits), fit.normal.map(f64::to_bits));
                    assert_eq!(plane.deviation.to_bits(), fit.flatness.sqrt().to_bits());
                    let at = by.map(|by| by as f64);
                    let apart = plane.distance(cubes.in_cube(cube, *place)) - fit.distance(at);
                    assert!(apart.abs() < 1e-9, "{apart}");
                    fitted += 1;
                }
            }
        }
        assert!(fitted > 500 && fitted < 1_800, "{fitted}");
    }

    #[test]
    fn planes_do_not_depend_on_what_coordinates_are_counted_from() {
        let (places, origin, surfaces) = scene();
        let by = [300, 41, 1_777];
        let moved: Vec<[i32; 3]> = places.iter().map(|place| [0, 1, 2].map(|k| place[k] + by[k])).collect();
        let other = [0, 1, 2].map(|k| origin[k] - i64::from(by[k]));
        let one = Cubes::new(&places, origin, 500);
        let two = Cubes::new(&moved, other, 500);
        let [of_one, of_two] = [&one, &two].map(|cubes| cubes.planes(&cubes.sums(&surfaces), 1, |_| true));
        for point in 0..places.len() {
            assert_eq!(of_one.of(one.of(point)), of_two.of(two.of(point)));
        }
        // If no point is wanted, there are no planes.
        let none = one.planes(&one.sums(&surfaces), 1, |_| false);
        assert!((0..one.len()).all(|cube| none.of(cube).is_empty()));
    }

    #[test]
    fn points_that_are_taken_to_another_surface_count_as_if_they_had_been_there() {
        let (places, origin, surfaces) = scene();
        let cubes = Cubes::new(&places, origin, 500);
        let mut sums = cubes.sums(&surfaces);
        let now: Vec<u32> = surfaces.iter().enumerate().map(|(at, was)| [*was, 0, 3, 9][at % 4]).collect();
        for (point, (from, to)) in surfaces.iter().zip(&now).enumerate() {
            cubes.take(&mut sums, point, places[point], *from, *to);
        }
        let fresh = cubes.sums(&now);
        for fewest in [1, 2, 3] {
            let [taken, fresh] = [&sums, &fresh].map(|sums| cubes.planes(sums, fewest, |_| true));
            for cube in 0..cubes.len() {
                assert_eq!(taken.of(cube), fresh.of(cube));
                assert!(fewest == 1 || taken.of(cube).is_empty() || taken.of(cube).len() >= fewest);
            }
        }
    }

    #[test]
    fn cubes_within_reach_have_all_points_within_reach() {
        let (places, origin, _) = scene();
        let cubes = Cubes::new(&places, origin, 250);
        for (point, reach) in [(0, 1), (7, 250), (30, 251), (99, 600)] {
            let near = cubes.within(reach, std::iter::once(cubes.of(point)));
            for (other, place) in places.iter().enumerate() {
                let squared: u64 =
                    (0..3).map(|axis| u64::from(place[axis].abs_diff(places[point][axis])).pow(2)).sum();
                assert!(near[cubes.of(other)] || squared > reach.unsigned_abs().pow(2), "{point} {other}");
            }
            assert!(near.iter().filter(|near| **near).count() < cubes.len());
        }
    }

    #[test]
    fn without_noise_the_deviation_is_a_lattice_unit() {
        let places: Vec<[i32; 3]> = (0..100).map(|n| [n % 10 * 20, n / 10 * 20, 50]).collect();
        let cubes = Cubes::new(&places, [0; 3], 500);
        let planes = cubes.planes(&cubes.sums(&[4; 100]), 1, |_| true);
        let [plane] = planes.of(0) else { panic!("{planes:?}") };
        assert!((likeness(plane.normal, [0.0, 0.0, 1.0]) - 1.0).abs() < 1e-12);
        assert_eq!((plane.surface, plane.deviation.to_bits()), (4, 1.0_f64.to_bits()));
        // On one line there is no plane.
        let line: Vec<[i32; 3]> = (0..100).map(|n| [n, n, n]).collect();
        let cubes = Cubes::new(&line, [0; 3], 500);
        assert!(cubes.planes(&cubes.sums(&[4; 100]), 1, |_| true).of(0).is_empty());
    }
}

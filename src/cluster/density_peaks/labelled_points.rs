//! The points of clusters around a tile, grouped by voxel. It finds the points nearest to a place, and one
//! representative of each small cell. It only searches: callers decide what to do with the results.
//!
//! Points are grouped voxel by voxel in separate arrays of coordinates. So the voxels of one column are one
//! contiguous range of memory, and a search is a few loops over ranges that the compiler vectorises.
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "points of a tile fit u32 and local coordinates i32, see TileCloud and VoxelIndex"
)]

use std::collections::BTreeMap;
use std::ops::Range;

use super::surroundings::Surroundings;
use crate::cluster::columns::{Finder, Voxel};
use crate::model::VoxelGrid;
use crate::spatial::{Cell, KNearest};

/// Edge of the cells of representatives in metres (chosen: points near the scanner are a few centimetres
/// apart, and the number of pairs between two borders grows with the square of the number of points).
pub(super) const REPRESENTATIVE_M: f64 = 0.1;

/// A neighbour: squared distance in lattice units, and index in [`LabelledPoints`].
pub(super) type Neighbour = (u64, u32);

/// The labelled points, see the module.
pub(super) struct LabelledPoints<'a> {
    around: &'a Surroundings,
    /// Edge of a voxel in lattice units.
    edge: i64,
    places: Places,
    /// Index of each point in the surroundings.
    source: Vec<u32>,
}

/// Coordinates grouped by voxel.
#[derive(Debug, Default)]
pub(super) struct Places {
    /// Local coordinates.
    axes: [Vec<i32>; 3],
    /// First index of each voxel, and the end.
    first: Vec<u32>,
}

impl Places {
    /// Range of the points of a voxel.
    pub(super) fn of(&self, voxel: usize) -> Range<usize> {
        self.first[voxel] as usize..self.first[voxel + 1] as usize
    }

    /// Range of the points of consecutive voxels.
    fn of_all(&self, voxels: Range<usize>) -> Range<usize> {
        self.first[voxels.start] as usize..self.first[voxels.end] as usize
    }

    /// Local coordinates of a point.
    pub(super) fn get(&self, place: usize) -> [i32; 3] {
        [0, 1, 2].map(|axis| self.axes[axis][place])
    }

    /// Squared distances from consecutive points to one place, in order.
    fn distances(&self, stretch: Range<usize>, to: [i32; 3]) -> impl Iterator<Item = u64> + '_ {
        let [x, y, z] = [0, 1, 2].map(|axis| &self.axes[axis][stretch.clone()]);
        // Unsigned differences, because the smallest vector units can multiply these.
        let square = move |value: i32, axis: usize| u64::from(value.abs_diff(to[axis])).pow(2);
        x.iter().zip(y).zip(z).map(move |((&x, &y), &z)| square(x, 0) + square(y, 1) + square(z, 2))
    }
}

impl<'a> LabelledPoints<'a> {
    /// The points of clusters in `around`. Its voxels have edges of `edge` lattice units.
    pub(super) fn new(around: &'a Surroundings, edge: u32) -> Self {
        let voxels = around.voxels.len();
        let labelled = |voxel: u32| around.cluster[voxel as usize] != 0;
        let mut first = vec![0_u32; voxels + 1];
        for &voxel in around.voxel.iter().filter(|&&voxel| labelled(voxel)) {
            first[voxel as usize + 1] += 1;
        }
        let mut total = 0;
        for count in &mut first {
            total += *count;
            *count = total;
        }
        let mut next = first.clone();
        let mut source = vec![0; total as usize];
        for (point, &voxel) in (0_u32..).zip(&around.voxel).filter(|(_, voxel)| labelled(**voxel)) {
            let slot = &mut next[voxel as usize];
            source[*slot as usize] = point;
            *slot += 1;
        }
        let cloud = &around.points.cloud;
        let pick = |axis: &[i32]| source.iter().map(|&point| axis[point as usize]).collect();
        let axes = [pick(&cloud.x), pick(&cloud.y), pick(&cloud.z)];
        Self { around, edge: i64::from(edge), places: Places { axes, first }, source }
    }

    /// Lattice coordinates of local (0, 0, 0).
    pub(super) fn origin(&self) -> [i64; 3] {
        self.around.points.cloud.origin
    }

    /// Lattice coordinates of a point.
    pub(super) fn lattice_point(&self, point: u32) -> [i64; 3] {
        let (by, origin) = (self.relative(point, [0; 3]), self.origin());
        [0, 1, 2].map(|axis| origin[axis] + by[axis])
    }

    /// Cluster of a point.
    pub(super) fn cluster(&self, point: u32) -> u32 {
        self.around.cluster_of(self.source[point as usize] as usize)
    }

    /// Coordinates of a point relative to a local place.
    pub(super) fn relative(&self, point: u32, to: [i32; 3]) -> [i64; 3] {
        let place = self.places.get(point as usize);
        [0, 1, 2].map(|axis| i64::from(place[axis]) - i64::from(to[axis]))
    }

    /// The first place (by x, then y, then z) of each cell of [`REPRESENTATIVE_M`] and each cluster, over the
    /// `wanted` voxels. Of several points in this place, any one is taken. If cells cross borders of voxels,
    /// `wanted` must contain all voxels of a cluster that share a cell.
    pub(super) fn representatives(&self, wanted: &[bool]) -> Representatives {
        let cloud = &self.around.points.cloud;
        let cell_edge = cloud.lattice.units(REPRESENTATIVE_M).max(1);
        let grid = VoxelGrid::new(cloud.origin, cell_edge as u32);
        let nested = self.edge % cell_edge == 0;
        // Cell and cluster, place, voxel, point, for cells that several voxels share.
        let mut shared: Vec<([u32; 4], [i32; 3], u32, u32)> = Vec::new();
        let mut of_voxel: Vec<([u32; 3], [i32; 3], u32)> = Vec::new();
        let mut result = Representatives::default();
        result.places.first.push(0);
        for (voxel, &wanted) in wanted.iter().enumerate() {
            of_voxel.clear();
            if wanted {
                of_voxel.extend(self.places.of(voxel).map(|point| {
                    let place = self.places.get(point);
                    ([0, 1, 2].map(|axis| grid.index(axis, place[axis])), place, point as u32)
                }));
                of_voxel.sort_unstable();
                of_voxel.dedup_by_key(|entry| entry.0);
            }
            if nested {
                self.choose(&mut result, of_voxel.iter().map(|entry| entry.2));
            } else {
                let cluster = self.around.cluster[voxel];
                shared.extend(
                    of_voxel
                        .iter()
                        .map(|&([i, j, k], place, point)| ([i, j, k, cluster], place, voxel as u32, point)),
                );
            }
        }
        if !nested {
            shared.sort_unstable();
            shared.dedup_by_key(|entry| entry.0);
            shared.sort_unstable_by_key(|entry| (entry.2, entry.3));
            let mut rest = &shared[..];
            for voxel in 0..wanted.len() as u32 {
                let (here, others) = rest.split_at(rest.partition_point(|entry| entry.2 <= voxel));
                self.choose(&mut result, here.iter().map(|entry| entry.3));
                rest = others;
            }
        }
        result
    }

    /// Adds the representatives of the next voxel.
    fn choose(&self, to: &mut Representatives, points: impl Iterator<Item = u32>) {
        let mut bounds = [[i32::MAX; 3], [i32::MIN; 3]];
        for point in points {
            let place = self.places.get(point as usize);
            bounds = [0, 1].map(|end| {
                [0, 1, 2].map(|axis| match end {
                    0 => bounds[end][axis].min(place[axis]),
                    _ => bounds[end][axis].max(place[axis]),
                })
            });
            for (axis, value) in to.places.axes.iter_mut().zip(place) {
                axis.push(value);
            }
            to.core.push(self.around.points.core[self.source[point as usize] as usize]);
        }
        to.places.first.push(to.core.len() as u32);
        to.bounds.push(bounds);
    }

    /// A search with a radius of `reach` lattice units.
    pub(super) fn search(&self, reach: i64) -> Search<'_> {
        Search {
            points: self,
            finder: self.around.voxels.finder(),
            farthest: (reach / self.edge + 1) as i32,
            centre: None,
            rings: Vec::new(),
            crowds: BTreeMap::new(),
            found: Vec::new(),
        }
    }

    /// The `most` nearest points to a local place at a squared distance of at most `limit`, found by
    /// comparison with all.
    pub(super) fn nearest_of_all(&self, place: [i32; 3], most: usize, limit: u64) -> Vec<Neighbour> {
        let all = self.places.distances(0..self.source.len(), place).zip(0_u32..);
        let mut found: Vec<Neighbour> = all.filter(|neighbour| neighbour.0 <= limit).collect();
        self.keep_nearest(&mut found, most);
        found
    }

    /// Keeps the `most` nearest points, with the farthest at the end. Of equally near points, the first in
    /// the order of places (by x, then y, then z) are kept.
    fn keep_nearest(&self, found: &mut Vec<Neighbour>, most: usize) {
        if found.len() > most {
            let place = |neighbour: &Neighbour| self.places.get(neighbour.1 as usize);
            found
                .select_nth_unstable_by(most - 1, |a, b| a.0.cmp(&b.0).then_with(|| place(a).cmp(&place(b))));
            found.truncate(most);
        }
    }
}

/// The representatives of the cells near borders of clusters, by voxel.
#[derive(Debug, Default)]
pub(super) struct Representatives {
    pub(super) places: Places,
    /// Whether the tile owns the point.
    pub(super) core: Vec<bool>,
    /// Smallest and largest coordinates of each voxel.
    bounds: Vec<[[i32; 3]; 2]>,
}

impl Representatives {
    /// Number of representatives of a voxel whose squared distance to a place is below `limit`.
    pub(super) fn nearer(&self, voxel: usize, place: [i32; 3], limit: u64) -> u64 {
        let stretch = self.places.of(voxel);
        let [least, most] = self.bounds[voxel];
        let gap = |axis: usize| u64::from(place[axis].clamp(least[axis], most[axis]).abs_diff(place[axis]));
        if stretch.is_empty() || gap(0).pow(2) + gap(1).pow(2) + gap(2).pow(2) >= limit {
            return 0;
        }
        self.places.distances(stretch, place).map(|distance| u64::from(distance < limit)).sum()
    }
}

/// A column of voxels around the place of a search.
struct Beside {
    step: [i32; 2],
    voxels: Range<usize>,
}

/// A search for nearest points. Remembers the columns around the last place.
pub(super) struct Search<'a> {
    points: &'a LabelledPoints<'a>,
    finder: Finder<'a>,
    farthest: i32,
    centre: Option<Cell>,
    /// Occupied columns sorted by their distance in columns, up to the largest distance needed so far.
    rings: Vec<Vec<Beside>>,
    /// Voxels of more than [`CROWD`] points in which single points were searched.
    crowds: BTreeMap<usize, Crowd>,
    found: Vec<Neighbour>,
}

/// A voxel with many points.
#[derive(Default)]
struct Crowd {
    /// Number of times that all its points were compared.
    times: u32,
    index: Option<KNearest>,
}

/// Number of surplus neighbours that are collected before the farther ones are removed.
const SLACK: usize = 44;
/// Largest number of points of a voxel that are always compared one by one. Chosen: a search in an index
/// takes about as long as this many comparisons.
const CROWD: usize = 256;
/// Number of times that all points of a voxel are compared before they are indexed. Chosen: building an index
/// takes about as long. So no index is built that is rarely needed, and the time for two dense neighbouring
/// voxels does not grow with the product of their points.
const TIMES: u32 = 64;

impl Search<'_> {
    /// The `most` nearest points to a local place at a squared distance of at most `limit`, in no particular
    /// order. Of equally near points, the first in the order of places are kept. `limit` must be within the
    /// reach of the search.
    ///
    /// It visits shells of voxels around the voxel of the place, and stops when the next shell cannot contain
    /// a point that is near enough.
    pub(super) fn nearest(&mut self, place: [i32; 3], most: usize, limit: u64) -> &[Neighbour] {
        let edge = self.points.edge;
        let origin = self.points.around.points.cloud.origin;
        let global = [0, 1, 2].map(|axis| origin[axis] + i64::from(place[axis]));
        let voxel: Voxel = global.map(|value| value.div_euclid(edge) as i32);
        let within = global.map(|value| value.rem_euclid(edge));
        // Distance from the place to the nearest face of its voxel.
        let margin = within.iter().map(|&value| (value + 1).min(edge - value)).min().unwrap_or(0);
        let cell = [voxel[0], voxel[1]];
        if self.centre != Some(cell) {
            self.centre = Some(cell);
            self.rings.clear();
        }
        self.found.clear();
        let mut worst = limit;
        for ring in 0..=self.farthest {
            if ring > 0 && ((margin + i64::from(ring - 1) * edge) as u64).pow(2) > worst {
                break;
            }
            if self.rings.len() <= ring as usize {
                let beside = self.ring(cell, ring);
                self.rings.push(beside);
            }
            for inner in 0..=ring {
                for at in 0..self.rings[inner as usize].len() {
                    worst = self.look_at([inner, ring], at, (place, voxel[2], within), most, worst);
                }
            }
        }
        self.points.keep_nearest(&mut self.found, most);
        &self.found
    }

    /// Visits the voxels that column number `at` of ring `inner` adds to the shell `ring`.
    fn look_at(
        &mut self,
        [inner, ring]: [i32; 2],
        at: usize,
        (place, k, within): ([i32; 3], i32, [i64; 3]),
        most: usize,
        mut worst: u64,
    ) -> u64 {
        let points = self.points;
        let Beside { step, voxels } = &self.rings[inner as usize][at];
        let gap = |axis: usize| match step[axis] {
            0 => 0,
            by if by > 0 => (i64::from(by) * points.edge - within[axis]) as u64,
            by => (within[axis] - i64::from(by + 1) * points.edge + 1) as u64,
        };
        if gap(0).pow(2) + gap(1).pow(2) > worst {
            return worst;
        }
        let heights = &points.around.voxels.heights()[voxels.clone()];
        let stretch = |low: i32, high: i32| {
            let start = heights.partition_point(|&height| height < low);
            let end = start + heights[start..].partition_point(|&height| height <= high);
            voxels.start + start..voxels.start + end
        };
        // A column of this ring is new, so all its voxels in the shell are visited. Columns of inner rings
        // add only the two ends of the shell.
        let stretches = if inner == ring {
            [stretch(k - ring, k + ring), 0..0]
        } else {
            [stretch(k - ring, k - ring), stretch(k + ring, k + ring)]
        };
        let before = self.found.len();
        for voxels in stretches {
            let all = points.places.of_all(voxels.clone());
            if most == 1 && all.len() > CROWD {
                for voxel in voxels {
                    worst = self.look_for_one(voxel, place, worst);
                }
            } else {
                worst = self.compare(all, place, most, worst);
            }
        }
        if self.found.len() != before && self.found.len() >= most {
            points.keep_nearest(&mut self.found, most);
            worst = self.found.iter().map(|neighbour| neighbour.0).max().map_or(worst, |far| worst.min(far));
        }
        worst
    }

    /// Compares consecutive points with a place. Returns the new limit.
    fn compare(&mut self, stretch: Range<usize>, place: [i32; 3], most: usize, mut worst: u64) -> u64 {
        let points = self.points;
        for (distance, point) in points.places.distances(stretch.clone(), place).zip(stretch) {
            if distance <= worst {
                self.found.push((distance, point as u32));
                if self.found.len() >= most + SLACK {
                    points.keep_nearest(&mut self.found, most);
                    worst = self.found.last().map_or(worst, |last| worst.min(last.0));
                }
            }
        }
        worst
    }

    /// Finds the point of a voxel that is nearest to a place, if it is within the limit. Returns the new
    /// limit.
    fn look_for_one(&mut self, voxel: usize, place: [i32; 3], worst: u64) -> u64 {
        let places = &self.points.places;
        let stretch = places.of(voxel);
        if stretch.len() > CROWD {
            let crowd = self.crowds.entry(voxel).or_default();
            if crowd.times == TIMES {
                let points = || stretch.clone().map(|point| (places.get(point), point as u32)).collect();
                let index = crowd.index.get_or_insert_with(|| KNearest::of(points(), 1));
                let found = index.nearest_to(place, worst);
                self.found.extend(found);
                return found.map_or(worst, |found| found.0);
            }
            crowd.times += 1;
        }
        self.compare(stretch, place, 1, worst)
    }

    fn ring(&mut self, [i, j]: Cell, ring: i32) -> Vec<Beside> {
        let steps = (-ring..=ring).flat_map(|di| (-ring..=ring).map(move |dj| [di, dj]));
        steps
            .filter(|step| step[0].abs().max(step[1].abs()) == ring)
            .map(|step| Beside { step, voxels: self.finder.column([i + step[0], j + step[1]]) })
            .filter(|beside| !beside.voxels.is_empty())
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::TilePoints;
    use crate::cluster::columns::{Columns, global_indices};
    use crate::model::{Lattice, TileCloud};
    use crate::numbers::Numbers;
    use crate::spatial::VoxelIndex;

    const EDGE: u32 = 300;

    /// Points in voxels of one cluster. Those with x below 0 are in halo voxels.
    fn surroundings(points: &[[i64; 3]]) -> Surroundings {
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, points);
        let index = VoxelIndex::build("test", &cloud, EDGE).unwrap();
        let indices = global_indices("test", &index, |_| true).unwrap();
        let cluster = indices.iter().map(|([i, ..], _)| u32::from(*i >= 0)).collect();
        let mut voxel = vec![0; points.len()];
        for (range, number) in index.streaks() {
            voxel[range].fill(number as u32);
        }
        let voxels = Columns::new(indices.iter().map(|entry| entry.0));
        let points = TilePoints { cloud, core: vec![true; points.len()], ground: Vec::new() };
        Surroundings { points, voxel, voxels, cluster, owned: Vec::new() }
    }

    /// Two dense voxels, one of them in halo, and some more points. Steps of 10 mm make ties everywhere, and
    /// many points are in one place.
    #[test]
    fn beside_dense_voxels_the_nearest_is_that_of_brute_force_and_few_points_are_compared() {
        let mut numbers = Numbers::new(3);
        let mut below = |most: i64| i64::try_from(numbers.next()).unwrap() % most;
        let mut points = Vec::new();
        for (count, origin, sides) in [
            (2_000, [-600, 0, 0], [30, 30, 30]),
            (3_000, [300, 0, 0], [30, 30, 30]),
            (400, [0, 910, 30], [2, 20, 20]),
            (300, [600, -900, -900], [60, 200, 200]),
        ] {
            let mut point = || [0, 1, 2].map(|axis| origin[axis] + 10 * below(sides[axis]));
            points.extend((0..count).map(|_| point()));
        }
        let around = surroundings(&points);
        let labelled = LabelledPoints::new(&around, EDGE);
        let mut search = labelled.search(1_500);
        for from in points.iter().filter(|point| point[0] < 0) {
            let local = [0, 1, 2].map(|axis| i32::try_from(from[axis] - labelled.origin()[axis]).unwrap());
            let squared = |to: &[i64; 3]| (0..3).map(|axis| from[axis].abs_diff(to[axis]).pow(2)).sum();
            let others = points.iter().filter(|point| point[0] >= 0);
            let nearest: (u64, [i64; 3]) = others.map(|to| (squared(to), *to)).min().unwrap();
            for limit in [1_500_u64.pow(2), nearest.0] {
                let found = search.nearest(local, 1, limit);
                let found: Vec<_> =
                    found.iter().map(|(squared, point)| (*squared, labelled.lattice_point(*point))).collect();
                assert_eq!(found, [nearest], "{from:?}");
            }
            assert!(search.nearest(local, 1, nearest.0 - 1).is_empty());
        }
        let dense = search.crowds.values().filter(|crowd| crowd.index.is_some()).count();
        assert!(dense >= 2 && search.crowds.values().all(|crowd| crowd.times <= TIMES), "{dense}");
    }
}

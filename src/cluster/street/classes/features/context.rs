//! Features of the classes around a voxel. From these, a second classifier corrects the first: a patch of
//! leaves in the middle of a facade is a part of the facade.
//!
//! This is the auto-context of Tu and Bai, "Auto-context and its application to high-level vision tasks and
//! 3D brain image segmentation", IEEE TPAMI 32(10), 1744-1757 (2010), doi:10.1109/TPAMI.2009.186, with means
//! over cubes instead of single positions around a voxel.
//!
//! A feature is the mean probability of a class over the occupied voxels of a window of whole cubes on the
//! global lattice. Sums are integers, so a feature depends only on the voxels within [`REACH_EDGES`].
#![expect(clippy::cast_possible_truncation, reason = "voxels of a tile fit u32 (VoxelIndex)")]

use super::cells::Cells;
use super::{ROWS, Sink};
use crate::cluster::columns::Finder;
use crate::cluster::street::classes::classified::Shares;
use crate::cluster::street::settings::CLASSES;
use crate::cluster::street::voxels::stored::Voxels;

/// Edges of the cubes in voxels: 0.45, 0.9 and 1.8 m.
const FINE: i32 = 3;
const MIDDLE: i32 = 6;
const WIDE: i32 = 12;
/// Radius of the slab in cubes of 0.9 m: 6.3 m wide and one cube high.
const SLAB: i32 = 3;

/// Distance within which other voxels change a feature, in edges of a voxel: the corner of a window of three
/// wide cubes with the voxel in the middle one.
pub(in crate::cluster::street) const REACH_EDGES: i64 = 36;
const _: () = assert!(2 * (2 * WIDE as i64).pow(2) <= REACH_EDGES.pow(2) && (SLAB + 1) * MIDDLE <= 2 * WIDE);

/// Names of the features, in their order: the voxel's own probabilities and height, then the means over
/// windows of 1.35, 2.7 and 5.4 m, over the slab, and over the columns above and below.
pub(crate) const NAMES: [&str; 57] = [
    "own none",
    "own tree",
    "own pole",
    "own vehicle",
    "own building",
    "own fence",
    "own small",
    "own wire",
    "H",
    "1.3m none",
    "1.3m tree",
    "1.3m pole",
    "1.3m vehicle",
    "1.3m building",
    "1.3m fence",
    "1.3m small",
    "1.3m wire",
    "2.7m none",
    "2.7m tree",
    "2.7m pole",
    "2.7m vehicle",
    "2.7m building",
    "2.7m fence",
    "2.7m small",
    "2.7m wire",
    "5.4m none",
    "5.4m tree",
    "5.4m pole",
    "5.4m vehicle",
    "5.4m building",
    "5.4m fence",
    "5.4m small",
    "5.4m wire",
    "slab none",
    "slab tree",
    "slab pole",
    "slab vehicle",
    "slab building",
    "slab fence",
    "slab small",
    "slab wire",
    "above none",
    "above tree",
    "above pole",
    "above vehicle",
    "above building",
    "above fence",
    "above small",
    "above wire",
    "below none",
    "below tree",
    "below pole",
    "below vehicle",
    "below building",
    "below fence",
    "below small",
    "below wire",
];

/// Sums of the probabilities over voxels, and the number of these voxels.
#[derive(Debug, Default, Clone, Copy)]
struct Sum {
    shares: [u32; CLASSES],
    voxels: u32,
}

impl Sum {
    fn add(&mut self, other: &Self) {
        self.shares.iter_mut().zip(&other.shares).for_each(|(sum, share)| *sum += share);
        self.voxels += other.voxels;
    }

    fn without(&self, part: &Self) -> Self {
        Self {
            shares: std::array::from_fn(|class| self.shares[class] - part.shares[class]),
            voxels: self.voxels - part.voxels,
        }
    }

    /// The means; 0 if there are no voxels.
    fn means(&self) -> [f32; CLASSES] {
        self.shares.map(|sum| sum as f32 / self.voxels.max(1) as f32)
    }
}

/// Cubes with the sums over their voxels.
struct Cubes {
    cells: Cells,
    sums: Vec<Sum>,
    /// Whether a wanted voxel is in the cube.
    wanted: Vec<bool>,
}

impl Cubes {
    fn new(voxels: &Voxels, shares: &[Shares], wanted: &[bool], edge: i32) -> Self {
        let cells = Cells::of(voxels, edge);
        let mut sums = vec![Sum::default(); cells.len()];
        let mut inside = vec![false; cells.len()];
        for ((&cube, shares), &wanted) in cells.of_voxel.iter().zip(shares).zip(wanted) {
            sums[cube as usize].add(&Sum { shares: shares.map(u32::from), voxels: 1 });
            inside[cube as usize] |= wanted;
        }
        Self { cells, sums, wanted: inside }
    }

    /// A value for each wanted cube from its position and the columns around it. Other cubes have the
    /// default.
    fn each<T: Default + Clone>(&self, mut value: impl FnMut(&mut Finder<'_>, [i32; 3]) -> T) -> Vec<T> {
        let columns = &self.cells.columns;
        let mut finder = columns.finder();
        let mut values = vec![T::default(); self.cells.len()];
        for (column, &[i, j]) in columns.cells().iter().enumerate() {
            for cube in columns.voxels(column).filter(|&cube| self.wanted[cube]) {
                values[cube] = value(&mut finder, [i, j, columns.heights()[cube]]);
            }
        }
        values
    }

    /// The means over the window of all cubes at most `radius` away in the plane and `levels` in height.
    fn windows(&self, radius: i32, levels: i32) -> Vec<[f32; CLASSES]> {
        let heights = self.cells.columns.heights();
        self.each(|finder, [i, j, k]| {
            let mut sum = Sum::default();
            for (di, dj) in square(radius) {
                let column = finder.column([i + di, j + dj]);
                let low =
                    column.start + heights[column.clone()].partition_point(|&height| height < k - levels);
                for cube in (low..column.end).take_while(|&cube| heights[cube] <= k + levels) {
                    sum.add(&self.sums[cube]);
                }
            }
            sum.means()
        })
    }

    /// The means over the cubes above and below, in the columns at most one cube away.
    fn above_and_below(&self) -> Vec<[[f32; CLASSES]; 2]> {
        let columns = &self.cells.columns;
        // The sum over each cube and those below it in its column.
        let mut up_to = self.sums.clone();
        for column in 0..columns.cells().len() {
            for cube in columns.voxels(column).skip(1) {
                let below = up_to[cube - 1];
                up_to[cube].add(&below);
            }
        }
        let heights = columns.heights();
        self.each(|finder, [i, j, k]| {
            let (mut above, mut below) = (Sum::default(), Sum::default());
            for (di, dj) in square(1) {
                let column = finder.column([i + di, j + dj]);
                let Some(last) = column.clone().last() else { continue };
                let low = heights[column.clone()].partition_point(|&height| height < k);
                let high = heights[column.clone()].partition_point(|&height| height <= k);
                let before = |count: usize| match count {
                    0 => Sum::default(),
                    _ => up_to[column.start + count - 1],
                };
                below.add(&before(low));
                above.add(&up_to[last].without(&before(high)));
            }
            [above.means(), below.means()]
        })
    }

    fn of(&self, voxel: usize) -> usize {
        self.cells.of_voxel[voxel] as usize
    }
}

fn square(radius: i32) -> impl Iterator<Item = (i32, i32)> {
    (-radius..=radius).flat_map(move |di| (-radius..=radius).map(move |dj| (di, dj)))
}

/// Computes the features of the wanted voxels and gives them to `sink` in batches, each voxel once, in
/// ascending order. `heights` (in lattice units) and `shares` cover all voxels.
pub(in crate::cluster::street) fn compute(
    voxels: &Voxels,
    heights: &[i32],
    shares: &[Shares],
    wanted: &[bool],
    sink: Sink<'_>,
) {
    let fine = Cubes::new(voxels, shares, wanted, FINE);
    let middle = Cubes::new(voxels, shares, wanted, MIDDLE);
    let wide = Cubes::new(voxels, shares, wanted, WIDE);
    let near = [fine.windows(1, 1), middle.windows(1, 1), wide.windows(1, 1), middle.windows(SLAB, 0)];
    let column = fine.above_and_below();
    let step_m = voxels.lattice.step_m() as f32;
    let numbers: Vec<u32> =
        (0_u32..).zip(wanted).filter(|(_, wanted)| **wanted).map(|(voxel, _)| voxel).collect();
    let mut rows: Vec<f32> = Vec::with_capacity(ROWS.min(numbers.len()) * NAMES.len());
    for some in numbers.chunks(ROWS) {
        rows.clear();
        for voxel in some.iter().map(|&voxel| voxel as usize) {
            rows.extend(shares[voxel].map(f32::from));
            rows.push(heights[voxel] as f32 * step_m);
            for (means, cubes) in near.iter().zip([&fine, &middle, &wide, &middle]) {
                rows.extend(means[cubes.of(voxel)]);
            }
            column[fine.of(voxel)].iter().for_each(|means| rows.extend(means));
        }
        sink(some, &rows);
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::model::Lattice;

    #[test]
    fn features_are_those_of_brute_force_and_of_what_lies_within_reach() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let points: Vec<[i64; 3]> = (0..4_000)
            .map(|_| {
                [
                    rng.random_range(-9_000..9_000),
                    rng.random_range(-7_000..7_000),
                    rng.random_range(-500..9_000),
                ]
            })
            .collect();
        let share = |key: [i32; 3]| -> Shares {
            let class = (key[0] + 3 * key[1] + 7 * key[2]).rem_euclid(8) as usize;
            std::array::from_fn(|other| if other == class { 200 } else { (class + other) as u8 })
        };
        let rows = |points: &[[i64; 3]], wanted: &dyn Fn([i32; 3]) -> bool| {
            let voxels = Voxels::of_points(Lattice::MILLIMETRE, points);
            let shares: Vec<Shares> = voxels.key.iter().map(|&key| share(key)).collect();
            let heights: Vec<i32> = voxels.key.iter().map(|key| key[2] * 150).collect();
            let wanted: Vec<bool> = voxels.key.iter().map(|&key| wanted(key)).collect();
            let mut all = Vec::new();
            compute(&voxels, &heights, &shares, &wanted, &mut |numbers, rows| {
                for (&number, row) in numbers.iter().zip(rows.chunks_exact(NAMES.len())) {
                    all.push((voxels.key[number as usize], row.to_vec()));
                }
            });
            (voxels, all)
        };
        let inside = |key: [i32; 3]| key[0].abs() < 8 && key[1].abs() < 8;
        let (voxels, all) = rows(&points, &inside);
        assert!(all.len() > 30, "{}", all.len());
        for (key, row) in all.iter().step_by(7) {
            let cube = |key: [i32; 3], edge: i32| key.map(|index| index.div_euclid(edge));
            let mean = |near: &dyn Fn([i32; 3]) -> bool, class: usize| {
                let (mut sum, mut count) = (0_u32, 0_u32);
                for other in voxels.key.iter().filter(|other| near(**other)) {
                    sum += u32::from(share(*other)[class]);
                    count += 1;
                }
                if count == 0 { 0.0 } else { sum as f32 / count as f32 }
            };
            let apart = |other: [i32; 3], edge: i32| {
                let (a, b) = (cube(*key, edge), cube(other, edge));
                [(a[0] - b[0]).abs().max((a[1] - b[1]).abs()), b[2] - a[2]]
            };
            let boxed = |edge: i32, radius: i32, levels: i32| {
                move |other: [i32; 3]| {
                    let [plane, up] = apart(other, edge);
                    plane <= radius && up.abs() <= levels
                }
            };
            let windows: [&dyn Fn([i32; 3]) -> bool; 6] = [
                &boxed(3, 1, 1),
                &boxed(6, 1, 1),
                &boxed(12, 1, 1),
                &boxed(6, 3, 0),
                &|other| apart(other, 3)[0] <= 1 && apart(other, 3)[1] > 0,
                &|other| apart(other, 3)[0] <= 1 && apart(other, 3)[1] < 0,
            ];
            assert_eq!(row[..CLASSES], share(*key).map(f32::from));
            assert!((row[CLASSES] - key[2] as f32 * 0.15).abs() < 1e-4);
            for (number, window) in windows.into_iter().enumerate() {
                for class in 0..CLASSES {
                    let found = row[CLASSES + 1 + number * CLASSES + class];
                    assert_eq!(found.to_bits(), mean(window, class).to_bits(), "window {number} of {key:?}");
                }
            }
        }
        // Whole columns within reach of a wanted one.
        let gap = |a: i32| i64::from((a.abs() - 8).max(0));
        let near = |point: &&[i64; 3]| {
            let [i, j, _] = point.map(|value| value.div_euclid(150) as i32);
            gap(i).pow(2) + gap(j).pow(2) <= REACH_EDGES.pow(2)
        };
        let part: Vec<[i64; 3]> = points.iter().filter(near).copied().collect();
        assert!(part.len() < points.len(), "something is left out");
        assert!(rows(&part, &inside).1 == all);
    }
}

//! The tree filter: the class of a part of an object from its height, the width of its crown in both
//! directions, the filled share of its plan, and the widths of its layers. It does not know the ground:
//! heights are above the lowest voxel of the part.
//!
//! The paper uses "prior knowledge (e.g. crown size)" and gives no numbers. All numbers here were chosen on
//! three labelled scenes and tested on two others, see `benches/results/normalized-cut.md`. The plan of a
//! crown is about as deep as wide, and filled. The plan of a facade is a line or a few lines.

use std::collections::BTreeMap;

use super::cut::Parts;
use super::pieces::Voxels;
use crate::cluster::columns::{Columns, Voxel};
use crate::model::{Lattice, in_u32};
use crate::spatial::DisjointSets;

/// Classes, as in `config/classes.toml`.
const TREE: u8 = 2;
const POLE: u8 = 3;
const CAR: u8 = 4;
const FACADE: u8 = 5;
const OTHER: u8 = 9;
/// All of them.
pub(super) const CLASSES: [u8; 5] = [TREE, POLE, CAR, FACADE, OTHER];

/// Measures of a part on voxels of one edge.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Shape {
    height_m: f64,
    /// Longer side of the box in the plane.
    length_m: f64,
    /// Standard deviation of the columns along the longer and the shorter axis in the plane.
    long_m: f64,
    short_m: f64,
    /// Share of the layers that a column occupies, mean over the columns.
    fill: f64,
    /// Area of the columns divided by the product of both deviations: 4 pi for a disc, 12 for a square, less
    /// for lines.
    solid: f64,
    /// Median of the widths of the layers (longer side of the box of a layer). `most_m` is their third
    /// quartile.
    half_m: f64,
    most_m: f64,
}

impl Shape {
    /// The measures of some voxels with edges of `edge_m`. There is at least one voxel.
    fn of(keys: &[Voxel], edge_m: f64) -> Self {
        let low = |axis: usize| keys.iter().map(|key| key[axis]).min().unwrap_or(0);
        let base = [0, 1, 2].map(low);
        let at = |key: &Voxel| [0, 1, 2].map(|axis| key[axis].abs_diff(base[axis]));
        let mut columns: BTreeMap<[u32; 2], u32> = BTreeMap::new();
        // Smallest and largest i and j of each layer.
        let mut layers: BTreeMap<u32, [u32; 4]> = BTreeMap::new();
        for [i, j, k] in keys.iter().map(at) {
            *columns.entry([i, j]).or_default() += 1;
            let layer = layers.entry(k).or_insert([i, i, j, j]);
            *layer = [layer[0].min(i), layer[1].max(i), layer[2].min(j), layer[3].max(j)];
        }
        let count = layers.keys().next_back().map_or(1, |top| top + 1);
        let mut widths: Vec<u32> =
            layers.values().map(|[i, i_end, j, j_end]| (i_end - i).max(j_end - j) + 1).collect();
        widths.resize(count as usize, 0);
        widths.sort_unstable();
        let width = |quarters: usize| f64::from(widths[(widths.len() - 1) * quarters / 4]) * edge_m;
        let side = |axis: usize| columns.keys().map(|cell| cell[axis]).max().map_or(1, |end| end + 1);
        let [long_m, short_m] = deviations(columns.keys()).map(|value| value * edge_m);
        let share = |column: &u32| f64::from(*column) / f64::from(count);
        let of_columns = columns.len() as f64;
        Self {
            height_m: f64::from(count) * edge_m,
            length_m: f64::from(side(0).max(side(1))) * edge_m,
            long_m,
            short_m,
            fill: columns.values().map(share).sum::<f64>() / of_columns,
            solid: of_columns * edge_m * edge_m / (long_m * short_m).max(f64::MIN_POSITIVE),
            half_m: width(2),
            most_m: width(3),
        }
    }

    /// Whether the part is about as deep as wide, and fills its plan. Measured on voxels of 0.6 m.
    fn is_crown(&self) -> bool {
        self.short_m >= 0.15 && self.short_m >= 0.4 * self.long_m && self.solid >= 8.0
    }

    /// Whether most layers are narrow, and the part is upright, with at most one arm. Measured on voxels of
    /// 0.3 m.
    fn is_pole(&self) -> bool {
        self.height_m >= 1.8 && self.half_m <= 0.65 && self.most_m <= 1.3 && self.short_m <= 0.3
    }

    /// Whether the part has the size of a car. Measured on voxels of 0.3 m.
    fn is_car(&self) -> bool {
        (1.0..=2.5).contains(&self.height_m)
            && (3.0..=6.5).contains(&self.length_m)
            && (0.35..=0.9).contains(&self.short_m)
            && self.fill > 0.25
    }
}

/// Standard deviations of cells along their longer and shorter axis, in cells.
fn deviations<'a>(cells: impl Iterator<Item = &'a [u32; 2]>) -> [f64; 2] {
    let mut sums = [0_u64; 5];
    let mut count = 0_u64;
    for &[i, j] in cells {
        let [i, j] = [i, j].map(u64::from);
        for (sum, term) in sums.iter_mut().zip([i, j, i * i, j * j, i * j]) {
            *sum += term;
        }
        count += 1;
    }
    let count = count.max(1) as f64;
    let [i, j, ii, jj, ij] = sums.map(|sum| sum as f64 / count);
    let [ii, jj, ij] = [ii - i * i, jj - j * j, ij - i * j];
    let [middle, half] = [(ii + jj) / 2.0, (ii - jj) / 2.0];
    let root = (half * half + ij * ij).sqrt();
    [middle + root, middle - root].map(|value| value.max(0.0).sqrt())
}

/// The class of each part.
pub(super) fn classes(voxels: &Voxels, parts: &Parts, lattice: Lattice, finest: i64, tall_m: f64) -> Vec<u8> {
    let mut of_part: Vec<Vec<Voxel>> = vec![Vec::new(); parts.count as usize];
    for (key, part) in voxels.key.iter().zip(&parts.of) {
        of_part[*part as usize].push(*key);
    }
    let edge_m = lattice.metres(voxels.edge);
    of_part
        .into_iter()
        .map(|mut keys| {
            let fine = Shape::of(&keys, edge_m);
            // The filled share of a plan depends on the size of the voxels, so crowns are measured on twice
            // the edge of the setting.
            let coarse = if voxels.edge < 2 * finest {
                keys.iter_mut().for_each(|key| *key = key.map(|index| index >> 1));
                keys.sort_unstable();
                keys.dedup();
                Shape::of(&keys, 2.0 * edge_m)
            } else {
                fine
            };
            class(&fine, &coarse, tall_m)
        })
        .collect()
}

fn class(fine: &Shape, coarse: &Shape, tall_m: f64) -> u8 {
    let tall = fine.height_m > tall_m;
    if tall && coarse.is_crown() {
        TREE
    } else if fine.is_pole() {
        POLE
    } else if tall && fine.length_m >= 1.8 {
        FACADE
    } else if fine.is_car() {
        CAR
    } else {
        OTHER
    }
}

/// Joins facades that touch, because the cut is meant for trees, and a facade is one object.
pub(super) fn join_facades(voxels: &Voxels, parts: Parts, classes: Vec<u8>) -> (Parts, Vec<u8>) {
    if classes.iter().filter(|class| **class == FACADE).count() < 2 {
        return (parts, classes);
    }
    let mut sets = DisjointSets::new(parts.count);
    Columns::new(voxels.key.iter().copied()).touching(|a, b| {
        let [a, b] = [a, b].map(|voxel| parts.of[voxel]);
        if a != b && [a, b].iter().all(|part| classes[*part as usize] == FACADE) {
            sets.union(a, b);
        }
    });
    // The name of a set is its first part, so the order of parts stays.
    let mut number = vec![u32::MAX; classes.len()];
    let mut kept = Vec::new();
    for part in 0..parts.count {
        let name = sets.find(part);
        if name == part {
            number[part as usize] = in_u32(kept.len(), "parts of an object");
            kept.push(classes[part as usize]);
        } else {
            number[part as usize] = number[name as usize];
        }
    }
    let of = parts.of.iter().map(|&part| number[part as usize]).collect();
    (Parts { of, count: in_u32(kept.len(), "parts of an object"), ..parts }, kept)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::Numbers;

    /// The class of points in millimetres as one part.
    fn class_of(points: &[[i64; 3]], edge: i64) -> u8 {
        let voxels = voxels_of(points, edge);
        let parts = Parts { of: vec![0; voxels.len()], count: 1, ..Parts::default() };
        classes(&voxels, &parts, Lattice::MILLIMETRE, 300, 2.5)[0]
    }

    fn voxels_of(points: &[[i64; 3]], edge: i64) -> Voxels {
        let mut key: Vec<Voxel> = points
            .iter()
            .map(|point| point.map(|value| i32::try_from(value.div_euclid(edge)).unwrap()))
            .collect();
        key.sort_unstable();
        key.dedup();
        let count = key.len();
        Voxels { doublings: 0, edge, key, points: vec![1; count], sums: vec![[0; 3]; count] }
    }

    /// A number that looks random, from 0 to `end`.
    fn noise(numbers: &mut Numbers, end: i64) -> i64 {
        i64::try_from(numbers.below(end.unsigned_abs())).unwrap()
    }

    fn tree() -> Vec<[i64; 3]> {
        let mut numbers = Numbers::new(1);
        let mut points: Vec<[i64; 3]> = (0..2_500).step_by(100).map(|z| [0, 0, z]).collect();
        while points.len() < 900 {
            let by = [(); 3].map(|()| noise(&mut numbers, 4_000) - 2_000);
            if by.iter().map(|value| value * value).sum::<i64>() < 4_000_000 {
                points.push([by[0], by[1], by[2] + 4_200]);
            }
        }
        points
    }

    fn wall(length: i64) -> Vec<[i64; 3]> {
        (0..length / 100).flat_map(|x| (0..60).map(move |z| [x * 100, x * 40, z * 100])).collect()
    }

    #[test]
    fn trees_poles_cars_and_facades_are_told_apart() {
        let pole: Vec<[i64; 3]> = (0..70).map(|z| [0, 0, z * 100]).collect();
        let mut lamp = pole.clone();
        lamp.extend((0..20).map(|x| [x * 100, 0, 7_000]));
        let car: Vec<[i64; 3]> = (0..45)
            .flat_map(|x| (0..18).map(move |y| [x * 100, y * 100, if x % 45 < 10 { 700 } else { 1_300 }]))
            .chain((0..45).flat_map(|x| (0..13).map(move |z| [x * 100, 0, z * 100])))
            .collect();
        let bush: Vec<[i64; 3]> = tree().iter().map(|point| point.map(|value| value / 4)).collect();
        for (name, points, expected) in [
            ("tree", tree(), TREE),
            ("pole", pole, POLE),
            ("lamp", lamp, POLE),
            ("car", car, CAR),
            ("facade", wall(9_000), FACADE),
            ("bush", bush, OTHER),
        ] {
            assert_eq!(class_of(&points, 300), expected, "{name}");
        }
        assert_eq!(class_of(&tree(), 600), TREE, "an object that was cut on coarser voxels");
    }

    #[test]
    fn measures_of_a_box() {
        let keys: Vec<Voxel> =
            (0..4).flat_map(|i| (0..2).flat_map(move |j| (0..10).map(move |k| [i, j, k]))).collect();
        let shape = Shape::of(&keys, 0.5);
        assert_eq!((shape.height_m, shape.length_m, shape.half_m, shape.most_m), (5.0, 2.0, 2.0, 2.0));
        assert!((shape.long_m - 1.25_f64.sqrt() * 0.5).abs() < 1e-12);
        assert!((shape.short_m - 0.25).abs() < 1e-12);
        assert!((shape.solid - 2.0 / (1.25_f64.sqrt() * 0.5 * 0.25)).abs() < 1e-9, "{shape:?}");
        assert!((shape.fill - 1.0).abs() < 1e-12);
    }

    #[test]
    fn facades_that_touch_are_one_and_all_else_remains() {
        let voxels = voxels_of(&wall(9_000), 300);
        let third = |key: &Voxel| u32::try_from(key[0] / 10).unwrap();
        let parts =
            || Parts { of: voxels.key.iter().map(third).collect(), count: 3, unsettled: 2, doublings: 1 };
        let (joined, classes) = join_facades(&voxels, parts(), vec![FACADE; 3]);
        assert_eq!((joined.count, joined.unsettled, classes), (1, 2, vec![FACADE]));
        assert!(joined.of.iter().all(|part| *part == 0));
        // The part in the middle is a tree, so the two facades do not touch.
        let (joined, classes) = join_facades(&voxels, parts(), vec![FACADE, TREE, FACADE]);
        assert_eq!((&joined.of, classes), (&parts().of, vec![FACADE, TREE, FACADE]));
        let (joined, classes) = join_facades(&voxels, parts(), vec![OTHER, FACADE, FACADE]);
        assert_eq!((joined.count, classes), (2, vec![OTHER, FACADE]));
        assert_eq!(joined.of, parts().of.iter().map(|part| (*part).min(1)).collect::<Vec<_>>());
    }
}

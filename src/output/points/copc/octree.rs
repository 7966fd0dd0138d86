//! The octree of a cloud-optimised point cloud: which point belongs to which node, independently of the order
//! and the division of the points.
//!
//! A node has a grid of 128 cells a side. Of all points of the drive in a cell, the one with the smallest
//! rank (a hash of its number) is shown by the node, unless a coarser node shows it already: the level of a
//! point is the first one where no point in its cell has a smaller rank. That needs no order. Below a square
//! of the plane with few points, the tree ends, and its node takes what is left. Down to the cells of the
//! raster, the squares count the points of the raster ([`super::squares`]); below, they count the points
//! themselves. Both counts are of the whole drive, so the tree is a function of the points alone, and the
//! columns in which it is built can be chosen by memory.
//!
//! The place of a point is that of its written coordinates, because a reader looks for them in its node.

use crate::model::{GOLDEN_GAMMA, PointId, splitmix64};

/// Number of binary digits of a place along an axis.
const DIGITS: u32 = 32;
/// Binary logarithm of the number of cells of a node along an axis: 128 cells, as is usual for such files.
const GRID_DIGITS: u32 = 7;
/// Deepest level: the place of a point has no digits for the grid of a deeper level.
const DEEPEST: u32 = DIGITS - GRID_DIGITS;
/// Largest number of points in a column that is not divided further. Chosen: chunks of the usual size (LASzip
/// has 50,000).
pub(crate) const LEAF_POINTS: usize = 50_000;

/// Level and position of a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
pub(crate) struct NodeKey {
    /// 0 is the root.
    pub(crate) level: u32,
    /// Position along the axes, 0 to 2^level - 1.
    pub(crate) at: [u32; 3],
}

impl NodeKey {
    /// The node that contains this one.
    pub(crate) fn parent(self) -> Option<Self> {
        let level = self.level.checked_sub(1)?;
        Some(Self { level, at: self.at.map(|at| at >> 1) })
    }
}

/// Binary digits of a place below a lattice unit. The corners of nodes are whole numbers of these parts for
/// 13 levels below cells of 1,000 units, which no node of a drive is below. So a place is in the node that
/// its parts are in.
pub(crate) const PART_DIGITS: u32 = 10;

/// A cube around all points, in lattice units.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Cube {
    /// Its corner with the smallest coordinates.
    pub(crate) origin: [i64; 3],
    /// Its edge.
    pub(crate) side: i64,
}

impl Cube {
    /// The cube around an extent whose columns are whole cells of a raster with this edge.
    pub(crate) fn around([low, high]: [[i64; 3]; 2], edge: i64) -> Self {
        let origin = low.map(|value| value.div_euclid(edge) * edge);
        let longest = (0..3).map(|axis| high[axis] - origin[axis]).max().unwrap_or(0);
        let mut side = edge;
        while side <= longest {
            side *= 2;
        }
        Self { origin, side }
    }

    /// The place in the cube of a point, whose coordinates are in parts of a lattice unit.
    pub(crate) fn place(&self, parts: [i64; 3]) -> Spot {
        let digits = |axis: usize| {
            let along = i128::from(parts[axis]) - (i128::from(self.origin[axis]) << PART_DIGITS);
            let place = (along << (DIGITS - PART_DIGITS)).div_euclid(i128::from(self.side));
            // The cube is around all points (`CopcFormat::extent_in_tree`).
            debug_assert!(u32::try_from(place).is_ok(), "{parts:?} outside {self:?}");
            u32::try_from(place.max(0)).unwrap_or(u32::MAX)
        };
        Spot::of([digits(0), digits(1), digits(2)])
    }

    /// Largest level at which columns are whole cells of the raster.
    pub(crate) fn raster_level(&self, edge: i64) -> u32 {
        (self.side / edge).ilog2().min(DEEPEST)
    }
}

/// A place in the cube: the digits of its coordinates, interleaved, so that all places in a cell of any level
/// have a common prefix.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Spot(u128);

impl Spot {
    fn of(at: [u32; 3]) -> Self {
        let [x, y, z] = at.map(spread);
        Self(x << 2 | y << 1 | z)
    }

    /// The position along the axes.
    fn at(self) -> [u32; 3] {
        [2, 1, 0].map(|place| gathered(self.0 >> place))
    }

    /// The node of a level.
    pub(crate) fn node(self, level: u32) -> NodeKey {
        NodeKey { level, at: self.at().map(|at| at.checked_shr(DIGITS - level).unwrap_or(0)) }
    }

    /// The cell of the grid of a node of a level.
    pub(crate) fn cell(self, level: u32) -> u128 {
        self.0 >> (3 * (DEEPEST - level))
    }

    /// The first level on whose grid the two places are in different cells; above [`DEEPEST`] if there is
    /// none.
    fn level_apart(self, other: Self) -> u32 {
        let bits = (self.0 ^ other.0).leading_zeros() - (u128::BITS - 3 * DIGITS);
        (bits / 3 + 1).saturating_sub(GRID_DIGITS).min(DEEPEST + 1)
    }
}

/// Steps that move the digits of a 16-bit number apart, to every third bit: the shift, and the mask of the
/// bits that stay.
const APART: [(u32, u64); 4] =
    [(16, 0xff00_00ff), (8, 0x00f0_0f00_f00f), (4, 0x0c30_c30c_30c3), (2, 0x2492_4924_9249)];
/// Number of bits that 16 digits take after these steps.
const HALF: u32 = 48;

/// The number with its digits at every third bit.
fn spread(value: u32) -> u128 {
    let half = |value: u32| {
        let bits = u64::from(value & 0xffff);
        u128::from(APART.iter().fold(bits, |bits, (by, stay)| (bits | bits << by) & stay))
    };
    half(value >> 16) << HALF | half(value)
}

/// The number whose digits are every third bit: the steps of [`spread`] backward.
fn gathered(bits: u128) -> u32 {
    let half = |bits: u128| {
        #[expect(clippy::cast_possible_truncation, reason = "the lower bits are wanted")]
        let mut bits = bits as u64 & APART[3].1;
        for step in (0..APART.len()).rev() {
            let stay = if step == 0 { 0xffff } else { APART[step - 1].1 };
            bits = (bits | bits >> APART[step].0) & stay;
        }
        u32::try_from(bits).unwrap_or(0)
    };
    half(bits >> HALF) << 16 | half(bits)
}

/// The order in which points are shown: a hash of their number, so that shown points are spread evenly. Not
/// of their place: points at one place would have one rank. The file depends on the order of records anyway,
/// because the ids of objects do.
pub(crate) fn rank(id: PointId) -> u64 {
    splitmix64(id.number().wrapping_add(GOLDEN_GAMMA))
}

/// Number of levels at which a cell of the grid is larger than a column of this level, so that one column
/// alone cannot decide.
pub(crate) fn undecided_levels(column_level: u32) -> u32 {
    column_level.saturating_sub(GRID_DIGITS)
}

/// The level of each point of a column of level `column`. `leaves` are the levels at which the tree ends, by
/// point. `wins` says whether a point has the smallest rank of all points in its cell of a level that
/// [`undecided_levels`] counts.
pub(crate) fn levels(
    column: u32,
    points: &[(Spot, u64)],
    leaves: &[u32],
    wins: impl Fn(usize, u32) -> bool,
) -> Vec<u32> {
    let undecided = undecided_levels(column);
    let mut order: Vec<u32> = (0_u32..).take(points.len()).collect();
    order.sort_unstable_by_key(|&point| points[point as usize]);
    let mut level = vec![undecided; points.len()];
    // For each point, finds the nearest point before it with a smaller rank, and the nearest after it. If a
    // cell of the point contains any point with a smaller rank, it contains one of these two.
    for backward in [false, true] {
        let mut open: Vec<u32> = Vec::new();
        for step in 0..order.len() {
            let point = order[if backward { order.len() - 1 - step } else { step }] as usize;
            while open.pop_if(|other| points[*other as usize].1 > points[point].1).is_some() {}
            if let Some(&other) = open.last() {
                level[point] = level[point].max(points[point].0.level_apart(points[other as usize].0));
            }
            open.push(u32::try_from(point).unwrap_or(u32::MAX));
        }
    }
    for (point, level) in level.iter_mut().enumerate() {
        let shown = (0..undecided).find(|&coarse| wins(point, coarse));
        *level = shown.unwrap_or(*level).min(leaves[point]);
    }
    level
}

/// The level at which the tree ends, for each point of a column. `above` is the level of the square of the
/// raster in which a point is; where that is a cell, of level `cells`, the points of the cell decide.
pub(crate) fn leaf_levels(points: &[(Spot, u64)], cells: u32, above: impl Fn(Spot) -> u32) -> Vec<u32> {
    let mut leaves: Vec<u32> = points.iter().map(|(spot, _)| above(*spot)).collect();
    let whole = points.iter().zip(&leaves).zip(0_u32..).filter(|((_, level), _)| **level >= cells);
    let mut flat: Vec<(u64, u32)> = whole.map(|(((spot, _), _), point)| (spot.flat(), point)).collect();
    flat.sort_unstable();
    let of_level = |flat: u64, level: u32| flat.checked_shr(2 * (DIGITS - level)).unwrap_or(0);
    let in_cell = |a: &(u64, u32), b: &(u64, u32)| of_level(a.0, cells) == of_level(b.0, cells);
    let mut open: Vec<(u32, &[(u64, u32)])> = flat.chunk_by(in_cell).map(|part| (cells, part)).collect();
    while let Some((level, part)) = open.pop() {
        if part.len() <= LEAF_POINTS || level >= DEEPEST {
            part.iter().for_each(|(_, point)| leaves[*point as usize] = level);
            continue;
        }
        let parts = part.chunk_by(|a, b| of_level(a.0, level + 1) == of_level(b.0, level + 1));
        open.extend(parts.map(|part| (level + 1, part)));
    }
    leaves
}

impl Spot {
    /// The code of its square of a level of the plane: the first digits of x and y, interleaved.
    pub(crate) fn square(self, level: u32) -> u64 {
        self.flat().checked_shr(2 * (DIGITS - level)).unwrap_or(0)
    }

    /// The digits of x and y, interleaved.
    fn flat(self) -> u64 {
        let [x, y, _] = self.at();
        let spread = |value: u32| {
            let mut bits = u64::from(value);
            for (shift, mask) in [
                (16, 0x0000_ffff_0000_ffff),
                (8, 0x00ff_00ff_00ff_00ff),
                (4, 0x0f0f_0f0f_0f0f_0f0f),
                (2, 0x3333_3333_3333_3333),
                (1, 0x5555_5555_5555_5555_u64),
            ] {
                bits = (bits | bits << shift) & mask;
            }
            bits
        };
        spread(x) << 1 | spread(y)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    #[test]
    fn digits_are_spread_and_gathered() {
        for value in [0, 1, 0x8000_0001, 0x1234_5678, u32::MAX] {
            let bits = spread(value);
            assert!((0..32).all(|digit| bits >> (3 * digit) & 1 == u128::from(value >> digit & 1)));
            assert_eq!(
                (bits.count_ones(), gathered(bits), gathered(bits | bits << 1)),
                (value.count_ones(), value, value)
            );
        }
    }

    #[test]
    fn a_place_is_found_again_in_its_nodes() {
        let place = |cube: Cube, point: [i64; 3]| cube.place(point.map(|value| value << PART_DIGITS));
        let cube = Cube::around([[-3_500, 12_300, 40], [9_000, 20_000, 5_000]], 1_000);
        assert_eq!(cube, Cube { origin: [-4_000, 12_000, 0], side: 16_000 });
        assert_eq!(cube.raster_level(1_000), 4);
        let spot = place(cube, [8_999, 12_000, 4_100]);
        assert_eq!(spot.node(0), NodeKey { level: 0, at: [0; 3] });
        assert_eq!(spot.node(4), NodeKey { level: 4, at: [12, 0, 4] });
        assert_eq!(spot.node(4).parent(), Some(spot.node(3)));
        assert_eq!(spot.node(0).parent(), None);
        // One cell of the grid of the root is 125 mm.
        let near = place(cube, [8_990, 12_000, 4_100]);
        assert_eq!((spot.cell(0) == near.cell(0), spot.cell(5) == near.cell(5)), (true, false));
        assert_eq!(
            spot.level_apart(near),
            (0..).find(|&level| spot.cell(level) != near.cell(level)).unwrap()
        );
        assert_eq!(spot.level_apart(spot), DEEPEST + 1);
    }

    /// Compares with the definition, for columns of any size.
    #[test]
    fn levels_do_not_depend_on_the_columns_in_which_they_are_found() {
        let cube = Cube::around([[0; 3], [255_999, 255_999, 9_000]], 1_000);
        // Dense at one end, so that there are leaves of many levels.
        let place = |n: i64| {
            let spread = n * n * 7_919 % 256_000;
            [spread * spread / 256_000, n * 104_729 % 256_000 * (n % 3) / 2, n * 31 % 9_000]
        };
        let points: Vec<(Spot, u64)> = (0..160_000)
            .map(|n| {
                (cube.place(place(n).map(|value| value << PART_DIGITS)), rank(PointId::new(n.unsigned_abs())))
            })
            .collect();
        let mut best: Vec<BTreeMap<u128, u64>> = vec![BTreeMap::new(); 12];
        for (spot, rank) in &points {
            for (level, cells) in best.iter_mut().enumerate() {
                let cell = cells.entry(spot.cell(u32::try_from(level).unwrap())).or_insert(*rank);
                *cell = (*cell).min(*rank);
            }
        }
        let leaves = leaf_levels(&points, 0, |_| 0);
        let whole = levels(0, &points, &leaves, |_, _| false);
        assert!(leaves.iter().max() >= Some(&2) && leaves.iter().min() < leaves.iter().max());
        for (point, (spot, rank)) in points.iter().enumerate() {
            let first = (0..12).find(|&level| best[level as usize][&spot.cell(level)] == *rank).unwrap_or(12);
            assert_eq!(whole[point], first.min(leaves[point]), "{point}");
        }
        for column in [1, 2] {
            let mut parts = BTreeMap::<NodeKey, Vec<usize>>::new();
            for (point, (spot, _)) in points.iter().enumerate() {
                let NodeKey { level, at: [x, y, _] } = spot.node(column);
                parts.entry(NodeKey { level, at: [x, y, 0] }).or_default().push(point);
            }
            // Only columns that are not below a leaf of a coarser level, as in a run.
            for members in parts.values().filter(|members| leaves[members[0]] >= column) {
                let part: Vec<_> = members.iter().map(|&point| points[point]).collect();
                let of_part = leaf_levels(&part, column, |_| column);
                assert!(members.iter().zip(&of_part).all(|(&point, leaf)| leaves[point] == *leaf));
                let found = levels(column, &part, &of_part, |_, _| false);
                assert!(members.iter().zip(&found).all(|(&point, level)| whole[point] == *level));
            }
        }
    }

    #[test]
    fn large_cells_are_decided_by_all_columns() {
        let cube = Cube::around([[0; 3], [1_023_000, 1_023_000, 0]], 1_000);
        let points: Vec<(Spot, u64)> = (0..40)
            .map(|n| {
                (
                    cube.place([n * 20, n * 7, 0].map(|value: i64| value << PART_DIGITS)),
                    rank(PointId::new(n.unsigned_abs())),
                )
            })
            .collect();
        assert_eq!((undecided_levels(7), undecided_levels(9)), (0, 2));
        let smallest = (0..40).min_by_key(|&point| points[point].1).unwrap();
        // The column is a leaf, but one of its points may be shown by coarser nodes.
        let leaves = [9; 40];
        assert!(levels(9, &points, &leaves, |_, _| false).iter().all(|level| (2..=9).contains(level)));
        let found = levels(9, &points, &leaves, |point, level| point == smallest && level >= 1);
        assert!(found[smallest] == 1 && found.iter().filter(|level| **level < 2).count() == 1, "{found:?}");
    }
}

//! A cloud cut into voxels: the occupied ones in sorted order, their columns, their neighbours, and their
//! points.
//!
//! Nothing here is a hash map, and nothing has the size of the bounding box. Occupied voxels are a sorted
//! list, and neighbours are found by merging sorted lists. A stray point kilometres away costs one voxel.
//!
//! Scanners write points in the order of measurement, so that many consecutive points share a voxel. Such a
//! run is called a *streak*. Streaks are sorted, not points. Memory: 12 bytes per streak and 12 per voxel,
//! and 16 more per streak during the sort.
#![expect(
    clippy::cast_possible_truncation,
    reason = "counts of points fit u32 (checked in build), bit fields are masked"
)]

use std::ops::Range;

use crate::model::AlgorithmError;
use crate::model::{TileCloud, VoxelGrid};

/// The occupied voxels of a cloud, sorted by (i, j, k), local indices of a [`VoxelGrid`].
#[derive(Debug, Clone)]
pub struct VoxelIndex {
    grid: VoxelGrid,
    /// k of each voxel.
    height: Vec<u32>,
    /// Points of each voxel.
    count: Vec<u32>,
    /// Position in `sorted_streaks` of the first streak of each voxel, and the end.
    streak_first: Vec<u32>,
    /// (i, j) of each column.
    column: Vec<[u32; 2]>,
    /// First voxel of each column, and the end.
    column_first: Vec<u32>,
    /// First column of each row (columns with equal i), and the end.
    row_first: Vec<u32>,
    /// First point of each streak in the order of the points, and the end.
    streak_start: Vec<u32>,
    /// Voxel of each streak.
    streak_voxel: Vec<u32>,
    /// Streaks by voxel, within a voxel in the order of the points.
    sorted_streaks: Vec<u32>,
}

impl VoxelIndex {
    /// Cuts `cloud` into voxels of `edge` lattice units. O(points + streaks log extent). `method` is the
    /// caller's name for the error.
    ///
    /// # Errors
    /// [`AlgorithmError::TooManyCells`] when the indices along the three axes need more than 64 bits together
    /// (three axes of 600 km each at 0.3 m), [`AlgorithmError::TooManyPoints`] above 2^32 - 1 points.
    pub fn build(method: &'static str, cloud: &TileCloud, edge: u32) -> Result<Self, AlgorithmError> {
        if u32::try_from(cloud.len()).is_err() {
            return Err(AlgorithmError::TooManyPoints { method, points: cloud.len() as u64 });
        }
        let grid = VoxelGrid::new(cloud.origin, edge);
        let packing = Packing::for_extent(method, cloud, &grid)?;
        let (keys, streak_start) = streaks(cloud, &grid, &packing);
        let streak_bits = bits(keys.len() as u64);
        let mut index = Self::without_voxels(grid, streak_start, keys.len());
        if packing.total() + streak_bits <= u64::BITS {
            // Key and streak are packed into one word, in place of the keys, for a radix sort over the bits
            // of the key. A tile of the ground pass needs most memory here.
            let mut words = keys;
            words.iter_mut().zip(0_u64..).for_each(|(word, streak)| *word = (*word << streak_bits) | streak);
            let words = radix_sort(words, streak_bits, packing.total());
            let mask = (1_u64 << streak_bits) - 1;
            index.fill(&packing, words.into_iter().map(|word| (word >> streak_bits, (word & mask) as u32)));
        } else {
            let mut pairs: Vec<(u64, u32)> = keys.into_iter().zip(0..).collect();
            pairs.sort_unstable();
            index.fill(&packing, pairs.into_iter());
        }
        Ok(index)
    }

    fn without_voxels(grid: VoxelGrid, streak_start: Vec<u32>, streaks: usize) -> Self {
        Self {
            grid,
            height: Vec::new(),
            count: Vec::new(),
            streak_first: Vec::new(),
            column: Vec::new(),
            column_first: Vec::new(),
            row_first: Vec::new(),
            streak_start,
            streak_voxel: vec![0; streaks],
            sorted_streaks: Vec::with_capacity(streaks),
        }
    }

    /// Takes the streaks in the order of their keys.
    fn fill(&mut self, packing: &Packing, sorted: impl Iterator<Item = (u64, u32)>) {
        let mut last = None;
        for (key, streak) in sorted {
            if last != Some(key) {
                last = Some(key);
                let [i, j, k] = packing.unpack(key);
                if self.column.last() != Some(&[i, j]) {
                    if self.column.last().is_none_or(|column| column[0] != i) {
                        self.row_first.push(self.column.len() as u32);
                    }
                    self.column.push([i, j]);
                    self.column_first.push(self.height.len() as u32);
                }
                self.streak_first.push(self.sorted_streaks.len() as u32);
                self.height.push(k);
                self.count.push(0);
            }
            let voxel = self.height.len() - 1;
            self.count[voxel] += self.streak_points(streak).len() as u32;
            self.streak_voxel[streak as usize] = voxel as u32;
            self.sorted_streaks.push(streak);
        }
        self.row_first.push(self.column.len() as u32);
        self.column_first.push(self.height.len() as u32);
        self.streak_first.push(self.sorted_streaks.len() as u32);
    }

    /// The grid of the voxels.
    #[must_use]
    pub fn grid(&self) -> &VoxelGrid {
        &self.grid
    }

    /// Number of occupied voxels.
    #[must_use]
    pub fn len(&self) -> usize {
        self.height.len()
    }

    /// Whether there are no voxels, that is, no points.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.height.is_empty()
    }

    /// k of each voxel, by voxel.
    #[must_use]
    pub fn heights(&self) -> &[u32] {
        &self.height
    }

    /// Number of points of each voxel, by voxel.
    #[must_use]
    pub fn counts(&self) -> &[u32] {
        &self.count
    }

    /// (i, j) of each occupied column, sorted.
    #[must_use]
    pub fn columns(&self) -> &[[u32; 2]] {
        &self.column
    }

    /// The voxels of a column, from the lowest up.
    #[inline]
    #[must_use]
    pub fn column_voxels(&self, column: usize) -> Range<usize> {
        self.column_first[column] as usize..self.column_first[column + 1] as usize
    }

    /// Streaks in the order of the points: ranges of point indices that share a voxel, and the voxel.
    pub fn streaks(&self) -> impl Iterator<Item = (Range<usize>, usize)> {
        self.streak_start
            .windows(2)
            .zip(&self.streak_voxel)
            .map(|(bounds, &voxel)| (bounds[0] as usize..bounds[1] as usize, voxel as usize))
    }

    /// The points of a voxel, as ranges of point indices.
    pub fn voxel_points(&self, voxel: usize) -> impl Iterator<Item = Range<usize>> {
        let range = self.streak_first[voxel] as usize..self.streak_first[voxel + 1] as usize;
        self.sorted_streaks[range].iter().map(|&streak| self.streak_points(streak))
    }

    #[inline]
    fn streak_points(&self, streak: u32) -> Range<usize> {
        let streak = streak as usize;
        self.streak_start[streak] as usize..self.streak_start[streak + 1] as usize
    }

    /// Visits the pairs of occupied rows (i, i + `di`), as their ranges of columns.
    pub fn row_pairs(&self, di: i64, mut visit: impl FnMut(Range<usize>, Range<usize>)) {
        let rows = self.row_first.len() - 1;
        let row_i = |row: usize| i64::from(self.column[self.row_first[row] as usize][0]);
        let columns = |row: usize| self.row_first[row] as usize..self.row_first[row + 1] as usize;
        let mut other = 0;
        for row in 0..rows {
            let wanted = row_i(row) + di;
            while other < rows && row_i(other) < wanted {
                other += 1;
            }
            if other < rows && row_i(other) == wanted {
                visit(columns(row), columns(other));
            }
        }
    }

    /// Visits the pairs of occupied columns (i, j) and (i + `di`, j + `dj`).
    pub fn column_pairs(&self, [di, dj]: [i64; 2], mut visit: impl FnMut(usize, usize)) {
        let j = |column: usize| i64::from(self.column[column][1]);
        self.row_pairs(di, |row, other_row| {
            let mut other = other_row.start;
            for column in row {
                let wanted = j(column) + dj;
                while other < other_row.end && j(other) < wanted {
                    other += 1;
                }
                if other < other_row.end && j(other) == wanted {
                    visit(column, other);
                }
            }
        });
    }
}

/// A cloud with the voxels that one kernel built and the next one may need again.
#[derive(Debug)]
pub struct TileView<'a> {
    cloud: &'a TileCloud,
    voxels: Option<VoxelIndex>,
}

impl<'a> TileView<'a> {
    /// The cloud, without voxels yet.
    #[must_use]
    pub fn new(cloud: &'a TileCloud) -> Self {
        Self { cloud, voxels: None }
    }

    /// The points.
    #[must_use]
    pub fn cloud(&self) -> &'a TileCloud {
        self.cloud
    }

    /// The voxels of `edge` lattice units over all points. They are built unless the previous ones had the
    /// same edge.
    ///
    /// # Errors
    /// Those of [`VoxelIndex::build`].
    pub fn voxels(&mut self, method: &'static str, edge: u32) -> Result<&VoxelIndex, AlgorithmError> {
        // Voxels of another edge are freed before new ones are built.
        let same = self.voxels.take().filter(|index| index.grid.edge == edge);
        let index = match same {
            Some(index) => index,
            None => VoxelIndex::build(method, self.cloud, edge)?,
        };
        Ok(self.voxels.insert(index))
    }
}

/// How (i, j, k) are packed into one word, the highest bits first.
#[derive(Debug)]
struct Packing {
    j_bits: u32,
    k_bits: u32,
    i_bits: u32,
}

impl Packing {
    fn for_extent(method: &'static str, cloud: &TileCloud, grid: &VoxelGrid) -> Result<Self, AlgorithmError> {
        let cells = [&cloud.x, &cloud.y, &cloud.z].map(|axis| axis.iter().max().copied().unwrap_or(0));
        let cells = [0, 1, 2].map(|axis| u64::from(grid.index(axis, cells[axis])) + 1);
        let [i_bits, j_bits, k_bits] = cells.map(bits);
        if i_bits + j_bits + k_bits > u64::BITS {
            let longest = cells.into_iter().max().unwrap_or(0);
            let others = i_bits + j_bits + k_bits - bits(longest);
            let limit = 1_u64.checked_shl(u64::BITS - others.min(u64::BITS)).unwrap_or(u64::MAX);
            return Err(AlgorithmError::TooManyCells {
                method,
                cells: longest,
                edge_units: grid.edge,
                limit,
            });
        }
        Ok(Self { i_bits, j_bits, k_bits })
    }

    fn total(&self) -> u32 {
        self.i_bits + self.j_bits + self.k_bits
    }

    fn pack(&self, [i, j, k]: [u32; 3]) -> u64 {
        // checked_shl: if one axis takes all bits, the shift is by 64, and i is 0.
        let i = u64::from(i).checked_shl(self.j_bits + self.k_bits).unwrap_or(0);
        i | (u64::from(j) << self.k_bits) | u64::from(k)
    }

    fn unpack(&self, key: u64) -> [u32; 3] {
        let field =
            |low: u32, width: u32| (key.checked_shr(low).unwrap_or(0) & ((1_u64 << width) - 1)) as u32;
        [
            field(self.j_bits + self.k_bits, self.i_bits),
            field(self.k_bits, self.j_bits),
            field(0, self.k_bits),
        ]
    }
}

/// The number of bits that hold every value below `count`.
fn bits(count: u64) -> u32 {
    u64::BITS - count.saturating_sub(1).leading_zeros()
}

/// The key of every streak and the index of its first point (and the end).
fn streaks(cloud: &TileCloud, grid: &VoxelGrid, packing: &Packing) -> (Vec<u64>, Vec<u32>) {
    let mut keys = Vec::new();
    let mut starts = Vec::new();
    // The beginning of the current voxel. A point is in the voxel if it is less than an edge further on each
    // axis. This saves the three divisions for all points of a streak but the first.
    let mut begin = None::<[u32; 3]>;
    for (point, ((&x, &y), &z)) in cloud.x.iter().zip(&cloud.y).zip(&cloud.z).enumerate() {
        let position = [grid.position(0, x), grid.position(1, y), grid.position(2, z)];
        let inside = begin.is_some_and(|begin| {
            (position[0].wrapping_sub(begin[0]) < grid.edge)
                & (position[1].wrapping_sub(begin[1]) < grid.edge)
                & (position[2].wrapping_sub(begin[2]) < grid.edge)
        });
        if !inside {
            let voxel = position.map(|value| value / grid.edge);
            begin = Some(voxel.map(|value| value * grid.edge));
            keys.push(packing.pack(voxel));
            starts.push(point as u32);
        }
    }
    starts.push(cloud.len() as u32);
    (keys, starts)
}

/// Sorts words by the `width` bits above bit `low`. Stable, least significant digit first, with digits of at
/// most 11 bits (2,048 counters fit the first-level cache).
fn radix_sort(mut words: Vec<u64>, low: u32, width: u32) -> Vec<u64> {
    let passes = width.div_ceil(11);
    let mut spare = vec![0; words.len()];
    let mut done = 0;
    for pass in 0..passes {
        let digit_bits = (width - done).div_ceil(passes - pass);
        let digit = |word: u64| ((word >> (low + done)) & ((1 << digit_bits) - 1)) as usize;
        let mut next = vec![0_u32; 1 << digit_bits];
        for &word in &words {
            next[digit(word)] += 1;
        }
        let mut total = 0;
        for slot in &mut next {
            total += std::mem::replace(slot, total);
        }
        for &word in &words {
            let slot = &mut next[digit(word)];
            spare[*slot as usize] = word;
            *slot += 1;
        }
        std::mem::swap(&mut words, &mut spare);
        done += digit_bits;
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Lattice;

    fn index(points: &[[i64; 3]], edge: u32) -> VoxelIndex {
        VoxelIndex::build("test", &TileCloud::from_lattice_points(Lattice::MILLIMETRE, points), edge).unwrap()
    }

    fn all_points(index: &VoxelIndex) -> Vec<Vec<usize>> {
        (0..index.len()).map(|voxel| index.voxel_points(voxel).flatten().collect()).collect()
    }

    #[test]
    fn voxels_are_sorted_and_lead_back_to_their_points() {
        // Edge 10. Voxels, relative to the lowest of each axis (i from -1, j from 0, k from 0):
        // points 0, 1, 4: (1, 0, 0); point 2: (0, 1, 2); point 3: (1, 0, 1).
        let index = index(&[[0, 0, 0], [9, 9, 9], [-1, 10, 29], [0, 0, 10], [5, 5, 5]], 10);
        assert_eq!(index.grid().base, [-1, 0, 0]);
        assert_eq!(index.columns(), [[0, 1], [1, 0]]);
        assert_eq!(index.heights(), [2, 0, 1]);
        assert_eq!(index.counts(), [1, 3, 1]);
        assert_eq!(all_points(&index), [vec![2], vec![0, 1, 4], vec![3]]);
        let streaks: Vec<_> = index.streaks().collect();
        assert_eq!(streaks, [(0..2, 1), (2..3, 0), (3..4, 2), (4..5, 1)]);
    }

    #[test]
    fn column_pairs_are_those_at_the_offset() {
        let index = index(&[[0, 0, 0], [0, 1, 0], [0, 3, 0], [2, 0, 0], [2, 2, 0], [3, 1, 0]], 1);
        let pairs = |offset| {
            let mut pairs = Vec::new();
            index.column_pairs(offset, |a, b| pairs.push((a, b)));
            pairs
        };
        assert_eq!(pairs([0, 0]), [(0, 0), (1, 1), (2, 2), (3, 3), (4, 4), (5, 5)]);
        assert_eq!(pairs([0, 1]), [(0, 1)]);
        assert_eq!(pairs([2, -1]), [(1, 3), (2, 4)]);
        assert_eq!(pairs([1, 1]), [(3, 5)]);
        assert_eq!(pairs([1, -1]), [(4, 5)]);
        assert_eq!(pairs([-2, 1]), [(3, 1), (4, 2)]);
        assert_eq!(pairs([5, 0]), []);
    }

    #[test]
    fn extents_that_do_not_fit_beside_the_streak_are_sorted_too() {
        // 2^30 cells on two axes are 61 bits, which leaves no room for the streaks of 16 points.
        let far = (1 << 30) + 5;
        let mut points = vec![[far, far, 0]];
        points.extend((0..16).map(|step| [15 - step, 0, 0]));
        let index = index(&points, 1);
        assert_eq!(index.len(), 17);
        let order: Vec<usize> = all_points(&index).into_iter().flatten().collect();
        assert_eq!(order, [16, 15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0]);
    }

    #[test]
    fn extents_beyond_64_bits_are_refused_with_both_numbers() {
        let far = (1 << 30) - 1;
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, &[[0; 3], [far; 3]]);
        let error = VoxelIndex::build("test", &cloud, 1).unwrap_err();
        let expected =
            AlgorithmError::TooManyCells { method: "test", cells: 1 << 30, edge_units: 1, limit: 1 << 4 };
        assert_eq!(error, expected);
    }

    #[test]
    fn no_points_make_no_voxels() {
        let index = index(&[], 300);
        assert!(index.is_empty());
        assert_eq!(index.streaks().count(), 0);
        index.column_pairs([0, 0], |_, _| panic!("no pairs"));
    }

    #[test]
    fn a_view_cuts_again_only_for_another_edge() {
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, &[[0; 3], [10; 3]]);
        let mut view = TileView::new(&cloud);
        let first = view.voxels("test", 20).unwrap().heights().as_ptr();
        assert_eq!(view.voxels("test", 20).unwrap().heights().as_ptr(), first);
        assert_eq!(view.voxels("test", 5).unwrap().len(), 2);
    }
}

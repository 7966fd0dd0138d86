//! Joins voxels that touch. The caller defines touching; this file walks over the neighbours.
//!
//! Neighbouring voxels mostly belong to one set already. Consecutive voxels of a column in one set are
//! therefore handled as one *span*. Two spans of one set are skipped as a whole. For two spans of different
//! sets, only the first pair of voxels that touch is needed. Memory: 4 bytes per voxel for the sets and at
//! most 4 for the spans.
#![expect(clippy::cast_possible_truncation, reason = "indices of voxels fit u32, see VoxelIndex")]

use std::ops::{Range, RangeInclusive};

use crate::spatial::{DisjointSets, VoxelIndex};

/// Sets of voxels that grow by joining.
#[derive(Debug)]
pub struct Linker<'a> {
    index: &'a VoxelIndex,
    sets: DisjointSets,
    /// First voxel of each span, and the end.
    span_first: Vec<u32>,
    /// First span of each column, and the end.
    column_first: Vec<u32>,
}

impl<'a> Linker<'a> {
    /// Every voxel in a set of its own.
    #[must_use]
    pub fn new(index: &'a VoxelIndex) -> Self {
        let sets = DisjointSets::new(index.len() as u32);
        let mut linker = Self { index, sets, span_first: Vec::new(), column_first: Vec::new() };
        linker.find_spans();
        linker
    }

    /// The sets in their current state.
    #[must_use]
    pub fn into_sets(self) -> DisjointSets {
        self.sets
    }

    /// Joins voxels of one column that `touch` and whose k differ by an amount in `dk` (> 0).
    pub fn link_column(&mut self, dk: RangeInclusive<i64>, mut touch: impl FnMut(u32, u32) -> bool) {
        let k = |voxel: usize| i64::from(self.index.heights()[voxel]);
        for column in 0..self.index.columns().len() {
            let voxels = self.index.column_voxels(column);
            for voxel in voxels.clone() {
                let above = (voxel + 1..voxels.end).take_while(|&other| k(other) - k(voxel) <= *dk.end());
                for other in above.filter(|&other| k(other) - k(voxel) >= *dk.start()) {
                    let a = voxel as u32;
                    let b = other as u32;
                    if self.sets.find(a) != self.sets.find(b) && touch(a, b) {
                        self.sets.union(a, b);
                    }
                }
            }
        }
    }

    /// Joins voxels at the column offset (di, dj), not (0, 0), that `touch` and whose k differ by an amount
    /// in `dk`.
    pub fn link_beside(
        &mut self,
        offset: [i64; 2],
        dk: &RangeInclusive<i64>,
        mut touch: impl FnMut(u32, u32) -> bool,
    ) {
        let heights = self.index.heights();
        let k = |voxel: usize| i64::from(heights[voxel]);
        let spans = &self.span_first;
        let columns = &self.column_first;
        let sets = &mut self.sets;
        let span = |span: usize| spans[span] as usize..spans[span + 1] as usize;
        self.index.column_pairs(offset, |column, other_column| {
            let mut first = columns[other_column] as usize;
            let end = columns[other_column + 1] as usize;
            for voxels in (columns[column] as usize..columns[column + 1] as usize).map(span) {
                let low = k(voxels.start) + dk.start();
                let high = k(voxels.end - 1) + dk.end();
                while first < end && k(span(first).end - 1) < low {
                    first += 1;
                }
                for others in (first..end).map(span).take_while(|others| k(others.start) <= high) {
                    let a = voxels.start as u32;
                    let b = others.start as u32;
                    if sets.find(a) != sets.find(b)
                        && any_pair(heights, voxels.clone(), others, dk, &mut touch)
                    {
                        sets.union(a, b);
                    }
                }
            }
        });
    }

    /// Recomputes the spans. Useful after steps that joined many voxels. Results never depend on it.
    pub fn find_spans(&mut self) {
        self.span_first.clear();
        self.column_first.clear();
        for column in 0..self.index.columns().len() {
            self.column_first.push(self.span_first.len() as u32);
            let mut last = None;
            for voxel in self.index.column_voxels(column) {
                let root = Some(self.sets.find(voxel as u32));
                if root != last {
                    self.span_first.push(voxel as u32);
                    last = root;
                }
            }
        }
        self.column_first.push(self.span_first.len() as u32);
        self.span_first.push(self.index.len() as u32);
    }
}

/// Whether any voxel of `voxels` touches one of `others` whose k differs by an amount in `dk`. Both are
/// sorted by k.
fn any_pair(
    heights: &[u32],
    voxels: Range<usize>,
    others: Range<usize>,
    dk: &RangeInclusive<i64>,
    mut touch: impl FnMut(u32, u32) -> bool,
) -> bool {
    let k = |voxel: usize| i64::from(heights[voxel]);
    let lowest = k(others.start) - dk.end();
    let start = voxels.start + heights[voxels.clone()].partition_point(|&height| i64::from(height) < lowest);
    let mut first = others.start;
    for voxel in start..voxels.end {
        while first < others.end && k(first) < k(voxel) + dk.start() {
            first += 1;
        }
        if first == others.end {
            return false;
        }
        let reachable = (first..others.end).take_while(|&other| k(other) <= k(voxel) + dk.end());
        for other in reachable {
            if touch(voxel as u32, other as u32) {
                return true;
            }
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Lattice, TileCloud};

    /// Columns (0, 0) with k 0, 1, 5, 6 (voxels 0 to 3) and (1, 2) with k 1, 3, 8 (voxels 4 to 6).
    fn index() -> VoxelIndex {
        let points = [[0, 0, 0], [0, 0, 1], [0, 0, 5], [0, 0, 6], [1, 2, 1], [1, 2, 3], [1, 2, 8]];
        VoxelIndex::build("test", &TileCloud::from_lattice_points(Lattice::MILLIMETRE, &points), 1).unwrap()
    }

    fn roots(linker: Linker<'_>) -> Vec<u32> {
        let mut sets = linker.into_sets();
        (0..7).map(|voxel| sets.find(voxel)).collect()
    }

    #[test]
    fn a_column_is_joined_within_dk() {
        let index = index();
        let mut linker = Linker::new(&index);
        linker.link_column(1..=1, |_, _| true);
        assert_eq!(roots(linker), [0, 0, 2, 2, 4, 5, 6]);
        let mut linker = Linker::new(&index);
        linker.link_column(2..=4, |_, _| true);
        // k 1 and 5 of the first column (difference 4), 1 and 3 of the second; 0 and 5, 1 and 6 differ by 5.
        assert_eq!(roots(linker), [0, 1, 1, 3, 4, 4, 6]);
    }

    #[test]
    fn columns_are_joined_at_the_offset_within_dk_with_and_without_spans() {
        let index = index();
        for spans in [false, true] {
            let mut linker = Linker::new(&index);
            linker.link_column(1..=1, |_, _| true);
            if spans {
                linker.find_spans();
            }
            linker.link_beside([1, 2], &(-1..=1), |_, _| true);
            assert_eq!(roots(linker), [0, 0, 2, 2, 0, 5, 6], "dk 1, spans {spans}");

            let mut linker = Linker::new(&index);
            linker.link_column(1..=1, |_, _| true);
            if spans {
                linker.find_spans();
            }
            linker.link_beside([1, 2], &(-2..=2), |a, b| (a, b) != (1, 4));
            // k 0 and 1, 1 and 3, 5 and 3, 6 and 8: everything.
            assert_eq!(roots(linker), [0; 7], "dk 2, spans {spans}");
        }
        let mut linker = Linker::new(&index);
        linker.link_beside([1, 1], &(-9..=9), |_, _| true);
        assert_eq!(roots(linker), [0, 1, 2, 3, 4, 5, 6]);
    }
}

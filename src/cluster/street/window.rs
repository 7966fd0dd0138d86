//! Windows of voxels: which voxels lie near a voxel.

use std::ops::Range;

use crate::cluster::columns::{Columns, Finder};
use crate::spatial::Cell;

/// A window around a voxel: the columns within a radius in the plane, and the same number of levels below and
/// above.
#[derive(Debug)]
pub(crate) struct Window {
    steps: Vec<[i32; 2]>,
    levels: i32,
}

impl Window {
    /// The window with this radius in voxels and this number of levels below and above. A column is in the
    /// window if its squared distance is at most r² + r, which rounds the disc to whole voxels.
    pub(crate) fn new(radius: i32, levels: i32) -> Self {
        let steps = (-radius..=radius)
            .flat_map(|di| (-radius..=radius).map(move |dj| [di, dj]))
            .filter(|[di, dj]| di * di + dj * dj <= radius * radius + radius)
            .collect();
        Self { steps, levels }
    }

    /// The window of all voxels at most `steps` away on every axis.
    pub(crate) fn square(steps: i32) -> Self {
        let all = (-steps..=steps).flat_map(|di| (-steps..=steps).map(move |dj| [di, dj])).collect();
        Self { steps: all, levels: steps }
    }

    /// Steps to the columns of the window.
    pub(crate) fn steps(&self) -> &[[i32; 2]] {
        &self.steps
    }

    /// The window over these columns.
    pub(crate) fn over(self, columns: &Columns) -> Visitor<'_> {
        Visitor { window: self, columns, finder: columns.finder(), last: None, ranges: Vec::new() }
    }
}

/// Visits the windows of one voxel after another. It is fastest if the voxels of a column follow each other
/// from the lowest up: their windows have the same columns, and a voxel below one window is also below the
/// next.
pub(crate) struct Visitor<'a> {
    window: Window,
    columns: &'a Columns,
    finder: Finder<'a>,
    /// Where the last voxel was.
    last: Option<(Cell, i32)>,
    /// The voxels of each non-empty column of the window, without those below the window.
    ranges: Vec<Range<usize>>,
}

impl Visitor<'_> {
    /// Visits every voxel in the window around voxel (i, j, k), the voxel itself included.
    #[inline]
    pub(crate) fn visit(&mut self, cell @ [i, j]: Cell, k: i32, mut visit: impl FnMut(usize)) {
        if self.last.is_none_or(|(last, below)| last != cell || k < below) {
            let Self { window, finder, ranges, .. } = self;
            ranges.clear();
            let around = window.steps.iter().map(|[di, dj]| finder.column([i + di, j + dj]));
            ranges.extend(around.filter(|column| !column.is_empty()));
        }
        self.last = Some((cell, k));
        let heights = self.columns.heights();
        let levels = self.window.levels;
        for range in &mut self.ranges {
            while range.start < range.end && heights[range.start] < k - levels {
                range.start += 1;
            }
            for voxel in range.clone().take_while(|&voxel| heights[voxel] <= k + levels) {
                visit(voxel);
            }
        }
    }
}

//! Windows of voxels: which voxels lie near a voxel.

use crate::cluster::columns::{Columns, Finder};
use crate::spatial::Cell;

/// A window around a voxel: the columns within a radius in the plane, and as many levels below as above.
#[derive(Debug)]
pub(super) struct Window {
    steps: Vec<[i32; 2]>,
    levels: i32,
}

impl Window {
    /// The window with this radius in voxels and this number of levels below and above. A column is in the
    /// window if its squared distance is at most r² + r, which rounds the disc to whole voxels.
    pub(super) fn new(radius: i32, levels: i32) -> Self {
        let steps = (-radius..=radius)
            .flat_map(|di| (-radius..=radius).map(move |dj| [di, dj]))
            .filter(|[di, dj]| di * di + dj * dj <= radius * radius + radius)
            .collect();
        Self { steps, levels }
    }

    /// The window of all voxels at most `steps` away on every axis.
    pub(super) fn square(steps: i32) -> Self {
        let all = (-steps..=steps).flat_map(|di| (-steps..=steps).map(move |dj| [di, dj])).collect();
        Self { steps: all, levels: steps }
    }

    /// Steps to the columns of the window.
    pub(super) fn steps(&self) -> &[[i32; 2]] {
        &self.steps
    }

    /// Visits every voxel in the window around voxel (i, j, k), the voxel itself included.
    #[inline]
    pub(super) fn visit(
        &self,
        columns: &Columns,
        finder: &mut Finder<'_>,
        [i, j]: Cell,
        k: i32,
        mut visit: impl FnMut(usize),
    ) {
        let heights = columns.heights();
        for [di, dj] in &self.steps {
            let column = finder.column([i + di, j + dj]);
            if column.is_empty() {
                continue;
            }
            let low =
                column.start + heights[column.clone()].partition_point(|&height| height < k - self.levels);
            for voxel in (low..column.end).take_while(|&voxel| heights[voxel] <= k + self.levels) {
                visit(voxel);
            }
        }
    }
}

//! Where a component stands: its columns of voxels, with the top and the number of voxels of each.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::cluster::street::spans::{self, Spans};
use crate::spatial::Cell;

/// The columns of a component: see [`Footprint`].
pub(crate) type Columns = BTreeMap<Cell, (i32, u32)>;

/// The top of each column of voxels of a component, in lattice units above ground, and its number of voxels.
#[derive(Debug, Default, Clone, Serialize, Deserialize)]
pub(crate) struct Footprint(Columns);

impl Footprint {
    pub(crate) fn of_voxel(column: Cell, height: i32) -> Self {
        Self(BTreeMap::from([(column, (height, 1))]))
    }

    pub(crate) fn columns(&self) -> &Columns {
        &self.0
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        for (&column, &(top, count)) in &other.0 {
            let entry = self.0.entry(column).or_insert((i32::MIN, 0));
            *entry = (entry.0.max(top), entry.1 + count);
        }
    }
}

/// The middle of a column of voxels, in lattice units.
pub(crate) fn centre(column: Cell, edge: i64) -> [i64; 2] {
    column.map(|index| i64::from(index) * edge + edge / 2)
}

/// The column of voxels at a place.
pub(crate) fn column([x, y]: [i64; 2], edge: i64) -> Cell {
    [x, y].map(|at| i32::try_from(at.div_euclid(edge)).unwrap_or(i32::MAX))
}

/// The columns grouped by steps of `edge` along the narrowest box around them. Each has its position across
/// the box, as [`spans::position`] gives it. `spans` are the spans of the columns.
pub(crate) fn along(columns: &Columns, spans: &Spans, edge: i64) -> Vec<Vec<(i64, Cell)>> {
    let narrowest = spans.narrowest();
    let start = spans.from(narrowest.along());
    let mut steps: Vec<Vec<(i64, Cell)>> = Vec::new();
    for &column in columns.keys() {
        let place = centre(column, edge);
        let from_start = spans::position(place, narrowest.along()) - start;
        let at = usize::try_from(from_start.div_euclid(spans::SCALE_UNITS * edge)).unwrap_or(0);
        if steps.len() <= at {
            steps.resize(at + 1, Vec::new());
        }
        steps[at].push((spans::position(place, narrowest.across()), column));
    }
    steps
}

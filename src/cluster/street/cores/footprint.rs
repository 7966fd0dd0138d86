//! Where a component stands: its columns of voxels, with the top and the number of voxels of each.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

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

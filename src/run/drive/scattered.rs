//! The points of the drive grouped by tile, as the pass `scatter` stored them.

use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::model::TileId;
use crate::run::engine::Sections;

/// Bytes of a point.
pub(crate) const STRIDE: usize = 16;

/// The position of each tile's points in a unit: (tile, first point), ascending, and the end.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct Groups {
    pub(crate) first: Vec<(TileId, u64)>,
    pub(crate) end: u64,
}

/// The points of the drive grouped by tile, unit by unit.
#[derive(Debug)]
pub(crate) struct Scattered {
    pub(crate) units: Vec<ScatteredUnit>,
    /// The points of each unit.
    pub(crate) points: Sections,
}

/// Where the points of a run of blocks of one file are, grouped by tile.
#[derive(Debug)]
pub(crate) struct ScatteredUnit {
    /// Number of the input file.
    pub(crate) number: usize,
    /// Record number of the unit's first point in that file.
    pub(crate) first_record: u64,
    pub(crate) groups: Groups,
}

impl Scattered {
    /// The points of a tile in a unit in file order, [`STRIDE`] bytes each.
    pub(crate) fn points(&self, unit: usize, tile: TileId) -> Result<Vec<u8>> {
        let groups = &self.units[unit].groups;
        let Ok(at) = groups.first.binary_search_by_key(&tile, |group| group.0) else {
            return Ok(Vec::new());
        };
        let first = groups.first[at].1;
        let end = groups.first.get(at + 1).map_or(groups.end, |next| next.1);
        let mut bytes = vec![0; usize::try_from(end - first).unwrap_or(0) * STRIDE];
        self.points.get(unit)?.read_into(first * STRIDE as u64, &mut bytes)?;
        Ok(bytes)
    }
}

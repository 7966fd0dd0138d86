//! The points of the drive grouped by tile, as the pass `scatter` wrote them.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::model::TileId;
use crate::store::StoreError;

/// Bytes of a point in a scattered file.
pub(crate) const STRIDE: usize = 16;

/// Where the points of each tile are in the file of a unit: (tile, first point), ascending, and the end.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct Groups {
    pub(crate) first: Vec<(TileId, u64)>,
    pub(crate) end: u64,
}

/// The points of the drive grouped by tile, unit by unit.
#[derive(Debug)]
pub(crate) struct Scattered {
    pub(crate) units: Vec<ScatteredUnit>,
}

/// The points of a run of blocks of one file, grouped by tile.
#[derive(Debug)]
pub(crate) struct ScatteredUnit {
    pub(crate) path: PathBuf,
    pub(crate) file: File,
    /// Number of the input file.
    pub(crate) number: usize,
    /// Record of the unit's first point in that file.
    pub(crate) first_record: u64,
    pub(crate) groups: Groups,
}

impl ScatteredUnit {
    /// The points of a tile in this unit in file order, [`STRIDE`] bytes each.
    pub(crate) fn points(&self, tile: TileId) -> Result<Vec<u8>> {
        let Ok(at) = self.groups.first.binary_search_by_key(&tile, |group| group.0) else {
            return Ok(Vec::new());
        };
        let first = self.groups.first[at].1;
        let end = self.groups.first.get(at + 1).map_or(self.groups.end, |next| next.1);
        let mut bytes = vec![0; usize::try_from(end - first).unwrap_or(0) * STRIDE];
        self.file
            .read_exact_at(&mut bytes, first * STRIDE as u64)
            .map_err(StoreError::io("read", &self.path))?;
        Ok(bytes)
    }
}

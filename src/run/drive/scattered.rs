//! The points of the drive grouped by tile, as the pass `scatter` stored them.

use crate::error::Result;
use crate::model::{FlagPlace, TileId};
use crate::run::drive::Groups;
use crate::run::engine::Sections;

/// Bytes of a point.
pub(crate) const STRIDE: usize = 16;
/// The bits of the last word of a point with the number of its record in the unit. A unit has far fewer
/// records than these bits can count.
pub(crate) const RECORD_BITS: u32 = u32::MAX >> 1;
/// The other bit of this word: whether the point is withheld.
pub(crate) const WITHHELD: FlagPlace = FlagPlace { offset: STRIDE - 1, mask: 1 << 7 };

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
    pub(crate) groups: Groups<TileId>,
}

impl Scattered {
    /// The points of a tile in a unit in file order, [`STRIDE`] bytes each.
    pub(crate) fn points(&self, unit: usize, tile: TileId) -> Result<Vec<u8>> {
        let range = self.units[unit].groups.bytes(tile, STRIDE);
        if range.is_empty() {
            return Ok(Vec::new());
        }
        self.points.get(unit)?.read(range)
    }
}

//! Reads points further around a tile for results that are not certain yet. A result that depends on the
//! nearest neighbours of a place is exact only if no unread cell may contain a nearer one. Until then, the
//! place *asks for more*. The cells within the distance that it needs are read in pieces, for such places
//! only, until all results are certain. The distance is limited to twice the halo at first, then to four
//! times, and so on.

use std::collections::BTreeMap;

use super::method::{TilePoints, TileWindow};
use crate::error::Result;
use crate::spatial::{Cell, CellMap, LookedAt};

/// Approximate number of points that are read at once.
const PIECE_POINTS: u64 = 1_000_000;

/// A result that may be wrong until more points around it have been read.
pub(crate) trait Asking {
    /// The cell of its place.
    fn cell(&self) -> Cell;

    /// Radius in lattice units within which all points must be known; `i64::MAX` for the whole drive.
    fn needed(&self) -> i64;
}

/// Processes the points of some cells for the remaining askers.
type Read<'a, A> = &'a mut dyn FnMut(TilePoints, &[Cell], &mut [A]) -> Result<()>;

/// The cells that a tile has read, for results that may need more.
pub(crate) struct Further<'a> {
    tile: &'a dyn TileWindow,
    /// Cells within the halo of the tile.
    cells: &'a CellMap<u8>,
    /// Halo of the tile, in lattice units.
    reach: i64,
}

impl<'a> Further<'a> {
    /// The tile has read `cells`, which are the cells within `reach`.
    pub(crate) fn new(tile: &'a dyn TileWindow, cells: &'a CellMap<u8>, reach: i64) -> Self {
        Self { tile, cells, reach }
    }

    /// The cells that have been read at first.
    pub(crate) fn looked_at(&self) -> LookedAt<'a> {
        LookedAt::of(self.tile.occupied(), self.tile.grid(), self.cells)
    }

    /// Reads the surroundings of the askers, piece by piece, until all are certain. `read` gets the points of
    /// a piece, its cells and the remaining askers. `settle` gets each asker when it is certain.
    pub(crate) fn answer<A: Asking>(
        &self,
        mut asking: Vec<A>,
        read: Read<'_, A>,
        settle: &mut dyn FnMut(A),
    ) -> Result<()> {
        let mut looked_at = self.looked_at();
        let mut reach = self.reach;
        while !asking.is_empty() {
            reach = reach.saturating_mul(2).max(1);
            let mut around = BTreeMap::new();
            for asker in &asking {
                let distance = around.entry(asker.cell()).or_insert(0);
                *distance = reach.min(asker.needed()).max(*distance);
            }
            let cells = looked_at.missing_within(&around);
            for piece in looked_at.pieces(&cells, PIECE_POINTS) {
                let points = self.tile.points_of(piece.clone())?;
                read(points, &piece, &mut asking)?;
            }
            looked_at.add(&cells);
            let (certain, open) =
                asking.into_iter().partition(|asker| looked_at.is_clear(asker.cell(), asker.needed()));
            asking = open;
            Vec::into_iter(certain).for_each(&mut *settle);
        }
        Ok(())
    }
}

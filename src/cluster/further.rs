//! Reading further around for those that are not certain: what depends on the nearest neighbours of a place is exact only
//! if no cell that has not been read may hold a nearer one. Whoever may be wrong *asks for more*: the cells within the
//! distance that it asks about (at first no further than twice the halo, then four times, ...) are read in pieces, for
//! these askers alone, until all are certain.

use std::collections::BTreeMap;

use super::method::{TilePoints, TileWindow};
use crate::error::Result;
use crate::spatial::{Cell, CellMap, LookedAt};

/// Points of one piece of what is read at once.
const PIECE_POINTS: u64 = 1_000_000;

/// Something that may be wrong before more has been read around it.
pub(crate) trait Asking {
    /// The cell that it is in.
    fn cell(&self) -> Cell;

    /// Lattice units around it within which everything has to be known; `i64::MAX` for the whole drive.
    fn needed(&self) -> i64;
}

/// Looks at the points of some cells on behalf of those who still ask.
type Read<'a, A> = &'a mut dyn FnMut(TilePoints, &[Cell], &mut [A]) -> Result<()>;

/// What a tile has read, for those who may ask for more.
pub(crate) struct Further<'a> {
    tile: &'a dyn TileWindow,
    /// Cells that were read in the first place.
    cells: &'a CellMap<u8>,
    /// How far around the tile that is, in lattice units.
    reach: i64,
}

impl<'a> Further<'a> {
    /// The tile has read `cells`, which are those within `reach`.
    pub(crate) fn new(tile: &'a dyn TileWindow, cells: &'a CellMap<u8>, reach: i64) -> Self {
        Self { tile, cells, reach }
    }

    /// What is known at first.
    pub(crate) fn looked_at(&self) -> LookedAt<'a> {
        LookedAt::of(self.tile.occupied(), self.tile.grid(), self.cells)
    }

    /// Reads around the askers what they need, piece by piece, until all are certain. `read` gets the points of a piece,
    /// its cells and all who still ask; `settle` gets each of them when it is certain.
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

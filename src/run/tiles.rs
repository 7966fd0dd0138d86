//! The points of a tile: which blocks to read, and the gathering out of them.

use crate::error::{Error, Result};
use crate::model::BlockZone;
use crate::run::drive::Drive;
use crate::store::StoreError;
use crate::tiling::{Gathered, Gatherer, Plan, Region};

/// Tiles over a drive.
pub(crate) struct Tiles<'a> {
    pub(crate) drive: &'a Drive,
    pub(crate) plan: &'a Plan,
    /// Zone map: blocks of each file.
    pub(crate) zones: &'a [Vec<BlockZone>],
    /// Smallest lattice z of the drive.
    pub(crate) lowest: i64,
}

impl Tiles<'_> {
    /// Blocks (file, block) that may hold points of `region`.
    fn blocks<'b>(&'b self, region: &'b Region) -> impl Iterator<Item = (usize, usize)> + 'b {
        self.zones.iter().enumerate().flat_map(move |(file, zones)| {
            zones
                .iter()
                .enumerate()
                .filter(move |(_, zone)| zone.may_meet(&region.area))
                .map(move |(block, _)| (file, block))
        })
    }

    /// Records that reading `region` means.
    pub(crate) fn records_read(&self, region: &Region) -> u64 {
        self.blocks(region).map(|(file, block)| u64::from(self.zones[file][block].count)).sum()
    }

    /// Asks the system to read ahead.
    pub(crate) fn prefetch(&self, tile: usize, reach: i64) {
        let region = self.plan.region(tile, reach);
        for (file, block) in self.blocks(&region) {
            if !self.drive.file(file).is_compressed() {
                self.drive.file(file).prefetch(block);
            }
        }
    }

    /// The points of a tile and of everything within `reach` of it; with `objects_only` without ground and noise,
    /// which the ground pass has found.
    pub(crate) fn gather(&self, tile: usize, reach: i64, objects_only: bool) -> Result<Gathered> {
        self.drive.check_unchanged()?;
        let region = self.plan.region(tile, reach);
        let mut gatherer = Gatherer::new(&region, self.drive.lattice(), self.lowest);
        let (mut buffer, mut classes) = (Vec::new(), Vec::new());
        for (file, block) in self.blocks(&region) {
            if objects_only {
                let run = &self.drive.file(file).blocks()[block];
                let column = &self.drive.classes[file];
                classes.resize(run.count as usize, 0);
                column
                    .read(run.first_record, &mut classes)
                    .map_err(StoreError::io("read", column.path()))?;
            }
            let first_id = self.drive.first_id(file, block);
            let wanted = objects_only.then_some(&classes[..]);
            self.drive
                .geometry(file, block, &mut buffer, |view, transform| {
                    gatherer.block(view, transform, first_id, wanted)
                })?
                .map_err(|_| Error::Bug(format!("a height in tile {tile} does not fit the surveyed range")))?;
        }
        Ok(gatherer.finish())
    }
}

//! The points of tiles: which blocks to read, and how points are gathered from them, before and after their
//! classes are known.

use std::sync::OnceLock;

use crate::codec;
use crate::error::{Error, Result};
use crate::model::{RecordView, TileId};
use crate::run::drive::verdicts::{TileVerdicts, range};
use crate::run::drive::{Drive, RECORD_BITS, STRIDE, Scattered, StoredFields, Surveyed, WITHHELD};
use crate::run::engine::Payloads;
use crate::spatial::{Area, BlockZone};
use crate::tiling::{Gathered, Gatherer, HeightOutOfRange, Plan, Region, Wanted};

/// The code of records that none of the given tiles owns. No point has it.
const NOBODYS: u8 = u8::MAX;

/// A drive divided into tiles.
pub(crate) struct Tiled<'a> {
    pub(crate) drive: &'a Drive,
    pub(crate) surveyed: &'a Surveyed,
    pub(crate) plan: &'a Plan,
    /// The points grouped by tile, if the order of the records is unfavourable. Otherwise tiles read whole
    /// blocks.
    scattered: Option<Scattered>,
    /// All cells of tiles.
    area: OnceLock<Area>,
}

impl<'a> Tiled<'a> {
    /// The tiles of a plan. They read whole blocks.
    pub(crate) fn whole_blocks(drive: &'a Drive, surveyed: &'a Surveyed, plan: &'a Plan) -> Self {
        Self { drive, surveyed, plan, scattered: None, area: OnceLock::new() }
    }

    /// The same tiles. They read points that are grouped by tile.
    pub(crate) fn grouped(self, scattered: Scattered) -> Self {
        Self { scattered: Some(scattered), ..self }
    }

    /// Number of tiles.
    pub(crate) fn count(&self) -> usize {
        self.plan.tiles.len()
    }

    /// Zone map: blocks of each file.
    fn zones(&self) -> &[Vec<BlockZone>] {
        &self.surveyed.survey.zones
    }

    /// Blocks (file, block) that may contain points of `region`.
    fn blocks<'b>(&'b self, region: &'b Region) -> impl Iterator<Item = (usize, usize)> + 'b {
        self.zones().iter().enumerate().flat_map(move |(file, zones)| {
            zones
                .iter()
                .enumerate()
                .filter(move |(_, zone)| zone.may_meet(&region.area))
                .map(move |(block, _)| (file, block))
        })
    }

    /// Whether any of these blocks may contain points of a tile.
    pub(crate) fn may_meet_tiles(&self, file: usize, mut blocks: std::ops::Range<usize>) -> bool {
        let area = self.area.get_or_init(|| Area::of(self.plan.cells().iter().map(|(cell, _)| cell)));
        blocks.any(|block| self.zones()[file][block].may_meet(area))
    }

    /// Number of records that are read for `region`.
    pub(crate) fn records_read(&self, region: &Region) -> u64 {
        self.blocks(region).map(|(file, block)| u64::from(self.zones()[file][block].count)).sum()
    }

    /// Records read per point needed, if tiles read whole blocks.
    pub(crate) fn amplification(&self, reach: i64) -> f64 {
        let mut read = 0;
        let mut needed = 0;
        for tile in 0..self.count() {
            let region = self.plan.region(tile, reach);
            read += self.records_read(&region);
            needed += region.points;
        }
        read as f64 / needed.max(1) as f64
    }

    /// Asks the system to read ahead.
    pub(crate) fn prefetch(&self, tile: usize, reach: i64) {
        if self.scattered.is_some() {
            return;
        }
        let region = self.plan.region(tile, reach);
        for (file, block) in self.blocks(&region) {
            if !self.drive.file(file).is_compressed() {
                self.drive.file(file).prefetch(block);
            }
        }
    }

    /// All points of a tile and of everything within `reach` of it.
    pub(crate) fn gather_all(&self, tile: usize, reach: i64) -> Result<Gathered> {
        self.gather(&self.plan.region(tile, reach), Wanted::All, &[])
    }

    /// The `wanted` points of a region. `verdicts` belong to the tiles of the region, and are needed unless
    /// all points are wanted.
    fn gather(&self, region: &Region, wanted: Wanted, verdicts: &[TileVerdicts]) -> Result<Gathered> {
        self.drive.check_unchanged()?;
        let lowest = self.surveyed.lowest();
        let mut gatherer = Gatherer::new(region, self.drive.lattice(), lowest, wanted);
        match &self.scattered {
            Some(scattered) => self.gather_groups(scattered, region, &mut gatherer, verdicts)?,
            None => self.gather_blocks(region, &mut gatherer, verdicts)?,
        }
        Ok(gatherer.finish())
    }

    fn gather_blocks(
        &self,
        region: &Region,
        gatherer: &mut Gatherer<'_>,
        verdicts: &[TileVerdicts],
    ) -> Result<()> {
        let mut buffer = Vec::new();
        let mut codes = Vec::new();
        for (file, block) in self.blocks(region) {
            if !verdicts.is_empty() {
                codes.clear();
                codes.resize(self.drive.file(file).blocks()[block].count as usize, NOBODYS);
                let mut any = false;
                for verdicts in verdicts {
                    if let Some(entry) = verdicts.block(file, block) {
                        verdicts.scatter(entry, &mut codes)?;
                        any = true;
                    }
                }
                if !any {
                    continue;
                }
            }
            let first_id = self.drive.first_id(file, block);
            let classes = (!verdicts.is_empty()).then_some(&codes[..]);
            let any_withheld = self.zones()[file][block].withheld > 0;
            self.drive
                .geometry(file, block, &mut buffer, |view, transform| {
                    let view = RecordView { withheld: view.withheld.filter(|_| any_withheld), ..*view };
                    gatherer.block(&view, transform, |record, _| first_id + record as u64, classes)
                })?
                .map_err(out_of_range)?;
        }
        Ok(())
    }

    fn gather_groups(
        &self,
        scattered: &Scattered,
        region: &Region,
        gatherer: &mut Gatherer<'_>,
        verdicts: &[TileVerdicts],
    ) -> Result<()> {
        let record =
            |bytes: &[u8]| u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]) & RECORD_BITS;
        let withheld = (self.surveyed.survey.withheld() > 0).then_some(WITHHELD);
        // The points of a tile and its classes are both in the order of the ids.
        let mut seen = vec![0; region.tiles.len()];
        for (place, unit) in scattered.units.iter().enumerate() {
            let first_id = self.drive.catalog.first_id(unit.number) + unit.first_record;
            let transform = self.drive.file(unit.number).transform();
            for (number, &tile) in region.tiles.iter().enumerate() {
                let bytes = scattered.points(place, tile)?;
                let count = (bytes.len() / STRIDE) as u64;
                let classes = verdicts.get(number).map(|verdicts| {
                    verdicts.classes.get(range(seen[number], count)).ok_or_else(|| {
                        Error::bug(format!("tile {tile} has more points than the pass ground has seen"))
                    })
                });
                seen[number] += count;
                let view = RecordView { bytes: &bytes, stride: STRIDE, gps_time: None, withheld };
                let id = |_: usize, bytes: &[u8]| first_id + u64::from(record(bytes));
                gatherer.block(&view, transform, id, classes.transpose()?).map_err(out_of_range)?;
            }
        }
        Ok(())
    }
}

/// A drive in tiles whose ground and noise are known.
pub(crate) struct Classified<'a> {
    pub(crate) tiled: &'a Tiled<'a>,
    /// The pass that determined them.
    pub(crate) ground: Payloads,
    /// Points of objects in the core of each tile.
    pub(crate) objects: Vec<u64>,
    /// Warnings about the ground.
    pub(crate) warnings: Vec<String>,
}

impl Classified<'_> {
    /// The records of a tile with their classes.
    pub(crate) fn verdicts(&self, tile: TileId) -> Result<TileVerdicts> {
        TileVerdicts::decode(&self.ground.get(tile.index())?)
    }

    /// One section of the payload of a tile, decoded.
    pub(crate) fn section<T: serde::de::DeserializeOwned>(&self, tile: TileId, section: usize) -> Result<T> {
        codec::decode(&self.ground.reader(tile.index())?.read_section(section)?)
    }

    /// Approximate number of points of objects in a tile and within `reach` of it. Their share is assumed to
    /// be the same as in the core.
    pub(crate) fn object_points(&self, tile: usize, reach: i64) -> u64 {
        let plan = self.tiled.plan;
        let core = u128::from(plan.tiles[tile].points.max(1));
        let all = u128::from(plan.region_points(tile, reach)) * u128::from(self.objects[tile]);
        u64::try_from(all / core).unwrap_or(u64::MAX)
    }

    /// The `wanted` points of a region with the stored further fields.
    pub(crate) fn gather(
        &self,
        region: &Region,
        wanted: Wanted,
        fields: Option<&StoredFields>,
    ) -> Result<Gathered> {
        let verdicts = region.tiles.iter().map(|&tile| self.verdicts(tile)).collect::<Result<Vec<_>>>()?;
        let mut gathered = self.tiled.gather(region, wanted, &verdicts)?;
        if let Some(fields) = fields {
            gathered.cloud.fields = fields.of_points(self.tiled.drive, &gathered.cloud.id)?;
        }
        Ok(gathered)
    }
}

fn out_of_range(_: HeightOutOfRange) -> Error {
    Error::bug("a height does not fit the surveyed range")
}

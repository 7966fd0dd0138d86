//! The points of a tile: which blocks to read, and the gathering out of them.

use crate::error::{Error, Result};
use crate::model::RecordView;
use crate::run::drive::Drive;
use crate::run::fields_pass::StoredFields;
use crate::run::scatter_pass::{STRIDE, Scattered};
use crate::run::scene::Scene;
use crate::spatial::BlockZone;
use crate::store::StoreError;
use crate::tiling::{Gathered, Gatherer, HeightOutOfRange, Plan, Region, Wanted};

/// Tiles over a drive.
#[derive(Clone, Copy)]
pub(crate) struct Tiles<'a> {
    pub(crate) drive: &'a Drive,
    pub(crate) plan: &'a Plan,
    /// Zone map: blocks of each file.
    pub(crate) zones: &'a [Vec<BlockZone>],
    /// Smallest lattice z of the drive.
    pub(crate) lowest: i64,
    /// The points grouped by tile, where the order of the records is bad.
    pub(crate) scattered: Option<&'a Scattered>,
    /// Points of objects in the core of each tile; none before the ground pass is done.
    pub(crate) objects: &'a [u64],
    /// Further fields of the points, where a method asked for them.
    pub(crate) fields: Option<&'a StoredFields>,
}

impl<'a> Tiles<'a> {
    /// The tiles of a plan, reading whole blocks.
    pub(crate) fn of(drive: &'a Drive, plan: &'a Plan, scene: &'a Scene) -> Self {
        Self {
            drive,
            plan,
            zones: &scene.survey.zones,
            lowest: scene.lowest(),
            scattered: None,
            objects: &[],
            fields: None,
        }
    }
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

    /// Records read per point needed, when tiles read whole blocks.
    pub(crate) fn amplification(&self, reach: i64) -> f64 {
        let (mut read, mut needed) = (0, 0);
        for tile in 0..self.plan.tiles.len() {
            let region = self.plan.region(tile, reach);
            read += self.records_read(&region);
            needed += region.points;
        }
        read as f64 / needed.max(1) as f64
    }

    /// Points of objects in a tile and within `reach` of it, about: their share is taken for that in the core. After the ground
    /// pass.
    pub(crate) fn object_points(&self, tile: usize, reach: i64) -> u64 {
        let points = self.plan.region_points(tile, reach);
        let core = u128::from(self.plan.tiles[tile].points.max(1));
        let objects = u128::from(self.objects[tile]);
        u64::try_from(u128::from(points) * objects / core).unwrap_or(u64::MAX)
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

    /// The points of a tile and of everything within `reach` of it that are `wanted`; classes are those that the
    /// ground pass has found.
    pub(crate) fn gather(&self, tile: usize, reach: i64, wanted: Wanted) -> Result<Gathered> {
        self.gather_region(&self.plan.region(tile, reach), wanted)
    }

    /// The `wanted` points of a region.
    pub(crate) fn gather_region(&self, region: &Region, wanted: Wanted) -> Result<Gathered> {
        self.drive.check_unchanged()?;
        let mut gatherer = Gatherer::new(region, self.drive.lattice(), self.lowest, wanted);
        let classified = wanted != Wanted::All;
        match self.scattered {
            Some(scattered) => self.gather_groups(scattered, region, &mut gatherer, classified)?,
            None => self.gather_blocks(region, &mut gatherer, classified)?,
        }
        let mut gathered = gatherer.finish();
        if let Some(fields) = self.fields {
            gathered.cloud.fields = fields.of_points(self.drive, &gathered.cloud.id)?;
        }
        Ok(gathered)
    }

    fn gather_blocks(&self, region: &Region, gatherer: &mut Gatherer<'_>, classified: bool) -> Result<()> {
        let (mut buffer, mut classes) = (Vec::new(), Vec::new());
        for (file, block) in self.blocks(region) {
            if classified {
                let run = &self.drive.file(file).blocks()[block];
                self.classes(file, run.first_record, run.count.into(), &mut classes)?;
            }
            let first_id = self.drive.first_id(file, block);
            let wanted = classified.then_some(&classes[..]);
            self.drive
                .geometry(file, block, &mut buffer, |view, transform| {
                    gatherer.block(view, transform, |record, _| first_id + record as u64, wanted)
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
        classified: bool,
    ) -> Result<()> {
        let (mut classes, mut wanted) = (Vec::new(), Vec::new());
        for group in scattered.groups(&region.tiles) {
            let group = group?;
            let record = |bytes: &[u8]| u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]);
            if classified && !group.bytes.is_empty() {
                self.classes(group.file, group.first_record, group.records, &mut classes)?;
                wanted.clear();
                wanted.extend(group.bytes.chunks_exact(STRIDE).map(|bytes| classes[record(bytes) as usize]));
            }
            let first_id = self.drive.catalog.first_id(group.file) + group.first_record;
            let view = RecordView { bytes: &group.bytes, stride: STRIDE, gps_time: None };
            let transform = self.drive.file(group.file).transform();
            let id = |_: usize, bytes: &[u8]| first_id + u64::from(record(bytes));
            gatherer.block(&view, transform, id, classified.then_some(&wanted[..])).map_err(out_of_range)?;
        }
        Ok(())
    }

    /// Class codes of consecutive records.
    fn classes(&self, file: usize, first: u64, count: u64, classes: &mut Vec<u8>) -> Result<()> {
        let column = &self.drive.classes[file];
        classes.resize(usize::try_from(count).unwrap_or(0), 0);
        Ok(column.read(first, classes).map_err(StoreError::io("read", column.path()))?)
    }
}

fn out_of_range(_: HeightOutOfRange) -> Error {
    Error::bug("a height does not fit the surveyed range".to_owned())
}

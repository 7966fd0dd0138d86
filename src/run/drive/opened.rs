//! The opened drive: files, lattice, raster, blocks of records with their geometry, and the units of passes
//! that read it in order.

use std::ops::Range;
use std::sync::OnceLock;

use bytemuck::Pod;

use crate::config::Config;
use crate::error::Result;
use crate::input::{Catalog, Fields, InputFile};
use crate::model::{FileId, FlagPlace, Lattice, LatticeTransform, PointId, RecordView};
use crate::run::drive::per_point::PerPoint;
use crate::run::engine::Payloads;
use crate::spatial::CellGrid;
use crate::survey::{Collector, SurveyError};

/// Smallest and largest number of points of one unit of a pass over blocks. A unit is in memory as a whole
/// before it is stored, with up to 16 bytes per point, so the largest does not grow with the drive.
const UNIT_POINTS: (u64, u64) = (200_000, 1_000_000);
/// Number of records whose values are read at once.
const PAGE: u64 = 65_536;
/// Approximate number of units into which passes over blocks divide a drive.
const UNITS_PER_DRIVE: u64 = 256;

/// Consecutive blocks of one file: the unit of passes that read the input in order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct BlockRun {
    /// Number of the file in the catalog.
    pub(crate) file: usize,
    /// Its blocks.
    pub(crate) blocks: Range<usize>,
    /// Number of their records.
    pub(crate) points: u64,
}

/// A record as it is unpacked: x, y and z as in the record, and whether it is withheld.
type UnpackedRecord = [u8; 13];
/// Where it says that it is withheld.
const UNPACKED_WITHHELD: FlagPlace = FlagPlace { offset: 12, mask: 1 };

/// The records of a unit of a compressed file, as the survey unpacks them.
#[derive(Debug, Default)]
pub(crate) struct Unpacked {
    /// x, y and z as in the record.
    pub(crate) positions: Vec<[i32; 3]>,
    /// 1 if the record is withheld, else 0.
    pub(crate) withheld: Vec<u8>,
}

/// The same for all compressed files, as it is stored.
#[derive(Debug)]
pub(crate) struct Positions {
    pub(crate) positions: PerPoint<[i32; 3]>,
    /// Only of units with withheld records.
    pub(crate) withheld: PerPoint<u8>,
}

/// The drive.
#[derive(Debug)]
pub(crate) struct Drive {
    pub(crate) catalog: Catalog,
    pub(crate) grid: CellGrid,
    /// Positions of compressed files. Known after the survey has unpacked them.
    positions: OnceLock<Positions>,
}

impl Drive {
    /// The drive of `catalog`.
    pub(crate) fn new(catalog: Catalog, config: &Config) -> Self {
        let grid = CellGrid::new(catalog.lattice().units(config.tiling.cell));
        Self { catalog, grid, positions: OnceLock::new() }
    }

    /// From now on the positions of compressed files are read from here.
    pub(crate) fn use_positions(&self, positions: Positions) {
        // A process completes the survey once. A second time would give the same positions.
        let _ = self.positions.set(positions);
    }

    pub(crate) fn lattice(&self) -> Lattice {
        self.catalog.lattice()
    }

    pub(crate) fn file(&self, file: usize) -> &InputFile {
        &self.catalog.files()[file]
    }

    /// Id of the first record of a block.
    pub(crate) fn first_id(&self, file: usize, block: usize) -> PointId {
        self.catalog.first_id(file) + self.file(file).blocks()[block].first_record
    }

    /// File of a point.
    pub(crate) fn file_of(&self, id: PointId) -> FileId {
        FileId::at(self.locate(id).0)
    }

    /// File and record of a point.
    pub(crate) fn locate(&self, id: PointId) -> (usize, u64) {
        let file = self.catalog.file_of(id);
        (file, id - self.catalog.first_id(file))
    }

    /// The drive divided into runs of consecutive blocks, a pure function of the input.
    pub(crate) fn block_runs(&self) -> Vec<BlockRun> {
        let target = (self.catalog.point_count() / UNITS_PER_DRIVE).clamp(UNIT_POINTS.0, UNIT_POINTS.1);
        let mut runs: Vec<BlockRun> = Vec::new();
        for (number, file) in self.catalog.files().iter().enumerate() {
            for (index, block) in file.blocks().iter().enumerate() {
                let points = u64::from(block.count);
                match runs.last_mut() {
                    Some(run) if run.file == number && run.points < target => {
                        run.blocks.end = index + 1;
                        run.points += points;
                    }
                    _ => runs.push(BlockRun { file: number, blocks: index..index + 1, points }),
                }
            }
        }
        runs
    }

    /// Memory of a unit that works block by block: bytes of the largest block of a run, decoded, with `more`
    /// bytes per record.
    pub(crate) fn largest_block_bytes(&self, run: &BlockRun, more: u64) -> u64 {
        let file = self.file(run.file);
        let records =
            run.blocks.clone().map(|block| u64::from(file.blocks()[block].count)).max().unwrap_or(0);
        records * (file.layout().record_len as u64 + more)
    }

    /// Surveys a block directly from the file (decoded, if compressed). Adds its records to `unpacked` if
    /// that is given.
    pub(crate) fn survey_block(
        &self,
        (file, block): (usize, usize),
        unpacked: Option<&mut Unpacked>,
        buffer: &mut Vec<u8>,
        collector: &mut Collector,
    ) -> Result<()> {
        let input = self.file(file);
        let layout = input.layout();
        let run = &input.blocks()[block];
        {
            let view = layout.view(input.records(block, Fields::Geometry, buffer)?);
            if let Some(Unpacked { positions, withheld }) = unpacked {
                positions.extend(view.xyz());
                let records = view.bytes.chunks_exact(view.stride);
                withheld.extend(records.map(|record| u8::from(view.is_withheld(record))));
            }
            collector.block(&view, input.transform()).map_err(|absurd| SurveyError::Position {
                path: input.path().to_owned(),
                record: run.first_record + absurd.record as u64,
                xyz: absurd.xyz,
            })?;
        }
        input.release(block);
        Ok(())
    }

    /// The geometry of a block: from the mapped file, or from the unpacked positions of a compressed one.
    pub(crate) fn geometry<T>(
        &self,
        file: usize,
        block: usize,
        buffer: &mut Vec<u8>,
        see: impl FnOnce(&RecordView<'_>, &LatticeTransform) -> T,
    ) -> Result<T> {
        let input = self.file(file);
        let run = &input.blocks()[block];
        if let Some(Positions { positions, withheld }) =
            self.positions.get().filter(|_| input.is_compressed())
        {
            let mut xyz = vec![[0_i32; 3]; run.count as usize];
            positions.read(file, run.first_record, &mut xyz)?;
            let mut flags = vec![0; xyz.len()];
            withheld.read(file, run.first_record, &mut flags)?;
            let plain = RecordView {
                bytes: bytemuck::cast_slice(&xyz),
                stride: size_of::<[i32; 3]>(),
                gps_time: None,
                withheld: None,
            };
            if flags.iter().all(|flag| *flag == 0) {
                return Ok(see(&plain, input.transform()));
            }
            let records = plain.bytes.chunks_exact(plain.stride).zip(&flags);
            let mut flagged = Vec::with_capacity(flags.len() * size_of::<UnpackedRecord>());
            for (record, flag) in records {
                flagged.extend_from_slice(record);
                flagged.push(*flag);
            }
            let stride = size_of::<UnpackedRecord>();
            let view = RecordView { bytes: &flagged, stride, withheld: Some(UNPACKED_WITHHELD), ..plain };
            return Ok(see(&view, input.transform()));
        }
        let seen;
        {
            let view = input.layout().view(input.records(block, Fields::Geometry, buffer)?);
            seen = see(&view, input.transform());
        }
        input.release(block);
        Ok(seen)
    }

    /// One value per point from section `number` of the units of a pass over `runs`.
    pub(crate) fn per_point<T: Pod + Default>(
        &self,
        runs: &[BlockRun],
        units: &Payloads,
        number: usize,
    ) -> PerPoint<T> {
        PerPoint::new(runs.iter().map(|run| self.records_of(run)).collect(), units, number)
    }

    /// The same, if only units with `has` have the section. Other records have the default.
    pub(crate) fn per_point_of<T: Pod + Default>(
        &self,
        runs: &[BlockRun],
        units: &Payloads,
        number: usize,
        has: &[bool],
    ) -> PerPoint<T> {
        let records = |(run, has): (&BlockRun, &bool)| {
            let (file, records) = self.records_of(run);
            (file, records.start..if *has { records.end } else { records.start })
        };
        PerPoint::new(runs.iter().zip(has).map(records).collect(), units, number)
    }

    /// File and records of a run.
    fn records_of(&self, run: &BlockRun) -> (usize, Range<u64>) {
        let block = self.file(run.file).blocks().get(run.blocks.start);
        let first = block.map_or(0, |block| block.first_record);
        (run.file, first..first + run.points)
    }

    /// The values of points by their ids. The ids are mostly ascending.
    pub(crate) fn values_of<T: Pod + Default>(
        &self,
        values: &PerPoint<T>,
        ids: &[PointId],
    ) -> Result<Vec<T>> {
        let mut found = Vec::with_capacity(ids.len());
        let mut page = Vec::new();
        let mut page_ids = PointId::default()..PointId::default();
        for &id in ids {
            if !page_ids.contains(&id) {
                let (file, record) = self.locate(id);
                let first = record / PAGE * PAGE;
                let count = PAGE.min(self.file(file).point_count() - first);
                page.resize(usize::try_from(count).unwrap_or(0), T::default());
                values.read(file, first, &mut page)?;
                let first_id = self.catalog.first_id(file) + first;
                page_ids = first_id..first_id + count;
            }
            found.push(page[usize::try_from(id - page_ids.start).unwrap_or(0)]);
        }
        Ok(found)
    }

    /// Whether every file is unchanged since it was opened.
    pub(crate) fn check_unchanged(&self) -> Result<()> {
        for file in self.catalog.files() {
            file.check_unchanged()?;
        }
        Ok(())
    }
}

//! The opened drive: files, lattice, raster, blocks of records with their geometry, and the units of passes
//! that read it in order.

use std::ops::Range;

use crate::config::Config;
use crate::error::Result;
use crate::input::{Catalog, Fields, InputFile};
use crate::model::{FileId, Lattice, LatticeTransform, PointId, RecordView};
use crate::run::drive::columns::sync_columns;
use crate::spatial::CellGrid;
use crate::store::{Column, RunDir, StoreError};
use crate::survey::{Collector, SurveyError};

/// Smallest and largest number of points of one unit of a pass over blocks.
const UNIT_POINTS: (u64, u64) = (200_000, 8_000_000);
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

/// Record coordinates of compressed files, unpacked once: x, y, z as in the records, twelve bytes per record.
type Positions = Column<[i32; 3]>;

/// The drive.
#[derive(Debug)]
pub(crate) struct Drive {
    pub(crate) catalog: Catalog,
    pub(crate) grid: CellGrid,
    /// Only for compressed files.
    positions: Vec<Option<Positions>>,
}

impl Drive {
    /// The drive of `catalog` without columns: enough to survey and to plan.
    pub(crate) fn without_columns(catalog: Catalog, config: &Config) -> Self {
        let grid = CellGrid::new(catalog.lattice().units(config.tiling.cell));
        let positions = catalog.files().iter().map(|_| None).collect();
        Self { catalog, grid, positions }
    }

    /// The drive of `catalog` with its columns in `run_dir`; the pass with the folder `survey` fills them.
    pub(crate) fn open(catalog: Catalog, config: &Config, run_dir: &RunDir, survey: &str) -> Result<Self> {
        let mut drive = Self::without_columns(catalog, config);
        drive.positions.clear();
        for (number, file) in drive.catalog.files().iter().enumerate() {
            let unpacked = file.is_compressed();
            let column = || run_dir.column("positions", number, file.point_count(), survey);
            drive.positions.push(unpacked.then(column).transpose()?);
        }
        Ok(drive)
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
        let file =
            (0..self.catalog.files().len()).rfind(|&file| self.catalog.first_id(file) <= id).unwrap_or(0);
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

    /// Surveys a block directly from the file (decoded, if compressed), and unpacks its positions if
    /// requested.
    pub(crate) fn survey_block(
        &self,
        (file, block): (usize, usize),
        unpack: bool,
        buffer: &mut Vec<u8>,
        collector: &mut Collector,
    ) -> Result<()> {
        let input = self.file(file);
        let layout = input.layout();
        let run = &input.blocks()[block];
        {
            let bytes = input.records(block, Fields::Geometry, buffer)?;
            let view = RecordView { bytes, stride: layout.record_len, gps_time: layout.gps_time };
            if let Some(positions) = self.positions[file].as_ref().filter(|_| unpack) {
                let xyz: Vec<[i32; 3]> = view.xyz().collect();
                positions
                    .write_run(run.first_record, &xyz)
                    .map_err(StoreError::io("write", positions.path()))?;
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

    /// Syncs all unpacked positions to the disk.
    pub(crate) fn sync_positions(&self) -> Result<()> {
        sync_columns(self.positions.iter().flatten())
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
        if let Some(positions) = &self.positions[file] {
            let mut xyz = vec![[0_i32; 3]; run.count as usize];
            positions.read(run.first_record, &mut xyz).map_err(StoreError::io("read", positions.path()))?;
            let view = RecordView { bytes: bytemuck::cast_slice(&xyz), stride: 12, gps_time: None };
            return Ok(see(&view, input.transform()));
        }
        let seen;
        {
            let bytes = input.records(block, Fields::Geometry, buffer)?;
            let layout = input.layout();
            let view = RecordView { bytes, stride: layout.record_len, gps_time: layout.gps_time };
            seen = see(&view, input.transform());
        }
        input.release(block);
        Ok(seen)
    }

    /// Whether every file is unchanged since it was opened.
    pub(crate) fn check_unchanged(&self) -> Result<()> {
        for file in self.catalog.files() {
            file.check_unchanged()?;
        }
        Ok(())
    }
}

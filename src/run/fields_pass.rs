//! Pass `fields`: further fields of every point (intensity, colours) in columns of their own, and exact sums of every
//! field that distances are to be taken in, over all points of the drive, ground and noise included.

use crate::codec;
use crate::error::Result;
use crate::input::{Fields, InputError};
use crate::model::{Field, FieldSums, RecordView, record_xyz};
use crate::run::drive::{BlockRun, Drive};
use crate::run::engine::Pass;
use crate::run::inputs;
use crate::store::{Column, PassDir, RunDir, StoreError};

/// Records that are read from a column at once.
const PAGE: u64 = 65_536;

/// Columns of further fields.
#[derive(Debug)]
pub(crate) struct StoredFields {
    /// Fields in all, coordinates among them.
    dimensions: usize,
    /// For each field a column per file.
    columns: Vec<(Field, Vec<Column<u16>>)>,
}

impl StoredFields {
    /// Opens or creates the columns of those of `fields` that are no coordinates.
    ///
    /// # Errors
    /// When a file has no such field.
    pub(crate) fn open(drive: &Drive, fields: &[Field], run_dir: &RunDir) -> Result<Self> {
        let mut columns = Vec::new();
        for &field in fields.iter().filter(|field| field.axis().is_none()) {
            let mut files = Vec::new();
            for (number, file) in drive.catalog.files().iter().enumerate() {
                if file.layout().field(field).is_none() {
                    let (path, point_format) = (file.path().to_owned(), file.layout().point_format);
                    return Err(InputError::NoField { path, point_format, field: field.name() }.into());
                }
                let name = format!("field-{}", field.name());
                files.push(run_dir.column(&name, number, file.point_count(), inputs::FIELDS)?);
            }
            columns.push((field, files));
        }
        Ok(Self { dimensions: fields.len(), columns })
    }

    /// Fields in all, coordinates among them.
    pub(crate) fn dimensions(&self) -> usize {
        self.dimensions
    }

    /// The fields of points by their ids, which ascend mostly.
    pub(crate) fn of_points(&self, drive: &Drive, ids: &[u64]) -> Result<Vec<(Field, Vec<u16>)>> {
        let mut fields = Vec::new();
        for (field, columns) in &self.columns {
            let mut values = Vec::with_capacity(ids.len());
            let (mut page, mut page_ids) = (Vec::new(), 0..0);
            for &id in ids {
                if !page_ids.contains(&id) {
                    let (file, record) = drive.locate(id);
                    let first = record / PAGE * PAGE;
                    let count = PAGE.min(drive.file(file).point_count() - first);
                    page.resize(usize::try_from(count).unwrap_or(0), 0);
                    let column = &columns[file];
                    column.read(first, &mut page).map_err(StoreError::io("read", column.path()))?;
                    let first_id = drive.catalog.first_id(file) + first;
                    page_ids = first_id..first_id + count;
                }
                values.push(page[usize::try_from(id - page_ids.start).unwrap_or(0)]);
            }
            fields.push((*field, values));
        }
        Ok(fields)
    }
}

pub(crate) struct FieldsPass<'a> {
    pub(crate) drive: &'a Drive,
    pub(crate) runs: Vec<BlockRun>,
    /// The fields that distances are taken in, coordinates among them.
    pub(crate) fields: &'a [Field],
    pub(crate) stored: &'a StoredFields,
}

impl FieldsPass<'_> {
    fn block(&self, file: usize, block: usize, buffer: &mut Vec<u8>, sums: &mut [FieldSums]) -> Result<()> {
        let input = self.drive.file(file);
        let (layout, transform) = (input.layout(), input.transform());
        let first_record = input.blocks()[block].first_record;
        {
            let bytes = input.records(block, Fields::All, buffer)?;
            let records = RecordView { bytes, stride: layout.record_len, gps_time: None }.bytes;
            let value =
                |record: &[u8], offset: usize| u16::from_le_bytes([record[offset], record[offset + 1]]);
            for (field, sums) in self.fields.iter().zip(sums.iter_mut()) {
                let records = records.chunks_exact(layout.record_len);
                match (field.axis(), layout.field(*field)) {
                    (Some(axis), _) => records.for_each(|r| sums.add(transform.apply(record_xyz(r))[axis])),
                    (None, Some(offset)) => records.for_each(|r| sums.add(value(r, offset).into())),
                    (None, None) => {}
                }
            }
            for (field, columns) in &self.stored.columns {
                let Some(offset) = layout.field(*field) else { continue };
                let values: Vec<u16> =
                    records.chunks_exact(layout.record_len).map(|record| value(record, offset)).collect();
                let column = &columns[file];
                column.write_run(first_record, &values).map_err(StoreError::io("write", column.path()))?;
            }
        }
        input.release(block);
        Ok(())
    }

    /// Sums of each field over the drive, from the finished pass.
    pub(crate) fn reduce(&self, dir: &PassDir) -> Result<Vec<(Field, FieldSums)>> {
        let mut sums = vec![FieldSums::default(); self.fields.len()];
        for unit in 0..self.units() {
            let part: Vec<FieldSums> = codec::decode(&dir.payload(unit)?)?;
            sums.iter_mut().zip(&part).for_each(|(sums, part)| sums.merge(part));
        }
        Ok(self.fields.iter().copied().zip(sums).collect())
    }
}

impl Pass for FieldsPass<'_> {
    fn name(&self) -> &'static str {
        "fields"
    }

    fn units(&self) -> usize {
        self.runs.len()
    }

    fn points(&self, unit: usize) -> u64 {
        self.runs[unit].points
    }

    fn bytes(&self, unit: usize) -> u64 {
        self.drive.largest_block_bytes(&self.runs[unit], 2)
    }

    fn run(&self, unit: usize) -> Result<Vec<u8>> {
        let run = &self.runs[unit];
        self.drive.file(run.file).check_unchanged()?;
        let mut sums = vec![FieldSums::default(); self.fields.len()];
        let mut buffer = Vec::new();
        for block in run.blocks.clone() {
            self.block(run.file, block, &mut buffer, &mut sums)?;
        }
        for (_, columns) in &self.stored.columns {
            let column = &columns[run.file];
            column.sync().map_err(StoreError::io("sync", column.path()))?;
        }
        codec::encode(&sums)
    }
}

//! Pass `fields`: writes further fields of every point (intensity, colours) to columns, and computes exact
//! sums of every field in which distances are measured, over all points of the drive, ground and noise
//! included.

use crate::codec;
use crate::error::Result;
use crate::input::Fields;
use crate::model::{Field, FieldSums, RecordView, record_xyz};
use crate::run::drive::{BlockRun, Drive, StoredFields, Surveyed};
use crate::run::engine::{Outline, Pass, Payloads, prefix};
use crate::run::passes::ground::ALGORITHM_EPOCH;
use crate::store::{Inputs, PassDir, RunDir};

const NUMBER: u32 = 1;
const NAME: &str = "fields";

/// Prefix of the folder of the pass.
pub(crate) fn writers() -> String {
    format!("{}{NAME}", prefix(NUMBER))
}

/// The pass depends on the content of the input and on the names of the fields.
pub(crate) fn outline(surveyed: &Surveyed, fields: &[Field]) -> Outline {
    let names: Vec<&str> = fields.iter().map(|field| field.name()).collect();
    let depends = Inputs::new()
        .with("algorithm epoch", ALGORITHM_EPOCH)
        .with("input content", format!("{:016x}", surveyed.content_digest()))
        .with("fields", names.join(" "));
    Outline::new(NUMBER, NAME, depends)
}

pub(crate) struct FieldsPass<'a> {
    drive: &'a Drive,
    run_dir: &'a RunDir,
    runs: Vec<BlockRun>,
    stored: &'a StoredFields,
    outline: Outline,
}

impl<'a> FieldsPass<'a> {
    pub(crate) fn of(
        drive: &'a Drive,
        stored: &'a StoredFields,
        run_dir: &'a RunDir,
        outline: Outline,
    ) -> Self {
        Self { drive, run_dir, runs: drive.block_runs(), stored, outline }
    }
}

impl FieldsPass<'_> {
    fn block(&self, file: usize, block: usize, buffer: &mut Vec<u8>, sums: &mut [FieldSums]) -> Result<()> {
        let input = self.drive.file(file);
        let layout = input.layout();
        let transform = input.transform();
        let first_record = input.blocks()[block].first_record;
        {
            let bytes = input.records(block, Fields::All, buffer)?;
            let records = RecordView { bytes, stride: layout.record_len, gps_time: None }.bytes;
            for (field, sums) in self.stored.fields.iter().zip(sums.iter_mut()) {
                let records = records.chunks_exact(layout.record_len);
                match (field.axis(), layout.field(*field)) {
                    (Some(axis), _) => records.for_each(|r| sums.add(transform.apply(record_xyz(r))[axis])),
                    (None, Some(place)) => records.for_each(|r| sums.add(place.value(r).into())),
                    (None, None) => {}
                }
            }
            for (field, column) in &self.stored.columns {
                let Some(place) = layout.field(*field) else { continue };
                let values: Vec<u16> =
                    records.chunks_exact(layout.record_len).map(|record| place.value(record)).collect();
                column.write_run(file, first_record, &values)?;
            }
        }
        input.release(block);
        Ok(())
    }
}

impl Pass for FieldsPass<'_> {
    type Global = Vec<(Field, FieldSums)>;

    fn outline(&self) -> &Outline {
        &self.outline
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

    fn prepare(&self, _dir: &PassDir) -> Result<()> {
        self.stored.open(self.run_dir, self.drive)
    }

    fn run(&self, unit: usize) -> Result<Vec<u8>> {
        let run = &self.runs[unit];
        self.drive.file(run.file).check_unchanged()?;
        let mut sums = vec![FieldSums::default(); self.stored.fields.len()];
        let mut buffer = Vec::new();
        for block in run.blocks.clone() {
            self.block(run.file, block, &mut buffer, &mut sums)?;
        }
        codec::encode(&sums)
    }

    fn sync(&self) -> Result<()> {
        self.stored.columns.iter().try_for_each(|(_, column)| column.sync())
    }

    /// Sums of each field over the drive.
    fn reduce(&self, payloads: &Payloads) -> Result<Vec<(Field, FieldSums)>> {
        let mut sums = vec![FieldSums::default(); self.stored.fields.len()];
        for unit in 0..self.units() {
            let part: Vec<FieldSums> = codec::decode(&payloads.get(unit)?)?;
            sums.iter_mut().zip(&part).for_each(|(sums, part)| sums.merge(part));
        }
        Ok(self.stored.fields.iter().copied().zip(sums).collect())
    }
}

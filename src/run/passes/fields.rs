//! Pass `fields`: stores further fields of every point (intensity, colours), and computes exact sums over all
//! points of the drive, ground and noise included, withheld points not, of every field in which distances are
//! measured.
//!
//! ```text
//! payload := sums values*        sections; values (u16) of each field that is not a coordinate
//! ```

use crate::codec;
use crate::error::Result;
use crate::input::Fields;
use crate::model::{Field, FieldSums, record_xyz};
use crate::run::drive::{BlockRun, Drive, StoredFields, Surveyed, stored_fields};
use crate::run::engine::{Outline, Pass, Payloads};
use crate::run::passes::ground::ALGORITHM_EPOCH;
use crate::store::Inputs;

const NUMBER: u32 = 1;
const NAME: &str = "fields";

/// Sections of the payload of a unit: sums, and the values of the first field.
const SUMS: usize = 0;
const VALUES: usize = 1;

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
    runs: Vec<BlockRun>,
    /// The fields that a method asks for, coordinates included.
    fields: &'a [Field],
    /// The fields that are not coordinates.
    stored: Vec<Field>,
    outline: Outline,
}

impl<'a> FieldsPass<'a> {
    /// The pass for these fields.
    ///
    /// # Errors
    /// When a file has no such field.
    pub(crate) fn of(drive: &'a Drive, fields: &'a [Field], outline: Outline) -> Result<Self> {
        Ok(Self { drive, runs: drive.block_runs(), fields, stored: stored_fields(drive, fields)?, outline })
    }
}

/// The result of a unit.
struct Found {
    sums: Vec<FieldSums>,
    /// Values of the fields that are not coordinates.
    values: Vec<Vec<u16>>,
}

impl FieldsPass<'_> {
    fn block(&self, file: usize, block: usize, buffer: &mut Vec<u8>, found: &mut Found) -> Result<()> {
        let input = self.drive.file(file);
        let layout = input.layout();
        let transform = input.transform();
        {
            let bytes = input.records(block, Fields::All, buffer)?;
            let records = bytes;
            for (field, sums) in self.fields.iter().zip(&mut found.sums) {
                let records = records.chunks_exact(layout.record_len);
                let records = records.filter(|record| !layout.withheld.is_set(record));
                match (field.axis(), layout.field(*field)) {
                    (Some(axis), _) => records.for_each(|r| sums.add(transform.apply(record_xyz(r))[axis])),
                    (None, Some(place)) => records.for_each(|r| sums.add(place.value(r).into())),
                    (None, None) => {}
                }
            }
            for (field, values) in self.stored.iter().zip(&mut found.values) {
                let Some(place) = layout.field(*field) else { continue };
                values.extend(records.chunks_exact(layout.record_len).map(|record| place.value(record)));
            }
        }
        input.release(block);
        Ok(())
    }
}

impl Pass for FieldsPass<'_> {
    type Global = (StoredFields, Vec<(Field, FieldSums)>);

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
        // A block as read, and the values of the unit, which are in memory twice while the unit is stored.
        let run = &self.runs[unit];
        self.drive.largest_block_bytes(run, 2) + run.points * 4 * self.stored.len() as u64
    }

    fn run(&self, unit: usize) -> Result<Vec<u8>> {
        let run = &self.runs[unit];
        self.drive.file(run.file).check_unchanged()?;
        let sums = vec![FieldSums::default(); self.fields.len()];
        let mut found = Found { sums, values: vec![Vec::new(); self.stored.len()] };
        let mut buffer = Vec::new();
        for block in run.blocks.clone() {
            self.block(run.file, block, &mut buffer, &mut found)?;
        }
        let sums = codec::encode(&found.sums)?;
        let values = found.values.iter().map(|values| bytemuck::cast_slice(values));
        Ok(codec::pack(&std::iter::once(&sums[..]).chain(values).collect::<Vec<&[u8]>>()))
    }

    /// The stored fields, and sums of each field over the drive.
    fn reduce(&self, payloads: &Payloads) -> Result<Self::Global> {
        let mut sums = vec![FieldSums::default(); self.fields.len()];
        for unit in 0..self.units() {
            let part: Vec<FieldSums> = codec::decode(&payloads.section(unit, SUMS)?)?;
            sums.iter_mut().zip(&part).for_each(|(sums, part)| sums.merge(part));
        }
        let column = |(field, number)| (field, self.drive.per_point(&self.runs, payloads, number));
        let columns = self.stored.iter().copied().zip(VALUES..).map(column).collect();
        Ok((StoredFields { columns }, self.fields.iter().copied().zip(sums).collect()))
    }
}

//! One small value per point (position, field, class, object), as a pass has stored it in its units. Each
//! unit has the values of a run of records, so every value has one writer and is covered by the checksum of
//! its unit.

use std::ops::Range;

use bytemuck::Pod;

use crate::error::Result;
use crate::run::engine::{Payloads, Sections};

/// One value per point of the drive.
#[derive(Debug)]
pub(crate) struct PerPoint<T> {
    sections: Sections,
    /// File and records of each unit, ascending.
    runs: Vec<(usize, Range<u64>)>,
    /// The value of records that are not in any unit.
    beside: T,
}

impl<T: Pod + Default> PerPoint<T> {
    const WIDTH: u64 = size_of::<T>() as u64;

    /// The values in section `number` of the units of a pass. `runs` are file and records of each unit.
    pub(crate) fn new(runs: Vec<(usize, Range<u64>)>, units: &Payloads, number: usize) -> Self {
        Self { sections: Sections::of(units.clone(), number), runs, beside: T::default() }
    }

    /// The same values, with `beside` instead of the default for records outside a section, which are not in
    /// any unit.
    pub(crate) fn with_beside(self, beside: T) -> Self {
        Self { beside, ..self }
    }

    /// Reads the values of consecutive records of a file.
    pub(crate) fn read(&self, file: usize, first: u64, values: &mut [T]) -> Result<()> {
        let mut record = first;
        let mut rest = values;
        while !rest.is_empty() {
            let after =
                self.runs.partition_point(|(other, records)| (*other, records.start) <= (file, record));
            let unit = after.checked_sub(1).filter(|&unit| {
                let (other, records) = &self.runs[unit];
                *other == file && records.contains(&record)
            });
            let next =
                self.runs.get(after).filter(|next| next.0 == file).map_or(u64::MAX, |next| next.1.start);
            let end = unit.map_or(next, |unit| self.runs[unit].1.end);
            let here = usize::try_from(end - record).unwrap_or(usize::MAX).min(rest.len());
            let (part, further) = rest.split_at_mut(here);
            match unit {
                Some(unit) => {
                    let at = (record - self.runs[unit].1.start) * Self::WIDTH;
                    self.sections.get(unit)?.read_into(at, bytemuck::cast_slice_mut(part))?;
                }
                None => part.fill(self.beside),
            }
            record += here as u64;
            rest = further;
        }
        Ok(())
    }
}

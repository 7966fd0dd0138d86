//! One small value per point (position, field, class, object), as a pass has stored it in its units. Each unit has the
//! values of a run of records, so every value has one writer and is covered by the checksum of its unit.

use std::marker::PhantomData;

use bytemuck::Pod;

use crate::error::{Error, Result};
use crate::run::engine::{Payloads, Sections};

/// One value per point of the drive.
#[derive(Debug)]
pub(crate) struct PerPoint<T> {
    sections: Sections,
    /// File and first record of each unit, ascending.
    starts: Vec<(usize, u64)>,
    value: PhantomData<T>,
}

impl<T: Pod + Default> PerPoint<T> {
    const WIDTH: u64 = size_of::<T>() as u64;

    /// The values in section `number` of the units of a pass. `starts` are file and first record of each unit.
    pub(crate) fn new(starts: Vec<(usize, u64)>, units: &Payloads, number: usize) -> Self {
        Self { sections: Sections::of(units.clone(), number), starts, value: PhantomData }
    }

    /// Reads the values of consecutive records of a file.
    pub(crate) fn read(&self, file: usize, first: u64, values: &mut [T]) -> Result<()> {
        let mut record = first;
        let mut rest = values;
        while !rest.is_empty() {
            let after = self.starts.partition_point(|start| *start <= (file, record));
            let unit = after.checked_sub(1).filter(|&unit| self.starts[unit].0 == file);
            let unit = unit.ok_or_else(|| Error::bug(format!("record {record} is in no unit")))?;
            let end = self.starts.get(after).filter(|next| next.0 == file).map_or(u64::MAX, |next| next.1);
            let here = usize::try_from(end - record).unwrap_or(usize::MAX).min(rest.len());
            let (part, further) = rest.split_at_mut(here);
            let at = (record - self.starts[unit].1) * Self::WIDTH;
            self.sections.get(unit)?.read_into(at, bytemuck::cast_slice_mut(part))?;
            record += here as u64;
            rest = further;
        }
        Ok(())
    }
}

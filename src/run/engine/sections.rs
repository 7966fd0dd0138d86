//! One section of the payloads of all units of a pass, read in parts. A bounded number of files is open at a
//! time, because a long drive has more units than a process may open files.

use std::collections::VecDeque;
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use crate::error::{Error, Result};
use crate::run::engine::pass::Payloads;
use crate::store::UnitReader;

/// Number of files that stay open. Chosen: a tenth of the usual limit of 1,024 per process.
const OPEN: usize = 100;

/// The section of every unit.
#[derive(Debug)]
pub(crate) struct Sections {
    payloads: Payloads,
    number: usize,
    /// The most recently used sections, the latest last.
    open: Mutex<VecDeque<(usize, Arc<Section>)>>,
}

/// The section of one unit.
#[derive(Debug)]
pub(crate) struct Section {
    reader: UnitReader,
    range: Range<u64>,
}

impl Sections {
    /// Section `number` of these payloads.
    pub(crate) fn of(payloads: Payloads, number: usize) -> Self {
        Self { payloads, number, open: Mutex::default() }
    }

    /// The section of a unit.
    pub(crate) fn get(&self, unit: usize) -> Result<Arc<Section>> {
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(at) = open.iter().rposition(|(other, _)| *other == unit)
            && let Some((_, section)) = open.remove(at)
        {
            open.push_back((unit, Arc::clone(&section)));
            return Ok(section);
        }
        let reader = self.payloads.reader(unit)?;
        let range = reader.section(self.number)?;
        let section = Arc::new(Section { reader, range });
        if open.len() >= OPEN {
            open.pop_front();
        }
        open.push_back((unit, Arc::clone(&section)));
        Ok(section)
    }
}

impl Section {
    /// Bytes of the section.
    pub(crate) fn read(&self, range: Range<u64>) -> Result<Vec<u8>> {
        let mut bytes = vec![0; usize::try_from(range.end - range.start).unwrap_or(0)];
        self.read_into(range.start, &mut bytes)?;
        Ok(bytes)
    }

    /// Fills a buffer with the bytes of the section from an offset on.
    pub(crate) fn read_into(&self, at: u64, bytes: &mut [u8]) -> Result<()> {
        if at + bytes.len() as u64 > self.range.end - self.range.start {
            return Err(Error::bug(format!("a section ends before byte {}", at + bytes.len() as u64)));
        }
        Ok(self.reader.read_into(self.range.start + at, bytes)?)
    }
}

//! What a pass is. It says everything about itself: units, what they need, what it depends on, what a unit computes, and
//! what the drive knows once all units are done.

use crate::error::{Error, Result};
use crate::run::engine::folders::Outline;
use crate::store::{PassDir, UnitReader};

/// One pass over units.
pub(crate) trait Pass: Sync {
    /// What the drive knows once the pass is complete.
    type Global;

    /// Name, folder, and what the pass depends on.
    fn outline(&self) -> &Outline;

    /// Number of units.
    fn units(&self) -> usize;

    /// Points of a unit, for progress.
    fn points(&self, unit: usize) -> u64;

    /// Estimated bytes that a unit in flight needs.
    fn bytes(&self, unit: usize) -> u64;

    /// Makes ready what units write beside their payloads, before any of them runs; may invalidate units for which that
    /// was lost.
    fn prepare(&self, _dir: &PassDir) -> Result<()> {
        Ok(())
    }

    /// Asks the system to read ahead what `unit` will need.
    fn prefetch(&self, _unit: usize) {}

    /// Computes a unit: returns its payload, and may write beside it what [`Pass::sync`] makes durable.
    fn run(&self, unit: usize) -> Result<Vec<u8>>;

    /// Makes everything that finished units wrote beside their payloads survive a power cut.
    fn sync(&self) -> Result<()> {
        Ok(())
    }

    /// The reduction at the barrier: reads payloads in unit order.
    fn reduce(&self, payloads: &Payloads) -> Result<Self::Global>;
}

/// The payloads of a complete pass, by unit.
#[derive(Debug, Clone)]
pub(crate) enum Payloads {
    /// On disk.
    Stored(PassDir),
    /// In memory, of passes that are run without a run directory.
    InMemory(Vec<Vec<u8>>),
}

impl Payloads {
    /// The payload of a unit.
    pub(crate) fn get(&self, unit: usize) -> Result<Vec<u8>> {
        match self {
            Self::Stored(dir) => Ok(dir.payload(unit)?),
            Self::InMemory(payloads) => payloads.get(unit).cloned().ok_or_else(|| no_unit(unit)),
        }
    }

    /// A reader of parts of the payload of a unit.
    pub(crate) fn reader(&self, unit: usize) -> Result<UnitReader> {
        Ok(self.dir()?.reader(unit)?)
    }

    /// The folder of the pass.
    pub(crate) fn dir(&self) -> Result<&PassDir> {
        match self {
            Self::Stored(dir) => Ok(dir),
            Self::InMemory(_) => Err(Error::bug("a pass in memory has no folder")),
        }
    }
}

fn no_unit(unit: usize) -> Error {
    Error::bug(format!("unit {unit} was not computed"))
}

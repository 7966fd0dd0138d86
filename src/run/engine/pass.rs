//! The trait of passes. A pass declares its units, their memory and the values that they depend on; it
//! computes a unit; and it reduces all units to a result for the drive.

use crate::codec;
use crate::error::{Error, Result};
use crate::run::engine::folders::Outline;
use crate::store::{PassDir, UnitReader};

/// One pass over units.
pub(crate) trait Pass: Sync {
    /// The result for the drive once the pass is complete.
    type Global;

    /// Name, folder, and the values that the pass depends on.
    fn outline(&self) -> &Outline;

    /// Number of units.
    fn units(&self) -> usize;

    /// Points of a unit, for progress.
    fn points(&self, unit: usize) -> u64;

    /// Estimated bytes that a unit in flight needs.
    fn bytes(&self, unit: usize) -> u64;

    /// Prepares the files that units write beside their payloads, before any unit runs. It may invalidate
    /// units whose files were lost.
    fn prepare(&self, _dir: &PassDir) -> Result<()> {
        Ok(())
    }

    /// Checks that the source of its stored units is unchanged, before a worker continues from them.
    fn verify(&self, _dir: &PassDir) -> Result<()> {
        Ok(())
    }

    /// Asks the system to read ahead the data of `unit`.
    fn prefetch(&self, _unit: usize) {}

    /// Computes a unit and returns its payload. It may also write files beside the payload, which
    /// [`Pass::sync`] syncs.
    fn run(&self, unit: usize) -> Result<Vec<u8>>;

    /// Syncs to the disk all files that finished units wrote beside their payloads.
    fn sync(&self) -> Result<()> {
        Ok(())
    }

    /// The reduction at the barrier. It reads the payloads in the order of the units.
    fn reduce(&self, payloads: &Payloads) -> Result<Self::Global>;
}

/// The payloads of a complete pass, by unit.
#[derive(Debug, Clone)]
pub(crate) enum Payloads {
    /// On disk.
    Stored(PassDir),
    /// In memory, for passes without a run directory.
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

    /// One section of the payload of a unit.
    pub(crate) fn section(&self, unit: usize, number: usize) -> Result<Vec<u8>> {
        match self {
            Self::Stored(dir) => dir.reader(unit)?.read_section(number),
            Self::InMemory(payloads) => {
                let payload = payloads.get(unit).ok_or_else(|| no_unit(unit))?;
                codec::section(payload, number).map(<[u8]>::to_vec)
            }
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

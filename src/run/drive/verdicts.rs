//! The result of the pass `ground` for each tile: which records the tile owns, and their classes. A tile
//! stores them in its own unit, so every value has one writer. Readers of a block combine the classes of all
//! tiles that own records of it.

use serde::{Deserialize, Serialize};

use crate::codec;
use crate::error::{Error, Result};
use crate::model::{FileId, PointClass, PointId};
use crate::run::drive::opened::Drive;
use crate::run::drive::sections;

/// A block with records that a tile owns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct OwnedBlock {
    /// The file.
    pub(crate) file: FileId,
    /// Number of the block in the file.
    pub(crate) block: u32,
    /// Start and end of its runs among all runs of the tile, in bytes.
    pub(crate) runs: (u64, u64),
    /// Number of points of the tile before this block, and in this block.
    pub(crate) points: (u64, u64),
    /// Number of points of objects of the tile before this block, and in this block.
    pub(crate) objects: (u64, u64),
}

/// The records that a tile owns with their classes.
#[derive(Debug, Default)]
pub(crate) struct TileVerdicts {
    /// Ascending by file and block.
    pub(crate) blocks: Vec<OwnedBlock>,
    /// Run lengths of records, alternately not owned and owned, block after block.
    pub(crate) runs: Vec<u8>,
    /// Class code of each owned record, in order.
    pub(crate) classes: Vec<u8>,
}

/// Run lengths of records, alternately not owned and owned.
pub(crate) fn lengths(runs: &[u8]) -> Result<Vec<u32>> {
    codec::decode(runs)
}

impl TileVerdicts {
    /// The records with these ids (ascending) and classes.
    pub(crate) fn collect(drive: &Drive, ids: &[PointId], classes: Vec<u8>) -> Result<Self> {
        let mut verdicts = Self { classes, ..Self::default() };
        let mut start = 0;
        let mut objects = 0;
        while start < ids.len() {
            let (file, record) = drive.locate(ids[start]);
            let blocks = drive.file(file).blocks();
            let block = blocks.partition_point(|block| block.first_record + u64::from(block.count) <= record);
            let run =
                blocks.get(block).ok_or_else(|| Error::bug(format!("record {record} is in no block")))?;
            let first = drive.catalog.first_id(file) + run.first_record;
            let end = start + ids[start..].partition_point(|&id| id < first + u64::from(run.count));
            let from = verdicts.runs.len() as u64;
            verdicts.runs.extend(codec::encode(&run_lengths(&ids[start..end], first))?);
            let here = verdicts.classes[start..end].iter().filter(|&&code| is_object(code)).count() as u64;
            verdicts.blocks.push(OwnedBlock {
                file: FileId::at(file),
                block: u32::try_from(block)
                    .map_err(|_| Error::bug(format!("block {block} has no number")))?,
                runs: (from, verdicts.runs.len() as u64),
                points: (start as u64, (end - start) as u64),
                objects: (objects, here),
            });
            objects += here;
            start = end;
        }
        Ok(verdicts)
    }

    /// The sections behind the summary.
    pub(crate) fn into_sections(self) -> Result<[Vec<u8>; 3]> {
        Ok([codec::encode(&self.blocks)?, self.runs, self.classes])
    }

    /// The records of a payload.
    pub(crate) fn decode(payload: &[u8]) -> Result<Self> {
        Ok(Self {
            blocks: codec::decode(codec::section(payload, sections::BLOCKS)?)?,
            runs: codec::section(payload, sections::RUNS)?.to_vec(),
            classes: codec::section(payload, sections::CLASSES)?.to_vec(),
        })
    }

    /// The entry of a block, if the tile owns any record of it.
    pub(crate) fn block(&self, file: usize, block: usize) -> Option<&OwnedBlock> {
        let key = |entry: &OwnedBlock| (entry.file.index(), entry.block as usize);
        let at = self.blocks.binary_search_by_key(&(file, block), key).ok()?;
        self.blocks.get(at)
    }

    /// The runs of a block, see [`lengths`].
    pub(crate) fn runs(&self, entry: &OwnedBlock) -> Result<Vec<u32>> {
        lengths(&self.runs[range(entry.runs.0, entry.runs.1 - entry.runs.0)])
    }

    /// The class codes of the owned records of a block.
    pub(crate) fn classes(&self, entry: &OwnedBlock) -> &[u8] {
        &self.classes[range(entry.points.0, entry.points.1)]
    }

    /// Writes the class codes of the owned records of a block over `codes`, which has one per record of the
    /// block.
    pub(crate) fn scatter(&self, entry: &OwnedBlock, codes: &mut [u8]) -> Result<()> {
        scatter(&self.runs(entry)?, self.classes(entry), codes)
    }
}

/// Whether a class code means a point of an object.
pub(crate) fn is_object(code: u8) -> bool {
    code == PointClass::Object.code()
}

/// The part of a column in memory that starts at `first` and has `count` values.
pub(crate) fn range(first: u64, count: u64) -> std::ops::Range<usize> {
    let at = |value: u64| usize::try_from(value).unwrap_or(usize::MAX);
    at(first)..at(first + count)
}

/// Writes `values` over the owned records of `all`. `runs` are the run lengths of records, alternately not
/// owned and owned.
pub(crate) fn scatter<T: Copy>(runs: &[u32], values: &[T], all: &mut [T]) -> Result<()> {
    let mut record = 0;
    let mut value = 0;
    for pair in runs.chunks_exact(2) {
        record += pair[0] as usize;
        let length = pair[1] as usize;
        let (Some(to), Some(from)) =
            (all.get_mut(record..record + length), values.get(value..value + length))
        else {
            return Err(Error::bug("the records of a tile do not match its block"));
        };
        to.copy_from_slice(from);
        record += length;
        value += length;
    }
    Ok(())
}

/// Run lengths of the records from the id `first` on, alternately not among `ids` and among them.
fn run_lengths(ids: &[PointId], first: PointId) -> Vec<u32> {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "all are records of one block, which are counted in 32 bits"
    )]
    let length = |from: PointId, to: PointId| (to - from) as u32;
    let mut lengths = Vec::new();
    let mut next = first;
    for run in ids.chunk_by(|a, b| *a + 1 == *b) {
        let end = run[0] + run.len() as u64;
        lengths.extend([length(next, run[0]), length(run[0], end)]);
        next = end;
    }
    lengths
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_tell_which_records_are_owned() {
        let runs = run_lengths(&[1_003, 1_004, 1_005, 1_009].map(PointId::new), PointId::new(1_000));
        assert_eq!(runs, [3, 3, 3, 1]);
        let mut codes = [9; 12];
        scatter(&runs, &[0, 1, 2, 3], &mut codes).unwrap();
        assert_eq!(codes, [9, 9, 9, 0, 1, 2, 9, 9, 9, 3, 9, 9]);
        assert!(scatter(&runs, &[0, 1], &mut codes).is_err());
        assert!(scatter(&runs, &[0, 1, 2, 3], &mut codes[..9]).is_err());
    }
}

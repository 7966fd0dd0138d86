//! A labelled copy of one input file: planned first, then made from records in any order of chunks.
//!
//! The copy is made by editing bytes. Everything that is not edited survives: padding of the header, records
//! of any user, coordinate reference system, waveforms, every bit of a point. Changed are: the positions in
//! the header, the record length, one extra-bytes record, the laszip record, and in every point the label
//! and, if requested, the class.

use std::io::{Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

use laz::LazVlr;

use super::edit::{self, Positions};
use super::laz_chunk::{
    CHUNK_RECORDS, ChunkExtent, ChunkSize, TABLE_OFFSET_BYTES, chunk_table, compress_chunk,
};
use super::options::LabelOptions;
use super::record::RecordPlan;
use super::tail::{Tail, TailError};
use crate::config::OutputFormat;
use crate::input::InputFile;
use crate::input::decode::Chunking;
use crate::model::Kind;
use crate::output::error::OutputError;

/// Bit of the global encoding: the waveforms are in a file of their own.
const EXTERNAL_WAVEFORMS: u16 = 1 << 2;

/// The plan of one labelled copy.
#[derive(Debug, Clone)]
pub struct LabelledFile {
    name: String,
    /// Folder that errors name together with the copy; empty if it is not known.
    folder: PathBuf,
    points: u64,
    record: RecordPlan,
    /// Header and records up to the points. Positions after the points are filled in when they are known.
    prologue: Vec<u8>,
    positions: Positions,
    tail: Tail,
    laz: Option<LazVlr>,
    chunks: Vec<Range<u64>>,
    warnings: Vec<String>,
}

impl LabelledFile {
    /// Plans the copy of `input`; nothing is written.
    ///
    /// # Errors
    /// [`OutputError::DimensionName`], [`OutputError::DimensionType`], [`OutputError::RecordLength`] when the
    /// label does not fit, [`OutputError::Source`] when the input cannot be read, [`OutputError::Compress`].
    pub fn plan(input: &InputFile, options: &LabelOptions) -> Result<Self, OutputError> {
        if options.dimension.is_empty() || options.dimension.len() > 31 {
            return Err(OutputError::DimensionName { name: options.dimension.clone() });
        }
        let compressed = match options.format {
            OutputFormat::Same => input.is_compressed(),
            OutputFormat::Las => false,
            OutputFormat::Laz => true,
        };
        let (record, descriptors) = RecordPlan::new(input, options)?;
        let (chunk_size, chunks) = chunks(input, compressed);
        let laz = compressed.then(|| edit::laz_record(input, record.output_len(), chunk_size)).transpose()?;
        let mut warnings = Vec::new();
        note_losses(input, &mut warnings);
        let edit::Edited { prologue, positions, tail } =
            edit::edit(input, record.output_len(), &descriptors, laz.as_ref())?;
        let name = output_name(input, compressed);
        let points = input.point_count();
        let folder = PathBuf::new();
        let mut planned =
            Self { name, folder, points, record, prologue, positions, tail, laz, chunks, warnings };
        if planned.laz.is_none() {
            let start = planned.epilogue_offset();
            planned.positions.fill(&mut planned.prologue, &planned.tail, start);
        }
        Ok(planned)
    }

    /// File name of the copy: the name of the input with the extension of the format; `x.copc.laz` becomes
    /// `x.laz`.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether the copy is compressed.
    #[must_use]
    pub fn is_compressed(&self) -> bool {
        self.laz.is_some()
    }

    /// Points of the copy.
    #[must_use]
    pub fn point_count(&self) -> u64 {
        self.points
    }

    /// Bytes of one new record.
    #[must_use]
    pub fn record_len(&self) -> usize {
        self.record.output_len()
    }

    /// Warnings about what the copy cannot keep.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Runs of records that are labelled (and compressed) at once, in file order, without gaps.
    ///
    /// They are the blocks of the input, except that a compressed copy of a file without chunks has runs of
    /// 50,000 records.
    #[must_use]
    pub fn chunks(&self) -> &[Range<u64>] {
        &self.chunks
    }

    /// Appends the new records of a run of records to `out`: the original bytes with label and class.
    ///
    /// `classes` are codes of [`crate::model::PointClass`], or its `UNDECIDED` outside a section. `kinds` has
    /// the class and confidence of the object of each record; if it is empty, all objects have class 0.
    ///
    /// # Panics
    /// When there is not one label and one class for every record.
    pub fn label(&self, records: &[u8], labels: &[u32], classes: &[u8], kinds: &[Kind], out: &mut Vec<u8>) {
        self.record.label(records, labels, classes, kinds, out);
    }

    /// Everything before the points. For a compressed copy it is not final: [`LabelledFile::assemble_laz`]
    /// writes the final one.
    #[must_use]
    pub fn prologue(&self) -> &[u8] {
        &self.prologue
    }

    /// Where a record of an uncompressed copy starts, in bytes.
    #[must_use]
    pub fn record_offset(&self, record: u64) -> u64 {
        self.prologue.len() as u64 + record * self.record.output_len() as u64
    }

    /// Where the bytes after the points of an uncompressed copy start.
    #[must_use]
    pub fn epilogue_offset(&self) -> u64 {
        self.record_offset(self.points)
    }

    /// Bytes after the points.
    #[must_use]
    pub fn epilogue_len(&self) -> u64 {
        self.tail.len()
    }

    /// Writes the bytes after the points: extended records, waveforms. Memory does not grow with them.
    ///
    /// # Errors
    /// [`OutputError::Source`], [`OutputError::Write`].
    pub fn write_epilogue(&self, input: &InputFile, out: &mut impl Write) -> Result<(), OutputError> {
        self.tail.write(input.source(), out).map_err(|error| match error {
            TailError::Read(source) => OutputError::Source { path: input.path().to_owned(), source },
            TailError::Write(source) => self.write_error(source),
        })
    }

    /// Compresses the new records of exactly one of [`LabelledFile::chunks`], on any thread.
    ///
    /// # Errors
    /// [`OutputError::PartialRecord`], [`OutputError::Compress`], [`OutputError::NotCompressed`] for a copy
    /// that is not compressed.
    pub fn compress(&self, records: &[u8]) -> Result<Vec<u8>, OutputError> {
        compress_chunk(self.laz()?, records)
    }

    /// Writes a compressed copy: header, chunks (number of records and bytes of each, in order), their table,
    /// and the bytes after the points.
    ///
    /// # Errors
    /// Errors of the chunks, [`OutputError::Write`], [`OutputError::Source`], [`OutputError::Incomplete`] if
    /// the chunks differ from [`LabelledFile::chunks`].
    pub fn assemble_laz<E: From<OutputError>>(
        &self,
        input: &InputFile,
        chunks: impl Iterator<Item = Result<(u32, Vec<u8>), E>>,
        out: &mut (impl Write + Seek),
    ) -> Result<(), E> {
        let failed = |source| self.write_error(source);
        let start = self.prologue.len() as u64;
        out.write_all(&self.prologue).map_err(failed)?;
        out.write_all(&0_u64.to_le_bytes()).map_err(failed)?;
        let mut table_at = start + TABLE_OFFSET_BYTES;
        let mut extents = Vec::with_capacity(self.chunks.len());
        for chunk in chunks {
            let (records, bytes) = chunk?;
            out.write_all(&bytes).map_err(failed)?;
            extents.push(ChunkExtent { records: records.into(), bytes: bytes.len() as u64 });
            table_at += bytes.len() as u64;
        }
        self.check_complete(&extents)?;
        let table = chunk_table(self.laz()?, &extents)?;
        out.write_all(&table).map_err(failed)?;
        self.write_epilogue(input, out)?;
        let mut prologue = self.prologue.clone();
        self.positions.fill(&mut prologue, &self.tail, table_at + table.len() as u64);
        out.seek(SeekFrom::Start(0)).map_err(failed)?;
        out.write_all(&prologue).map_err(failed)?;
        out.write_all(&table_at.to_le_bytes()).map_err(failed)?;
        out.seek(SeekFrom::End(0)).map_err(failed)?;
        out.flush().map_err(failed)?;
        Ok(())
    }

    fn laz(&self) -> Result<&LazVlr, OutputError> {
        self.laz.as_ref().ok_or_else(|| OutputError::NotCompressed { name: self.name.clone() })
    }

    fn check_complete(&self, extents: &[ChunkExtent]) -> Result<(), OutputError> {
        let planned = self.chunks.iter().map(|chunk| chunk.end - chunk.start);
        if planned.eq(extents.iter().map(|extent| extent.records)) {
            return Ok(());
        }
        let written = extents.iter().map(|extent| extent.records).sum();
        Err(OutputError::Incomplete { name: self.name.clone(), promised: self.points, written })
    }

    /// From now on, errors name the copy in this folder.
    pub(crate) fn in_folder(&mut self, folder: &Path) {
        folder.clone_into(&mut self.folder);
    }

    fn write_error(&self, source: std::io::Error) -> OutputError {
        OutputError::Write { path: self.folder.join(&self.name), source }
    }
}

/// Refuses copies that would have the same name.
///
/// # Errors
/// [`OutputError::NameClash`].
pub fn check_names<'a>(copies: impl IntoIterator<Item = &'a LabelledFile>) -> Result<(), OutputError> {
    let mut names = std::collections::BTreeSet::new();
    for copy in copies {
        if !names.insert(copy.name().to_lowercase()) {
            return Err(OutputError::NameClash { name: copy.name().to_owned() });
        }
    }
    Ok(())
}

/// The runs of records of the copy, and how the table of chunks stores them.
fn chunks(input: &InputFile, compressed: bool) -> (ChunkSize, Vec<Range<u64>>) {
    let chunking = input.coding().map(|coding| coding.chunking);
    let size = match chunking {
        Some(Chunking::Fixed(size)) => ChunkSize::Fixed(size),
        Some(Chunking::Variable) => ChunkSize::Variable,
        Some(Chunking::Whole) | None => ChunkSize::Fixed(CHUNK_RECORDS),
    };
    if compressed && matches!(chunking, Some(Chunking::Whole) | None) {
        let points = input.point_count();
        let starts = (0..points).step_by(CHUNK_RECORDS as usize);
        return (size, starts.map(|start| start..points.min(start + u64::from(CHUNK_RECORDS))).collect());
    }
    let blocks = input.blocks().iter();
    (size, blocks.map(|block| block.first_record..block.first_record + u64::from(block.count)).collect())
}

fn note_losses(input: &InputFile, warnings: &mut Vec<String>) {
    if input.is_copc() {
        warnings.push(format!(
            "{} is a cloud-optimised point cloud; its labelled copy is plain LAZ or LAS without the index",
            input.name()
        ));
    }
    if input.header().global_encoding & EXTERNAL_WAVEFORMS != 0 {
        warnings.push(format!(
            "the waveforms of {} are in a *.wdp file beside it; copy that file to the labelled copy if needed",
            input.name()
        ));
    }
}

/// The name of the input with the extension of the copy.
fn output_name(input: &InputFile, compressed: bool) -> String {
    copy_name(input.name(), input.is_compressed(), compressed)
}

/// The same, from the name and from whether the input and the copy are compressed.
fn copy_name(name: &str, was_compressed: bool, compressed: bool) -> String {
    let cloud = without(name, ".copc.laz");
    if cloud.is_none() && compressed == was_compressed {
        return name.to_owned();
    }
    let stem = cloud.or_else(|| without(name, ".las")).or_else(|| without(name, ".laz")).unwrap_or(name);
    format!("{stem}.{}", if compressed { "laz" } else { "las" })
}

/// The name without an ending in upper or lower case. Endings are ASCII, so they have the same number of
/// bytes in the name.
fn without<'a>(name: &'a str, ending: &str) -> Option<&'a str> {
    let at = name.len().checked_sub(ending.len())?;
    name.get(at..)?.eq_ignore_ascii_case(ending).then(|| &name[..at])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_copy_has_the_name_of_its_input_with_the_ending_of_its_format() {
        for (name, was_compressed, compressed, expected) in [
            ("a.las", false, false, "a.las"),
            ("a.LAS", false, true, "a.laz"),
            ("a.b.Laz", true, false, "a.b.las"),
            ("a.copc.laz", true, true, "a.laz"),
            ("a.COPC.LAZ", true, false, "a.las"),
            ("las", false, true, "las.laz"),
            // Letters whose lower case has more or fewer bytes.
            ("\u{212A}K.copc.laz", true, true, "\u{212A}K.laz"),
            ("\u{130}.las", false, true, "\u{130}.laz"),
            ("\u{212A}.las", false, true, "\u{212A}.laz"),
        ] {
            assert_eq!(copy_name(name, was_compressed, compressed), expected, "{name}");
        }
    }
}

//! The positions of the blocks of a file: runs of LAS records, or the chunks of a LAZ file from its table.
//! The table is not trusted: every number is checked against the file before it is used or memory is
//! allocated.

use crate::model::in_u32;
use std::io::BufReader;
use std::ops::Range;
use std::path::Path;

use laz::laszip::{ChunkTable, ChunkTableEntry};

use super::decode::{Chunking, Coding, MAX_CHUNK_BYTES, MAX_POINTS_PER_BYTE, quietly};
use super::error::{ChunkProblem, ChunkTableProblem, InputError};
use super::header::Header;
use super::mapped::{ByteSource, RangeReader};
use super::uncounted;

/// Records of a block of uncompressed points.
const LAS_BLOCK_RECORDS: u64 = 65_536;
/// Largest size of a block of uncompressed points in bytes (records may be long).
const LAS_BLOCK_BYTES: u64 = 32 << 20;

/// A run of records that is read at once.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Block {
    /// First record of the run in its file.
    pub first_record: u64,
    /// Records in the run, at least 1.
    pub count: u32,
    /// Bytes of the file with the run (compressed, in LAZ).
    pub bytes: Range<u64>,
}

/// The blocks of a file of uncompressed points.
///
/// # Errors
/// [`InputError::Truncated`] when no count of the header fits into the file, [`InputError::NotCounted`] when
/// the count is 0 but there are records, [`InputError::Read`].
pub(crate) fn las_blocks(
    path: &Path,
    header: &Header,
    source: &ByteSource,
    warnings: &mut Vec<String>,
) -> Result<Vec<Block>, InputError> {
    let size = source.len();
    let record_len = u64::from(header.record_len);
    let end = header.tail_start.unwrap_or(size);
    let present = |end: u64| (end - header.points_start) / record_len;
    let counts = &header.counts;
    let exact = counts.iter().copied().find(|count| *count == present(end));
    let fitting = || counts.iter().copied().filter(|count| *count <= present(size)).max();
    let count = exact.or_else(fitting).ok_or_else(|| InputError::Truncated {
        path: path.to_owned(),
        promised: counts[0],
        present: present(size),
    })?;
    let further = uncounted::records(header, source, count)
        .map_err(|error| InputError::Read { path: path.to_owned(), source: error })?;
    match (count, further) {
        (_, 0) => {}
        (0, further) => {
            return Err(InputError::NotCounted {
                path: path.to_owned(),
                found: format!("{further} whole records"),
            });
        }
        (count, further) => warnings.push(uncounted::warning(count, further)),
    }
    let step = LAS_BLOCK_RECORDS.min((LAS_BLOCK_BYTES / record_len).max(1));
    let starts = (0..count).step_by(usize::try_from(step).unwrap_or(usize::MAX));
    Ok(starts
        .map(|first| {
            let records = step.min(count - first);
            let start = header.points_start + first * record_len;
            Block {
                first_record: first,
                count: in_u32(records, "records of a block"),
                bytes: start..start + records * record_len,
            }
        })
        .collect())
}

/// The blocks of a file of compressed points.
///
/// # Errors
/// [`InputError::ChunkTable`], [`InputError::NotCounted`] when the count is 0 but there are chunks,
/// [`InputError::Read`].
pub(crate) fn laz_blocks(
    path: &Path,
    header: &Header,
    coding: &Coding,
    source: &ByteSource,
    warnings: &mut Vec<String>,
) -> Result<Vec<Block>, InputError> {
    let finder = Finder { header, coding, source, end: header.tail_start.unwrap_or(source.len()) };
    if header.counts == [0] {
        return match finder.uncounted() {
            Some(found) => Err(InputError::NotCounted { path: path.to_owned(), found }),
            None => Ok(Vec::new()),
        };
    }
    let found = match coding.chunking {
        Chunking::Whole => finder.whole(),
        Chunking::Fixed(_) | Chunking::Variable => finder.chunks(warnings),
    };
    found.and_then(|blocks| finder.checked(blocks)).map_err(|problem| match problem {
        Problem::Table(problem) => InputError::ChunkTable { path: path.to_owned(), problem },
        Problem::Read(error) => InputError::Read { path: path.to_owned(), source: error },
    })
}

enum Problem {
    Table(ChunkTableProblem),
    Read(std::io::Error),
}

impl From<ChunkTableProblem> for Problem {
    fn from(problem: ChunkTableProblem) -> Self {
        Self::Table(problem)
    }
}

impl From<std::io::Error> for Problem {
    fn from(error: std::io::Error) -> Self {
        Self::Read(error)
    }
}

struct Finder<'a> {
    header: &'a Header,
    coding: &'a Coding,
    source: &'a ByteSource,
    /// First byte after all bytes that can belong to points.
    end: u64,
}

impl Finder<'_> {
    /// Points without chunks: one block.
    fn whole(&self) -> Result<Vec<(u64, u64)>, Problem> {
        Ok(vec![(self.header.counts[0], self.end.saturating_sub(self.header.points_start))])
    }

    /// Points and bytes of every chunk, from the table, or found by walking over the chunks if there is none.
    fn chunks(&self, warnings: &mut Vec<String>) -> Result<Vec<(u64, u64)>, Problem> {
        let Some(table) = self.table_position()? else {
            warnings.push("the table of compressed chunks is missing; a search has found the chunks".into());
            return self.walk(warnings);
        };
        let entries = self.read_table(table)?;
        if entries.is_empty() {
            warnings.push("the table of compressed chunks is empty; a search has found the chunks".into());
            return self.walk(warnings);
        }
        match self.coding.chunking {
            Chunking::Fixed(size) => self.fixed(&entries, size),
            Chunking::Variable | Chunking::Whole => self.variable(&entries),
        }
    }

    /// The beginning of the chunks, after the position of their table.
    fn chunks_start(&self) -> u64 {
        match self.coding.chunking {
            Chunking::Whole => self.header.points_start,
            Chunking::Fixed(_) | Chunking::Variable => self.header.points_start + 8,
        }
    }

    /// The position of the table. A writer that could not seek stores -1 in its place, and the position at
    /// the end of the file.
    fn table_position(&self) -> Result<Option<u64>, Problem> {
        let size = self.source.len();
        let read = |at: u64| -> Result<u64, Problem> {
            let mut buffer = Vec::new();
            let bytes = self.source.slice(at..at + 8, &mut buffer)?;
            let mut word = [0; 8];
            word.copy_from_slice(bytes);
            Ok(u64::try_from(i64::from_le_bytes(word)).unwrap_or(0))
        };
        let start = self.chunks_start();
        if start + 8 > size {
            return Err(ChunkTableProblem::Outside { offset: start, size }.into());
        }
        let position = read(self.header.points_start)?;
        if position >= start {
            if position + 8 > size {
                return Err(ChunkTableProblem::Outside { offset: position, size }.into());
            }
            return Ok(Some(position));
        }
        let position = read(size - 8)?;
        Ok((start..=size - 8).contains(&position).then_some(position))
    }

    /// The entries of the table at `position`. Their number is checked before the decoder allocates memory.
    fn read_table(&self, position: u64) -> Result<Vec<ChunkTableEntry>, Problem> {
        let mut buffer = Vec::new();
        let head = self.source.slice(position..position + 8, &mut buffer)?;
        let word = |at: usize| u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
        let version = word(0);
        let chunks = u64::from(word(4));
        if version != 0 {
            return Err(ChunkTableProblem::Version { version }.into());
        }
        let bytes = position - self.chunks_start();
        // One more chunk, because some writers add an empty one at the end.
        let limit = bytes / self.coding.smallest_chunk() + 1;
        if chunks > limit {
            return Err(ChunkTableProblem::TooMany { chunks, bytes, limit }.into());
        }
        let mut stream = BufReader::new(RangeReader::new(self.source, position..self.source.len()));
        let variable = self.coding.chunking == Chunking::Variable;
        let table = quietly(|| {
            ChunkTable::read(&mut stream, variable)
                .map_err(|error| ChunkProblem::Damaged { cause: error.to_string() })
        })
        .map_err(|problem| ChunkTableProblem::Damaged { cause: problem.to_string() })?;
        Ok(table.as_ref().to_vec())
    }

    /// Chunks of one size: as many of the listed chunks as the points need. Any further chunks must be empty.
    fn fixed(&self, entries: &[ChunkTableEntry], size: u32) -> Result<Vec<(u64, u64)>, Problem> {
        let size = u64::from(size);
        let used = entries.iter().rposition(|entry| entry.byte_count > 0).map_or(0, |last| last as u64 + 1);
        let present = used * size;
        let count = self.header.counts.iter().copied().find(|count| count.div_ceil(size) == used);
        let promised = self.header.counts[0];
        let count = count.ok_or(ChunkTableProblem::Points { promised, present })?;
        let points = (0..used).map(|chunk| size.min(count - chunk * size));
        Ok(points.zip(entries).map(|(points, entry)| (points, entry.byte_count)).collect())
    }

    /// Chunks with different numbers of points, which must add up.
    fn variable(&self, entries: &[ChunkTableEntry]) -> Result<Vec<(u64, u64)>, Problem> {
        let present = entries.iter().fold(0_u64, |sum, entry| sum.saturating_add(entry.point_count));
        if !self.header.counts.contains(&present) {
            return Err(ChunkTableProblem::Points { promised: self.header.counts[0], present }.into());
        }
        Ok(entries.iter().map(|entry| (entry.point_count, entry.byte_count)).collect())
    }

    /// Chunks without a table, one after the other until all points are found.
    fn walk(&self, warnings: &mut Vec<String>) -> Result<Vec<(u64, u64)>, Problem> {
        let promised = self.header.counts[0];
        let mut chunks = Vec::new();
        let mut found = 0;
        let mut position = self.chunks_start();
        while found < promised {
            let wanted = match self.coding.chunking {
                Chunking::Fixed(size) => Some(u64::from(size).min(promised - found)),
                Chunking::Variable | Chunking::Whole => None,
            };
            let missing = ChunkTableProblem::Missing { promised, found };
            let (points, bytes) = match self.coding.layered_head() {
                Some(head) => self.walk_layered(position, head, wanted),
                None => self.walk_points(position, wanted),
            }
            .filter(|(points, bytes)| *points > 0 && *bytes <= self.end.saturating_sub(position))
            .ok_or(missing)?;
            chunks.push((points, bytes));
            found += points;
            position += bytes;
        }
        if found > promised {
            return Err(ChunkTableProblem::Missing { promised, found }.into());
        }
        let rest = position..uncounted::limit(self.header, self.source.len(), position);
        if self.may_be_chunks(&rest) && !self.is_table(position, chunks.len()) {
            let bytes = rest.end - rest.start;
            warnings.push(uncounted::warning_of_chunks(promised, bytes));
        }
        Ok(chunks)
    }

    /// A description of the points in a file whose header promises none; `None` if there are none. Unreadable
    /// parts count as absent, because an empty file needs no table.
    fn uncounted(&self) -> Option<String> {
        let start = self.chunks_start();
        let table = match self.coding.chunking {
            Chunking::Whole => None,
            Chunking::Fixed(_) | Chunking::Variable => self.table_position().ok().flatten(),
        };
        let entries = table.and_then(|table| self.read_table(table).ok()).unwrap_or_default();
        let used = entries.iter().filter(|entry| entry.byte_count > 0);
        let chunks = used.clone().count() as u64;
        if chunks > 0 {
            let points = match self.coding.chunking {
                Chunking::Fixed(size) => format!("up to {}", chunks.saturating_mul(u64::from(size))),
                Chunking::Variable | Chunking::Whole => {
                    used.fold(0_u64, |sum, entry| sum.saturating_add(entry.point_count)).to_string()
                }
            };
            let plural = if chunks == 1 { "" } else { "s" };
            return Some(format!("{chunks} compressed chunk{plural} with {points} points"));
        }
        let rest = start..table.unwrap_or_else(|| uncounted::limit(self.header, self.source.len(), start));
        self.may_be_chunks(&rest).then(|| format!("{} bytes of compressed points", rest.end - rest.start))
    }

    /// Whether bytes have room for a chunk, and are not only padding.
    fn may_be_chunks(&self, rest: &Range<u64>) -> bool {
        rest.end.saturating_sub(rest.start) >= self.coding.smallest_chunk()
            && uncounted::bytes(self.source, rest).is_ok_and(|bytes| bytes > 0)
    }

    /// Whether a table of this number of chunks begins at `position`. A writer that was stopped may not have
    /// stored the position of its table.
    fn is_table(&self, position: u64, chunks: usize) -> bool {
        let mut buffer = Vec::new();
        let head = self.source.slice(position..position + 8, &mut buffer);
        head.is_ok_and(|head| {
            let (version, count) = head.split_at(4);
            version == [0; 4] && u32::try_from(chunks).is_ok_and(|chunks| count == chunks.to_le_bytes())
        })
    }

    /// Points and bytes of a layered chunk, which states its own length.
    fn walk_layered(&self, position: u64, head: u64, wanted: Option<u64>) -> Option<(u64, u64)> {
        let mut buffer = Vec::new();
        let head = self.source.slice(position..position.checked_add(head)?, &mut buffer).ok()?;
        let (points, bytes) = self.coding.layered_size(head);
        Some((wanted.unwrap_or(u64::from(points)), bytes))
    }

    /// Points and bytes of a chunk whose points are coded one after the other. It ends with its last point,
    /// so it must be decoded to find its end.
    fn walk_points(&self, position: u64, wanted: Option<u64>) -> Option<(u64, u64)> {
        let points = wanted.and_then(|points| u32::try_from(points).ok())?;
        let stream = BufReader::new(RangeReader::new(self.source, position..self.end));
        let end = self.coding.skip(stream, points).ok()?;
        Some((u64::from(points), end.checked_sub(position)?))
    }

    /// The chunks as blocks, if they are inside the file and can be decoded in bounded memory.
    fn checked(&self, chunks: Vec<(u64, u64)>) -> Result<Vec<Block>, Problem> {
        let mut blocks = Vec::with_capacity(chunks.len());
        let mut first_record = 0;
        let mut position = self.chunks_start();
        for (chunk, (points, bytes)) in chunks.into_iter().enumerate() {
            // The decoder gives negative sizes for garbage. Here they are very large numbers.
            let end = position.saturating_add(bytes);
            if end > self.end {
                return Err(ChunkTableProblem::Overrun { chunk, end, limit: self.end }.into());
            }
            let fits = MAX_CHUNK_BYTES / u64::from(self.header.record_len);
            let limit = fits.min(bytes.saturating_mul(MAX_POINTS_PER_BYTE));
            if points > limit || (points > 0 && bytes < self.coding.smallest_chunk()) {
                return Err(ChunkTableProblem::Dense { chunk, points, bytes, limit }.into());
            }
            if points > 0 {
                let count = in_u32(points, "points of a chunk");
                blocks.push(Block { first_record, count, bytes: position..end });
            }
            first_record += points;
            position = end;
        }
        Ok(blocks)
    }
}

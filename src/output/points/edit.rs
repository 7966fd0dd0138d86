//! Edits the bytes of a file around its points: the header, and the variable length records before and after
//! the points.

use laz::LazVlr;

use super::descriptor::{self, DESCRIPTOR, Descriptors};
use super::laz_chunk::{ChunkSize, laz_vlr, laz_vlr_data};
use super::tail::Tail;
use crate::input::InputFile;
use crate::input::decode::{LASZIP, MAX_EXTRA_BYTES};
use crate::input::layout::{EXTRA_BYTES, SPEC_USER};
use crate::input::vlr::Vlr;
use crate::output::error::OutputError;

/// User of the records that make a file a cloud-optimised point cloud.
const COPC_USER: &str = "copc";
// Fields of the header (LAS 1.4 R15, table 3).
const POINTS_START: usize = 96;
const RECORD_COUNT: usize = 100;
const POINT_FORMAT: usize = 104;
const RECORD_LENGTH: usize = 105;
const LEGACY_POINTS: usize = 107;
const LEGACY_BY_RETURN: usize = 111;
const WAVEFORM_START: usize = 227;
const EVLR_START: usize = 235;
const EVLR_COUNT: usize = 243;
const POINTS: usize = 247;
const COMPRESSED: u8 = 0x80;

/// The new bytes around the points.
pub(super) struct Edited {
    pub(super) prologue: Vec<u8>,
    pub(super) positions: Positions,
    pub(super) tail: Tail,
}

/// Header fields that depend on the position of the bytes after the points.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Positions {
    /// First extended record, from the start of the tail.
    first_evlr: Option<u64>,
    /// Where the waveforms were in the input.
    waveforms: Option<u64>,
}

impl Positions {
    /// Writes the fields, for a tail that starts at byte `start` of the file.
    pub(super) fn fill(&self, prologue: &mut [u8], tail: &Tail, start: u64) {
        if let Some(first) = self.first_evlr {
            put(prologue, EVLR_START, &(start + first).to_le_bytes());
        }
        if let Some(position) = self.waveforms.and_then(|old| tail.position_of(old)) {
            put(prologue, WAVEFORM_START, &(start + position).to_le_bytes());
        }
    }
}

/// What happens to a variable length record.
enum Fate {
    Keep,
    Drop,
    Replace(Vec<u8>),
}

/// The bytes before and after the points of the copy.
pub(super) fn edit(
    input: &InputFile,
    record_len: usize,
    descriptors: &Descriptors,
    laz: Option<&LazVlr>,
) -> Result<Edited, OutputError> {
    let header = input.header();
    let described = descriptors.updated(input.layout().descriptors.clone());
    // Many readers look for descriptors only before the points. So those after the points move there.
    let is_after = header.evlrs.records.iter().any(|record| record.is(SPEC_USER, EXTRA_BYTES));
    let fits = described.len() + descriptors.new.len() * DESCRIPTOR <= usize::from(u16::MAX);
    let moved = is_after && fits && !described.is_empty();
    let unchanged = descriptors.new.is_empty() && !moved;
    let mut editor = Editor {
        input,
        wanted: descriptors,
        descriptors: (!unchanged).then(|| [&described[..], &descriptors.new.concat()].concat()),
        unchanged,
        laz: laz.map(laz_vlr_data).transpose()?,
    };
    let mut prologue = editor.read(0..header.header_size)?;
    let mut count = 0_u32;
    for record in &header.vlrs.records {
        let bytes = match editor.fate(record)? {
            Fate::Drop => continue,
            Fate::Keep => editor.read(record.start..record.payload.end)?,
            Fate::Replace(payload) => editor.with_payload(record, &payload)?,
        };
        prologue.extend(bytes);
        count += 1;
    }
    if (moved || !is_after)
        && let Some(payload) = editor.descriptors.take()
    {
        prologue.extend(descriptor::vlr(SPEC_USER, EXTRA_BYTES, "Extra Bytes Record", &payload));
        count += 1;
    }
    if let Some(payload) = editor.laz.take() {
        prologue.extend(descriptor::vlr(LASZIP.0, LASZIP.1, LazVlr::DESCRIPTION, &payload));
        count += 1;
    }
    prologue.extend(editor.read(header.vlrs.end..header.points_start)?);
    let (tail, positions, evlrs) = editor.tail()?;
    patch_header(input, &mut prologue, record_len, count, evlrs, laz.is_some())?;
    Ok(Edited { prologue, positions, tail })
}

struct Editor<'a> {
    input: &'a InputFile,
    wanted: &'a Descriptors,
    /// All descriptors of the copy; `None` once they are placed.
    descriptors: Option<Vec<u8>>,
    /// Whether there are no descriptors to add, so that the records stay where they are.
    unchanged: bool,
    /// Payload of the new laszip record; `None` once it is placed.
    laz: Option<Vec<u8>>,
}

impl Editor<'_> {
    fn read(&self, range: std::ops::Range<u64>) -> Result<Vec<u8>, OutputError> {
        let mut buffer = Vec::new();
        let bytes = self.input.source().slice(range, &mut buffer);
        bytes
            .map(<[u8]>::to_vec)
            .map_err(|source| OutputError::Source { path: self.input.path().to_owned(), source })
    }

    /// A record of the header with another payload.
    fn with_payload(&self, record: &Vlr, payload: &[u8]) -> Result<Vec<u8>, OutputError> {
        let length = u16::try_from(payload.len()).map_err(|_| OutputError::Descriptors {
            path: self.input.path().to_owned(),
            count: payload.len() / DESCRIPTOR,
            limit: usize::from(u16::MAX) / DESCRIPTOR,
        })?;
        let mut bytes = self.read(record.start..record.payload.start)?;
        put(&mut bytes, 20, &length.to_le_bytes());
        bytes.extend(payload);
        Ok(bytes)
    }

    fn fate(&mut self, record: &Vlr) -> Result<Fate, OutputError> {
        if record.user == COPC_USER {
            return Ok(Fate::Drop);
        }
        if record.is(LASZIP.0, LASZIP.1) {
            return Ok(self.laz.take().map_or(Fate::Drop, Fate::Replace));
        }
        if !record.is(SPEC_USER, EXTRA_BYTES) {
            return Ok(Fate::Keep);
        }
        if self.unchanged {
            if self.wanted.replaced.is_empty() {
                return Ok(Fate::Keep);
            }
            let before = self.read(record.payload.clone())?;
            let after = self.wanted.updated(before.clone());
            return Ok(if after == before { Fate::Keep } else { Fate::Replace(after) });
        }
        // The specification allows only one such record, and some readers read only one. So the first gets
        // all descriptors.
        Ok(self.descriptors.take().map_or(Fate::Drop, Fate::Replace))
    }

    /// The bytes after the points, where the extended records start in them, and the number of these records.
    fn tail(&mut self) -> Result<(Tail, Positions, u32), OutputError> {
        let header = self.input.header();
        let mut tail = Tail::default();
        let mut positions = Positions { first_evlr: None, waveforms: header.waveform_start };
        // The chunk table follows the compressed points. It is not copied, because the copy gets a new one.
        let start = match (self.input.is_compressed(), header.tail_start) {
            (false, _) => self.points_end(),
            (true, Some(start)) => start,
            (true, None) => self.input.size_bytes(),
        };
        let Some(first) = header.evlrs.records.first() else {
            tail.copy(start..self.input.size_bytes());
            return Ok((tail, positions, 0));
        };
        tail.copy(start..first.start.max(start));
        let mut count = 0;
        for record in &header.evlrs.records {
            let at = tail.len();
            match self.fate(record)? {
                Fate::Drop => continue,
                Fate::Keep => tail.copy(record.start..record.payload.end),
                Fate::Replace(payload) => {
                    let mut head = self.read(record.start..record.payload.start)?;
                    put(&mut head, 20, &(payload.len() as u64).to_le_bytes());
                    tail.add([head, payload].concat());
                }
            }
            positions.first_evlr.get_or_insert(at);
            count += 1;
        }
        tail.copy(header.evlrs.end..self.input.size_bytes());
        Ok((tail, positions, count))
    }

    fn points_end(&self) -> u64 {
        self.input.blocks().last().map_or(self.input.header().points_start, |last| last.bytes.end)
    }
}

/// The fields of the header that do not depend on the bytes after the points.
fn patch_header(
    input: &InputFile,
    prologue: &mut [u8],
    record_len: usize,
    records: u32,
    evlrs: u32,
    compressed: bool,
) -> Result<(), OutputError> {
    let points_start = u32::try_from(prologue.len())
        .map_err(|_| OutputError::Header { path: input.path().to_owned(), length: prologue.len() })?;
    put(prologue, POINTS_START, &points_start.to_le_bytes());
    put(prologue, RECORD_COUNT, &records.to_le_bytes());
    let format = input.layout().point_format | if compressed { COMPRESSED } else { 0 };
    put(prologue, POINT_FORMAT, &[format]);
    let length = u16::try_from(record_len).unwrap_or(u16::MAX);
    put(prologue, RECORD_LENGTH, &length.to_le_bytes());
    if input.version().1 >= 4 {
        if evlrs == 0 {
            put(prologue, EVLR_START, &0_u64.to_le_bytes());
        }
        put(prologue, EVLR_COUNT, &evlrs.to_le_bytes());
    }
    if input.header().counts.len() > 1 {
        // The two counts of the input disagree. The copy states the number of points that it contains. For
        // point formats 6 to 10, that is not in the legacy fields, which must be 0 (LAS 1.4 R15, table 3).
        // Two counts that agree are kept as all bytes are, also where they should not be there.
        let points = input.point_count();
        let is_legacy = input.layout().point_format < 6;
        let legacy = u32::try_from(points).ok().filter(|_| is_legacy).unwrap_or(0);
        put(prologue, LEGACY_POINTS, &legacy.to_le_bytes());
        if !is_legacy {
            put(prologue, LEGACY_BY_RETURN, &[0; 20]);
        }
        put(prologue, POINTS, &points.to_le_bytes());
    }
    Ok(())
}

fn put(bytes: &mut [u8], at: usize, value: &[u8]) {
    bytes[at..at + value.len()].copy_from_slice(value);
}

/// The laszip record of the copy.
///
/// # Errors
/// [`OutputError::RecordLength`] when there are more extra bytes than our own reader decodes.
pub(super) fn laz_record(
    input: &InputFile,
    record_len: usize,
    chunk_size: ChunkSize,
) -> Result<LazVlr, OutputError> {
    let layout = input.layout();
    let limit = layout.base_len + MAX_EXTRA_BYTES;
    let extra = u16::try_from(record_len - layout.base_len).unwrap_or(u16::MAX);
    if record_len > limit {
        return Err(OutputError::RecordLength { path: input.path().to_owned(), length: record_len, limit });
    }
    let vlr = laz_vlr(layout.point_format, extra, chunk_size)?;
    if !matches!(layout.point_format, 4 | 5) {
        return Ok(vlr);
    }
    // `laz` gives version 2 to the wave packets of formats 4 and 5. LASzip knows only version 1 of them,
    // which is the same coding, and refuses the file. The version is the last of the three words of an item.
    const WAVE_PACKET: [u8; 2] = [9, 0];
    let mut payload = laz_vlr_data(&vlr)?;
    for item in payload[34..].chunks_exact_mut(6).filter(|item| item[..2] == WAVE_PACKET) {
        item[4..6].copy_from_slice(&1_u16.to_le_bytes());
    }
    LazVlr::from_buffer(payload).map_err(|source| OutputError::Compress { source: Box::new(source) })
}

//! Compressed points: the coding of a file, and decoding of one chunk into records.

use std::cell::Cell;
use std::io::{Cursor, Read, Seek};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Once;

use laz::record::{LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor};
use laz::{DecompressionSelection, LazItem, LazItemType, LazVlr};

use super::Fields;
use super::error::{ChunkProblem, InputError};
use super::header::{self, Header};
use super::mapped::ByteSource;
use crate::error::panic_text;

/// User id and record id of the description of the compression.
pub(crate) const LASZIP: (&str, u16) = (LazVlr::USER_ID, LazVlr::RECORD_ID);
/// Largest chunk that is decoded, in bytes of records. Common chunks have 50,000 points, or 1.5 to 3 MB. A
/// chunk above the limit is damaged, or the file cannot be processed out of core.
pub(crate) const MAX_CHUNK_BYTES: u64 = 256 << 20;
/// Largest number of points per compressed byte. The adaptive models of the coder never give a symbol more
/// than 1 - (n - 1)/2^15 of the interval (n symbols; 2^15 is the largest total count). A point that repeats
/// the previous one therefore costs at least 0.0076 bits, so a byte has at most 1,050 points. Rounded up
/// generously.
pub(crate) const MAX_POINTS_PER_BYTE: u64 = 4096;
/// Largest number of extra bytes that are decoded. The decoder keeps up to four models of 2.5 kB for each.
pub(crate) const MAX_EXTRA_BYTES: usize = 4096;
/// Records decoded between two growths of the output.
const STEP: usize = 8192;

/// The arrangement of the chunks of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Chunking {
    /// One stream without chunks and without a table (LASzip before 2.0).
    Whole,
    /// Chunks of this many points; the last one may be shorter.
    Fixed(u32),
    /// Every chunk has its own number of points.
    Variable,
}

/// The coding of the points of a file.
#[derive(Debug, Clone)]
pub(crate) struct Coding {
    /// The fields of a record, in the order of the coder.
    items: Vec<LazItem>,
    /// Layers of a chunk (point formats 6 to 10), or `None` if points are coded one after the other.
    layers: Option<usize>,
    /// The arrangement of the chunks.
    pub(crate) chunking: Chunking,
    record_len: usize,
}

impl Coding {
    /// The coding that the laszip record of the file describes, checked against the point format.
    ///
    /// # Errors
    /// [`InputError::LaszipRecord`] when the record is missing, damaged, unknown, or for another point
    /// format.
    pub(crate) fn read(path: &Path, header: &Header, source: &ByteSource) -> Result<Self, InputError> {
        let problem = |problem: String| InputError::LaszipRecord { path: path.to_owned(), problem };
        let record = header
            .vlrs
            .records
            .iter()
            .find(|record| record.is(LASZIP.0, LASZIP.1))
            .ok_or_else(|| problem("is missing".into()))?;
        let bytes =
            record.read(source, u64::from(u16::MAX)).ok_or_else(|| problem("cannot be read".into()))?;
        if bytes.len() < 34 {
            return Err(problem(format!("has {} bytes, but needs at least 34", bytes.len())));
        }
        let (compressor, coder) =
            (u16::from_le_bytes([bytes[0], bytes[1]]), u16::from_le_bytes([bytes[2], bytes[3]]));
        let vlr = LazVlr::from_buffer(&bytes).map_err(|error| problem(format!("cannot be used: {error}")))?;
        let record_len = usize::from(header.record_len);
        let extra = record_len - usize::from(header::base_length(header.point_format));
        check_items(vlr.items(), header.point_format, extra).map_err(problem)?;
        let layered = header.point_format >= 6;
        let chunking = match (compressor, layered) {
            _ if coder != 0 => return Err(problem(format!("names coder {coder}; only coder 0 is known"))),
            (1, false) => Chunking::Whole,
            (2, false) | (3, true) if vlr.uses_variable_size_chunks() => Chunking::Variable,
            (2, false) | (3, true) => Chunking::Fixed(vlr.chunk_size()),
            _ => {
                return Err(problem(format!(
                    "names compressor {compressor}, which point format {} cannot have",
                    header.point_format
                )));
            }
        };
        let layers = layered.then(|| vlr.items().iter().map(layers_of).sum());
        Ok(Self { items: vlr.items().clone(), layers, chunking, record_len })
    }

    /// Smallest size of a chunk in bytes: its first record is stored raw.
    pub(crate) fn smallest_chunk(&self) -> u64 {
        self.record_len as u64
    }

    /// Bytes of a layered chunk before its layers: a record, the number of points, the sizes of the layers.
    pub(crate) fn layered_head(&self) -> Option<u64> {
        self.layers.map(|layers| (self.record_len + 4 + 4 * layers) as u64)
    }

    /// Number of points and bytes of a layered chunk, from its head.
    pub(crate) fn layered_size(&self, head: &[u8]) -> (u32, u64) {
        let word = |at: usize| u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
        let sizes = (self.record_len + 4..head.len()).step_by(4).map(|at| u64::from(word(at)));
        (word(self.record_len), head.len() as u64 + sizes.sum::<u64>())
    }

    /// Decodes the `count` points of the chunk `bytes` into `records`, which is overwritten.
    ///
    /// # Errors
    /// Why the chunk cannot be decoded. `records` never grows beyond `count` records; the caller checks
    /// `count`.
    pub(crate) fn decode(
        &self,
        bytes: &[u8],
        count: u32,
        fields: Fields,
        records: &mut Vec<u8>,
    ) -> Result<(), ChunkProblem> {
        records.clear();
        self.check_layers(bytes, count)?;
        let total = count as usize * self.record_len;
        records.reserve_exact(total);
        quietly(|| {
            let mut decoder = self.decoder(Cursor::new(bytes), fields)?;
            while records.len() < total {
                let start = records.len();
                records.resize(total.min(start + STEP * self.record_len), 0);
                decoder.decompress_many(&mut records[start..]).map_err(damaged)?;
            }
            let used = decoder.get_mut().stream_position().map_err(damaged)?;
            self.check_end(count, used, bytes.len() as u64)
        })
    }

    /// Decodes `count` points of a stream of points coded one after the other. Returns the position after
    /// them.
    pub(crate) fn skip<R: Read + Seek + Send + Sync>(
        &self,
        mut stream: R,
        count: u32,
    ) -> Result<u64, ChunkProblem> {
        quietly(|| {
            let mut decoder = self.decoder(&mut stream, Fields::All)?;
            let mut record = vec![0; self.record_len];
            for _ in 0..count {
                decoder.decompress_next(&mut record).map_err(damaged)?;
            }
            decoder.get_mut().stream_position().map_err(damaged)
        })
    }

    /// Checks that the layers are inside the chunk, because the decoder allocates memory by their sizes. Also
    /// checks the number of points in the chunk, because the decoder ignores it and would decode garbage
    /// after the last point.
    fn check_layers(&self, bytes: &[u8], count: u32) -> Result<(), ChunkProblem> {
        let Some(head) = self.layered_head() else { return Ok(()) };
        let present = bytes.len() as u64;
        let Some(bytes) = usize::try_from(head).ok().and_then(|head| bytes.get(..head)) else {
            return Err(ChunkProblem::Layers { promised: head, present });
        };
        let (points, promised) = self.layered_size(bytes);
        if promised > present {
            return Err(ChunkProblem::Layers { promised, present });
        }
        if points != count {
            return Err(ChunkProblem::Points { promised: count, present: points });
        }
        Ok(())
    }

    /// Checks that the last point ends a chunk of points coded one after the other, which does not state how
    /// many they are. The coder writes as many bytes as are read (LASzip, `ArithmeticEncoder::done`). Other
    /// data may follow points without chunks.
    fn check_end(&self, count: u32, used: u64, present: u64) -> Result<(), ChunkProblem> {
        if self.layers.is_some() || self.chunking == Chunking::Whole || used == present {
            return Ok(());
        }
        Err(ChunkProblem::Longer { promised: count, used, present })
    }

    fn decoder<'a, R: Read + Seek + Send + Sync + 'a>(
        &self,
        stream: R,
        fields: Fields,
    ) -> Result<Box<dyn RecordDecompressor<R> + 'a>, ChunkProblem> {
        let mut decoder: Box<dyn RecordDecompressor<R> + 'a> = match self.layers {
            Some(_) => Box::new(LayeredPointRecordDecompressor::new(stream)),
            None => Box::new(SequentialPointRecordDecompressor::new(stream)),
        };
        decoder.set_fields_from(&self.items).map_err(damaged)?;
        decoder.set_selection(match fields {
            Fields::All => DecompressionSelection::all(),
            Fields::Geometry => {
                DecompressionSelection::base().decompress_z().decompress_flags().decompress_gps_time()
            }
        });
        Ok(decoder)
    }
}

fn damaged(error: impl ToString) -> ChunkProblem {
    ChunkProblem::Damaged { cause: error.to_string() }
}

/// Number of layers that an item adds to a chunk.
fn layers_of(item: &LazItem) -> usize {
    match item.item_type() {
        LazItemType::Point14 => 9,
        LazItemType::RGB14 | LazItemType::WavePacket14 => 1,
        LazItemType::RGBNIR14 => 2,
        LazItemType::Byte14(count) => usize::from(count),
        _ => 0,
    }
}

/// Checks that the items are those of the point format, followed by the extra bytes. Otherwise returns the
/// reason.
fn check_items(items: &[LazItem], point_format: u8, extra: usize) -> Result<(), String> {
    use LazItemType::{GpsTime, Point10, Point14, RGB12, RGB14, RGBNIR14, WavePacket13, WavePacket14};
    let expected: &[LazItemType] = match point_format {
        0 => &[Point10],
        1 => &[Point10, GpsTime],
        2 => &[Point10, RGB12],
        3 => &[Point10, GpsTime, RGB12],
        4 => &[Point10, GpsTime, WavePacket13],
        5 => &[Point10, GpsTime, RGB12, WavePacket13],
        6 => &[Point14],
        7 => &[Point14, RGB14],
        8 => &[Point14, RGBNIR14],
        9 => &[Point14, WavePacket14],
        _ => &[Point14, RGBNIR14, WavePacket14],
    };
    let versions = if point_format >= 6 { 3..=4 } else { 1..=2 };
    if let Some(item) = items.iter().find(|item| !versions.contains(&item.version())) {
        return Err(format!("codes {:?} in version {}", item.item_type(), item.version()));
    }
    let types: Vec<LazItemType> = items.iter().map(LazItem::item_type).collect();
    let (fixed, rest) = types.split_at(expected.len().min(types.len()));
    let mut coded = 0;
    for item in rest {
        match item {
            LazItemType::Byte(count) if point_format < 6 => coded += usize::from(*count),
            LazItemType::Byte14(count) if point_format >= 6 => coded += usize::from(*count),
            _ => return Err(format!("codes {types:?}, which is not point format {point_format}")),
        }
    }
    if fixed != expected {
        return Err(format!("codes {types:?}, which is not point format {point_format}"));
    }
    if coded != extra {
        return Err(format!("codes {coded} extra bytes, but the records have {extra}"));
    }
    if extra > MAX_EXTRA_BYTES {
        return Err(format!("codes {extra} extra bytes; the limit is {MAX_EXTRA_BYTES}"));
    }
    Ok(())
}

thread_local! {
    /// Whether a panic on this thread comes from the decoder. Such a panic becomes an error and is not
    /// printed.
    static QUIET: Cell<bool> = const { Cell::new(false) };
}

/// Calls the decoder, which may panic on damaged data. A panic becomes an error.
pub(crate) fn quietly<T>(call: impl FnOnce() -> Result<T, ChunkProblem>) -> Result<T, ChunkProblem> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let previous = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if !QUIET.get() {
                previous(panic);
            }
        }));
    });
    let before = QUIET.replace(true);
    let outcome = catch_unwind(AssertUnwindSafe(call));
    QUIET.set(before);
    outcome.unwrap_or_else(|panic| Err(ChunkProblem::Damaged { cause: panic_text(&*panic) }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_of_the_decoder_is_an_error_and_later_panics_are_real_again() {
        let error = quietly::<()>(|| panic!("symbol {} out of range", 7)).expect_err("caught");
        assert_eq!(error.to_string(), "damaged data (symbol 7 out of range)");
        assert!(!QUIET.get());
        assert!(quietly(|| Ok(3)).is_ok());
    }

    #[test]
    fn items_must_be_those_of_the_point_format() {
        let items = |format, extra| {
            laz::LazItemRecordBuilder::default_for_point_format_id(format, extra).expect("known format")
        };
        for format in 0..=10 {
            assert_eq!(check_items(&items(format, 0), format, 0), Ok(()), "{format}");
            assert_eq!(check_items(&items(format, 5), format, 5), Ok(()), "{format}");
            assert!(check_items(&items(format, 5), format, 4).is_err(), "{format}");
            assert!(check_items(&items(format, 0), (format + 1) % 11, 0).is_err(), "{format}");
        }
        assert!(check_items(&[], 0, 0).is_err());
    }
}

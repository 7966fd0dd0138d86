//! One independent LAZ chunk as bytes, and the table of all chunks. This module knows nothing about files,
//! threads or their order.
//!
//! A chunk's bytes depend on its records and on the LASzip record alone, so any thread may compress any chunk
//! and one collector appends them. Layout of the point data (LASzip specification, "chunk table"): 8 bytes
//! with the absolute file offset of the chunk table, the chunks, the table.

use laz::laszip::{ChunkTable, ChunkTableEntry};
use laz::record::{LayeredPointRecordCompressor, RecordCompressor, SequentialPointRecordCompressor};
use laz::{LazVlr, LazVlrBuilder};

use crate::output::OutputError;

/// Records of a chunk if nothing else determines it: LASzip's default, for which most readers are tuned.
pub(crate) const CHUNK_RECORDS: u32 = 50_000;
/// Bytes in front of the first chunk, which contain the file offset of the chunk table (i64, little-endian).
pub(crate) const TABLE_OFFSET_BYTES: u64 = 8;

/// How many records a chunk has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ChunkSize {
    /// This many, except in the last chunk; LASzip's own default is 50,000.
    Fixed(u32),
    /// Any number per chunk; the chunk table stores it.
    Variable,
}

/// Size of one compressed chunk, for the chunk table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ChunkExtent {
    /// Records in the chunk.
    pub(crate) records: u64,
    /// Compressed bytes of the chunk.
    pub(crate) bytes: u64,
}

/// The LASzip record for records of `point_format` followed by `extra_bytes` bytes each.
///
/// # Errors
/// [`OutputError::Compress`] for a point format that LASzip does not know.
pub(crate) fn laz_vlr(point_format: u8, extra_bytes: u16, chunk: ChunkSize) -> Result<LazVlr, OutputError> {
    let builder =
        LazVlrBuilder::default().with_point_format(point_format, extra_bytes).map_err(compress_error)?;
    Ok(match chunk {
        ChunkSize::Fixed(records) => builder.with_fixed_chunk_size(records),
        ChunkSize::Variable => builder.with_variable_chunk_size(),
    }
    .build())
}

/// The data of the LASzip record (user id `laszip encoded`, record id 22204).
///
/// # Errors
/// [`OutputError::Compress`] if the encoder refuses.
pub(crate) fn laz_vlr_data(vlr: &LazVlr) -> Result<Vec<u8>, OutputError> {
    let mut data = Vec::new();
    vlr.write_to(&mut data).map_err(|source| compress_error(source.into()))?;
    Ok(data)
}

/// The bytes of the chunk that contains exactly `records` (whole records, little-endian, as in a LAS file;
/// not empty).
///
/// # Errors
/// [`OutputError::PartialRecord`] if the slice is not a whole number of records, [`OutputError::Compress`]
/// for a LASzip record with items of an unknown version.
pub(crate) fn compress_chunk(vlr: &LazVlr, records: &[u8]) -> Result<Vec<u8>, OutputError> {
    let record_bytes = vlr.items_size();
    if records.is_empty() || !(records.len() as u64).is_multiple_of(record_bytes) {
        return Err(OutputError::PartialRecord { bytes: records.len(), record_bytes });
    }
    let out = Vec::with_capacity(records.len() / 4);
    // LASzip codes items of versions 1 and 2 (point formats 0 to 5) record by record, and later versions in
    // layers.
    if vlr.items().first().is_some_and(|item| item.version() <= 2) {
        run(SequentialPointRecordCompressor::new(out), vlr, records)
    } else {
        run(LayeredPointRecordCompressor::new(out), vlr, records)
    }
}

fn run<C: RecordCompressor<Vec<u8>>>(
    mut coder: C,
    vlr: &LazVlr,
    records: &[u8],
) -> Result<Vec<u8>, OutputError> {
    coder.set_fields_from(vlr.items()).map_err(compress_error)?;
    coder
        .compress_many(records)
        .and_then(|()| coder.done())
        .map_err(|source| compress_error(source.into()))?;
    Ok(coder.into_inner())
}

/// The bytes of the chunk table that follows the last chunk, for chunks in file order.
///
/// # Errors
/// [`OutputError::Compress`] if the encoder refuses.
pub(crate) fn chunk_table(vlr: &LazVlr, chunks: &[ChunkExtent]) -> Result<Vec<u8>, OutputError> {
    let mut table = ChunkTable::with_capacity(chunks.len());
    for chunk in chunks {
        table.push(ChunkTableEntry { point_count: chunk.records, byte_count: chunk.bytes });
    }
    let mut bytes = Vec::new();
    table.write_to(&mut bytes, vlr).map_err(|source| compress_error(source.into()))?;
    Ok(bytes)
}

fn compress_error(source: laz::LasZipError) -> OutputError {
    OutputError::Compress { source: Box::new(source) }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    /// Records with slowly changing coordinates and a pseudo-random rest, so that every field compressor
    /// works.
    fn records(count: usize, size: usize) -> Vec<u8> {
        let mut state = 1u32;
        let mut bytes = Vec::with_capacity(count * size);
        for index in 0..count {
            let mut record = vec![0u8; size];
            for byte in &mut record[12..] {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                *byte = (state >> 24) as u8 & 0x11;
            }
            for axis in 0..3 {
                let value = i32::try_from(index * (axis + 1)).unwrap();
                record[axis * 4..axis * 4 + 4].copy_from_slice(&value.to_le_bytes());
            }
            bytes.extend(record);
        }
        bytes
    }

    fn assemble(vlr: &LazVlr, data: &[u8], chunk_records: usize) -> Vec<u8> {
        let size = usize::try_from(vlr.items_size()).unwrap();
        let mut file = vec![0u8; 8];
        let mut extents = Vec::new();
        for part in data.chunks(chunk_records * size) {
            let bytes = compress_chunk(vlr, part).unwrap();
            extents.push(ChunkExtent { records: (part.len() / size) as u64, bytes: bytes.len() as u64 });
            file.extend(bytes);
        }
        let end = i64::try_from(file.len()).unwrap();
        file[..8].copy_from_slice(&end.to_le_bytes());
        file.extend(chunk_table(vlr, &extents).unwrap());
        file
    }

    #[test]
    fn chunks_joined_by_hand_equal_the_bytes_of_the_sequential_compressor() {
        for (format, size) in [(0u8, 20usize), (1, 28), (3, 34), (6, 30), (7, 36), (8, 38)] {
            for extra in [0usize, 5] {
                let vlr = laz_vlr(format, u16::try_from(extra).unwrap(), ChunkSize::Fixed(400)).unwrap();
                let data = records(1_001, size + extra);
                let mut whole = Cursor::new(Vec::new());
                laz::compress_buffer(&mut whole, &data, vlr.clone()).unwrap();
                assert_eq!(assemble(&vlr, &data, 400), whole.into_inner(), "format {format} extra {extra}");
            }
        }
    }

    #[test]
    fn variable_chunks_are_read_back() {
        let vlr = laz_vlr(6, 5, ChunkSize::Variable).unwrap();
        let data = records(1_001, 35);
        let file = assemble(&vlr, &data, 137);
        let mut reader = laz::LasZipDecompressor::new(Cursor::new(file), vlr).unwrap();
        let mut back = vec![0u8; data.len()];
        reader.decompress_many(&mut back).unwrap();
        assert_eq!(back, data);
    }

    #[test]
    fn a_partial_record_and_an_unknown_format_are_errors() {
        let vlr = laz_vlr(6, 0, ChunkSize::Variable).unwrap();
        assert!(matches!(
            compress_chunk(&vlr, &[0; 31]),
            Err(OutputError::PartialRecord { bytes: 31, record_bytes: 30 })
        ));
        assert!(matches!(laz_vlr(11, 0, ChunkSize::Variable), Err(OutputError::Compress { .. })));
    }
}

//! Streaming writer of a new LAS 1.4 or LAZ file: header, records in the given order, totals patched in at
//! the end. The only fields of a record that it interprets are position and return number.
//!
//! The file grows under a temporary name in its folder and gets its own name when it is complete and synced.
//! LAZ chunks are compressed by the threads of the current rayon pool and written in order, so the bytes do
//! not depend on the number of threads.

use std::io::{Seek, SeekFrom, Write};
use std::path::Path;

use las::raw::Header;
use las::raw::header::LargeFile;
use laz::LazVlr;
use rayon::prelude::*;

use crate::input::decode::LASZIP;
use crate::input::layout::{EXTRA_BYTES, SPEC_USER};
use crate::output::OutputError;
use crate::output::points::descriptor::{self, DESCRIPTOR, ExtraType, padded};
use crate::output::points::laz_chunk::{
    CHUNK_RECORDS, ChunkExtent, ChunkSize, TABLE_OFFSET_BYTES, chunk_table, compress_chunk, laz_vlr,
    laz_vlr_data,
};
use crate::whole_file::WholeFile;

/// Bytes of a LAS 1.4 header (specification 1.4 R15, table 3).
const HEADER_BYTES: u16 = 375;

/// Placeholder for the file offset of the chunk table: LASzip's -1 for "not known yet".
#[expect(clippy::cast_possible_truncation, reason = "8 fits")]
const TABLE_PLACE: [u8; TABLE_OFFSET_BYTES as usize] = [0xff; TABLE_OFFSET_BYTES as usize];

/// One dimension after the fields of the point format.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ExtraDimension {
    /// Name, at most 31 bytes.
    pub(crate) name: &'static str,
    /// Type of the value.
    pub(crate) kind: ExtraType,
    /// Description, at most 31 bytes.
    pub(crate) description: &'static str,
}

impl ExtraDimension {
    fn descriptor(&self) -> [u8; DESCRIPTOR] {
        descriptor::integer(self.name, self.kind, self.description)
    }
}

/// The format of the records of a new file, and its coordinate system.
#[derive(Debug, Clone)]
pub(crate) struct NewFileSchema {
    /// Point format, 6 to 10 (LAS 1.4 layouts).
    pub(crate) point_format: u8,
    /// Dimensions after the fields of the format, in record order.
    pub(crate) extra: Vec<ExtraDimension>,
    /// Metres per integer step, per axis.
    pub(crate) scale: [f64; 3],
    /// World coordinates of the integer (0, 0, 0), metres.
    pub(crate) offset: [f64; 3],
    /// Coordinate system as WKT.
    pub(crate) wkt: &'static str,
    /// System identifier of the header.
    pub(crate) system: &'static str,
    /// Year and day of the year of the header.
    pub(crate) created: (u16, u16),
    /// File source id of the header.
    pub(crate) source_id: u16,
}

/// A LAS or LAZ file that is being written.
#[derive(Debug)]
pub(crate) struct NewFile {
    file: WholeFile,
    header: Header,
    laz: Option<LazVlr>,
    record_bytes: usize,
    /// Records that do not fill a chunk yet.
    pending: Vec<u8>,
    chunks: Vec<ChunkExtent>,
    totals: Totals,
    /// Bytes of the file so far.
    position: u64,
}

/// The totals of all records for the header.
#[derive(Debug)]
struct Totals {
    by_return: [u64; 15],
    records: u64,
    low: [i32; 3],
    high: [i32; 3],
}

impl Totals {
    fn add(&mut self, record: &[u8]) {
        for axis in 0..3 {
            let at = axis * 4;
            let value = i32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]]);
            self.low[axis] = self.low[axis].min(value);
            self.high[axis] = self.high[axis].max(value);
        }
        // LAS 1.4 R15, table 16: the return number is the low half of byte 14; 0 is not a return.
        if let Some(return_index) = usize::from(record[14] & 0x0f).checked_sub(1) {
            self.by_return[return_index] += 1;
        }
        self.records += 1;
    }
}

impl NewFile {
    /// Starts `path`, which must not exist under this name until [`NewFile::finish`].
    ///
    /// # Errors
    /// [`OutputError::Write`] when the folder cannot be written, [`OutputError::Compress`] for a point format
    /// that LASzip does not know.
    pub(crate) fn create(path: &Path, schema: &NewFileSchema, compressed: bool) -> Result<Self, OutputError> {
        let extra_bytes: u16 = schema.extra.iter().map(|dimension| dimension.kind.bytes()).sum();
        let base = las::point::Format::new(schema.point_format)
            .map_err(|source| OutputError::Compress { source: Box::new(source) })?
            .len();
        let chunk = ChunkSize::Fixed(CHUNK_RECORDS);
        let laz = compressed.then(|| laz_vlr(schema.point_format, extra_bytes, chunk)).transpose()?;
        let extra: Vec<u8> = schema.extra.iter().flat_map(ExtraDimension::descriptor).collect();
        let wkt = [schema.wkt.as_bytes(), &[0]].concat();
        let mut vlrs = vec![
            descriptor::vlr(SPEC_USER, EXTRA_BYTES, "Extra Bytes Record", &extra),
            descriptor::vlr("LASF_Projection", 2112, "OGC Coordinate System WKT", &wkt),
        ];
        if let Some(laz) = &laz {
            vlrs.push(descriptor::vlr(LASZIP.0, LASZIP.1, LazVlr::DESCRIPTION, &laz_vlr_data(laz)?));
        }
        let data_offset = usize::from(HEADER_BYTES) + vlrs.iter().map(Vec::len).sum::<usize>();
        let header = header(schema, data_offset, vlrs.len(), base + extra_bytes, compressed);

        let mut new = Self {
            file: WholeFile::create(path)
                .map_err(|source| OutputError::Write { path: path.to_owned(), source })?,
            header,
            laz,
            record_bytes: usize::from(base + extra_bytes),
            pending: Vec::new(),
            chunks: Vec::new(),
            totals: Totals { by_return: [0; 15], records: 0, low: [i32::MAX; 3], high: [i32::MIN; 3] },
            position: data_offset as u64,
        };
        new.write_header()?;
        new.file.write_all(&vlrs.concat()).map_err(new.failed())?;
        if compressed {
            new.write(&TABLE_PLACE)?; // patched by `finish`
        }
        Ok(new)
    }

    /// Appends whole records, little-endian, as the schema says.
    ///
    /// # Errors
    /// [`OutputError::PartialRecord`] if the slice is not a whole number of records; [`OutputError::Write`].
    pub(crate) fn append(&mut self, records: &[u8]) -> Result<(), OutputError> {
        if !records.len().is_multiple_of(self.record_bytes) {
            let record_bytes = self.record_bytes as u64;
            return Err(OutputError::PartialRecord { bytes: records.len(), record_bytes });
        }
        records.chunks_exact(self.record_bytes).for_each(|record| self.totals.add(record));
        if self.laz.is_none() {
            return self.write(records);
        }
        self.pending.extend_from_slice(records);
        let chunk_bytes = self.record_bytes * CHUNK_RECORDS as usize;
        let full = self.pending.len() / chunk_bytes * chunk_bytes;
        self.write_chunks(full)
    }

    /// Completes the file: last chunk, chunk table, totals in the header; syncs it and gives it its name.
    /// Returns the number of records.
    ///
    /// # Errors
    /// [`OutputError::Write`]; the temporary file is then removed.
    pub(crate) fn finish(mut self) -> Result<u64, OutputError> {
        self.write_chunks(self.pending.len())?;
        if let Some(laz) = &self.laz {
            let table = chunk_table(laz, &self.chunks)?;
            let table_at = self.position;
            self.write(&table)?;
            let data_at = u64::from(self.header.offset_to_point_data);
            self.seek(data_at)?;
            self.file.write_all(&table_at.to_le_bytes()).map_err(self.failed())?;
        }
        self.fill_totals();
        self.seek(0)?;
        self.write_header()?;
        let failed = self.failed();
        self.file.finish().map_err(failed)?;
        Ok(self.totals.records)
    }

    fn write_chunks(&mut self, bytes: usize) -> Result<(), OutputError> {
        let Some(laz) = &self.laz else { return Ok(()) };
        let chunk_bytes = self.record_bytes * CHUNK_RECORDS as usize;
        let rest = self.pending.split_off(bytes);
        let whole = std::mem::replace(&mut self.pending, rest);
        let compressed: Vec<_> = whole
            .par_chunks(chunk_bytes)
            .map(|records| compress_chunk(laz, records))
            .collect::<Result<_, _>>()?;
        for (chunk, records) in compressed.iter().zip(whole.chunks(chunk_bytes)) {
            let records = (records.len() / self.record_bytes) as u64;
            self.chunks.push(ChunkExtent { records, bytes: chunk.len() as u64 });
            self.write(chunk)?;
        }
        Ok(())
    }

    fn fill_totals(&mut self) {
        let totals = &self.totals;
        let header = &mut self.header;
        header.large_file = Some(LargeFile {
            number_of_point_records: totals.records,
            number_of_points_by_return: totals.by_return,
        });
        if totals.records == 0 {
            return;
        }
        let low = totals.low.map(f64::from);
        let high = totals.high.map(f64::from);
        (header.min_x, header.max_x) = (
            low[0] * header.x_scale_factor + header.x_offset,
            high[0] * header.x_scale_factor + header.x_offset,
        );
        (header.min_y, header.max_y) = (
            low[1] * header.y_scale_factor + header.y_offset,
            high[1] * header.y_scale_factor + header.y_offset,
        );
        (header.min_z, header.max_z) = (
            low[2] * header.z_scale_factor + header.z_offset,
            high[2] * header.z_scale_factor + header.z_offset,
        );
    }

    fn write_header(&mut self) -> Result<(), OutputError> {
        let failed = self.failed();
        self.header.write_to(&mut self.file).map_err(|source| failed(std::io::Error::other(source)))
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), OutputError> {
        self.position += bytes.len() as u64;
        self.file.write_all(bytes).map_err(self.failed())
    }

    fn seek(&mut self, position: u64) -> Result<(), OutputError> {
        self.file.seek(SeekFrom::Start(position)).map(|_| ()).map_err(self.failed())
    }

    fn failed(&self) -> impl FnOnce(std::io::Error) -> OutputError + use<> {
        let path = self.file.path().to_owned();
        move |source| OutputError::Write { path, source }
    }
}

fn header(schema: &NewFileSchema, data_offset: usize, vlrs: usize, record: u16, compressed: bool) -> Header {
    let text = |text: &str| -> [u8; 32] { padded(text) };
    Header {
        file_source_id: schema.source_id,
        global_encoding: 0b1_0001, // GPS time is adjusted standard time; the coordinate system is WKT
        version: las::Version::new(1, 4),
        system_identifier: text(schema.system),
        generating_software: text(concat!("chainage ", env!("CARGO_PKG_VERSION"))),
        file_creation_year: schema.created.0,
        file_creation_day_of_year: schema.created.1,
        header_size: HEADER_BYTES,
        offset_to_point_data: u32::try_from(data_offset).unwrap_or(u32::MAX),
        number_of_variable_length_records: u32::try_from(vlrs).unwrap_or(u32::MAX),
        // LASzip marks a compressed file in the high bit of the format.
        point_data_record_format: schema.point_format | if compressed { 0x80 } else { 0 },
        point_data_record_length: record,
        x_scale_factor: schema.scale[0],
        y_scale_factor: schema.scale[1],
        z_scale_factor: schema.scale[2],
        x_offset: schema.offset[0],
        y_offset: schema.offset[1],
        z_offset: schema.offset[2],
        large_file: Some(LargeFile::default()),
        evlr: Some(las::raw::header::Evlr::default()),
        ..Header::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn schema() -> NewFileSchema {
        NewFileSchema {
            point_format: 6,
            extra: vec![
                ExtraDimension { name: "gt_instance", kind: ExtraType::U32, description: "object" },
                ExtraDimension { name: "gt_class", kind: ExtraType::U8, description: "class" },
            ],
            scale: [0.001; 3],
            offset: [651_000.0, 5_400_000.0, 0.0],
            wkt: "PROJCS[]",
            system: "test",
            created: (2026, 1),
            source_id: 3,
        }
    }

    fn record(index: i32) -> Vec<u8> {
        let mut record = vec![0u8; 35];
        record[..4].copy_from_slice(&index.to_le_bytes());
        record[4..8].copy_from_slice(&(-2 * index).to_le_bytes());
        record[8..12].copy_from_slice(&(index % 7).to_le_bytes());
        record[14] = if index % 3 == 0 { 0x22 } else { 0x11 }; // return 2 of 2, or 1 of 1
        record[22..30].copy_from_slice(&(f64::from(index) * 1e-6).to_le_bytes());
        record[30..34].copy_from_slice(&u32::try_from(index / 10).unwrap().to_le_bytes());
        record[34] = u8::try_from(index % 9).unwrap();
        record
    }

    #[test]
    fn las_and_laz_are_read_back_with_totals_of_all_records() {
        for compressed in [false, true] {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join(if compressed { "a.laz" } else { "a.las" });
            let mut file = NewFile::create(&path, &schema(), compressed).unwrap();
            let records: Vec<u8> = (0..120_001).flat_map(record).collect();
            for part in records.chunks(35 * 7_001) {
                file.append(part).unwrap();
            }
            assert!(!path.exists(), "the name appears when the file is complete");
            assert_eq!(file.finish().unwrap(), 120_001);

            let mut reader = las::Reader::from_path(&path).unwrap();
            let header = reader.header().clone();
            assert_eq!(header.number_of_points(), 120_001);
            assert_eq!(header.number_of_points_by_return(2), Some(40_001)); // multiples of 3 in 0..=120000
            assert!((header.bounds().max.x - 651_120.0).abs() < 1e-6);
            assert!((header.bounds().min.y - 5_399_760.0).abs() < 1e-6);
            assert!(header.has_wkt_crs());
            let last = reader.read_all().unwrap().points().last().unwrap().unwrap();
            assert_eq!(last.gps_time, Some(0.12));
            assert_eq!(last.extra_bytes, [&12_000u32.to_le_bytes()[..], &[3]].concat()); // 120000 % 9 = 3
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file stays");
        }
    }

    #[test]
    fn a_file_without_points_is_valid_and_an_unfinished_one_vanishes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.laz");
        let mut file = NewFile::create(&path, &schema(), true).unwrap();
        assert!(matches!(
            file.append(&[0; 36]),
            Err(OutputError::PartialRecord { bytes: 36, record_bytes: 35 })
        ));
        drop(file);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        NewFile::create(&path, &schema(), true).unwrap().finish().unwrap();
        assert_eq!(las::Reader::from_path(&path).unwrap().read_all().unwrap().len(), 0);
    }
}

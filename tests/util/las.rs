//! A tiny LAS writer, from the bytes of the specification and without the crate, so that its input is known
//! exactly.

use std::path::Path;

/// Units per millimetre in which scale and offset of a file are computed: 0.1 mm.
const TENTHS: i64 = 10;

/// One point: coordinates in millimetres, time, and a number that identifies it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Point {
    /// Coordinates in millimetres.
    pub(crate) mm: [i64; 3],
    /// GPS time in seconds; left out if the format has none.
    pub(crate) time: f64,
    /// Written as intensity.
    pub(crate) mark: u16,
}

impl Point {
    /// A point without time or mark.
    pub(crate) fn at(mm: [i64; 3]) -> Self {
        Self { mm, time: 0.0, mark: 0 }
    }
}

/// How points are stored in a file.
#[derive(Debug, Clone)]
pub(crate) struct Shape {
    /// Point format: 0, 1 (LAS 1.2) or 6 (LAS 1.4).
    pub(crate) format: u8,
    /// Scale in tenths of a millimetre.
    pub(crate) scale_tenths: i64,
    /// Offset in millimetres.
    pub(crate) offset_mm: [i64; 3],
    /// Mark of the points that are withheld.
    pub(crate) withheld: Option<u16>,
    /// Variable length records: user, number, payload.
    pub(crate) records: Vec<(&'static str, u16, Vec<u8>)>,
}

impl Default for Shape {
    fn default() -> Self {
        Self { format: 6, scale_tenths: TENTHS, offset_mm: [0; 3], withheld: None, records: Vec::new() }
    }
}

impl Shape {
    fn record_len(&self) -> usize {
        match self.format {
            0 => 20,
            1 => 28,
            6 => 30,
            other => panic!("point format {other} is not written here"),
        }
    }

    /// The record coordinate of a coordinate in millimetres, which must be an exact multiple of the scale.
    fn record(&self, mm: i64, axis: usize) -> i32 {
        let tenths = (mm - self.offset_mm[axis]) * TENTHS;
        assert_eq!(tenths % self.scale_tenths, 0, "{mm} mm is not a multiple of the scale");
        i32::try_from(tenths / self.scale_tenths).expect("fits a record")
    }

    fn point(&self, point: &Point, bytes: &mut Vec<u8>) {
        let start = bytes.len();
        for axis in 0..3 {
            bytes.extend(self.record(point.mm[axis], axis).to_le_bytes());
        }
        bytes.extend(point.mark.to_le_bytes());
        let withheld = self.withheld == Some(point.mark);
        if self.format == 6 {
            // Return 1 of 1; flags; class 1; user data, angle, source.
            bytes.extend([0x11, if withheld { 1 << 2 } else { 0 }, 1, 0, 0, 0, 7, 0]);
        } else {
            bytes.extend([0x09, if withheld { 1 | 1 << 7 } else { 1 }, 0, 0, 7, 0]);
        }
        if self.format > 0 {
            bytes.extend(point.time.to_le_bytes());
        }
        assert_eq!(bytes.len() - start, self.record_len());
    }

    /// The bytes of a file with these points.
    pub(crate) fn bytes(&self, points: &[Point]) -> Vec<u8> {
        let header_len: u16 = if self.format == 6 { 375 } else { 227 };
        let mut tail = Vec::new();
        for (user, number, payload) in &self.records {
            tail.extend([0; 2]);
            tail.extend(padded(user, 16));
            tail.extend(number.to_le_bytes());
            tail.extend(u16::try_from(payload.len()).expect("short").to_le_bytes());
            tail.extend([0; 32]);
            tail.extend(payload);
        }
        let start = u32::from(header_len) + u32::try_from(tail.len()).expect("small");
        let count = u32::try_from(points.len()).expect("few points");
        let mut bytes = b"LASF".to_vec();
        bytes.extend([0; 20]);
        bytes.extend([1, if self.format == 6 { 4 } else { 2 }]);
        bytes.extend(padded("test", 32));
        bytes.extend(padded("chainage tests", 32));
        bytes.extend([1, 0, 0xe9, 0x07]);
        bytes.extend(header_len.to_le_bytes());
        bytes.extend(start.to_le_bytes());
        bytes.extend(u32::try_from(self.records.len()).expect("few").to_le_bytes());
        bytes.push(self.format);
        bytes.extend(u16::try_from(self.record_len()).expect("short").to_le_bytes());
        let legacy = if self.format == 6 { 0 } else { count };
        bytes.extend(legacy.to_le_bytes());
        bytes.extend(legacy.to_le_bytes());
        bytes.extend([0; 16]);
        for _ in 0..3 {
            bytes.extend((self.scale_tenths as f64 / 10_000.0).to_le_bytes());
        }
        for axis in 0..3 {
            bytes.extend((self.offset_mm[axis] as f64 / 1_000.0).to_le_bytes());
        }
        for axis in 0..3 {
            let values = || points.iter().map(|point| point.mm[axis]);
            for end in [values().max(), values().min()] {
                bytes.extend((end.unwrap_or(0) as f64 / 1_000.0).to_le_bytes());
            }
        }
        if self.format == 6 {
            bytes.extend([0; 20]);
            bytes.extend(u64::from(count).to_le_bytes());
            bytes.extend(u64::from(count).to_le_bytes());
            bytes.extend([0; 14 * 8]);
        }
        assert_eq!(bytes.len(), usize::from(header_len));
        bytes.extend(tail);
        points.iter().for_each(|point| self.point(point, &mut bytes));
        bytes
    }

    /// Writes a file with these points. A name ending in `.laz` compresses it, with this many records per
    /// chunk.
    pub(crate) fn write_in_chunks(&self, path: &Path, points: &[Point], chunk: u32) {
        let laz = path.extension().is_some_and(|extension| extension == "laz");
        let bytes = if laz { self.compressed(points, chunk) } else { self.bytes(points) };
        std::fs::write(path, bytes).expect("a writable folder");
    }

    /// Writes a file with these points, compressed if its name ends in `.laz`.
    pub(crate) fn write(&self, path: &Path, points: &[Point]) {
        self.write_in_chunks(path, points, 50_000);
    }
}

fn padded(text: &str, len: usize) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    bytes.resize(len, 0);
    bytes
}

impl Shape {
    /// The bytes of a LAZ file with these points in chunks of `chunk` records.
    pub(crate) fn compressed(&self, points: &[Point], chunk: u32) -> Vec<u8> {
        let items = laz::LazItemRecordBuilder::default_for_point_format_id(self.format, 0).expect("items");
        let vlr = laz::LazVlrBuilder::new(items).with_fixed_chunk_size(chunk).build();
        let mut payload = Vec::new();
        vlr.write_to(&mut payload).expect("in memory");
        let mut shape = self.clone();
        shape.records.push(("laszip encoded", 22_204, payload));
        let mut bytes = shape.bytes(points);
        let records = bytes.split_off(bytes.len() - points.len() * self.record_len());
        bytes[104] |= 0x80;
        let mut out = std::io::Cursor::new(bytes);
        out.set_position(out.get_ref().len() as u64);
        let mut compressor = laz::LasZipCompressor::new(&mut out, vlr).expect("a compressor");
        compressor.compress_many(&records).expect("compressed");
        compressor.done().expect("done");
        drop(compressor);
        out.into_inner()
    }
}

/// The records that make coordinates geographic (EPSG 4326).
pub(crate) fn geographic() -> Vec<(&'static str, u16, Vec<u8>)> {
    let keys: [u16; 12] = [1, 1, 0, 2, 1_024, 0, 1, 2, 2_048, 0, 1, 4_326];
    vec![("LASF_Projection", 34_735, keys.iter().flat_map(|key| key.to_le_bytes()).collect())]
}

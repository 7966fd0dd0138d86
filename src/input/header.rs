//! The public header block of a LAS file. Every length is checked against the file.

use std::path::Path;

use las::raw;

use super::error::InputError;
use super::mapped::ByteSource;
use super::vlr::{self, Directory};

/// Bytes of the header of LAS 1.0 to 1.2.
const HEADER_1_2: u64 = 227;
/// Bytes of the header of LAS 1.3.
const HEADER_1_3: u64 = 235;
/// Bytes of the header of LAS 1.4.
const HEADER_1_4: u64 = 375;
/// Bit of the point format that marks compressed points (LASzip).
const COMPRESSED: u8 = 0x80;

/// Scale and offset of the three axes, in the units of the file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Scaling {
    /// World units per record unit.
    pub(crate) scale: [f64; 3],
    /// World coordinates of record (0, 0, 0).
    pub(crate) offset: [f64; 3],
}

/// The content of the header, checked as far as possible without reading the points.
#[derive(Debug)]
pub(crate) struct Header {
    /// Version as (major, minor).
    pub(crate) version: (u8, u8),
    /// The global encoding bits.
    pub(crate) global_encoding: u16,
    /// Point data record format, 0 to 10, without the compression bit.
    pub(crate) point_format: u8,
    /// Whether the points are compressed.
    pub(crate) compressed: bool,
    /// Bytes of one (uncompressed) record.
    pub(crate) record_len: u16,
    /// Bytes of the header block.
    pub(crate) header_size: u64,
    /// First byte of the points (if compressed, of the stored position of the chunk table).
    pub(crate) points_start: u64,
    /// The possible numbers of points, the most credible one first; never empty.
    pub(crate) counts: Vec<u64>,
    /// Scale and offset, checked.
    pub(crate) scaling: Scaling,
    /// Minimum and maximum of the coordinates as written, not trusted.
    pub(crate) extent: [[f64; 3]; 2],
    /// Variable length records of the header.
    pub(crate) vlrs: Directory,
    /// Extended variable length records.
    pub(crate) evlrs: Directory,
    /// First byte of the extended records (or of the waveforms of LAS 1.3), if the header names one.
    pub(crate) tail_start: Option<u64>,
    /// Position of the extended records according to the header, if it promises any. It is not checked.
    pub(crate) evlr_start: Option<u64>,
    /// Position of the waveform record according to the header. It is not checked, but copies state the
    /// correct one.
    pub(crate) waveform_start: Option<u64>,
    /// Problems that do not prevent processing.
    pub(crate) warnings: Vec<String>,
}

impl Header {
    /// Reads and checks the header of the file at `path`.
    ///
    /// # Errors
    /// Every kind of damage that makes the points unreadable or their coordinates meaningless.
    pub(crate) fn read(path: &Path, source: &ByteSource) -> Result<Self, InputError> {
        let raw = read_raw(path, source)?;
        let size = source.len();
        let header_size = u64::from(raw.header_size);
        let points_start = u64::from(raw.offset_to_point_data);
        let field = |field: &'static str, value: String, expected: String| InputError::HeaderField {
            path: path.to_owned(),
            field,
            value,
            expected,
        };
        if points_start < header_size || points_start > size {
            let expected = format!("{header_size} (the header) to {size} (the file)");
            return Err(field("offset to point data", points_start.to_string(), expected));
        }
        let point_format = raw.point_data_record_format & 0x3f;
        if point_format > 10 {
            return Err(field("point data format", point_format.to_string(), "0 to 10".into()));
        }
        let shortest = base_length(point_format);
        if raw.point_data_record_length < shortest {
            let expected = format!("at least {shortest} for point format {point_format}");
            return Err(field("record length", raw.point_data_record_length.to_string(), expected));
        }
        let mut warnings = Vec::new();
        let vlrs = read_vlrs(&raw, source, &mut warnings);
        let (tail_start, evlrs) = read_tail(&raw, source, &mut warnings);
        Ok(Self {
            version: (raw.version.major, raw.version.minor),
            global_encoding: raw.global_encoding,
            point_format,
            compressed: raw.point_data_record_format & COMPRESSED != 0,
            record_len: raw.point_data_record_length,
            header_size,
            points_start,
            counts: counts(&raw),
            scaling: scaling(path, &raw)?,
            extent: [[raw.min_x, raw.min_y, raw.min_z], [raw.max_x, raw.max_y, raw.max_z]],
            vlrs,
            evlrs,
            tail_start,
            evlr_start: raw.evlr.filter(|evlr| evlr.number_of_evlrs > 0).map(|evlr| evlr.start_of_first_evlr),
            waveform_start: raw.start_of_waveform_data_packet_record,
            warnings,
        })
    }

    /// All records of the header, then the extended ones.
    pub(crate) fn records(&self) -> impl Iterator<Item = &vlr::Vlr> {
        self.vlrs.records.iter().chain(&self.evlrs.records)
    }
}

/// The bytes of the header in the form that `las` reads, after a check of its size and version.
fn read_raw(path: &Path, source: &ByteSource) -> Result<raw::Header, InputError> {
    let size = source.len();
    let mut buffer = Vec::new();
    let read_error = |error| InputError::Read { path: path.to_owned(), source: error };
    let start = source.slice(0..size.min(HEADER_1_2), &mut buffer).map_err(read_error)?;
    if !start.starts_with(b"LASF") {
        let found = String::from_utf8_lossy(&start[..start.len().min(4)]).into_owned();
        return Err(InputError::NotLas { path: path.to_owned(), found });
    }
    let too_short =
        |needed: u64| InputError::TooShort { path: path.to_owned(), what: "header", needed, size };
    if size < HEADER_1_2 {
        return Err(too_short(HEADER_1_2));
    }
    let major = start[24];
    let minor = start[25];
    let needed = match (major, minor) {
        (1, 0..=2) => HEADER_1_2,
        (1, 3) => HEADER_1_3,
        (1, 4) => HEADER_1_4,
        _ => return Err(InputError::Version { path: path.to_owned(), major, minor }),
    };
    let declared = u64::from(u16::from_le_bytes([start[94], start[95]]));
    if declared < needed {
        return Err(InputError::HeaderField {
            path: path.to_owned(),
            field: "header size",
            value: declared.to_string(),
            expected: format!("at least {needed} for LAS {major}.{minor}"),
        });
    }
    if declared > size {
        return Err(too_short(declared));
    }
    let bytes = source.slice(0..declared, &mut buffer).map_err(read_error)?;
    raw::Header::read_from(bytes).map_err(|error| InputError::Read {
        path: path.to_owned(),
        source: std::io::Error::new(std::io::ErrorKind::InvalidData, error),
    })
}

/// Bytes of the fields of a point format, without extra bytes.
pub(crate) fn base_length(point_format: u8) -> u16 {
    las::point::Format::new(point_format).map_or(u16::MAX, |format| format.len())
}

fn read_vlrs(raw: &raw::Header, source: &ByteSource, warnings: &mut Vec<String>) -> Directory {
    let range = u64::from(raw.header_size)..u64::from(raw.offset_to_point_data);
    let promised = raw.number_of_variable_length_records;
    let vlrs = vlr::walk(source, range, promised, false);
    if vlrs.records.len() as u64 != u64::from(promised) {
        warnings.push(format!(
            "the header promises {promised} variable length records, but only {} fit before the points; the others are ignored",
            vlrs.records.len()
        ));
    }
    vlrs
}

/// The data after the points: extended records (LAS 1.4) or waveforms (LAS 1.3).
fn read_tail(raw: &raw::Header, source: &ByteSource, warnings: &mut Vec<String>) -> (Option<u64>, Directory) {
    let size = source.len();
    let points_start = u64::from(raw.offset_to_point_data);
    let Some(evlr) = raw.evlr else {
        let waveforms = raw.start_of_waveform_data_packet_record;
        return (waveforms.filter(|start| (points_start..=size).contains(start)), Directory::default());
    };
    let start = evlr.start_of_first_evlr;
    if start < points_start || start > size {
        warnings.push(format!(
            "the extended records should start at byte {start}, the points start at {points_start} and the file \
             has {size} bytes; the extended records are ignored"
        ));
        return (None, Directory::default());
    }
    let evlrs = vlr::walk(source, start..size, evlr.number_of_evlrs, true);
    if evlrs.records.len() as u64 != u64::from(evlr.number_of_evlrs) {
        warnings.push(format!(
            "the header promises {} extended records at byte {start}, but only {} are in the file; the others are ignored",
            evlr.number_of_evlrs,
            evlrs.records.len()
        ));
    }
    // A position without a record may be anywhere, even inside the points.
    ((!evlrs.records.is_empty()).then_some(start), evlrs)
}

/// The possible point counts. LAS 1.4 has two fields; a writer may fill both or only one.
fn counts(raw: &raw::Header) -> Vec<u64> {
    let legacy = u64::from(raw.number_of_point_records);
    match raw.large_file.map(|large| large.number_of_point_records) {
        Some(large) if large == legacy || legacy == 0 => vec![large],
        Some(0) | None => vec![legacy],
        Some(large) => vec![large, legacy],
    }
}

/// Scale and offset. An error if a coordinate computed with them could be infinite or undefined.
fn scaling(path: &Path, raw: &raw::Header) -> Result<Scaling, InputError> {
    let scaling = Scaling {
        scale: [raw.x_scale_factor, raw.y_scale_factor, raw.z_scale_factor],
        offset: [raw.x_offset, raw.y_offset, raw.z_offset],
    };
    for axis in 0..3 {
        let scale = scaling.scale[axis];
        let offset = scaling.offset[axis];
        let field = |field: &'static str, value: f64, expected: &str| InputError::HeaderField {
            path: path.to_owned(),
            field,
            value: format!("{value:e}"),
            expected: expected.into(),
        };
        if !(scale.is_finite() && scale > 0.0) {
            return Err(field(["x scale", "y scale", "z scale"][axis], scale, "a finite number above 0"));
        }
        if !offset.is_finite() {
            return Err(field(["x offset", "y offset", "z offset"][axis], offset, "a finite number"));
        }
    }
    Ok(scaling)
}

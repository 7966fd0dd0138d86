//! The positions of the fields in a point record: fixed ones by point format, extra ones by their
//! descriptors.

use super::header::{self, Header};
use super::mapped::ByteSource;
use super::vlr;
use crate::model::{Field, FlagPlace, RecordView};

/// Bytes of one extra-bytes descriptor (LAS 1.4 R15, table 24).
pub(crate) const DESCRIPTOR: usize = 192;
/// User id of the records of the LAS specification.
pub(crate) const SPEC_USER: &str = "LASF_Spec";
/// Record id of the description of extra bytes.
pub(crate) const EXTRA_BYTES: u16 = 4;

/// Size limit of the extra-bytes record: a descriptor for every byte of the longest record.
const MAX_DESCRIPTORS: u64 = (u16::MAX as u64) * (DESCRIPTOR as u64);

/// Bit of the flag of withheld points: in the byte with the class of formats 0 to 5 (LAS 1.4 R15, table 8),
/// and in the byte with the flags of formats 6 to 10 (table 16).
const WITHHELD: u8 = 1 << 7;
const WITHHELD_EXTENDED: u8 = 1 << 2;

/// The positions of the fields, in bytes from the start of the record.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordLayout {
    /// Point data record format, 0 to 10.
    pub point_format: u8,
    /// Bytes of one record.
    pub record_len: usize,
    /// Bytes of the standard fields of the format. Extra bytes follow.
    pub base_len: usize,
    /// GPS time (f64), if the format has it.
    pub gps_time: Option<usize>,
    /// Intensity (u16).
    pub intensity: usize,
    /// Byte with return number and number of returns.
    pub returns: usize,
    /// Number of bits of the return number in that byte, from bit 0. The number of returns follows with the
    /// same number of bits.
    pub return_bits: u8,
    /// Byte with the class.
    pub classification: usize,
    /// Bits of that byte for the class: 5 in formats 0 to 5, all in 6 to 10.
    pub classification_mask: u8,
    /// Flag of points that are withheld.
    pub withheld: FlagPlace,
    /// Point source id (u16).
    pub point_source_id: usize,
    /// Dimensions in the extra bytes with a descriptor.
    pub dimensions: Vec<ExtraDimension>,
    /// The descriptors of these dimensions, as they are in the file.
    pub(crate) descriptors: Vec<u8>,
}

/// Data types of unsigned extra dimensions of one, two and four bytes (LAS 1.4 R15, table 25).
const UNSIGNED_BYTE: u8 = 1;
const UNSIGNED_SHORT: u8 = 3;
const UNSIGNED_LONG: u8 = 5;

/// Where a field of a point is in its record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FieldPlace {
    offset: usize,
    /// Whether the field has two bytes instead of one.
    wide: bool,
}

impl FieldPlace {
    /// The value in a record.
    #[inline]
    #[must_use]
    pub fn value(self, record: &[u8]) -> u16 {
        let low = record[self.offset];
        if self.wide { u16::from_le_bytes([low, record[self.offset + 1]]) } else { low.into() }
    }
}

/// One described dimension of the extra bytes.
#[derive(Debug, Clone, PartialEq)]
pub struct ExtraDimension {
    /// Name without padding.
    pub name: String,
    /// Description without padding.
    pub description: String,
    /// Data type of the LAS specification: 0 undocumented bytes, 1 u8, 2 i8, 3 u16, 4 i16, 5 u32, 6 i32, 7
    /// u64, 8 i64, 9 f32, 10 f64; 11 to 30 are the deprecated pairs and triples of these.
    pub data_type: u8,
    /// First byte in the record.
    pub offset: usize,
    /// Its size in bytes.
    pub size: usize,
    /// Scale of the stored value, if the descriptor has one.
    pub scale: Option<f64>,
    /// Offset after scaling, if the descriptor has one.
    pub value_offset: Option<f64>,
}

impl RecordLayout {
    /// The layout from header and descriptors. Dimensions that do not fit are ignored with a warning.
    pub(crate) fn read(header: &Header, source: &ByteSource, warnings: &mut Vec<String>) -> Self {
        let extended = header.point_format >= 6;
        let base_len = usize::from(header::base_length(header.point_format));
        let gps_time = match header.point_format {
            0 | 2 => None,
            1 | 3..=5 => Some(20),
            _ => Some(22),
        };
        let mut layout = Self {
            point_format: header.point_format,
            record_len: usize::from(header.record_len),
            base_len,
            gps_time,
            intensity: 12,
            returns: 14,
            return_bits: if extended { 4 } else { 3 },
            classification: if extended { 16 } else { 15 },
            classification_mask: if extended { 0xff } else { 0x1f },
            withheld: FlagPlace { offset: 15, mask: if extended { WITHHELD_EXTENDED } else { WITHHELD } },
            point_source_id: if extended { 20 } else { 18 },
            dimensions: Vec::new(),
            descriptors: Vec::new(),
        };
        let mut fits = true;
        for record in header.records().filter(|record| record.is(SPEC_USER, EXTRA_BYTES)) {
            let bytes = record.read(source, MAX_DESCRIPTORS).unwrap_or_default();
            // If one dimension does not fit, the positions of the following ones are unknown.
            fits = fits && layout.describe(&bytes, warnings);
        }
        layout
    }

    /// Records of this layout.
    #[must_use]
    pub fn view<'a>(&self, bytes: &'a [u8]) -> RecordView<'a> {
        let withheld = Some(self.withheld);
        RecordView { bytes, stride: self.record_len, gps_time: self.gps_time, withheld }
    }

    /// Where a field that is not a coordinate is, if the records have it.
    #[must_use]
    pub fn field(&self, field: Field) -> Option<FieldPlace> {
        match field {
            Field::Class | Field::Core => {
                let dimension =
                    self.dimension(field.name()).filter(|found| found.data_type == UNSIGNED_BYTE)?;
                Some(FieldPlace { offset: dimension.offset, wide: false })
            }
            // Little-endian, so the lower two bytes of a wider number come first.
            Field::Instance => {
                let dimension = self.dimension(field.name());
                let found =
                    dimension.filter(|found| matches!(found.data_type, UNSIGNED_SHORT | UNSIGNED_LONG))?;
                Some(FieldPlace { offset: found.offset, wide: true })
            }
            Field::InstanceUpper => {
                let found = self.dimension(field.name()).filter(|found| found.data_type == UNSIGNED_LONG)?;
                Some(FieldPlace { offset: found.offset + 2, wide: true })
            }
            _ => self.word(field).map(|offset| FieldPlace { offset, wide: true }),
        }
    }

    /// Offset of a field of two bytes.
    fn word(&self, field: Field) -> Option<usize> {
        let red = match self.point_format {
            2 => Some(20),
            3 | 5 => Some(28),
            7 | 8 | 10 => Some(30),
            _ => None,
        };
        match field {
            Field::X
            | Field::Y
            | Field::Z
            | Field::Class
            | Field::Core
            | Field::Instance
            | Field::InstanceUpper => None,
            Field::Intensity => Some(self.intensity),
            Field::Red => red,
            Field::Green => red.map(|red| red + 2),
            Field::Blue => red.map(|red| red + 4),
            Field::Nir => matches!(self.point_format, 8 | 10).then_some(36),
        }
    }

    /// The extra bytes after the last described dimension.
    #[must_use]
    pub fn undescribed(&self) -> std::ops::Range<usize> {
        let end = self.dimensions.last().map_or(self.base_len, |last| last.offset + last.size);
        end..self.record_len
    }

    /// The described dimension of this name.
    #[must_use]
    pub fn dimension(&self, name: &str) -> Option<&ExtraDimension> {
        self.dimensions.iter().find(|dimension| dimension.name == name)
    }

    /// Adds the dimensions of one extra-bytes record after the previous ones. Returns whether all fit.
    fn describe(&mut self, bytes: &[u8], warnings: &mut Vec<String>) -> bool {
        if !bytes.len().is_multiple_of(DESCRIPTOR) {
            warnings.push(format!(
                "an extra-bytes record has {} bytes, which is not a multiple of {DESCRIPTOR}; its end is ignored",
                bytes.len()
            ));
        }
        for descriptor in bytes.chunks_exact(DESCRIPTOR) {
            let dimension = parse_descriptor(descriptor, self.undescribed().start);
            if dimension.data_type == 0 && dimension.size == 0 {
                continue; // undocumented, of no bytes: nothing to describe
            }
            let end = dimension.offset + dimension.size;
            if dimension.size == 0 || end > self.record_len {
                warnings.push(format!(
                    "the extra dimension {:?} (type {}) would end at byte {end} of records of {}; it and those \
                     after it are ignored",
                    dimension.name, dimension.data_type, self.record_len
                ));
                return false;
            }
            self.dimensions.push(dimension);
            self.descriptors.extend_from_slice(descriptor);
        }
        true
    }
}

fn parse_descriptor(bytes: &[u8], offset: usize) -> ExtraDimension {
    let data_type = bytes[2];
    let options = bytes[3];
    let size = match data_type {
        0 => usize::from(options),
        1..=30 => type_size(data_type),
        _ => 0,
    };
    let real = |at: usize| {
        let mut value = [0; 8];
        value.copy_from_slice(&bytes[at..at + 8]);
        f64::from_le_bytes(value)
    };
    let option = |bit: u8, at: usize| (data_type != 0 && options & bit != 0).then(|| real(at));
    ExtraDimension {
        name: vlr::text(&bytes[4..36]),
        description: vlr::text(&bytes[160..192]),
        data_type,
        offset,
        size,
        scale: option(0x08, 112),
        value_offset: option(0x10, 136),
    }
}

/// Bytes of a data type 1 to 30 (11 to 20 are pairs, 21 to 30 triples of 1 to 10).
fn type_size(data_type: u8) -> usize {
    const SINGLE: [usize; 10] = [1, 1, 2, 2, 4, 4, 8, 8, 4, 8];
    let index = usize::from(data_type - 1);
    SINGLE[index % 10] * (index / 10 + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_of_data_types_follow_the_specification() {
        for (data_type, size) in
            [(1, 1), (4, 2), (5, 4), (8, 8), (9, 4), (10, 8), (11, 2), (20, 16), (30, 24)]
        {
            assert_eq!(type_size(data_type), size, "type {data_type}");
        }
    }

    #[test]
    fn coordinates_are_little_endian() {
        let mut record = [0_u8; 20];
        record[0] = 1;
        record[4..8].copy_from_slice(&(-2_i32).to_le_bytes());
        record[10] = 1;
        assert_eq!(crate::model::record_xyz(&record), [1, -2, 65_536]);
    }
}

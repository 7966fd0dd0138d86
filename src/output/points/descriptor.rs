//! Extra-bytes descriptors and variable length records as bytes. This module knows nothing about files.

use std::ops::Range;

use crate::input::RecordLayout;
use crate::input::vlr::text;

/// Bytes of one descriptor (LAS 1.4 R15, table 24).
pub(crate) const DESCRIPTOR: usize = 192;
/// Data type of undocumented bytes; the options field then contains their number.
const UNDOCUMENTED: u8 = 0;
/// Bits of the options field that say whether scale and offset are valid. laspy 2 reads them for
/// undocumented bytes as well, and fails. So undocumented bytes have none of them.
const SCALE_AND_OFFSET: u8 = 1 << 3 | 1 << 4;
/// Bits of the options field that say whether the values for no data, minimum and maximum are valid, and the
/// bytes of these values (LAS 1.4 R15, tables 24 and 26).
const OF_VALUES: u8 = 0b111;
const VALUES: Range<usize> = 40..112;
/// Name of the dimension that keeps the class of the input.
pub(crate) const ORIGINAL_CLASS: &str = "original_classification";
/// Its description. It tells our dimension from that of another program.
pub(crate) const ORIGINAL_CLASS_TEXT: &str = "class before chainage";
/// Name of the dimension with the class of the object.
pub(crate) const OBJECT_CLASS: &str = "object_class";

/// Type of an extra-bytes dimension, with its code in the descriptor (LAS 1.4 R15, table 25).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum ExtraType {
    /// Unsigned byte.
    U8 = 1,
    /// Unsigned 32-bit integer.
    U32 = 5,
}

impl ExtraType {
    /// Bytes of a value.
    pub(crate) fn bytes(self) -> u16 {
        match self {
            Self::U8 => 1,
            Self::U32 => 4,
        }
    }
}

/// The descriptor of an unsigned integer dimension.
///
/// Scale 1 and offset 0 are written although the option bits that would make them valid stay unset: some
/// readers multiply by the field without checking the bits. Minimum, maximum and no-data stay unset.
pub(crate) fn integer(name: &str, kind: ExtraType, description: &str) -> [u8; DESCRIPTOR] {
    let mut bytes = [0; DESCRIPTOR];
    bytes[2] = kind as u8;
    bytes[4..36].copy_from_slice(&padded::<32>(name));
    for slot in 0..3 {
        bytes[112 + 8 * slot..120 + 8 * slot].copy_from_slice(&1.0_f64.to_le_bytes());
        bytes[136 + 8 * slot..144 + 8 * slot].copy_from_slice(&0.0_f64.to_le_bytes());
    }
    bytes[160..192].copy_from_slice(&padded::<32>(description));
    bytes
}

/// The descriptors that a copy needs.
#[derive(Debug, Clone, Default)]
pub(super) struct Descriptors {
    /// Those of new dimensions.
    pub(super) new: Vec<[u8; DESCRIPTOR]>,
    /// Names of dimensions of the input whose values the run replaces.
    pub(super) replaced: Vec<String>,
}

impl Descriptors {
    /// These descriptors of the input without no-data, minimum and maximum of values that the run replaces.
    /// They were those of the old values: with a no-data of 3, readers would hide the new object 3.
    pub(super) fn updated(&self, mut descriptors: Vec<u8>) -> Vec<u8> {
        for descriptor in descriptors.chunks_exact_mut(DESCRIPTOR) {
            let is_replaced = self.replaced.contains(&text(&descriptor[4..36]));
            // The options of undocumented bytes are their number.
            if is_replaced && descriptor[2] != UNDOCUMENTED && descriptor[3] & OF_VALUES != 0 {
                descriptor[3] &= !OF_VALUES;
                descriptor[VALUES].fill(0);
            }
        }
        descriptors
    }
}

/// What the descriptor of the dimension with the label of a point says.
pub(crate) fn of_label(surfaces: bool) -> &'static str {
    if surfaces { "surface, 0: none" } else { "object, 0: none" }
}

/// Descriptors for the extra bytes that have none, so that readers find a dimension after them at its place.
pub(crate) fn undescribed(layout: &RecordLayout) -> Vec<[u8; DESCRIPTOR]> {
    let Range { mut start, end } = layout.undescribed();
    let mut descriptors = Vec::new();
    while start < end {
        let count = piece(end - start);
        let mut bytes = [0; DESCRIPTOR];
        bytes[2] = UNDOCUMENTED;
        bytes[3] = count;
        bytes[4..36].copy_from_slice(&padded::<32>(&format!("undescribed_{}", start - layout.base_len)));
        bytes[160..192].copy_from_slice(&padded::<32>("bytes without a description"));
        descriptors.push(bytes);
        start += usize::from(count);
    }
    descriptors
}

/// The largest number of bytes, of `left`, that one descriptor may have.
fn piece(left: usize) -> u8 {
    let most = u8::try_from(left).unwrap_or(u8::MAX);
    (0..=most).rev().find(|count| count & SCALE_AND_OFFSET == 0).unwrap_or(0)
}

/// A variable length record with its header. The payload must be shorter than 65,536 bytes.
pub(crate) fn vlr(user: &str, record: u16, description: &str, payload: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0, 0];
    bytes.extend(padded::<16>(user));
    bytes.extend(record.to_le_bytes());
    bytes.extend(u16::try_from(payload.len()).unwrap_or(u16::MAX).to_le_bytes());
    bytes.extend(padded::<32>(description));
    bytes.extend(payload);
    bytes
}

/// `text` in a field of N bytes that ends in at least one zero.
pub(crate) fn padded<const N: usize>(text: &str) -> [u8; N] {
    let mut field = [0; N];
    let length = text.len().min(N - 1);
    field[..length].copy_from_slice(&text.as_bytes()[..length]);
    field
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_descriptor_has_its_fields_where_the_specification_says() {
        let bytes = integer("cluster_id", ExtraType::U32, "object");
        assert_eq!((bytes[2], bytes[3]), (5, 0));
        assert_eq!(&bytes[4..15], b"cluster_id\0");
        assert_eq!(bytes[112..120], 1.0_f64.to_le_bytes());
        assert_eq!(bytes[128..136], 1.0_f64.to_le_bytes());
        assert_eq!(bytes[136..160], [0; 24]);
        assert_eq!(&bytes[160..167], b"object\0");
        assert!(bytes[36..112].iter().all(|byte| *byte == 0), "no data, minimum and maximum are unset");
    }

    #[test]
    fn only_values_that_the_run_replaces_lose_their_minimum_and_maximum() {
        let stale = |name: &str, kind: u8, options: u8| {
            let mut bytes = integer(name, ExtraType::U32, "object");
            (bytes[2], bytes[3]) = (kind, options);
            bytes[VALUES].fill(7);
            bytes
        };
        let before = [
            stale("cluster_id", 5, 0b1_0111),
            stale("cluster_id", 5, 0b1_0000),
            stale("cluster_id", UNDOCUMENTED, 7),
            stale("cluster", 5, 0b111),
        ];
        let wanted = Descriptors { new: Vec::new(), replaced: vec!["cluster_id".to_owned()] };
        let after = wanted.updated(before.concat());
        let mut first = integer("cluster_id", ExtraType::U32, "object");
        first[3] = 0b1_0000;
        assert_eq!(after[..DESCRIPTOR], first);
        assert_eq!(after[DESCRIPTOR..], before[1..].concat());
    }

    #[test]
    fn numbers_of_bytes_do_not_look_like_a_scale() {
        let expected =
            [(1, 1), (7, 7), (8, 7), (31, 7), (32, 32), (45, 39), (69, 69), (255, 231), (300, 231)];
        for (left, count) in expected {
            assert_eq!(piece(left), count, "{left}");
        }
    }

    #[test]
    fn a_record_header_takes_54_bytes() {
        let bytes = vlr("LASF_Spec", 4, "Extra Bytes", &[7; 3]);
        assert_eq!(bytes.len(), 57);
        assert_eq!(&bytes[2..12], b"LASF_Spec\0");
        assert_eq!(bytes[18..22], [4, 0, 3, 0]);
    }
}

//! The directory of variable length records of a file: their names and positions. Their meaning is
//! interpreted elsewhere.

use std::ops::Range;

use super::mapped::ByteSource;

/// Bytes of the header of a variable length record.
pub(crate) const VLR_HEADER: u64 = 54;
/// Bytes of the header of an extended variable length record.
pub(crate) const EVLR_HEADER: u64 = 60;

/// One variable length record, of the header (VLR) or after the points (EVLR).
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Vlr {
    /// User id without the padding.
    pub(crate) user: String,
    /// Record id.
    pub(crate) record: u16,
    /// Byte of the file at which the header of the record starts.
    pub(crate) start: u64,
    /// Bytes of the file with the payload.
    pub(crate) payload: Range<u64>,
}

impl Vlr {
    /// Whether the record has this user id and record id.
    pub(crate) fn is(&self, user: &str, record: u16) -> bool {
        self.user == user && self.record == record
    }

    /// The payload, if it can be read and is at most `limit` bytes long.
    pub(crate) fn read(&self, source: &ByteSource, limit: u64) -> Option<Vec<u8>> {
        if self.payload.end - self.payload.start > limit {
            return None;
        }
        let mut buffer = Vec::new();
        source.slice(self.payload.clone(), &mut buffer).ok().map(<[u8]>::to_vec)
    }
}

/// The records found, and the end of their chain.
#[derive(Debug, Default)]
pub(crate) struct Directory {
    /// The records in file order.
    pub(crate) records: Vec<Vlr>,
    /// First byte after the last record.
    pub(crate) end: u64,
}

/// Follows a chain of `count` records through `range`. Stops early, without an error, at a record that does
/// not fit.
///
/// `count` may be any number. A record is at least as long as its header, so the walk ends with the range.
pub(crate) fn walk(source: &ByteSource, range: Range<u64>, count: u32, extended: bool) -> Directory {
    let head = if extended { EVLR_HEADER } else { VLR_HEADER };
    let mut directory = Directory { records: Vec::new(), end: range.start };
    let mut buffer = Vec::new();
    for _ in 0..count {
        let start = directory.end;
        let Some(payload) = start.checked_add(head).filter(|payload| *payload <= range.end) else { break };
        let Ok(bytes) = source.slice(start..payload, &mut buffer) else { break };
        let length = if extended {
            u64::from_le_bytes([
                bytes[20], bytes[21], bytes[22], bytes[23], bytes[24], bytes[25], bytes[26], bytes[27],
            ])
        } else {
            u64::from(u16::from_le_bytes([bytes[20], bytes[21]]))
        };
        let Some(end) = payload.checked_add(length).filter(|end| *end <= range.end) else { break };
        let record = u16::from_le_bytes([bytes[18], bytes[19]]);
        directory.records.push(Vlr { user: text(&bytes[2..18]), record, start, payload: payload..end });
        directory.end = end;
    }
    directory
}

/// A text field padded with zeros.
pub(crate) fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    decode(&bytes[..end]).trim().to_owned()
}

/// A text in its likely encoding: UTF-8, else Latin-1, which older writers used.
pub(crate) fn decode(bytes: &[u8]) -> String {
    std::str::from_utf8(bytes)
        .map_or_else(|_| bytes.iter().map(|byte| char::from(*byte)).collect(), str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_end_at_the_first_zero_and_may_be_latin_1() {
        assert_eq!(text(b"LASF_Spec\0\0garbage"), "LASF_Spec");
        assert_eq!(text("p\u{e5}".as_bytes()), "p\u{e5}");
        assert_eq!(text(b"p\xe5 \0"), "p\u{e5}");
    }
}

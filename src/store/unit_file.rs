//! The file that one unit of a pass (a tile, a run of blocks) leaves behind: its result and its commit record.
//!
//! ```text
//! file    := magic version unit fingerprint length payload checksum trailer
//! magic   := "CHAINAGE"                8 bytes
//! version := u32                       FORMAT_VERSION; raised when the bytes of any payload or of the plan change meaning
//! unit    := u32                       number of the unit in its pass
//! fingerprint := u128                  of everything the payload depends on
//! length  := u64                       bytes of payload
//! checksum := u64                      XXH3 of everything before it
//! trailer := "COMMITED"                8 bytes; a file without it was cut
//! ```
//! All numbers little-endian. A reader refuses a file that is cut, damaged or of another version or fingerprint, and
//! says why; it never believes `length` before it has compared it with the size of the file.

use std::ops::Range;

use xxhash_rust::xxh3::xxh3_64;

use crate::store::Fingerprint;

/// Version of the state on disk; a change of any payload raises it.
pub const FORMAT_VERSION: u32 = 3;

const MAGIC: &[u8; 8] = b"CHAINAGE";
const TRAILER: &[u8; 8] = b"COMMITED";
pub(crate) const HEADER_LEN: usize = 8 + 4 + 4 + 16 + 8;
pub(crate) const FOOTER_LEN: usize = 8 + 8;

/// Why a unit file is not used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Refusal {
    /// Cut, or bytes changed.
    Damaged(&'static str),
    /// Whole, but of another version of the format.
    OtherVersion(u32),
    /// Whole, but it depends on something that has changed since.
    Stale,
}

/// The bytes of a unit file.
pub(crate) fn encode(unit: u32, fingerprint: Fingerprint, payload: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEADER_LEN + payload.len() + FOOTER_LEN);
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&FORMAT_VERSION.to_le_bytes());
    bytes.extend_from_slice(&unit.to_le_bytes());
    bytes.extend_from_slice(&fingerprint.0.to_le_bytes());
    bytes.extend_from_slice(&(payload.len() as u64).to_le_bytes());
    bytes.extend_from_slice(payload);
    let checksum = xxh3_64(&bytes);
    bytes.extend_from_slice(&checksum.to_le_bytes());
    bytes.extend_from_slice(TRAILER);
    bytes
}

/// Where the payload of a unit file of `length` bytes is, by its header alone: for readers of a part of it, after the
/// whole was checked when the pass began or was written by it.
pub(crate) fn payload_range(
    header: &[u8; HEADER_LEN],
    length: u64,
    unit: u32,
    fingerprint: Fingerprint,
) -> Result<Range<u64>, Refusal> {
    let u32_at = |at: usize| u32::from_le_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]]);
    let payload = length.checked_sub((HEADER_LEN + FOOTER_LEN) as u64);
    let Some(payload) = payload.filter(|payload| header[32..40] == payload.to_le_bytes()) else {
        return Err(Refusal::Damaged("length does not match"));
    };
    if &header[..8] != MAGIC || u32_at(12) != unit {
        return Err(Refusal::Damaged("magic or number of the unit do not match"));
    }
    if u32_at(8) != FORMAT_VERSION {
        return Err(Refusal::OtherVersion(u32_at(8)));
    }
    if header[16..32] != fingerprint.0.to_le_bytes() {
        return Err(Refusal::Stale);
    }
    Ok(HEADER_LEN as u64..HEADER_LEN as u64 + payload)
}

/// The payload of a unit file, in place: what stands between header and footer of `bytes`.
pub(crate) fn decode(bytes: &[u8], unit: u32, fingerprint: Fingerprint) -> Result<&[u8], Refusal> {
    let damaged = Refusal::Damaged;
    if bytes.len() < HEADER_LEN + FOOTER_LEN {
        return Err(damaged("shorter than a header and a footer"));
    }
    let (content, footer) = bytes.split_at(bytes.len() - FOOTER_LEN);
    if &content[..8] != MAGIC {
        return Err(damaged("not a file of chainage"));
    }
    if &footer[8..] != TRAILER || footer[..8] != xxh3_64(content).to_le_bytes() {
        return Err(damaged("checksum or trailer do not match"));
    }
    let mut fields = [0_u8; HEADER_LEN];
    fields.copy_from_slice(&content[..HEADER_LEN]);
    let u32_at = |at: usize| u32::from_le_bytes([fields[at], fields[at + 1], fields[at + 2], fields[at + 3]]);
    if u32_at(8) != FORMAT_VERSION {
        return Err(Refusal::OtherVersion(u32_at(8)));
    }
    let payload = &content[HEADER_LEN..];
    if fields[32..40] != (payload.len() as u64).to_le_bytes() || u32_at(12) != unit {
        return Err(damaged("length or number of the unit do not match"));
    }
    if fields[16..32] != fingerprint.0.to_le_bytes() {
        return Err(Refusal::Stale);
    }
    Ok(payload)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_prefix_and_every_flipped_byte_is_refused() {
        let fingerprint = Fingerprint(77);
        let whole = encode(3, fingerprint, b"payload of a tile");
        assert_eq!(decode(&whole, 3, fingerprint), Ok(&b"payload of a tile"[..]));
        for length in 0..whole.len() {
            assert!(decode(&whole[..length], 3, fingerprint).is_err(), "prefix of {length} bytes");
        }
        for position in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[position] ^= 0x10;
            assert!(decode(&bytes, 3, fingerprint).is_err(), "byte {position} flipped");
            let header: &[u8; HEADER_LEN] = bytes.first_chunk().unwrap();
            let range = payload_range(header, bytes.len() as u64, 3, fingerprint);
            assert_eq!(range.is_err(), position < HEADER_LEN, "byte {position} of the header flipped");
        }
        let mut longer = whole.clone();
        longer.push(0);
        assert!(decode(&longer, 3, fingerprint).is_err());
    }

    #[test]
    fn another_unit_fingerprint_or_version_is_told_apart() {
        let whole = encode(3, Fingerprint(77), b"x");
        assert_eq!(decode(&whole, 3, Fingerprint(78)), Err(Refusal::Stale));
        assert!(matches!(decode(&whole, 4, Fingerprint(77)), Err(Refusal::Damaged(_))));
    }
}

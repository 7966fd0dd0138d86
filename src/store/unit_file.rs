//! The file that one unit of a pass (a tile, a run of blocks) leaves behind: its result and its commit
//! record.
//!
//! ```text
//! file    := magic version unit fingerprint length payload checksum trailer
//! magic   := "CHAINAGE"                8 bytes
//! version := u32                       FORMAT_VERSION; raised when payloads or the plan change meaning
//! unit    := u32                       number of the unit in its pass
//! fingerprint := u128                  of everything the payload depends on
//! length  := u64                       bytes of payload
//! checksum := u64                      XXH3 of everything before it
//! trailer := "COMMITED"                8 bytes; a file without it was cut
//! ```
//! All numbers are little-endian. A reader refuses a file that is truncated, damaged, or of another version
//! or fingerprint, and gives the reason. It compares `length` with the size of the file before it uses it.

use std::io::{self, Read, Write};
use std::ops::Range;

use xxhash_rust::xxh3::Xxh3;

use crate::store::Fingerprint;

/// Version of the state on disk. A change of any payload raises it.
pub const FORMAT_VERSION: u32 = 27;

const MAGIC: &[u8; 8] = b"CHAINAGE";
const TRAILER: &[u8; 8] = b"COMMITED";
pub(crate) const HEADER_LEN: usize = 8 + 4 + 4 + 16 + 8;
pub(crate) const FOOTER_LEN: usize = 8 + 8;

/// Why a unit file cannot be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Refusal {
    /// The file is truncated, or bytes have changed.
    Damaged(&'static str),
    /// The file is complete, but of another version of the format.
    OtherVersion(u32),
    /// The file is complete, but a value that it depends on has changed.
    Stale,
}

impl std::fmt::Display for Refusal {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Damaged(what) => write!(formatter, "it is damaged: {what}"),
            Self::OtherVersion(version) => {
                write!(formatter, "it has state version {version}, this is {FORMAT_VERSION}")
            }
            Self::Stale => formatter.write_str("it was computed from other input or with other settings"),
        }
    }
}

/// Bytes that are read at a time.
const BUFFER_BYTES: usize = 1 << 18;

/// Writes a unit file.
pub(crate) fn write(
    to: &mut dyn Write,
    unit: u32,
    fingerprint: Fingerprint,
    payload: &[u8],
) -> io::Result<()> {
    let mut header = Vec::with_capacity(HEADER_LEN);
    header.extend_from_slice(MAGIC);
    header.extend_from_slice(&FORMAT_VERSION.to_le_bytes());
    header.extend_from_slice(&unit.to_le_bytes());
    header.extend_from_slice(&fingerprint.0.to_le_bytes());
    header.extend_from_slice(&(payload.len() as u64).to_le_bytes());
    let mut checksum = Xxh3::new();
    checksum.update(&header);
    checksum.update(payload);
    to.write_all(&header)?;
    to.write_all(payload)?;
    to.write_all(&checksum.digest().to_le_bytes())?;
    to.write_all(TRAILER)
}

/// The range of the payload in a unit file of `length` bytes, from its header alone. For readers of a part of
/// the payload: the whole file was checked when the pass started, or this pass has written it.
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

/// Checks every byte of a unit file of `length` bytes. Appends the payload to `payload`, if that is given.
pub(crate) fn check(
    mut file: impl Read,
    length: u64,
    unit: u32,
    fingerprint: Fingerprint,
    mut payload: Option<&mut Vec<u8>>,
) -> io::Result<Result<(), Refusal>> {
    let damaged = |what| Ok(Err(Refusal::Damaged(what)));
    let Some(mut left) = length.checked_sub((HEADER_LEN + FOOTER_LEN) as u64) else {
        return damaged("shorter than a header and a footer");
    };
    let mut header = [0; HEADER_LEN];
    file.read_exact(&mut header)?;
    if &header[..8] != MAGIC {
        return damaged("not a file of chainage");
    }
    let mut checksum = Xxh3::new();
    checksum.update(&header);
    let mut buffer = vec![0; BUFFER_BYTES];
    while left > 0 {
        let part = usize::try_from(left).unwrap_or(usize::MAX).min(buffer.len());
        file.read_exact(&mut buffer[..part])?;
        checksum.update(&buffer[..part]);
        if let Some(payload) = &mut payload {
            payload.extend_from_slice(&buffer[..part]);
        }
        left -= part as u64;
    }
    let mut footer = [0; FOOTER_LEN];
    file.read_exact(&mut footer)?;
    if &footer[8..] != TRAILER || footer[..8] != checksum.digest().to_le_bytes() {
        return damaged("checksum or trailer do not match");
    }
    Ok(payload_range(&header, length, unit, fingerprint).map(|_| ()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encode(unit: u32, fingerprint: Fingerprint, payload: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        write(&mut bytes, unit, fingerprint, payload).unwrap();
        bytes
    }

    fn decode(bytes: &[u8], unit: u32, fingerprint: Fingerprint) -> Result<Vec<u8>, Refusal> {
        let mut payload = Vec::new();
        check(bytes, bytes.len() as u64, unit, fingerprint, Some(&mut payload)).unwrap().map(|()| payload)
    }

    #[test]
    fn every_prefix_and_every_flipped_byte_is_refused() {
        let fingerprint = Fingerprint(77);
        let whole = encode(3, fingerprint, b"payload of a tile");
        assert_eq!(decode(&whole, 3, fingerprint), Ok(b"payload of a tile".to_vec()));
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
        let mut later = whole.clone();
        later[8..12].copy_from_slice(&(FORMAT_VERSION + 1).to_le_bytes());
        let end = later.len() - FOOTER_LEN;
        let mut checksum = Xxh3::new();
        checksum.update(&later[..end]);
        later[end..end + 8].copy_from_slice(&checksum.digest().to_le_bytes());
        assert_eq!(decode(&later, 3, Fingerprint(77)), Err(Refusal::OtherVersion(FORMAT_VERSION + 1)));
    }
}

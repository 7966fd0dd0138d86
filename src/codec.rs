//! Payloads of units as bytes. The checksum of the unit file rules out damage, so a payload that cannot be
//! decoded is a bug.
//!
//! A payload may consist of sections, so that a reader takes what it needs and leaves the rest:
//!
//! ```text
//! sections := count end* section*
//! count    := u64       number of sections
//! end      := u64       where each section ends, counted from the end of this table
//! ```
//! Numbers are little-endian.

use std::ops::Range;

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::{Error, Result};

/// Bytes of a number in the table of sections.
const WORD: usize = size_of::<u64>();

/// The bytes of a payload.
pub(crate) fn encode<T: Serialize>(value: &T) -> Result<Vec<u8>> {
    postcard::to_stdvec(value).map_err(|error| Error::bug(format!("a payload does not encode: {error}")))
}

/// The payload in `bytes`.
pub(crate) fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Result<T> {
    postcard::from_bytes(bytes).map_err(|error| Error::bug(format!("a payload does not decode: {error}")))
}

/// Packs sections into one string of bytes.
pub(crate) fn pack<S: AsRef<[u8]>>(sections: &[S]) -> Vec<u8> {
    let length: usize = sections.iter().map(|section| section.as_ref().len()).sum();
    let mut bytes = Vec::with_capacity((1 + sections.len()) * WORD + length);
    bytes.extend((sections.len() as u64).to_le_bytes());
    let mut end = 0;
    for section in sections {
        end += section.as_ref().len() as u64;
        bytes.extend(end.to_le_bytes());
    }
    sections.iter().for_each(|section| bytes.extend_from_slice(section.as_ref()));
    bytes
}

/// Section `number` of packed bytes.
pub(crate) fn section(bytes: &[u8], number: usize) -> Result<&[u8]> {
    Ok(&bytes[section_in(bytes, number)?])
}

/// The range of section `number` in packed bytes.
pub(crate) fn section_in(bytes: &[u8], number: usize) -> Result<Range<usize>> {
    let range = section_range(&mut |range| bytes.get(to_usize(&range)?).map(<[u8]>::to_vec), number);
    let range = range.and_then(|range| to_usize(&range)).filter(|range| bytes.get(range.clone()).is_some());
    range.ok_or_else(|| no_section(number))
}

/// The range of section `number`. `read` returns bytes of the packed string. `None` if the section does not
/// exist.
pub(crate) fn section_range(
    read: &mut dyn FnMut(Range<u64>) -> Option<Vec<u8>>,
    number: usize,
) -> Option<Range<u64>> {
    let mut word = |at: usize| {
        let start = (at * WORD) as u64;
        let bytes = read(start..start + WORD as u64)?;
        bytes.first_chunk().map(|bytes| u64::from_le_bytes(*bytes))
    };
    let count = word(0)?;
    if number as u64 >= count {
        return None;
    }
    let body = count.checked_add(1)?.checked_mul(WORD as u64)?;
    let start = if number == 0 { 0 } else { word(number)? };
    Some(body.checked_add(start)?..body.checked_add(word(number + 1)?)?)
}

/// The error of a missing section.
pub(crate) fn no_section(number: usize) -> Error {
    Error::bug(format!("a payload has no section {number}"))
}

fn to_usize(range: &Range<u64>) -> Option<Range<usize>> {
    Some(usize::try_from(range.start).ok()?..usize::try_from(range.end).ok()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_section_is_found_and_no_other() {
        let sections: [&[u8]; 4] = [b"head", b"", b"two", b"3"];
        let bytes = pack(&sections);
        for (number, expected) in sections.iter().enumerate() {
            assert_eq!(section(&bytes, number).unwrap(), *expected);
        }
        assert!(section(&bytes, 4).is_err());
        for length in 0..bytes.len() {
            assert!(section(&bytes[..length], 3).is_err(), "cut to {length}");
        }
    }
}

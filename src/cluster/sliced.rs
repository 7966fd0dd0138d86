//! A global in slices: one value for the drive and one for each tile, in one string of bytes, so that a tile decodes
//! what concerns it and its neighbours, and not what the whole drive came to.
//!
//! ```text
//! global := count end* head slice*
//! count  := u64       number of slices
//! end    := u64       where the head and each slice end, from the end of this table
//! ```
//! Numbers little-endian; head and slices are payloads of their own.

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::codec;
use crate::error::{Error, Result};

const WORD: usize = size_of::<u64>();

/// The bytes of a global.
pub(crate) fn encode<H: Serialize, S: Serialize>(head: &H, slices: &[S]) -> Result<Vec<u8>> {
    let mut body = codec::encode(head)?;
    let mut ends = vec![body.len()];
    for slice in slices {
        body.extend(codec::encode(slice)?);
        ends.push(body.len());
    }
    let mut bytes = Vec::with_capacity((1 + ends.len()) * WORD + body.len());
    bytes.extend((slices.len() as u64).to_le_bytes());
    bytes.extend(ends.iter().flat_map(|&end| (end as u64).to_le_bytes()));
    bytes.extend(body);
    Ok(bytes)
}

/// The value for the drive.
pub(crate) fn head<H: DeserializeOwned>(global: &[u8]) -> Result<H> {
    codec::decode(part(global, 0)?)
}

/// The value of a tile.
pub(crate) fn slice<S: DeserializeOwned>(global: &[u8], tile: u32) -> Result<S> {
    codec::decode(part(global, tile as usize + 1)?)
}

fn part(global: &[u8], number: usize) -> Result<&[u8]> {
    find(global, number).ok_or_else(|| Error::bug(format!("a global has no part {number}")))
}

fn find(global: &[u8], number: usize) -> Option<&[u8]> {
    let (words, _) = global.as_chunks::<WORD>();
    let word = |at: usize| words.get(at).and_then(|word| usize::try_from(u64::from_le_bytes(*word)).ok());
    let count = word(0)?;
    if number > count {
        return None;
    }
    let body = global.get((2 + count) * WORD..)?;
    let start = if number == 0 { 0 } else { word(number)? };
    body.get(start..word(number + 1)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_slice_is_found_and_no_other() {
        let slices = [vec![1_u32, 70_000], vec![], vec![5]];
        let bytes = encode(&"head", &slices).unwrap();
        assert_eq!(head::<String>(&bytes).unwrap(), "head");
        for (tile, expected) in (0..).zip(&slices) {
            assert_eq!(slice::<Vec<u32>>(&bytes, tile).unwrap(), *expected);
        }
        assert!(slice::<Vec<u32>>(&bytes, 3).is_err());
        for length in 0..bytes.len() {
            assert!(slice::<Vec<u32>>(&bytes[..length], 2).is_err(), "cut to {length}");
        }
    }
}

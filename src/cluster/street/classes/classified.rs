//! The results of the steps `classes` and `context`: height above ground and class probabilities for each
//! voxel of a tile, and how later steps load them.

use crate::cluster::TileWindow;
use crate::cluster::street::settings::{CLASSES, STEP_CLASSES, STEP_CONTEXT};
use crate::cluster::street::voxels::stored::Voxels;
use crate::codec;
use crate::error::{Error, Result};
use crate::model::TileId;
use crate::spatial::Cell;

/// Sections of the payload.
const SECTION_HEIGHTS: usize = 0;
const SECTION_SHARES: usize = 1;

/// Probabilities of the classes of a voxel in steps of 1/255. Their sum is 255.
pub(crate) type Shares = [u8; CLASSES];

/// Voxels of a tile and around it with the results of one of these steps, in the same order.
#[derive(Debug)]
pub(crate) struct Classified {
    pub(crate) voxels: Voxels,
    /// Height of the centre above ground in lattice units.
    pub(crate) height: Vec<i32>,
    /// Probabilities of the classes.
    pub(crate) shares: Vec<Shares>,
}

impl Classified {
    /// Loads the voxels that [`Voxels::load`] loads, as step `classes` classifies them.
    pub(crate) fn at_first(tile: &dyn TileWindow, reach: i64) -> Result<Self> {
        Self::of_step(STEP_CLASSES, tile, Voxels::load(tile, reach)?)
    }

    /// Loads the voxels that [`Voxels::load`] loads.
    pub(crate) fn load(tile: &dyn TileWindow, reach: i64) -> Result<Self> {
        Self::load_with(tile, reach, &[])
    }

    /// Loads the voxels that [`Voxels::load_with`] loads.
    pub(crate) fn load_with(tile: &dyn TileWindow, reach: i64, also: &[Cell]) -> Result<Self> {
        Self::of_step(STEP_CONTEXT, tile, Voxels::load_with(tile, reach, also)?)
    }

    fn of_step(step: usize, tile: &dyn TileWindow, voxels: Voxels) -> Result<Self> {
        let values = voxels.gather(|other| read(&tile.payload(step, other)?, other))?;
        let (height, shares) = values.into_iter().unzip();
        Ok(Self { voxels, height, shares })
    }
}

/// The payload of a tile: heights as differences to the previous voxel, and the probabilities that are not 0.
pub(crate) fn encode(heights: &[i32], shares: &[Shares]) -> Result<Vec<u8>> {
    let mut last = 0;
    let steps: Vec<i32> =
        heights.iter().map(|&height| height.wrapping_sub(std::mem::replace(&mut last, height))).collect();
    Ok(codec::pack(&[codec::encode(&steps)?, encode_shares(shares)]))
}

/// Probabilities of voxels without those that are 0.
pub(crate) fn encode_shares(shares: &[Shares]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(3 * shares.len());
    for shares in shares {
        let mask = (0..CLASSES).fold(0, |mask, class| mask | (u8::from(shares[class] > 0) << class));
        bytes.push(mask);
        // The sum is known, so the last probability is not stored.
        let mut present = shares.iter().copied().filter(|&share| share > 0).peekable();
        while let Some(share) = present.next() {
            if present.peek().is_some() {
                bytes.push(share);
            }
        }
    }
    bytes
}

/// Heights and probabilities in a payload of `tile`.
fn read(payload: &[u8], tile: TileId) -> Result<Vec<(i32, Shares)>> {
    let steps: Vec<i32> = codec::decode(codec::section(payload, SECTION_HEIGHTS)?)?;
    let mut bytes = codec::section(payload, SECTION_SHARES)?.iter().copied();
    let mut height = 0_i32;
    let value = |step: i32| {
        height = height.wrapping_add(step);
        next_shares(&mut bytes).map(|shares| (height, shares))
    };
    let values: Option<Vec<(i32, Shares)>> = steps.into_iter().map(value).collect();
    match values {
        Some(values) if bytes.next().is_none() => Ok(values),
        _ => Err(Error::bug(format!("the classes of tile {} do not decode", tile.number()))),
    }
}

/// The next probabilities of [`encode_shares`]. `None` if the bytes end.
pub(crate) fn next_shares(bytes: &mut impl Iterator<Item = u8>) -> Option<Shares> {
    let mask = bytes.next()?;
    let mut shares = [0; CLASSES];
    let mut left = u8::MAX;
    for (class, share) in shares.iter_mut().enumerate() {
        if mask >> class & 1 == 1 {
            let last = mask >> class == 1;
            *share = if last { left } else { bytes.next()? };
            left = left.checked_sub(*share)?;
        }
    }
    Some(shares)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_and_probabilities_return_from_the_payload() {
        let heights = [i32::MAX, i32::MIN, 0, 17];
        let shares = [
            [0, 0, 0, 0, 0, 0, 0, 255],
            [255, 0, 0, 0, 0, 0, 0, 0],
            [1, 2, 3, 4, 5, 6, 7, 227],
            [0, 128, 0, 127, 0, 0, 0, 0],
        ];
        let payload = encode(&heights, &shares).unwrap();
        let read = read(&payload, TileId::new(0)).unwrap();
        assert_eq!(read, heights.into_iter().zip(shares).collect::<Vec<_>>());
    }

    #[test]
    fn a_payload_that_is_cut_is_refused() {
        let mut payload = encode(&[1, 2], &[[100, 155, 0, 0, 0, 0, 0, 0]; 2]).unwrap();
        payload.pop();
        assert!(read(&payload, TileId::new(0)).is_err());
    }
}

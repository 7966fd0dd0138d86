//! A global in slices: one value for the drive and one for each tile. A tile decodes only its own slice and
//! those of its neighbours.

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::codec;
use crate::error::Result;
use crate::model::TileId;

/// The bytes of a global.
pub(crate) fn encode<H: Serialize, S: Serialize>(head: &H, slices: &[S]) -> Result<Vec<u8>> {
    let mut sections = vec![codec::encode(head)?];
    for slice in slices {
        sections.push(codec::encode(slice)?);
    }
    Ok(codec::pack(&sections))
}

/// The value for the drive.
pub(crate) fn head<H: DeserializeOwned>(global: &[u8]) -> Result<H> {
    codec::decode(codec::section(global, 0)?)
}

/// The value of a tile.
pub(crate) fn slice<S: DeserializeOwned>(global: &[u8], tile: TileId) -> Result<S> {
    codec::decode(codec::section(global, tile.index() + 1)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_slice_is_found_and_no_other() {
        let slices = [vec![1_u32, 70_000], vec![], vec![5]];
        let bytes = encode(&"head", &slices).unwrap();
        assert_eq!(head::<String>(&bytes).unwrap(), "head");
        for (tile, expected) in TileId::first(3).zip(&slices) {
            assert_eq!(slice::<Vec<u32>>(&bytes, tile).unwrap(), *expected);
        }
        assert!(slice::<Vec<u32>>(&bytes, TileId::new(3)).is_err());
    }
}

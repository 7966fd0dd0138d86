//! Whether the model suits the drive, by counts of the step `voxels`, before any class is known.

use super::canopy::Cover;
use super::sparse::Stacked;
use super::stored::SECTION_COUNTS;
use crate::cluster::DriveWindow;
use crate::cluster::street::settings::{STEP_VOXELS, Scene};
use crate::codec;
use crate::error::Result;
use crate::model::TileId;

/// The counts of the drive, from the payloads of the step `voxels`.
pub(crate) fn reduce(drive: &dyn DriveWindow) -> Result<Vec<u8>> {
    let mut sums = (Stacked::default(), Cover::default());
    for tile in TileId::first(drive.tiles()) {
        let payload = drive.payload(STEP_VOXELS, tile)?;
        let (stacked, cover): (Stacked, Cover) = codec::decode(codec::section(&payload, SECTION_COUNTS)?)?;
        sums.0.add(stacked);
        sums.1.add(cover);
    }
    codec::encode(&sums)
}

/// The warnings about a drive, from the global result of the step `voxels`. `scene` is the scene of the
/// model, if the model is built in.
pub(crate) fn warnings(global: &[u8], scene: Option<Scene>) -> Result<Vec<String>> {
    let (stacked, cover): (Stacked, Cover) = codec::decode(global)?;
    let of_scene = scene.and_then(|scene| cover.warning(scene));
    Ok(stacked.warning().into_iter().chain(of_scene).collect())
}

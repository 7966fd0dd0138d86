//! Step `context`: the class probabilities of each voxel that a tile owns, from the probabilities of the
//! surrounding voxels. It reads no points.

use super::classified::{self, Classified, Shares};
use super::features::context::{self, REACH_EDGES};
use super::stage_classes::{Classify, classified_by};
use crate::cluster::street::settings::edge;
use crate::cluster::{Mapped, TileWindow};
use crate::error::Result;

/// Voxels around a tile with the results of step `classes`. They suffice to give its own voxels the same
/// features as in the whole drive.
pub(crate) fn load(tile: &dyn TileWindow) -> Result<Classified> {
    Classified::at_first(tile, REACH_EDGES * i64::from(edge(tile.lattice())))
}

/// Computes the payload of a tile.
pub(crate) fn map(tile: &dyn TileWindow, classify: Classify<'_>) -> Result<Mapped> {
    let around = load(tile)?;
    let shares = classified(&around, classify)?;
    let own = (0..shares.len()).filter(|&voxel| around.voxels.owned[voxel]);
    let (heights, shares): (Vec<i32>, Vec<Shares>) =
        own.map(|voxel| (around.height[voxel], shares[voxel])).unzip();
    Ok(Mapped::payload(classified::encode(&heights, &shares)?))
}

/// The probabilities of the voxels that the tile owns. The probabilities of other voxels are 0.
pub(crate) fn classified(around: &Classified, classify: Classify<'_>) -> Result<Vec<Shares>> {
    let Classified { voxels, height, shares } = around;
    classified_by(classify, voxels.len(), |rows| {
        context::compute(voxels, height, shares, &voxels.owned, rows);
    })
}

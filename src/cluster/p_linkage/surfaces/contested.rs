//! What a contest stores of a tile, in sections: the surfaces of its points, those of points that other tiles
//! read, and what the reduction needs. The reduction of a contest returns for each tile the surfaces that
//! have another number because they were merged, so surfaces are read with these.

use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

use super::contest::Touching;
use super::planes::Moments;
use crate::cluster::{DriveWindow, sliced};
use crate::codec;
use crate::error::Result;
use crate::model::{PointId, TileId};

const SECTION_SURFACES: usize = 0;
const SECTION_NEAR: usize = 1;
const SECTION_FOUND: usize = 2;

/// Moments of the points of a surface that are consistent with its local planes.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub(super) struct OnPlane {
    /// Of those away from its edges.
    pub(super) amid: Moments,
    /// Of the others.
    pub(super) at_edges: Moments,
}

impl OnPlane {
    pub(super) fn merge(&mut self, other: &Self) {
        self.amid.merge(&other.amid);
        self.at_edges.merge(&other.at_edges);
    }

    /// Of all.
    pub(super) fn all(&self) -> Moments {
        let mut all = self.amid;
        all.merge(&self.at_edges);
        all
    }
}

/// What the reduction needs of a tile.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Found {
    /// The surfaces of its points, ascending.
    pub(super) surfaces: Vec<u32>,
    /// Pairs of surfaces, the smaller number first, ascending.
    pub(super) touching: Vec<((u32, u32), Touching)>,
    /// Moments of the points of surfaces that are consistent with their local planes, ascending.
    pub(super) moments: Vec<(u32, OnPlane)>,
    /// Points whose surface is another one than before.
    pub(super) changed: u64,
}

/// The payload: the surfaces of the points that the tile owns, those near other tiles, and what is found.
pub(super) fn encode(own: &[u32], near: &[(PointId, u32)], found: &Found) -> Result<Vec<u8>> {
    let own: Vec<u8> = own.iter().flat_map(|surface| surface.to_le_bytes()).collect();
    Ok(codec::pack(&[own, codec::encode(&near)?, codec::encode(found)?]))
}

/// What the reduction needs of a tile.
pub(super) fn found(drive: &(impl DriveWindow + ?Sized), tile: TileId, step: usize) -> Result<Found> {
    codec::decode(codec::section(&drive.payload(step, tile)?, SECTION_FOUND)?)
}

/// The surface of each point that a tile owns, 0 for none.
pub(super) fn own(drive: &(impl DriveWindow + ?Sized), tile: TileId, step: usize) -> Result<Vec<u32>> {
    let merged = Renumbered::load(drive, tile, step)?;
    let payload = drive.payload(step, tile)?;
    let (surfaces, _) = codec::section(&payload, SECTION_SURFACES)?.as_chunks::<4>();
    Ok(surfaces.iter().map(|surface| merged.of(u32::from_le_bytes(*surface))).collect())
}

/// The surfaces of the points of a tile that other tiles read.
pub(super) fn near(
    drive: &(impl DriveWindow + ?Sized),
    tile: TileId,
    step: usize,
) -> Result<Vec<(PointId, u32)>> {
    let merged = Renumbered::load(drive, tile, step)?;
    let mut near: Vec<(PointId, u32)> =
        codec::decode(codec::section(&drive.payload(step, tile)?, SECTION_NEAR)?)?;
    near.iter_mut().for_each(|point| point.1 = merged.of(point.1));
    Ok(near)
}

/// The surfaces of a tile that have another number because they were merged.
struct Renumbered(FxHashMap<u32, u32>);

impl Renumbered {
    fn load(drive: &(impl DriveWindow + ?Sized), tile: TileId, step: usize) -> Result<Self> {
        let merged: Vec<(u32, u32)> = sliced::slice(drive.global(step), tile)?;
        Ok(Self(merged.into_iter().collect()))
    }

    fn of(&self, surface: u32) -> u32 {
        self.0.get(&surface).copied().unwrap_or(surface)
    }
}

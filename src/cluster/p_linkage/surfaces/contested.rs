//! The payload of a contest for a tile, in sections: the surfaces of its points, the surfaces of points that
//! other tiles read, and the input of the reduction. Merging gives surfaces new numbers. The reduction
//! returns these for each tile, and they are applied when surfaces are read.

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
    /// Moments of the points away from its edges.
    pub(super) amid: Moments,
    /// Moments of the points at its edges.
    pub(super) at_edges: Moments,
}

impl OnPlane {
    pub(super) fn merge(&mut self, other: &Self) {
        self.amid.merge(&other.amid);
        self.at_edges.merge(&other.at_edges);
    }

    /// Moments of all points.
    pub(super) fn all(&self) -> Moments {
        let mut all = self.amid;
        all.merge(&self.at_edges);
        all
    }
}

/// The input of the reduction from a tile.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Found {
    /// The surfaces of its points, ascending.
    pub(super) surfaces: Vec<u32>,
    /// Pairs of surfaces, the smaller number first, ascending.
    pub(super) touching: Vec<((u32, u32), Touching)>,
    /// Moments of the points of surfaces that are consistent with their local planes, ascending.
    pub(super) moments: Vec<(u32, OnPlane)>,
    /// Number of points whose surface has changed.
    pub(super) changed: u64,
}

/// The payload: the surfaces of the points that the tile owns, the surfaces of points near other tiles, and
/// the input of the reduction.
pub(super) fn encode(own: &[u32], near: &[(PointId, u32)], found: &Found) -> Result<Vec<u8>> {
    let own: Vec<u8> = own.iter().flat_map(|surface| surface.to_le_bytes()).collect();
    Ok(codec::pack(&[own, codec::encode(&near)?, codec::encode(found)?]))
}

/// The input of the reduction from a tile.
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

/// The new numbers of the surfaces of a tile that were merged.
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

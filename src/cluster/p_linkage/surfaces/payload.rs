//! The payload of the step `links` for a tile, in sections: labels, trees, planes, consistent points, parts
//! of open trees, pairs of points of different trees, and the trees of points near other tiles.

use serde::{Deserialize, Serialize};

use super::border::Border;
use super::planes::Moments;
use super::settings::{NAME, STEP_LINKS};
use super::slice::SlicePlane;
use crate::cluster::DriveWindow;
use crate::codec;
use crate::error::{Error, Result};
use crate::model::{PointId, TileId};

const SECTION_LABELS: usize = 0;
const SECTION_TREES: usize = 1;
const SECTION_PLANES: usize = 2;
const SECTION_CONSISTENT: usize = 3;
const SECTION_PARTS: usize = 4;
const SECTION_PAIRS: usize = 5;
const SECTION_NEAR: usize = 6;

/// Number of steps of a flatness per square lattice unit: 2^20.
const FLATNESS_STEPS: f64 = 1_048_576.0;

/// Sums of the flatness over points, in whole steps of 2^-20 square lattice units.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(super) struct FlatnessSums {
    pub(super) points: u64,
    sum: u128,
    squares: u128,
}

impl FlatnessSums {
    /// Adds a flatness in square lattice units: at most 2^32.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "not negative, below 2^52")]
    pub(super) fn add(&mut self, flatness: f64) {
        let steps = u128::from((flatness * FLATNESS_STEPS).round() as u64);
        self.points += 1;
        self.sum += steps;
        self.squares += steps * steps;
    }

    pub(super) fn merge(&mut self, other: &Self) {
        self.points += other.points;
        self.sum += other.sum;
        self.squares += other.squares;
    }

    /// Mean and standard deviation (equation 8) in square lattice units; 0 without points.
    pub(super) fn mean_and_deviation(&self) -> (f64, f64) {
        let points = self.points.max(1) as f64;
        let mean = self.sum as f64 / points;
        let variance = self.squares as f64 / points - mean * mean;
        (mean / FLATNESS_STEPS, variance.max(0.0).sqrt() / FLATNESS_STEPS)
    }
}

/// The part in one tile of a tree with links to other tiles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct OpenTree {
    /// Number of its points in the tile.
    pub(super) points: u64,
    /// Flatness of its root, if the tile owns it.
    pub(super) root: Option<f64>,
    /// Names by which the parts of different tiles are joined.
    pub(super) names: Vec<PointId>,
}

/// The trees of a tile: first the closed ones, which lie completely in it and may be slices, then the open
/// ones.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct OfTile {
    pub(super) flatness: FlatnessSums,
    /// Flatness of the root of each closed tree.
    pub(super) closed: Vec<f64>,
    pub(super) open: Vec<OpenTree>,
}

/// A closed slice: its plane, and the moments of its consistent points relative to the lowest corner of the
/// drive.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(super) struct Closed {
    pub(super) plane: SlicePlane,
    pub(super) moments: Moments,
}

/// A point of an open tree.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(super) struct OpenPoint {
    pub(super) id: PointId,
    /// Lattice coordinates.
    pub(super) at: [i64; 3],
    /// Its position among the object points that the tile owns, in the order of places.
    pub(super) own: u32,
}

/// A mutual pair across a seam. The tile that owns the first point (in the order of places) stores it.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(super) struct Across {
    /// Position of the tile's own point.
    pub(super) own: u32,
    /// The other point, and the tile that owns it.
    pub(super) other: PointId,
    pub(super) owner: TileId,
}

/// Mutual pairs of points of different trees (equation 10).
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Pairs {
    /// Pairs of closed trees with mutual pairs of consistent points, the smaller number first, ascending, and
    /// their border.
    pub(super) trees: Vec<((u32, u32), Border)>,
    /// Pairs of own points, by position. At least one point of each belongs to an open tree.
    pub(super) points: Vec<(u32, u32)>,
    pub(super) across: Vec<Across>,
    /// Ids and positions of own points that other tiles store in `across`, ascending.
    pub(super) ends: Vec<(PointId, u32)>,
    /// Positions and lattice coordinates of the own points in the three lists above, ascending.
    pub(super) places: Vec<(u32, [i64; 3])>,
}

/// The content of the payload.
#[derive(Debug, Default)]
pub(super) struct Stored {
    /// The tree of each point that the tile owns, from 1; 0 for none.
    pub(super) labels: Vec<u32>,
    pub(super) of_tile: OfTile,
    /// Planes of the closed trees.
    pub(super) planes: Vec<Closed>,
    /// Whether each point is consistent with the plane of its closed tree.
    pub(super) consistent: Vec<bool>,
    /// The points of each open tree.
    pub(super) parts: Vec<Vec<OpenPoint>>,
    pub(super) pairs: Pairs,
    /// Ids and trees (0 for none) of the points that other tiles read in the next steps, ascending.
    pub(super) near: Vec<(PointId, u32)>,
}

impl Stored {
    /// The payload.
    pub(super) fn encode(&self) -> Result<Vec<u8>> {
        let labels: Vec<u8> = self.labels.iter().flat_map(|label| label.to_le_bytes()).collect();
        let byte = |bits: &[bool]| bits.iter().rev().fold(0_u8, |byte, bit| byte << 1 | u8::from(*bit));
        let consistent: Vec<u8> = self.consistent.chunks(8).map(byte).collect();
        Ok(codec::pack(&[
            labels,
            codec::encode(&self.of_tile)?,
            codec::encode(&self.planes)?,
            consistent,
            codec::encode(&self.parts)?,
            codec::encode(&self.pairs)?,
            codec::encode(&self.near)?,
        ]))
    }

    /// The stored payload of a tile.
    pub(super) fn load(drive: &(impl DriveWindow + ?Sized), tile: TileId) -> Result<Self> {
        let payload = drive.payload(STEP_LINKS, tile)?;
        let labels = decode_labels(&payload)?;
        let bits = codec::section(&payload, SECTION_CONSISTENT)?;
        let bit = |at: usize| bits.get(at / 8).is_some_and(|byte| byte >> (at % 8) & 1 != 0);
        Ok(Self {
            consistent: (0..labels.len()).map(bit).collect(),
            labels,
            of_tile: codec::decode(codec::section(&payload, SECTION_TREES)?)?,
            planes: codec::decode(codec::section(&payload, SECTION_PLANES)?)?,
            parts: codec::decode(codec::section(&payload, SECTION_PARTS)?)?,
            pairs: codec::decode(codec::section(&payload, SECTION_PAIRS)?)?,
            near: codec::decode(codec::section(&payload, SECTION_NEAR)?)?,
        })
    }
}

impl Pairs {
    /// Lattice coordinates of an own point of a pair, by its position.
    pub(super) fn place(&self, own: u32) -> Result<[i64; 3]> {
        let at = self.places.binary_search_by_key(&own, |place| place.0);
        at.map(|at| self.places[at].1).map_err(|_| Error::bug(format!("{NAME}: point {own} has no place")))
    }
}

fn decode_labels(payload: &[u8]) -> Result<Vec<u32>> {
    let (labels, _) = codec::section(payload, SECTION_LABELS)?.as_chunks::<4>();
    Ok(labels.iter().map(|label| u32::from_le_bytes(*label)).collect())
}

/// The tree of each point that a tile owns, from 1; 0 for none.
pub(super) fn load_labels(drive: &(impl DriveWindow + ?Sized), tile: TileId) -> Result<Vec<u32>> {
    decode_labels(&drive.payload(STEP_LINKS, tile)?)
}

/// The trees of a tile.
pub(super) fn load_trees(drive: &(impl DriveWindow + ?Sized), tile: TileId) -> Result<OfTile> {
    codec::decode(codec::section(&drive.payload(STEP_LINKS, tile)?, SECTION_TREES)?)
}

/// The planes of the closed trees of a tile.
pub(super) fn load_planes(drive: &(impl DriveWindow + ?Sized), tile: TileId) -> Result<Vec<Closed>> {
    codec::decode(codec::section(&drive.payload(STEP_LINKS, tile)?, SECTION_PLANES)?)
}

/// Ids and trees of the points of a tile that other tiles read in the next steps.
pub(super) fn load_near(drive: &(impl DriveWindow + ?Sized), tile: TileId) -> Result<Vec<(PointId, u32)>> {
    codec::decode(codec::section(&drive.payload(STEP_LINKS, tile)?, SECTION_NEAR)?)
}

/// The points of the open trees of a tile.
pub(super) fn load_parts(drive: &(impl DriveWindow + ?Sized), tile: TileId) -> Result<Vec<Vec<OpenPoint>>> {
    codec::decode(codec::section(&drive.payload(STEP_LINKS, tile)?, SECTION_PARTS)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_deviation_are_those_of_equation_8_in_any_order() {
        let values = [1.0, 2.0, 4.0, 9.0];
        let mut all = FlatnessSums::default();
        values.iter().for_each(|value| all.add(*value));
        let (mean, deviation) = all.mean_and_deviation();
        assert!((mean - 4.0).abs() < 1e-9 && (deviation - 9.5_f64.sqrt()).abs() < 1e-9, "{mean} {deviation}");
        let mut parts = [FlatnessSums::default(); 2];
        parts[1].add(9.0);
        parts[1].add(1.0);
        parts[0].add(4.0);
        parts[0].add(2.0);
        let [mut one, other] = parts;
        one.merge(&other);
        assert_eq!(one, all);
        assert_eq!(FlatnessSums::default().mean_and_deviation(), (0.0, 0.0));
    }
}

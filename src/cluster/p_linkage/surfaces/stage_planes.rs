//! Step `planes`: the planes of slices that several tiles share. It does not read points of the drive, but
//! the points of open trees that the step `links` has stored.
//!
//! A plane needs all points of its slice, and a slice may be as long as the drive. So one tile fits it, the
//! first one with a part of it. That tile needs memory for the points of the whole slice: about 130 bytes for
//! each, which the bytes per point of the step do not include. The reduction distributes the planes: each
//! tile gets the plane, and the consistent points of its own parts.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::around::moments;
use super::payload::{self, OpenPoint};
use super::planes::Moments;
use super::settings::{NAME, STEP_PLANES, SurfacesConfig};
use super::slice::{Slice, SlicePlane, slice};
use super::stage_links::{self, OpenSlice};
use crate::cluster::{DriveWindow, Mapped, TileWindow, sliced};
use crate::codec;
use crate::error::{Error, Result};
use crate::model::{PointId, TileId};

/// The plane of a slice, as the tile that fits it stores it.
#[derive(Debug, Serialize, Deserialize)]
struct Fitted {
    /// Number of the slice.
    number: u32,
    plane: SlicePlane,
    /// Moments of the consistent points, from the lowest corner of the drive.
    moments: Moments,
    /// For each part: its tile, its number among the open trees there, and a bit for each point that says
    /// whether it is consistent.
    parts: Vec<(TileId, u32, Vec<u8>)>,
}

/// The plane of an open tree, and a bit for each of its points in a tile that says whether it is consistent.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct OpenPlane {
    pub(super) plane: SlicePlane,
    consistent: Vec<u8>,
}

impl OpenPlane {
    /// Whether a point is consistent, by its position in the part.
    pub(super) fn holds(&self, at: usize) -> bool {
        self.consistent.get(at / 8).is_some_and(|byte| byte >> (at % 8) & 1 != 0)
    }
}

/// A point of an open slice.
struct Point {
    at: [i64; 3],
    id: PointId,
    /// The part of the slice. `position` is the position in this part.
    part: u32,
    position: u32,
}

/// The slices that a tile fits: those whose first part it has, each once.
fn fitted_by(here: TileId, open: &[OpenSlice]) -> Vec<&OpenSlice> {
    let is_first = |slice: &OpenSlice| slice.parts.first().is_some_and(|part| part.0 == here);
    // A tile may have several parts of a slice.
    let by_number: BTreeMap<u32, &OpenSlice> = open
        .iter()
        .filter(|slice| slice.number != 0 && is_first(slice))
        .map(|slice| (slice.number, slice))
        .collect();
    by_number.into_values().collect()
}

/// Computes the payload of a tile.
pub(super) fn map(tile: &dyn TileWindow, config: &SurfacesConfig) -> Result<Mapped> {
    let of_links = stage_links::slices(tile, tile.tile())?;
    let slices = fitted_by(tile.tile(), &of_links.open);
    // Wanted parts by tile: the slice, its part, and the number of the open tree.
    let mut wanted: BTreeMap<TileId, Vec<(usize, u32, u32)>> = BTreeMap::new();
    for (at, slice) in slices.iter().enumerate() {
        for (part, (tile, number)) in (0_u32..).zip(&slice.parts) {
            wanted.entry(*tile).or_default().push((at, part, *number));
        }
    }
    // The payload of a tile is read once, and freed before the next one is read.
    let mut points: Vec<Vec<Point>> = slices.iter().map(|_| Vec::new()).collect();
    for (other, parts) in wanted {
        let stored = payload::load_parts(tile, other)?;
        for (at, part, number) in parts {
            let lost = || Error::bug(format!("{NAME}: tile {other} has no part {number}"));
            let of_part = stored.get(number as usize).ok_or_else(lost)?;
            let numbered = (0_u32..).zip(of_part);
            points[at].extend(numbered.map(|(position, &OpenPoint { id, at, .. })| Point {
                at,
                id,
                part,
                position,
            }));
        }
    }
    let corner = tile.extent().0;
    let fitted: Vec<Fitted> = slices
        .into_iter()
        .zip(points)
        .filter_map(|(slice, points)| fit(slice, points, (corner, config.refit_planes)))
        .collect();
    Ok(Mapped::payload(codec::encode(&fitted)?))
}

/// Fits the plane of a slice. `None` if its points have no plane.
fn fit(open: &OpenSlice, mut points: Vec<Point>, (corner, refit): ([i64; 3], bool)) -> Option<Fitted> {
    points.sort_unstable_by_key(|point| (point.at, point.id));
    let places: Vec<[i64; 3]> = points.iter().map(|point| point.at).collect();
    let Slice { plane, consistent } = slice(&places, refit)?;
    let mut of_parts = vec![0_usize; open.parts.len()];
    points.iter().for_each(|point| of_parts[point.part as usize] += 1);
    let mut parts: Vec<(TileId, u32, Vec<u8>)> = open
        .parts
        .iter()
        .zip(of_parts)
        .map(|((tile, number), points)| (*tile, *number, vec![0; points.div_ceil(8)]))
        .collect();
    for (point, _) in points.iter().zip(&consistent).filter(|(_, holds)| **holds) {
        parts[point.part as usize].2[point.position as usize / 8] |= 1 << (point.position % 8);
    }
    let kept = places.into_iter().zip(consistent).filter(|(_, holds)| *holds);
    let moments = moments(kept.map(|(place, _)| place), corner);
    Some(Fitted { number: open.number, plane, moments, parts })
}

/// The number and the moments of each slice with a plane, and the planes of the open trees of each tile.
pub(super) fn reduce(drive: &dyn DriveWindow) -> Result<Vec<u8>> {
    let mut shared: Vec<(u32, Moments)> = Vec::new();
    let mut of_tiles: Vec<Vec<Option<OpenPlane>>> = Vec::new();
    for tile in TileId::first(drive.tiles()) {
        of_tiles.push(vec![None; stage_links::slices(drive, tile)?.open.len()]);
    }
    for tile in TileId::first(drive.tiles()) {
        let fitted: Vec<Fitted> = codec::decode(&drive.payload(STEP_PLANES, tile)?)?;
        for Fitted { number, plane, moments, parts } in fitted {
            shared.push((number, moments));
            for (owner, tree, consistent) in parts {
                of_tiles[owner.index()][tree as usize] = Some(OpenPlane { plane, consistent });
            }
        }
    }
    sliced::encode(&shared, &of_tiles)
}

/// Moments of the consistent points of the shared slices that have a plane, by their numbers.
pub(super) fn shared(drive: &(impl DriveWindow + ?Sized)) -> Result<Vec<(u32, Moments)>> {
    sliced::head(drive.global(STEP_PLANES))
}

/// The plane of each open tree of a tile; `None` if it is not a slice, or if its points have no plane.
pub(super) fn of_open(drive: &(impl DriveWindow + ?Sized), tile: TileId) -> Result<Vec<Option<OpenPlane>>> {
    sliced::slice(drive.global(STEP_PLANES), tile)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slice_in_many_tiles_is_fitted_in_one_of_them_and_once() {
        // A slice with parts in all tiles, two of them in the first; a slice in tiles 3 and 4; and a tree
        // that is not a slice.
        let tile = TileId::new;
        let long: Vec<(TileId, u32)> =
            std::iter::once((tile(0), 1)).chain((0..40).map(|n| (tile(n), 0))).collect();
        let long = OpenSlice { number: 7, parts: long };
        let short = OpenSlice { number: 9, parts: vec![(tile(3), 1), (tile(4), 1)] };
        let none = OpenSlice { number: 0, parts: vec![(tile(5), 1)] };
        let open = |here: u32| match here {
            0 => vec![long.clone(), long.clone()],
            3 | 4 => vec![long.clone(), short.clone()],
            5 => vec![long.clone(), none.clone()],
            _ => vec![long.clone()],
        };
        let mut fits: Vec<(u32, u32)> = Vec::new();
        for here in 0..40 {
            let of_tile = open(here);
            fits.extend(fitted_by(tile(here), &of_tile).iter().map(|slice| (here, slice.number)));
        }
        assert_eq!(fits, [(0, 7), (3, 9)]);
    }

    #[test]
    fn each_part_gets_the_consistent_points_of_its_own() {
        // A floor in two parts whose points alternate, with outliers in the second one.
        let tiles = [TileId::new(4), TileId::new(8)];
        let open = OpenSlice { number: 3, parts: vec![(tiles[0], 5), (tiles[1], 0)] };
        let mut points = Vec::new();
        for n in 0..600_u32 {
            let (part, position) = (n % 2, n / 2);
            let off = if n % 20 == 7 { 400 } else { i64::from(n * 7_919 % 11) };
            let at = [i64::from(n % 25) * 20, i64::from(n / 25) * 20, off];
            points.push(Point { at, id: PointId::at(n as usize), part, position });
        }
        let found = fit(&open, points, ([0; 3], true)).unwrap();
        assert_eq!((found.number, found.parts.len()), (3, 2));
        assert_eq!(
            [0, 1].map(|part| (found.parts[part].0, found.parts[part].1)),
            [(tiles[0], 5), (tiles[1], 0)]
        );
        let of_part = |part: usize| {
            let consistent = found.parts[part].2.clone();
            OpenPlane { plane: found.plane, consistent }
        };
        let parts = [of_part(0), of_part(1)];
        let mut kept = 0;
        for n in 0..600_usize {
            let holds = parts[n % 2].holds(n / 2);
            assert!(!(holds && n % 20 == 7), "{n}");
            kept += u64::from(holds);
        }
        assert!(kept > 500 && found.moments.points == kept, "{kept}");
        assert!(!parts[0].holds(300) && !parts[0].holds(9_000));
        assert!(fit(&open, Vec::new(), ([0; 3], true)).is_none());
    }
}

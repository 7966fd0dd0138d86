//! Step `slices`: the planes of slices that several tiles share, and the adjacent slices whose normals agree,
//! with their border. It reads no points. Its reduction merges the slices whose borders agree too to surfaces
//! (equation 11).
//!
//! Every tile that needs the plane of a shared slice gathers all points of the slice and fits the plane. The
//! same points give the same plane, so it does not matter that several tiles do this.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::around::moments;
use super::border::Border;
use super::payload::{self, OpenPoint, Stored};
use super::planes::{Fit, Moments, likeness};
use super::settings::{STEP_SLICES, SurfacesConfig};
use super::slice::{Slice, SlicePlane, slice};
use super::stage_links::{self, OpenSlice, Slices, slice_of_tree};
use crate::cluster::{DriveWindow, Mapped, TileWindow, sliced};
use crate::codec;
use crate::error::{Error, Result};
use crate::model::{Plane, PointId, TileId};
use crate::spatial::DisjointSets;

/// What a tile finds.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Found {
    /// Adjacent slices whose normals deviate by less than the angle, the smaller number first, ascending.
    adjacent: Vec<((u32, u32), Adjacent)>,
    /// Moments of the consistent points of shared slices of which the tile has the first part.
    moments: Vec<(u32, Moments)>,
}

/// Two adjacent slices.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Adjacent {
    /// The pairs of points that the tile stores. Other tiles may store others.
    border: Border,
    /// The larger deviation of both, in lattice units.
    deviation: f64,
}

/// A tile and its slices.
struct Known {
    stored: Stored,
    slices: Slices,
    /// The slice of each tree.
    of_tree: Vec<u32>,
}

/// A slice that several tiles share.
struct Shared {
    plane: SlicePlane,
    /// Consistent points, ascending.
    consistent: BTreeSet<PointId>,
    moments: Moments,
}

/// The end of a pair of points, or of trees.
struct End {
    slice: u32,
    plane: SlicePlane,
}

/// The tiles and shared slices that have been looked at.
struct Seen<'a> {
    tile: &'a dyn TileWindow,
    refit_planes: bool,
    head: stage_links::Drive,
    tiles: BTreeMap<TileId, Known>,
    /// Parts of open trees, by tile.
    parts: BTreeMap<TileId, Vec<Vec<OpenPoint>>>,
    /// Shared slices by number; `None` if their points have no plane.
    shared: BTreeMap<u32, Option<Shared>>,
}

impl Seen<'_> {
    fn look_at(&mut self, tile: TileId) -> Result<()> {
        if !self.tiles.contains_key(&tile) {
            let stored = Stored::load(self.tile, tile)?;
            let slices = stage_links::slices(self.tile, tile)?;
            let of_tree = slice_of_tree(&self.head, &slices, &stored.of_tile);
            self.tiles.insert(tile, Known { stored, slices, of_tree });
        }
        Ok(())
    }

    fn known(&self, tile: TileId) -> Result<&Known> {
        self.tiles.get(&tile).ok_or_else(|| Error::bug(format!("tile {tile} was not looked at")))
    }

    /// Fits the plane of a shared slice, if this has not been done.
    fn fit(&mut self, open: &OpenSlice) -> Result<()> {
        if self.shared.contains_key(&open.number) {
            return Ok(());
        }
        let mut points: Vec<OpenPoint> = Vec::new();
        for &(tile, number) in &open.parts {
            if !self.parts.contains_key(&tile) {
                self.parts.insert(tile, payload::load_parts(self.tile, tile)?);
            }
            let part = self.parts.get(&tile).and_then(|parts| parts.get(number as usize));
            points.extend(part.ok_or_else(|| Error::bug(format!("tile {tile} has no part {number}")))?);
        }
        points.sort_unstable_by_key(|point| (point.at, point.id));
        let places: Vec<[i64; 3]> = points.iter().map(|point| point.at).collect();
        let shared = slice(&places, self.refit_planes).map(|Slice { plane, consistent }| {
            let kept: Vec<&OpenPoint> =
                points.iter().zip(consistent).filter(|(_, holds)| *holds).map(|(point, _)| point).collect();
            Shared {
                plane,
                moments: moments(kept.iter().map(|point| point.at), self.tile.extent().0),
                consistent: kept.iter().map(|point| point.id).collect(),
            }
        });
        self.shared.insert(open.number, shared);
        Ok(())
    }

    /// The slice of a point of a tile, by its position there and its id. `None` if it is in no slice, or if
    /// it is not consistent with the plane of its slice.
    fn end(
        &mut self,
        tile: TileId,
        own: u32,
        id: impl FnOnce(&Stored) -> Option<PointId>,
    ) -> Result<Option<End>> {
        self.look_at(tile)?;
        let Known { stored, slices, of_tree } = self.known(tile)?;
        let own = own as usize;
        let Some(tree) = (stored.labels[own] as usize).checked_sub(1) else { return Ok(None) };
        let slice = of_tree[tree];
        if slice == 0 {
            return Ok(None);
        }
        if let Some(closed) = stored.planes.get(tree) {
            return Ok(stored.consistent[own].then_some(End { slice, plane: closed.plane }));
        }
        let open = slices.open[tree - stored.planes.len()].clone();
        let id = id(stored).ok_or_else(|| Error::bug(format!("tile {tile} has no open point {own}")))?;
        self.fit(&open)?;
        let shared = self.shared.get(&open.number).and_then(Option::as_ref);
        Ok(shared
            .filter(|shared| shared.consistent.contains(&id))
            .map(|shared| End { slice, plane: shared.plane }))
    }
}

/// The id of a point of an open tree, by its position among the points of its tile.
fn open_id(stored: &Stored, own: u32) -> Option<PointId> {
    let tree = (stored.labels[own as usize] as usize).checked_sub(1)?;
    let part = stored.parts.get(tree.checked_sub(stored.planes.len())?)?;
    part.binary_search_by_key(&own, |point| point.own).ok().map(|at| part[at].id)
}

/// Computes the payload of a tile.
pub(super) fn map(tile: &dyn TileWindow, config: &SurfacesConfig) -> Result<Mapped> {
    let here = tile.tile();
    let head = stage_links::head(tile)?;
    let mut seen = Seen {
        tile,
        refit_planes: config.refit_planes,
        head,
        tiles: BTreeMap::new(),
        parts: BTreeMap::new(),
        shared: BTreeMap::new(),
    };
    seen.look_at(here)?;
    let cosine = config.cosine();
    let mut adjacent: BTreeMap<(u32, u32), Adjacent> = BTreeMap::new();
    let mut add = |a: &End, b: &End, border: Border| {
        if a.slice != b.slice && likeness(a.plane.normal, b.plane.normal) > cosine {
            let deviation = a.plane.deviation.max(b.plane.deviation);
            let pair = (a.slice.min(b.slice), a.slice.max(b.slice));
            let none = Adjacent { border: Border::default(), deviation };
            adjacent.entry(pair).or_insert(none).border.merge(&border);
        }
    };
    let pair = |(a, at_a): (&End, [i64; 3]), (b, at_b): (&End, [i64; 3])| {
        let mut border = Border::default();
        border.add((&a.plane, at_a), (&b.plane, at_b));
        border
    };
    let known = seen.known(here)?;
    for &((a, b), border) in &known.stored.pairs.trees {
        let end = |label: u32| {
            let tree = label as usize - 1;
            End { slice: known.of_tree[tree], plane: known.stored.planes[tree].plane }
        };
        let (a, b) = (end(a), end(b));
        if a.slice != 0 && b.slice != 0 {
            add(&a, &b, border);
        }
    }
    for (a, b) in known.stored.pairs.points.clone() {
        let Some(one) = seen.end(here, a, |stored| open_id(stored, a))? else { continue };
        let Some(other) = seen.end(here, b, |stored| open_id(stored, b))? else { continue };
        let places = &seen.known(here)?.stored.pairs;
        add(&one, &other, pair((&one, places.place(a)?), (&other, places.place(b)?)));
    }
    for across in seen.known(here)?.stored.pairs.across.clone() {
        let Some(a) = seen.end(here, across.own, |stored| open_id(stored, across.own))? else { continue };
        seen.look_at(across.owner)?;
        let ends = &seen.known(across.owner)?.stored.pairs.ends;
        // The other point is in no tree if its owner does not know it as an end.
        let Ok(at) = ends.binary_search_by_key(&across.other, |end| end.0) else { continue };
        let own = ends[at].1;
        if let Some(b) = seen.end(across.owner, own, |_| Some(across.other))? {
            let at_a = seen.known(here)?.stored.pairs.place(across.own)?;
            let at_b = seen.known(across.owner)?.stored.pairs.place(own)?;
            add(&a, &b, pair((&a, at_a), (&b, at_b)));
        }
    }
    let mut found = Found { adjacent: adjacent.into_iter().collect(), moments: Vec::new() };
    let open = seen.known(here)?.slices.open.clone();
    for slice in open.iter().filter(|slice| slice.number != 0) {
        if slice.parts.first().is_some_and(|part| part.0 == here)
            && found.moments.iter().all(|one| one.0 != slice.number)
        {
            seen.fit(slice)?;
            if let Some(Some(shared)) = seen.shared.get(&slice.number) {
                found.moments.push((slice.number, shared.moments));
            }
        }
    }
    Ok(Mapped::payload(codec::encode(&found)?))
}

/// What the drive knows once slices are merged.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Surfaces {
    /// Moments of the points of surface 1, 2, ... that are consistent with its slices, from the lowest corner
    /// of the drive.
    pub(super) moments: Vec<Moments>,
    /// Slices with a plane, surfaces of any size, and pairs of slices that were merged.
    pub(super) slices: u64,
    pub(super) surfaces: u64,
    pub(super) pairs: u64,
}

/// Merges slices to surfaces: the plane of each surface, and the surface (0: none) of each tree of each tile.
pub(super) fn reduce(drive: &dyn DriveWindow, config: &SurfacesConfig) -> Result<Vec<u8>> {
    let head = stage_links::head(drive)?;
    let mut adjacent: BTreeMap<(u32, u32), Adjacent> = BTreeMap::new();
    let mut shared: Vec<(u32, Moments)> = Vec::new();
    for tile in TileId::first(drive.tiles()) {
        let found: Found = codec::decode(&drive.payload(STEP_SLICES, tile)?)?;
        for (pair, part) in found.adjacent {
            let none = Adjacent { border: Border::default(), ..part };
            adjacent.entry(pair).or_insert(none).border.merge(&part.border);
        }
        shared.extend(found.moments);
    }
    let score = config.border_score;
    adjacent.retain(|_, pair| score <= 0.0 || pair.border.agrees(score, pair.deviation));
    let mut sets = DisjointSets::new(head.slices);
    adjacent.keys().for_each(|(a, b)| sets.union(a - 1, b - 1));
    // The surface of each slice, from 1.
    let mut surfaces = vec![0; head.slices as usize];
    let mut count = 0;
    for slice in 0..head.slices {
        let root = sets.find(slice);
        if root == slice {
            count += 1;
            surfaces[slice as usize] = count;
        } else {
            // A root is the smallest of its set.
            surfaces[slice as usize] = surfaces[root as usize];
        }
    }
    let mut sums = vec![Moments::default(); count as usize];
    let mut found =
        Surfaces { pairs: adjacent.len() as u64, slices: shared.len() as u64, ..Surfaces::default() };
    for (slice, moments) in shared {
        sums[surfaces[slice as usize - 1] as usize - 1].merge(&moments);
    }
    let mut of_tiles: Vec<Vec<u32>> = Vec::new();
    for tile in TileId::first(drive.tiles()) {
        let trees = payload::load_trees(drive, tile)?;
        let of_trees: Vec<u32> = slice_of_tree(&head, &stage_links::slices(drive, tile)?, &trees)
            .into_iter()
            .map(|slice| (slice as usize).checked_sub(1).map_or(0, |slice| surfaces[slice]))
            .collect();
        let planes = payload::load_planes(drive, tile)?;
        for (plane, surface) in planes.iter().zip(&of_trees).filter(|(_, surface)| **surface != 0) {
            sums[*surface as usize - 1].merge(&plane.moments);
            found.slices += 1;
        }
        of_tiles.push(of_trees);
    }
    // A shared slice without a plane is no surface, as one that lies in a tile is not.
    for surface in of_tiles.iter_mut().flatten().filter(|surface| **surface != 0) {
        if sums[*surface as usize - 1].points == 0 {
            *surface = 0;
        }
    }
    found.surfaces = sums.iter().filter(|sums| sums.points > 0).count() as u64;
    found.moments = sums;
    sliced::encode(&found, &of_tiles)
}

/// The plane that fits these points, whose moments are counted from the `corner`.
#[expect(clippy::cast_possible_truncation, reason = "a mean of lattice coordinates is one")]
pub(super) fn plane(sums: &Moments, fit: &Fit, corner: [i64; 3]) -> Plane {
    Plane {
        centre: [0, 1, 2].map(|axis| corner[axis] + fit.mean[axis].round() as i64),
        normal: Plane::upward(fit.normal),
        flatness_units2: fit.flatness,
        points: sums.points,
    }
}

/// What the drive knows.
pub(super) fn head(drive: &(impl DriveWindow + ?Sized)) -> Result<Surfaces> {
    sliced::head(drive.global(STEP_SLICES))
}

/// The surface, from 1, of each tree of a tile; 0 for none.
pub(super) fn surface_of_tree(drive: &(impl DriveWindow + ?Sized), tile: TileId) -> Result<Vec<u32>> {
    sliced::slice(drive.global(STEP_SLICES), tile)
}

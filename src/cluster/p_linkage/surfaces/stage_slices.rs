//! Step `slices`: the adjacent slices whose normals agree, with their border. It reads no points. Its
//! reduction merges those slices whose borders agree as well into surfaces (equation 11).

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::border::Border;
use super::payload::{self, Stored};
use super::planes::{Fit, Moments, likeness};
use super::settings::{NAME, STEP_SLICES, SurfacesConfig};
use super::slice::SlicePlane;
use super::stage_links::{self, slice_of_tree};
use super::stage_planes::{self, OpenPlane};
use crate::cluster::{DriveWindow, Mapped, TileWindow, sliced};
use crate::codec;
use crate::error::{Error, Result};
use crate::model::{Plane, TileId};
use crate::spatial::DisjointSets;

/// The result of a tile.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Found {
    /// Adjacent slices whose normals deviate by less than the angle, the smaller number first, ascending.
    adjacent: Vec<((u32, u32), Adjacent)>,
}

/// Two adjacent slices.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Adjacent {
    /// The pairs of points that the tile stores. Other tiles may store other pairs of the same slices.
    border: Border,
    /// The larger deviation of both, in lattice units.
    deviation: f64,
}

/// The payload of a tile, and its slices.
struct Known {
    stored: Stored,
    /// The slice of each tree.
    of_tree: Vec<u32>,
    /// The plane of each open tree.
    open: Vec<Option<OpenPlane>>,
}

/// One end of a pair of points or of trees.
struct End {
    slice: u32,
    plane: SlicePlane,
}

/// The tiles whose payloads have been read.
struct Seen<'a> {
    tile: &'a dyn TileWindow,
    head: stage_links::Drive,
    tiles: BTreeMap<TileId, Known>,
}

impl Seen<'_> {
    fn look_at(&mut self, tile: TileId) -> Result<&Known> {
        if !self.tiles.contains_key(&tile) {
            let stored = Stored::load(self.tile, tile)?;
            let of_tree = slice_of_tree(&self.head, &stage_links::slices(self.tile, tile)?, &stored.of_tile);
            let open = stage_planes::of_open(self.tile, tile)?;
            self.tiles.insert(tile, Known { stored, of_tree, open });
        }
        self.tiles.get(&tile).ok_or_else(|| Error::bug(format!("the payload of tile {tile} was not read")))
    }
}

impl Known {
    /// The slice of a point of the tile, by its position there. `None` if it is in no slice, or if it is not
    /// consistent with the plane of its slice.
    fn end(&self, own: u32) -> Result<Option<End>> {
        let Self { stored, of_tree, open } = self;
        let Some(tree) = (stored.labels[own as usize] as usize).checked_sub(1) else { return Ok(None) };
        let slice = of_tree[tree];
        if slice == 0 {
            return Ok(None);
        }
        if let Some(closed) = stored.planes.get(tree) {
            return Ok(stored.consistent[own as usize].then_some(End { slice, plane: closed.plane }));
        }
        let number = tree - stored.planes.len();
        let at = stored.parts[number].binary_search_by_key(&own, |point| point.own);
        let at = at.map_err(|_| Error::bug(format!("{NAME}: point {own} is not in its open tree")))?;
        let plane = open[number].as_ref().filter(|plane| plane.holds(at));
        Ok(plane.map(|open| End { slice, plane: open.plane }))
    }
}

/// Computes the payload of a tile.
pub(super) fn map(tile: &dyn TileWindow, config: &SurfacesConfig) -> Result<Mapped> {
    let here = tile.tile();
    let mut seen = Seen { tile, head: stage_links::head(tile)?, tiles: BTreeMap::new() };
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
    let known = seen.look_at(here)?;
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
    let pairs = &known.stored.pairs;
    for &(a, b) in &pairs.points {
        if let (Some(one), Some(other)) = (known.end(a)?, known.end(b)?) {
            add(&one, &other, pair((&one, pairs.place(a)?), (&other, pairs.place(b)?)));
        }
    }
    // The own ends of pairs across seams, with their places.
    let mut ends = Vec::new();
    for across in &pairs.across {
        if let Some(end) = known.end(across.own)? {
            ends.push((*across, end, pairs.place(across.own)?));
        }
    }
    for (across, a, at_a) in ends {
        let there = seen.look_at(across.owner)?;
        let pairs = &there.stored.pairs;
        // If the owner of the other point does not list it as an end, the point is in no tree.
        let Ok(at) = pairs.ends.binary_search_by_key(&across.other, |end| end.0) else { continue };
        let own = pairs.ends[at].1;
        if let Some(b) = there.end(own)? {
            add(&a, &b, pair((&a, at_a), (&b, pairs.place(own)?)));
        }
    }
    let found = Found { adjacent: adjacent.into_iter().collect() };
    Ok(Mapped::payload(codec::encode(&found)?))
}

/// The result of the step for the whole drive.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Surfaces {
    /// For surface 1, 2, ...: moments of its points that are consistent with its slices, relative to the
    /// lowest corner of the drive.
    pub(super) moments: Vec<Moments>,
    /// Counts for the report: slices with a plane, surfaces of any size, and merged pairs of slices.
    pub(super) slices: u64,
    pub(super) surfaces: u64,
    pub(super) pairs: u64,
}

/// Merges slices into surfaces: the moments of each surface, and the surface (0: none) of each tree of each
/// tile.
pub(super) fn reduce(drive: &dyn DriveWindow, config: &SurfacesConfig) -> Result<Vec<u8>> {
    let head = stage_links::head(drive)?;
    let mut adjacent: BTreeMap<(u32, u32), Adjacent> = BTreeMap::new();
    let shared = stage_planes::shared(drive)?;
    for tile in TileId::first(drive.tiles()) {
        let found: Found = codec::decode(&drive.payload(STEP_SLICES, tile)?)?;
        for (pair, part) in found.adjacent {
            let none = Adjacent { border: Border::default(), ..part };
            adjacent.entry(pair).or_insert(none).border.merge(&part.border);
        }
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
            // A root is the smallest member of its set, so it has its number already.
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
    // A shared slice without a plane is not a surface, like such a slice within one tile.
    for surface in of_tiles.iter_mut().flatten().filter(|surface| **surface != 0) {
        if sums[*surface as usize - 1].points == 0 {
            *surface = 0;
        }
    }
    found.surfaces = sums.iter().filter(|sums| sums.points > 0).count() as u64;
    found.moments = sums;
    sliced::encode(&found, &of_tiles)
}

/// The plane of a surface from a fit. Moments and fit are relative to `corner`.
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

//! Step `links`: normals, links, trees, the planes of trees that lie in one tile, and the pairs of points
//! that make slices adjacent. It searches the neighbours of all points; contests do so only for a few.
//!
//! Its reduction computes the mean and the deviation of the flatness of the drive, and joins the parts of
//! trees that several tiles share. A tree is a slice if it has 10 points or more and its root is a centre,
//! that is, if the root is flatter than mean + deviation (equation 8).

use std::collections::BTreeMap;

use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

use super::around::{Around, moments};
use super::border::Border;
use super::normals::{NONE, Normals};
use super::payload::{self, Across, Closed, OfTile, OpenPoint, OpenTree, Pairs, Stored};
use super::seams;
use super::settings::{CONTEST_REACHES, LINKS_REACHES, NAME, SLICE_POINTS, STEP_LINKS, SurfacesConfig};
use super::slice::slice;
use super::trees::{Tree, trees};
use crate::cluster::{DriveWindow, Mapped, TileWindow, sliced};
use crate::error::{Error, Result};
use crate::model::{PointId, TileId, in_u32};
use crate::spatial::DisjointSets;

/// Computes the payload of a tile.
pub(super) fn map(tile: &dyn TileWindow, config: &SurfacesConfig) -> Result<Mapped> {
    let reach = config.reach(tile.lattice());
    let around = Around::load(tile, reach, LINKS_REACHES)?;
    let normals = Normals::of(&around, config.neighbours as usize, reach);
    let mut stored = Stored::default();
    let mut own = vec![NONE; around.len()];
    for point in (0..around.len()).filter(|&point| around.is_core(point)) {
        own[point] = in_u32(stored.labels.len(), "points of a tile");
        stored.labels.push(0);
        if normals.has(point) {
            stored.of_tile.flatness.add(normals.flatness(point));
        }
    }
    stored.consistent = vec![false; stored.labels.len()];
    let (open, closed): (Vec<Tree>, Vec<Tree>) =
        trees(&around, &normals).into_iter().partition(|tree| !tree.names.is_empty());
    let corner = tile.extent().0;
    for tree in closed {
        add_closed(&mut stored, &around, &normals, &own, &tree, (corner, config.refit_planes));
    }
    let first_open = in_u32(stored.of_tile.closed.len(), "trees of a tile") + 1;
    for (label, tree) in (first_open..).zip(open) {
        add_open(&mut stored, &around, &normals, &own, &tree, label);
    }
    let near = CONTEST_REACHES * config.contest_zone(tile.lattice());
    stored.near = seams::near_others(tile, &around, &stored.labels, near);
    stored.pairs = pairs(tile, &around, &normals, &own, &stored)?;
    Ok(Mapped::payload(stored.encode()?))
}

/// Adds a tree that lies in the tile, if it may be a slice.
fn add_closed(
    stored: &mut Stored,
    around: &Around,
    normals: &Normals,
    own: &[u32],
    tree: &Tree,
    (corner, refit): ([i64; 3], bool),
) {
    let Some(root) = tree.root.filter(|_| tree.points.len() as u64 >= SLICE_POINTS) else { return };
    let places: Vec<[i64; 3]> =
        tree.points.iter().map(|&point| around.lattice_point(point as usize)).collect();
    let Some(found) = slice(&places, refit) else { return };
    stored.of_tile.closed.push(normals.flatness(root as usize));
    let label = in_u32(stored.of_tile.closed.len(), "trees of a tile");
    for (&point, &consistent) in tree.points.iter().zip(&found.consistent) {
        let own = own[point as usize] as usize;
        stored.labels[own] = label;
        stored.consistent[own] = consistent;
    }
    let consistent = places.iter().zip(&found.consistent).filter(|(_, holds)| **holds);
    let moments = moments(consistent.map(|(place, _)| *place), corner);
    stored.planes.push(Closed { plane: found.plane, moments });
}

/// Adds the part of a tree that several tiles share.
fn add_open(stored: &mut Stored, around: &Around, normals: &Normals, own: &[u32], tree: &Tree, label: u32) {
    let mut part = Vec::with_capacity(tree.points.len());
    for &point in &tree.points {
        let own = own[point as usize];
        stored.labels[own as usize] = label;
        let at = around.lattice_point(point as usize);
        part.push(OpenPoint { id: around.id[point as usize], at, own });
    }
    stored.parts.push(part);
    stored.of_tile.open.push(OpenTree {
        points: tree.points.len() as u64,
        root: tree.root.map(|root| normals.flatness(root as usize)),
        names: tree.names.clone(),
    });
}

/// The mutual pairs of points of different trees. The tile owns at least one point of each pair.
fn pairs(
    tile: &dyn TileWindow,
    around: &Around,
    normals: &Normals,
    own: &[u32],
    stored: &Stored,
) -> Result<Pairs> {
    let closed = in_u32(stored.of_tile.closed.len(), "trees of a tile");
    let label_of = |point: &u32| {
        let own = own.get(*point as usize).copied().unwrap_or(NONE);
        stored.labels.get(own as usize).copied().unwrap_or(NONE)
    };
    let labels: Vec<u32> = normals.points().iter().map(label_of).collect();
    let search = PairSearch { tile, around, normals, own, stored, closed, labels: &labels };
    let mut pairs = Pairs::default();
    let mut borders: FxHashMap<(u32, u32), Border> = FxHashMap::default();
    // The borders of one point: it has neighbours in a few trees.
    let mut of_point: Vec<(u32, Border)> = Vec::new();
    for slot in normals.slots() {
        let label = labels[slot];
        if label == 0 || label == NONE {
            continue;
        }
        search.pairs_of_point(slot, &mut pairs, &mut of_point)?;
        for (there, border) in of_point.drain(..) {
            borders.entry((label.min(there), label.max(there))).or_default().merge(&border);
        }
    }
    pairs.ends.sort_unstable();
    pairs.trees = borders.into_iter().collect();
    pairs.trees.sort_unstable_by_key(|border| border.0);
    pairs.places = places(around, own, &pairs);
    Ok(pairs)
}

/// The search for mutual pairs.
struct PairSearch<'a> {
    tile: &'a dyn TileWindow,
    around: &'a Around,
    normals: &'a Normals,
    own: &'a [u32],
    stored: &'a Stored,
    /// The largest label of a tree that lies in the tile.
    closed: u32,
    /// The tree of each slot: 0 without a tree, [`NONE`] if another tile owns the point.
    labels: &'a [u32],
}

impl PairSearch<'_> {
    /// Adds the pairs of the point in a slot. Pairs of two trees that lie in the tile go to `borders`, by the
    /// other tree.
    #[inline] // one loop with its caller, over all points and their neighbours
    fn pairs_of_point(&self, slot: usize, pairs: &mut Pairs, borders: &mut Vec<(u32, Border)>) -> Result<()> {
        let Self { tile, around, normals, own, stored, closed, labels } = *self;
        let is_closed = |label: u32| label <= closed;
        let consistent = |own: u32| stored.consistent[own as usize];
        let points = normals.points();
        let label = labels[slot];
        let point = points[slot] as usize;
        let place = around.lattice_point(point);
        let mut is_end = false;
        for &other in normals.consistent(slot) {
            let there = labels[other as usize];
            if there == label {
                continue;
            }
            let at = points[other as usize] as usize;
            let is_mutual = || normals.is_mutual(slot, other as usize);
            if there == NONE {
                if is_mutual() {
                    is_end = true;
                    if point < at {
                        let owner = owner(tile, around, at)?;
                        pairs.across.push(Across { own: own[point], other: around.id[at], owner });
                    }
                }
                continue;
            }
            // A pair of two own points is seen from both; only the first point adds it.
            if at < point || there == 0 {
                continue;
            }
            if !(is_closed(label) && is_closed(there)) {
                if is_mutual() {
                    pairs.points.push((own[point], own[at]));
                }
            } else if consistent(own[point]) && consistent(own[at]) && is_mutual() {
                let known = borders.iter().position(|border| border.0 == there).unwrap_or_else(|| {
                    borders.push((there, Border::default()));
                    borders.len() - 1
                });
                let [here, beyond] = [label, there].map(|label| &stored.planes[label as usize - 1].plane);
                borders[known].1.add((here, place), (beyond, around.lattice_point(at)));
            }
        }
        if is_end {
            pairs.ends.push((around.id[point], own[point]));
        }
        Ok(())
    }
}

/// Positions and lattice coordinates of own points in pairs, ascending.
fn places(around: &Around, own: &[u32], pairs: &Pairs) -> Vec<(u32, [i64; 3])> {
    let mut wanted: Vec<u32> = pairs.points.iter().flat_map(|pair| [pair.0, pair.1]).collect();
    wanted.extend(pairs.across.iter().map(|across| across.own));
    wanted.extend(pairs.ends.iter().map(|end| end.1));
    wanted.sort_unstable();
    wanted.dedup();
    let mut points = (0..around.len()).filter(|&point| own[point] != NONE);
    // Positions ascend with points, so one pass finds all.
    let place = |own_point: u32| {
        let point = points.find(|&point| own[point] == own_point)?;
        Some((own_point, around.lattice_point(point)))
    };
    wanted.into_iter().filter_map(place).collect()
}

fn owner(tile: &dyn TileWindow, around: &Around, point: usize) -> Result<TileId> {
    let [x, y, _] = around.lattice_point(point);
    let lost = || Error::bug(format!("{NAME}: point {} has no tile", around.id[point]));
    tile.owner([x, y], [x, y]).ok_or_else(lost)
}

/// A slice with parts in several tiles.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct OpenSlice {
    /// Its number from 1; 0 if the tree is not a slice.
    pub(super) number: u32,
    /// Tiles, and the numbers of its parts among their open trees, ascending.
    pub(super) parts: Vec<(TileId, u32)>,
}

/// The slices of a tile.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Slices {
    /// Number of slices in tiles before it, not counting those that it shares with them.
    pub(super) before: u32,
    /// The slice of each open tree.
    pub(super) open: Vec<OpenSlice>,
}

/// The result of the step for the whole drive.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Drive {
    /// Points with a normal.
    pub(super) points: u64,
    /// Mean and standard deviation of their flatness in square lattice units.
    pub(super) mean: f64,
    pub(super) deviation: f64,
    /// Flatness below which a root is a centre, in square lattice units.
    pub(super) limit: f64,
    /// Number of slices.
    pub(super) slices: u32,
}

impl Drive {
    /// Whether a root with this flatness is a centre.
    pub(super) fn is_centre(&self, flatness: f64) -> bool {
        flatness < self.limit
    }
}

/// A whole tree: number of points, flatness of its root, and its parts.
type Whole = (u64, Option<f64>, Vec<(TileId, u32)>);

/// The numbers of slices.
pub(super) fn reduce(drive: &dyn DriveWindow, config: &SurfacesConfig) -> Result<Vec<u8>> {
    let mut flatness = payload::FlatnessSums::default();
    let mut names: Vec<(PointId, u32)> = Vec::new();
    // The open trees of all tiles: tile, number in the tile, points, flatness of the root.
    let mut open: Vec<(TileId, u32, u64, Option<f64>)> = Vec::new();
    for tile in TileId::first(drive.tiles()) {
        let OfTile { flatness: sums, open: trees, .. } = payload::load_trees(drive, tile)?;
        flatness.merge(&sums);
        for (number, tree) in (0_u32..).zip(trees) {
            let node = in_u32(open.len(), "parts of trees");
            names.extend(tree.names.into_iter().map(|name| (name, node)));
            open.push((tile, number, tree.points, tree.root));
        }
    }
    let (mean, deviation) = flatness.mean_and_deviation();
    // If all points are equally flat, every root is a centre.
    let limit = match config.flat_m2 {
        given if given > 0.0 => given / drive.lattice().step_m().powi(2),
        _ if deviation > 0.0 => mean + deviation,
        _ => f64::INFINITY,
    };
    let mut head = Drive { points: flatness.points, mean, deviation, limit, slices: 0 };
    let groups = join(names, open.len());
    let mut whole: BTreeMap<u32, Whole> = BTreeMap::new();
    for (group, (tile, number, points, root)) in groups.iter().zip(open) {
        let tree = whole.entry(*group).or_default();
        tree.0 += points;
        tree.1 = tree.1.or(root);
        tree.2.push((tile, number));
    }
    let mut slices: Vec<Slices> = Vec::new();
    for tile in TileId::first(drive.tiles()) {
        let of_tile = payload::load_trees(drive, tile)?;
        slices.push(Slices { before: head.slices, open: vec![OpenSlice::default(); of_tile.open.len()] });
        head.slices += in_u32(of_tile.closed.iter().filter(|root| head.is_centre(**root)).count(), "slices");
    }
    for (points, root, parts) in whole.into_values() {
        let root = root.ok_or_else(|| Error::bug(format!("{NAME}: a tree has no root: {parts:?}")))?;
        if points < SLICE_POINTS || !head.is_centre(root) {
            continue;
        }
        head.slices += 1;
        for &(tile, number) in &parts {
            slices[tile.index()].open[number as usize] =
                OpenSlice { number: head.slices, parts: parts.clone() };
        }
    }
    sliced::encode(&head, &slices)
}

/// The group of each part. Parts with an equal name are one group.
fn join(mut names: Vec<(PointId, u32)>, parts: usize) -> Vec<u32> {
    names.sort_unstable();
    let mut sets = DisjointSets::new(in_u32(parts, "parts of trees"));
    for pair in names.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        sets.union(pair[0].1, pair[1].1);
    }
    (0..in_u32(parts, "parts of trees")).map(|part| sets.find(part)).collect()
}

/// What the drive knows.
pub(super) fn head(drive: &(impl DriveWindow + ?Sized)) -> Result<Drive> {
    sliced::head(drive.global(STEP_LINKS))
}

/// The slices of a tile.
pub(super) fn slices(drive: &(impl DriveWindow + ?Sized), tile: TileId) -> Result<Slices> {
    sliced::slice(drive.global(STEP_LINKS), tile)
}

/// The slice, from 1, of each tree of a tile: first the closed ones, then the open ones. 0 for none.
pub(super) fn slice_of_tree(head: &Drive, slices: &Slices, of_tile: &OfTile) -> Vec<u32> {
    let mut next = slices.before;
    let mut number = |root: &f64| {
        let centre = head.is_centre(*root);
        next += u32::from(centre);
        if centre { next } else { 0 }
    };
    let mut of_trees: Vec<u32> = of_tile.closed.iter().map(&mut number).collect();
    of_trees.extend(slices.open.iter().map(|slice| slice.number));
    of_trees
}

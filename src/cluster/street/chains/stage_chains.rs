//! Step `chains`: upright chains near the ground, and whether each is a trunk or a pole.
//!
//! A *piece* is a component of voxels in a height slice. It is upright and narrow, and fills most of its
//! slice. Its voxels are trees or poles, or look like a hedge or something small, as the foot of a trunk in
//! low growth does. Pieces of the same or of adjacent slices form one *chain* if their centres are near each
//! other in the plane. The classifier confuses single voxels of trunks and poles. So a chain is decided as a
//! whole, by the classes of its voxels and by what continues above it. Without this decision F1 falls from
//! 0.71 to 0.56 on an avenue (prototype).
//!
//! A piece is narrow, so a tile sees the whole of every piece that it owns. The tile with the column of the
//! piece's first voxel owns the piece. Pieces become chains in the reduction.
#![expect(
    clippy::cast_possible_truncation,
    reason = "voxels of a tile and pieces of a drive fit u32; a mean of coordinates is a coordinate"
)]

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::axis::Axis;
use super::piece::{LEVEL_M, Piece};
use super::verdict::{Kind, OTHER_TRUNK_M, decide};
use crate::cluster::columns::Voxel;
use crate::cluster::street::classes::classified::Classified;
use crate::cluster::street::settings::{EDGE_M, STEP_CHAINS, Scene};
use crate::cluster::street::shares::{self, FENCE, POLE, SMALL, TREE};
use crate::cluster::street::window::Window;
use crate::cluster::{DriveWindow, Mapped, TileWindow, sliced};
use crate::codec;
use crate::error::Result;
use crate::model::{Lattice, TileId};
use crate::spatial::DisjointSets;

/// Distance around a tile within which voxels are read, in metres: a piece (1.1 m) from an owned voxel on, a
/// piece linked to it (0.45 m and 1.1 m), and a voxel that would make this one wider (0.54 m: the centroids
/// of two voxels that are two and one apart). The columns around the centre of an owned piece are nearer.
const REACH_M: f64 = 3.4;
/// Slices of height above ground in metres. They overlap, so that a piece that one border cuts is whole in
/// another slice.
const SLICES_M: [(f64, f64); 5] = [(0.15, 0.9), (0.6, 1.4), (1.1, 1.9), (1.6, 2.4), (2.1, 2.9)];
/// Largest diagonal of a piece in the plane, in metres. Wider pieces are foliage.
const WIDTH_M: f64 = 0.75;
/// The same in a forest, for a piece that is mostly tree: a stem of 0.7 m has a diagonal of 1 m. On streets
/// this width would classify bushes as trunks: trees downtown have F1 0.922 with it and 0.950 without.
const STEM_WIDTH_M: f64 = 1.1;
/// Smallest share of the height of its slice that a piece fills.
const FILL: f64 = 0.6;
/// Smallest number of voxels of a piece.
const VOXELS: u32 = 4;
/// Smallest height in metres and smallest number of voxels of a piece of the lowest slice. They are small
/// because objects in front hide most of the trunk of a small tree.
const STUB_M: f64 = 0.25;
const STUB_VOXELS: u32 = 3;
/// Largest distance in the plane between the centres of linked pieces, in metres.
const LINK_M: f64 = 0.45;
/// Radius around the centre of a piece within which voxels above count as its continuation, in metres.
const AXIS_M: f64 = 0.45;
/// Height above ground from which voxels are above a chain, in metres.
const ABOVE_M: f64 = 2.9;
/// Radius and heights of the ring around the axis in which the voxels of a crown are counted, in metres.
const CROWN_M: f64 = 1.5;
const CROWN_HEIGHTS_M: (f64, f64) = (2.0, 6.0);
/// Lowest height at which a crown covers a side, in metres.
const SIDES_M: f64 = 2.1;
/// Number of levels. Everything higher is in the last one.
const LEVELS: i64 = 64;

/// What the drive decides about a piece.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Verdict {
    /// Number of its chain from 1; 0 if the piece is in no chain.
    pub(crate) chain: u32,
    /// Whether the chain is a pole. Otherwise it is a trunk.
    pub(crate) pole: bool,
    /// Whether the piece is the highest of its chain.
    pub(crate) top: bool,
}

/// The payload of a tile: the pieces that it owns, in the order of slice and first voxel.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Payload {
    pieces: Vec<Piece>,
}

/// The pieces of the tiles `near` that are in chains, with their verdicts.
pub(crate) fn load(tile: &dyn TileWindow, near: &[TileId]) -> Result<Vec<(Piece, Verdict)>> {
    let mut pieces = Vec::new();
    for &near in near {
        let payload: Payload = codec::decode(&tile.payload(STEP_CHAINS, near)?)?;
        let verdicts: Vec<Verdict> = sliced::slice(tile.global(STEP_CHAINS), near)?;
        pieces.extend(payload.pieces.into_iter().zip(verdicts).filter(|(_, verdict)| verdict.chain != 0));
    }
    Ok(pieces)
}

/// Where each chain of the drive stands: the centre of its lowest piece, in lattice units.
pub(crate) fn places(drive: &dyn DriveWindow) -> Result<BTreeMap<u32, [i64; 2]>> {
    let mut lowest: BTreeMap<u32, (i32, u8, Voxel, [i64; 2])> = BTreeMap::new();
    for tile in TileId::first(drive.tiles()) {
        let payload: Payload = codec::decode(&drive.payload(STEP_CHAINS, tile)?)?;
        let verdicts: Vec<Verdict> = sliced::slice(drive.global(STEP_CHAINS), tile)?;
        for (piece, verdict) in payload.pieces.iter().zip(verdicts).filter(|(_, verdict)| verdict.chain != 0)
        {
            let found = (piece.height.0, piece.slice, piece.first, piece.centre);
            let best = lowest.entry(verdict.chain).or_insert(found);
            *best = found.min(*best);
        }
    }
    Ok(lowest.into_iter().map(|(chain, (.., centre))| (chain, centre)).collect())
}

/// Whether voxels of a class may be a part of a chain. The foot of a trunk in low growth often looks like a
/// hedge or like something small.
pub(crate) fn may_be_upright(class: u8) -> bool {
    matches!(class, TREE | POLE | FENCE | SMALL)
}

/// A component of a slice while it is collected.
struct Part {
    voxels: Vec<usize>,
    min: [i64; 2],
    max: [i64; 2],
}

struct Units {
    width: i64,
    stem_width: i64,
    link: i64,
    axis: i64,
    crown: i64,
    crown_heights: (i32, i32),
    sides: i32,
    above: i32,
    level: i64,
    half_voxel: i64,
}

impl Units {
    fn new(lattice: Lattice, scene: Scene) -> Self {
        let stem_width = match scene {
            Scene::Street => WIDTH_M,
            Scene::Forest => STEM_WIDTH_M,
        };
        Self {
            width: lattice.units(WIDTH_M),
            stem_width: lattice.units(stem_width),
            link: lattice.units(LINK_M),
            axis: lattice.units(AXIS_M),
            crown: lattice.units(CROWN_M),
            crown_heights: (lattice.units(CROWN_HEIGHTS_M.0) as i32, lattice.units(CROWN_HEIGHTS_M.1) as i32),
            sides: lattice.units(SIDES_M) as i32,
            above: lattice.units(ABOVE_M) as i32,
            level: lattice.units(LEVEL_M),
            half_voxel: lattice.units(EDGE_M) / 2,
        }
    }
}

/// The pieces that a tile owns.
pub(crate) fn map(tile: &dyn TileWindow, scene: Scene) -> Result<Mapped> {
    let lattice = tile.lattice();
    let units = Units::new(lattice, scene);
    let around = Classified::load(tile, lattice.units_up(REACH_M))?;
    let class = shares::classes(&around.shares);
    let upright: Vec<bool> = class.iter().map(|&class| may_be_upright(class)).collect();
    let mut pieces: Vec<(Piece, bool)> = Vec::new();
    for (number, slice) in (0_u8..).zip(SLICES_M) {
        let range = (lattice.units(slice.0) as i32, lattice.units(slice.1) as i32);
        let inside =
            |voxel: usize| upright[voxel] && around.height[voxel] > range.0 && around.height[voxel] < range.1;
        let (fill, voxels) =
            if number == 0 { (STUB_M, STUB_VOXELS) } else { (FILL * (slice.1 - slice.0), VOXELS) };
        let least = (lattice.units(fill) as i32, voxels);
        for part in parts(&around, inside) {
            pieces.extend(piece(&around, &class, &units, number, &part, least));
        }
    }
    let pieces = linked(pieces, &units);
    Ok(Mapped::payload(codec::encode(&Payload { pieces })?))
}

/// The components of the voxels `inside` a slice. Two voxels are connected if they are at most two voxels
/// apart.
fn parts(around: &Classified, inside: impl Fn(usize) -> bool) -> Vec<Part> {
    let columns = &around.voxels.columns;
    let mut near = Window::new(2, 2).over(columns);
    let chosen: Vec<usize> = (0..columns.len()).filter(|&voxel| inside(voxel)).collect();
    let mut place = vec![u32::MAX; columns.len()];
    for (number, &voxel) in (0_u32..).zip(&chosen) {
        place[voxel] = number;
    }
    let mut sets = DisjointSets::new(chosen.len() as u32);
    for (number, &voxel) in (0_u32..).zip(&chosen) {
        let [i, j, k] = around.voxels.key[voxel];
        near.visit([i, j], k, |other| {
            if other > voxel && place[other] != u32::MAX {
                sets.union(number, place[other]);
            }
        });
    }
    let mut parts: BTreeMap<u32, Part> = BTreeMap::new();
    for (number, &voxel) in (0_u32..).zip(&chosen) {
        let [x, y, _] = around.voxels.centre[voxel];
        let part = parts.entry(sets.find(number)).or_insert_with(|| Part {
            voxels: Vec::new(),
            min: [x, y],
            max: [x, y],
        });
        part.voxels.push(voxel);
        part.min = [part.min[0].min(x), part.min[1].min(y)];
        part.max = [part.max[0].max(x), part.max[1].max(y)];
    }
    parts.into_values().collect()
}

/// The component as a piece, and whether the tile owns it. `None` if it is too wide, or if its height or its
/// number of voxels is below `least`.
fn piece(
    around: &Classified,
    class: &[u8],
    units: &Units,
    slice: u8,
    part: &Part,
    least: (i32, u32),
) -> Option<(Piece, bool)> {
    let size = [part.max[0] - part.min[0], part.max[1] - part.min[1]];
    let heights = part.voxels.iter().map(|&voxel| around.height[voxel]);
    let low = heights.clone().min()?;
    let high = heights.max()?;
    let count = part.voxels.len() as u32;
    let diagonal = size[0] * size[0] + size[1] * size[1];
    if diagonal > units.stem_width.pow(2) || high - low < least.0 || count < least.1 {
        return None;
    }
    let mut sum = [0_i64; 2];
    let mut axis = Axis::new(around.voxels.centre[part.voxels[0]]);
    let mut pole = 0;
    let mut tree = 0;
    for &voxel in &part.voxels {
        sum[0] += around.voxels.centre[voxel][0];
        sum[1] += around.voxels.centre[voxel][1];
        axis.add(around.voxels.centre[voxel]);
        pole += u32::from(around.shares[voxel][usize::from(POLE)]);
        tree += u32::from(around.shares[voxel][usize::from(TREE)]);
    }
    if diagonal > units.width.pow(2) && 2 * tree < 255 * count {
        return None;
    }
    let centre = sum.map(|sum| sum.div_euclid(i64::from(count)));
    let far = |voxel: &usize| squared(centre, around.voxels.centre[*voxel]);
    let radius = part.voxels.iter().map(far).max()?.isqrt() + units.half_voxel;
    let first = part.voxels[0];
    let mut piece = Piece {
        slice,
        first: around.voxels.key[first],
        centre,
        radius,
        height: (low, high),
        voxels: count,
        pole,
        tree,
        axis,
        pole_above: 0,
        any_above: 0,
        any_levels: 0,
        crown: 0,
        sides: [0; 8],
        links: Vec::new(),
    };
    let owned = around.voxels.owned[first];
    if owned {
        look_up(around, class, units, &mut piece);
    }
    Some((piece, owned))
}

/// Fills in the occupied levels around the axis of a piece, and the crown around it.
fn look_up(around: &Classified, class: &[u8], units: &Units, piece: &mut Piece) {
    // The window is around the first voxel, and the ring around the centre. The window has the whole ring of
    // a piece of a street. Of that of a stem that is wider than 0.75 m, in a forest, it leaves out what is
    // farther than 2.3 m from the first voxel. Tiles do not matter: both belong to the piece.
    let mut near = Window::new(15, i32::MAX / 4).over(&around.voxels.columns);
    let [i, j, k] = piece.first;
    near.visit([i, j], k, |voxel| {
        let of = class[voxel];
        if of != TREE && of != POLE {
            return;
        }
        let distance = squared(piece.centre, around.voxels.centre[voxel]);
        let height = around.height[voxel];
        if distance > units.axis.pow(2) {
            if of == TREE && distance <= units.crown.pow(2) {
                let at_height = height > units.crown_heights.0 && height < units.crown_heights.1;
                piece.crown += u32::from(at_height);
                if height > units.sides {
                    piece.sides[side(piece.centre, around.voxels.centre[voxel])] += 1;
                }
            }
            return;
        }
        let level = 1_u64 << (i64::from(height) / units.level).clamp(0, LEVELS - 1);
        piece.any_levels |= level;
        if height > units.above {
            piece.any_above |= level;
            if of == POLE {
                piece.pole_above |= level;
            }
        }
    });
}

/// The side of a place on which a voxel lies, one of eight.
fn side([x, y]: [i64; 2], [u, v, _]: [i64; 3]) -> usize {
    let (dx, dy) = (u - x, v - y);
    usize::from(dx > 0) | usize::from(dy > 0) << 1 | usize::from(dx.abs() > dy.abs()) << 2
}

fn squared([x, y]: [i64; 2], [u, v, _]: [i64; 3]) -> i64 {
    (x - u).pow(2) + (y - v).pow(2)
}

/// The pieces that the tile owns, with their links to all others.
fn linked(all: Vec<(Piece, bool)>, units: &Units) -> Vec<Piece> {
    let mut by_x: Vec<usize> = (0..all.len()).collect();
    by_x.sort_unstable_by_key(|&number| all[number].0.centre[0]);
    let mut pieces = Vec::new();
    for (piece, _) in all.iter().filter(|(_, owned)| *owned) {
        let start = by_x.partition_point(|&number| all[number].0.centre[0] < piece.centre[0] - units.link);
        let near = by_x[start..].iter().map(|&number| &all[number].0);
        let mut links: Vec<(u8, Voxel)> = near
            .take_while(|other| other.centre[0] <= piece.centre[0] + units.link)
            .filter(|other| other.slice.abs_diff(piece.slice) <= 1)
            .filter(|other| {
                let [x, y] = other.centre;
                squared(piece.centre, [x, y, 0]) <= units.link.pow(2)
            })
            .map(|other| (other.slice, other.first))
            .filter(|&other| other != (piece.slice, piece.first))
            .collect();
        links.sort_unstable();
        pieces.push(Piece { links, ..piece.clone() });
    }
    pieces.sort_unstable_by_key(|piece| (piece.slice, piece.first));
    pieces
}

/// Decides every chain of the drive.
pub(crate) fn reduce(drive: &dyn DriveWindow) -> Result<Vec<u8>> {
    let lattice = drive.lattice();
    let mut tiles = Vec::new();
    for tile in TileId::first(drive.tiles()) {
        let payload: Payload = codec::decode(&drive.payload(STEP_CHAINS, tile)?)?;
        tiles.push(payload.pieces);
    }
    // Pieces in an order that does not depend on tiles.
    let mut pieces: Vec<&Piece> = tiles.iter().flatten().collect();
    pieces.sort_unstable_by_key(|piece| (piece.slice, piece.first));
    let find =
        |slice, first| pieces.binary_search_by_key(&(slice, first), |piece| (piece.slice, piece.first));
    let mut sets = DisjointSets::new(pieces.len() as u32);
    for (number, piece) in (0_u32..).zip(&pieces) {
        for &(slice, first) in &piece.links {
            if let Ok(other) = find(slice, first) {
                sets.union(number, other as u32);
            }
        }
    }
    let mut chains: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for number in 0..pieces.len() as u32 {
        chains.entry(sets.find(number)).or_default().push(number);
    }
    let mut decided: Vec<(&[u32], [i64; 2], Kind)> = Vec::new();
    for members in chains.values() {
        let chain: Vec<&Piece> = members.iter().map(|&number| pieces[number as usize]).collect();
        decided.extend(decide(&chain, lattice).map(|kind| (&members[..], chain[0].centre, kind)));
    }
    let trunks = decided.iter().filter(|(.., kind)| *kind == Kind::Trunk).map(|(_, place, _)| *place);
    let trunks = Places::new(trunks.collect());
    let mut verdicts = vec![Verdict::default(); pieces.len()];
    for (chain, (members, place, kind)) in (1..).zip(decided) {
        let pole = match kind {
            Kind::Trunk => false,
            Kind::Pole => true,
            Kind::PoleBesideTrunk => trunks.any_within(place, lattice.units(OTHER_TRUNK_M)),
        };
        let highest = members.iter().copied().max_by_key(|&number| pieces[number as usize].reach());
        for &number in members {
            verdicts[number as usize] = Verdict { chain, pole, top: highest == Some(number) };
        }
    }
    let count = verdicts.iter().map(|verdict| verdict.chain).max().unwrap_or(0);
    let verdict =
        |piece: &Piece| find(piece.slice, piece.first).map_or(Verdict::default(), |at| verdicts[at]);
    let slices: Vec<Vec<Verdict>> = tiles.iter().map(|pieces| pieces.iter().map(verdict).collect()).collect();
    sliced::encode(&count, &slices)
}

/// Places in the plane, in the order of x.
struct Places(Vec<[i64; 2]>);

impl Places {
    fn new(mut places: Vec<[i64; 2]>) -> Self {
        places.sort_unstable();
        Self(places)
    }

    /// Whether one of the places is at most this distance away.
    fn any_within(&self, [x, y]: [i64; 2], distance: i64) -> bool {
        let from = self.0.partition_point(|place| place[0] < x - distance);
        let near = self.0[from..].iter().take_while(|place| place[0] <= x + distance);
        near.into_iter().any(|&[u, v]| squared([x, y], [u, v, 0]) <= distance.pow(2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_within_a_distance_is_found() {
        let places = Places::new(vec![[50, 0], [0, 30], [-20, 0]]);
        assert!(places.any_within([0, 0], 20) && !places.any_within([0, 0], 19));
        assert!(places.any_within([0, 60], 30) && !places.any_within([0, 61], 30));
        assert!(places.any_within([47, 4], 5) && !places.any_within([47, 5], 5));
        assert!(!Places::new(Vec::new()).any_within([0, 0], 100));
    }

    #[test]
    fn the_eight_sides_are_different() {
        let at = |dx, dy| side([0, 0], [dx, dy, 7]);
        let all: std::collections::BTreeSet<usize> =
            [(2, 1), (1, 2), (-1, 2), (-2, 1), (-2, -1), (-1, -2), (1, -2), (2, -1)]
                .map(|(dx, dy)| at(dx, dy))
                .into();
        assert_eq!(all.len(), 8);
    }
}

//! Step `clusters`: the `euclidean` objects of the drive, and their voxels. No other step joins points.
//!
//! A tile labels its points and those within d_t around it. It names each label by the single-link cells in
//! which a link to another tile may end. Points of one cell are within d_t of each other, so labels with an
//! equal name are one object. A link between two tiles has one end in each. Both tiles see the link, and both
//! use the cells of its ends as names.
//!
//! A tile stores the voxels of its own points: by label, the number of points and the sum of their places.
//! Several tiles store parts of a voxel at a border. Sums are integers, so the parts add up to the same
//! voxel, whatever the tiles.

use std::collections::BTreeMap;

use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

use super::pieces::{Pieces, Storing};
use super::settings::{NAME, NormalizedCutConfig, STEP_CLUSTERS};
use crate::cluster::columns::{Border, Voxel, global_indices, join};
use crate::cluster::linking::cell_side;
use crate::cluster::{Clusterer, DriveWindow, Euclidean, Mapped, TilePoints, TileWindow, sliced};
use crate::codec;
use crate::error::Result;
use crate::model::{AlgorithmError, Lattice, TileId};
use crate::spatial::{CellMap, VoxelIndex};

/// Sections of the payload.
const SECTION_LABELS: usize = 0;
const SECTION_FIGURES: usize = 1;
const SECTION_PIECES: usize = 2;

/// Size of an object, or of the part of it that a tile owns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Size {
    pub(super) points: u64,
    /// Smallest and largest coordinates in lattice units.
    pub(super) lo: [i64; 3],
    pub(super) hi: [i64; 3],
}

impl Size {
    const NONE: Self = Self { points: 0, lo: [i64::MAX; 3], hi: [i64::MIN; 3] };

    fn add(&mut self, other: &Self) {
        self.points += other.points;
        for axis in 0..3 {
            self.lo[axis] = self.lo[axis].min(other.lo[axis]);
            self.hi[axis] = self.hi[axis].max(other.hi[axis]);
        }
    }

    /// Whether an object is tall and wide enough to be cut. Its width is the longer side of its box in the
    /// plane.
    fn may_be_several(&self, config: &NormalizedCutConfig, lattice: Lattice) -> bool {
        let side = |axis: usize| lattice.metres(self.hi[axis] - self.lo[axis]);
        side(2) > config.tall && side(0).max(side(1)) > config.wide
    }
}

/// The input of the reduction from a tile.
#[derive(Debug, Default, Serialize, Deserialize)]
struct OfTile {
    /// Size of each label, over the points of the tile.
    sizes: Vec<Size>,
    border: Border,
}

/// An object that a tile cuts and classifies, with its parts in all tiles.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Assigned {
    /// Number of the object in the drive.
    pub(super) object: u32,
    pub(super) size: Size,
    /// Whether it is tall and wide enough to be cut.
    pub(super) several: bool,
    /// Tiles and labels of its parts, ascending.
    pub(super) parts: Vec<(TileId, u32)>,
}

/// The slice of the global for a tile.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Objects {
    /// Number from 1 of the object of each label; 0 if it has too few or too many points.
    pub(super) of_label: Vec<u32>,
    /// The objects that the tile cuts and classifies.
    pub(super) assigned: Vec<Assigned>,
}

/// Computes the payload of a tile.
pub(super) fn map(tile: &dyn TileWindow, euclidean: &Euclidean, edge: u32) -> Result<Mapped> {
    let lattice = tile.lattice();
    let reach = lattice.units_up(euclidean.reach(lattice).metres());
    let points = tile.points(reach, true)?;
    let mut labels = vec![0; points.cloud.len()];
    let count = euclidean.cluster(&points.cloud, &mut labels)?;
    let (count, labels) = own_labels(&points, labels, count);
    let mut sizes = vec![Size::NONE; count as usize];
    for (point, &label) in
        labels.iter().enumerate().filter(|(point, label)| points.core[*point] && **label > 0)
    {
        let at = points.cloud.lattice_point(point);
        sizes[label as usize - 1].add(&Size { points: 1, lo: at, hi: at });
    }
    let shared = shared_cells(tile, &points, &labels, reach)?;
    let of_tile = OfTile { sizes, border: Border { count, shared } };
    let pieces = pieces(&points, &labels, edge)?;
    let kept: Vec<u8> = (0..labels.len())
        .filter(|&point| points.core[point])
        .flat_map(|point| labels[point].to_le_bytes())
        .collect();
    Ok(Mapped::payload(codec::pack(&[kept, codec::encode(&of_tile)?, codec::encode(&pieces)?])))
}

/// Numbers the labels with points of the tile from 1, in their order. All other labels become 0.
fn own_labels(points: &TilePoints, mut labels: Vec<u32>, count: u32) -> (u32, Vec<u32>) {
    let mut number = vec![0; count as usize + 1];
    for (label, _) in labels.iter().zip(&points.core).filter(|(_, core)| **core) {
        number[*label as usize] = 1;
    }
    number[0] = 0;
    let mut last = 0;
    for number in number.iter_mut().filter(|number| **number == 1) {
        last += 1;
        *number = last;
    }
    labels.iter_mut().for_each(|label| *label = number[*label as usize]);
    (last, labels)
}

/// The single-link cells in which a link across the border of the tile may end, with the labels in them.
fn shared_cells(
    tile: &dyn TileWindow,
    points: &TilePoints,
    labels: &[u32],
    reach: i64,
) -> Result<Vec<(Voxel, u32)>> {
    let grid = tile.grid();
    let cloud = &points.cloud;
    let cell_of = |point: usize| {
        let [x, y, _] = cloud.lattice_point(point);
        grid.cell(x, y)
    };
    // Cells of the raster that are within reach of a point of another tile.
    let disc = grid.disc(reach);
    let mut foreign = CellMap::<u8>::default();
    let mut near = CellMap::<u8>::default();
    for cell in (0..cloud.len()).filter(|&point| !points.core[point]).filter_map(cell_of) {
        if std::mem::replace(foreign.entry(cell), 1) == 0 {
            disc.iter().for_each(|by| *near.entry([cell[0] + by[0], cell[1] + by[1]]) = 1);
        }
    }
    let side = i64::from(cell_side(reach));
    let (lowest, highest) = tile.extent();
    let base = lowest.map(|value| value.div_euclid(side));
    let too_many = |axis: usize| AlgorithmError::TooManyCells {
        method: NAME,
        cells: (highest[axis] - lowest[axis]).div_euclid(side).unsigned_abs(),
        edge_units: cell_side(reach),
        limit: i32::MAX as u64,
    };
    let mut near = near.cursor();
    let mut shared = Vec::new();
    // Whether a cell has points of the tile, and of other tiles.
    let mut has: FxHashMap<Voxel, [bool; 2]> = FxHashMap::default();
    let labelled = |point: &usize| labels[*point] > 0;
    for point in (0..cloud.len()).filter(labelled) {
        if cell_of(point).is_none_or(|cell| near.get(cell) == 0) {
            continue;
        }
        let at = cloud.lattice_point(point);
        let mut name = [0; 3];
        for axis in 0..3 {
            let index = at[axis].div_euclid(side) - base[axis];
            name[axis] = i32::try_from(index).map_err(|_| too_many(axis))?;
        }
        has.entry(name).or_default()[usize::from(!points.core[point])] = true;
        let one = (name, labels[point] - 1);
        if shared.last() != Some(&one) {
            shared.push(one);
        }
    }
    shared.sort_unstable();
    shared.dedup();
    // Linked points are at most two cells apart on each axis. So a cell has no link across the border if
    // every point on the other side is further away.
    let around = |[i, j, k]: Voxel| {
        let steps = |from: i32| from.saturating_sub(2)..=from.saturating_add(2);
        steps(i).flat_map(move |i| steps(j).flat_map(move |j| steps(k).map(move |k| [i, j, k])))
    };
    let faces =
        |cell: Voxel, side: usize| around(cell).any(|near| has.get(&near).is_some_and(|has| has[side]));
    shared.retain(|(cell, _)| {
        let [own, foreign] = has.get(cell).copied().unwrap_or_default();
        (own && faces(*cell, 1)) || (foreign && faces(*cell, 0))
    });
    Ok(shared)
}

/// The voxels of the points that the tile owns, by label.
fn pieces(points: &TilePoints, labels: &[u32], edge: u32) -> Result<Pieces> {
    let cloud = &points.cloud;
    let index = VoxelIndex::build(NAME, cloud, edge)?;
    let units = i64::from(edge);
    let keys = global_indices(NAME, &index, |_| true)?;
    let mut key_of = vec![[0; 3]; index.len()];
    keys.iter().for_each(|(key, voxel)| key_of[*voxel as usize] = *key);
    // Label, number of points and sums of each voxel. Further labels of a voxel are in `further`.
    let mut slots: Vec<(u32, u32, [u64; 3])> = vec![(0, 0, [0; 3]); index.len()];
    let mut further: BTreeMap<(usize, u32), (u32, [u64; 3])> = BTreeMap::new();
    for (range, voxel) in index.streaks() {
        let corner = key_of[voxel].map(|index| i64::from(index) * units);
        for point in range.filter(|&point| points.core[point] && labels[point] > 0) {
            let at = cloud.lattice_point(point);
            let offset = [0, 1, 2].map(|axis| at[axis].abs_diff(corner[axis]));
            let slot = &mut slots[voxel];
            if slot.1 == 0 {
                slot.0 = labels[point];
            }
            let (count, sums) = if slot.0 == labels[point] {
                (&mut slot.1, &mut slot.2)
            } else {
                let other = further.entry((voxel, labels[point])).or_default();
                (&mut other.0, &mut other.1)
            };
            *count += 1;
            (0..3).for_each(|axis| sums[axis] += offset[axis]);
        }
    }
    let mut found: Vec<(u32, Voxel, u32, [u64; 3])> = slots
        .into_iter()
        .zip(&key_of)
        .filter(|(slot, _)| slot.1 > 0)
        .map(|((label, count, sums), key)| (label - 1, *key, count, sums))
        .collect();
    found.extend(
        further.into_iter().map(|((voxel, label), (count, sums))| (label - 1, key_of[voxel], count, sums)),
    );
    found.sort_unstable_by_key(|piece| (piece.0, piece.1));
    let mut storing = Storing::default();
    found.into_iter().for_each(|(label, key, count, sums)| storing.push(label, key, count, sums));
    Ok(storing.finish())
}

/// A part of an object: the tile, its label there, its points.
type Part = (TileId, u32, u64);

/// The objects of the drive. Each is assigned to the tile that has the most of its points.
pub(super) fn reduce(
    drive: &dyn DriveWindow,
    euclidean: &Euclidean,
    config: &NormalizedCutConfig,
) -> Result<Vec<u8>> {
    let mut borders = Vec::new();
    let mut sizes = Vec::new();
    for tile in TileId::first(drive.tiles()) {
        let payload = drive.payload(STEP_CLUSTERS, tile)?;
        let of_tile: OfTile = codec::decode(codec::section(&payload, SECTION_FIGURES)?)?;
        borders.push(of_tile.border);
        sizes.push(of_tile.sizes);
    }
    let component = join(&borders);
    drop(borders);
    let mut objects: BTreeMap<u32, (Size, Vec<Part>)> = BTreeMap::new();
    for ((tile, components), sizes) in TileId::first(drive.tiles()).zip(&component).zip(&sizes) {
        for ((label, component), size) in (0_u32..).zip(components).zip(sizes) {
            let object = objects.entry(*component).or_insert((Size::NONE, Vec::new()));
            object.0.add(size);
            object.1.push((tile, label, size.points));
        }
    }
    let allowed = euclidean.object_size();
    let mut slices: Vec<Objects> = component
        .iter()
        .map(|labels| Objects { of_label: vec![0; labels.len()], assigned: Vec::new() })
        .collect();
    let mut number = 0;
    for (size, parts) in objects.into_values().filter(|object| allowed.contains(&object.0.points)) {
        number += 1;
        let mut points: BTreeMap<TileId, u64> = BTreeMap::new();
        for &(tile, label, count) in &parts {
            slices[tile.index()].of_label[label as usize] = number;
            *points.entry(tile).or_default() += count;
        }
        let Some((home, _)) = points.into_iter().min_by_key(|(tile, count)| (u64::MAX - count, *tile)) else {
            continue;
        };
        let several = size.may_be_several(config, drive.lattice());
        let parts = parts.into_iter().map(|(tile, label, _)| (tile, label)).collect();
        slices[home.index()].assigned.push(Assigned { object: number, size, several, parts });
    }
    sliced::encode(&number, &slices)
}

/// Number of objects of the drive.
pub(super) fn count(drive: &dyn DriveWindow) -> Result<u32> {
    sliced::head(drive.global(STEP_CLUSTERS))
}

/// The objects of a tile.
pub(super) fn objects(drive: &(impl DriveWindow + ?Sized), tile: TileId) -> Result<Objects> {
    sliced::slice(drive.global(STEP_CLUSTERS), tile)
}

/// The voxels of a tile, by label.
pub(super) fn load_pieces(drive: &(impl DriveWindow + ?Sized), tile: TileId) -> Result<Pieces> {
    codec::decode(codec::section(&drive.payload(STEP_CLUSTERS, tile)?, SECTION_PIECES)?)
}

/// The label (0: none) of each point of objects that a tile owns, in ascending order of points.
pub(super) fn load_labels(drive: &(impl DriveWindow + ?Sized), tile: TileId) -> Result<Vec<u32>> {
    let payload = drive.payload(STEP_CLUSTERS, tile)?;
    let (labels, _) = codec::section(&payload, SECTION_LABELS)?.as_chunks::<4>();
    Ok(labels.iter().map(|label| u32::from_le_bytes(*label)).collect())
}

//! Step `cut`: gathers each whole object from all tiles, cuts it, and classifies its parts. It reads no
//! points.
//!
//! One tile does this for an object: the one that has the most of its points. The result depends only on the
//! voxels of the object, so the choice of the tile does not matter.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::clusters::{self, Assigned};
use super::cut;
use super::pieces::Voxels;
use super::settings::{NAME, NormalizedCutConfig, STEP_CUT};
use super::tree_filter;
use crate::cluster::columns::Voxel;
use crate::cluster::{DriveWindow, Mapped, TileWindow, sliced};
use crate::codec;
use crate::error::{Error, Result};
use crate::model::{Lattice, TileId, in_u32};
use crate::words;

/// An object that a tile has cut and classified.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Named {
    object: u32,
    /// Class of each part.
    classes: Vec<u8>,
    several: bool,
    /// Number of doublings of the voxel edge for the first cut.
    doublings: u32,
    unsettled: u32,
    /// Number of points, and smallest and largest coordinates, for the report of coarse objects.
    points: u64,
    lo: [i64; 3],
    hi: [i64; 3],
}

/// The part of each voxel of a cut object.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct PartOfVoxel {
    /// Edge of a voxel in lattice units.
    pub(super) edge: i64,
    /// Voxels, ascending.
    pub(super) keys: Vec<Voxel>,
    pub(super) parts: Vec<u32>,
}

/// Place and groups of the parts of an object.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Placed {
    /// Group of the first part. The next parts have the next numbers.
    pub(super) first_group: u32,
    /// Class of each part.
    pub(super) classes: Vec<u8>,
    /// The tile that has cut the object, and the section of its payload with the parts of the voxels. `None`
    /// if the object is whole.
    pub(super) cut: Option<(TileId, u32)>,
}

/// An object that was cut on coarser voxels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Coarse {
    /// Smallest corner in lattice units.
    pub(super) at: [i64; 3],
    pub(super) points: u64,
    pub(super) length_m: f64,
    pub(super) voxel_m: f64,
}

/// Figures of the step for the report.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Figures {
    /// Numbers of objects of `euclidean`, of objects tall and wide enough to be cut, and of all parts.
    pub(super) objects: u64,
    pub(super) several: u64,
    pub(super) parts: u64,
    /// Number of eigenvectors that did not reach the tolerance.
    pub(super) unsettled: u64,
    pub(super) coarse: Vec<Coarse>,
}

/// Cuts the objects that are assigned to a tile.
pub(super) fn map(tile: &dyn TileWindow, config: &NormalizedCutConfig, edge: u32) -> Result<Mapped> {
    let lattice = tile.lattice();
    let assigned = clusters::objects(tile, tile.tile())?.assigned;
    let mut named = Vec::new();
    let mut sections = Vec::new();
    for (object, voxels) in assigned.iter().zip(gather(tile, &assigned, config, edge)?) {
        let parts = if object.several {
            cut::cut(&voxels, config, lattice)
        } else {
            cut::Parts { of: vec![0; voxels.len()], count: 1, ..cut::Parts::default() }
        };
        let classes = tree_filter::classes(&voxels, &parts, lattice, edge.into(), config.tall);
        let (parts, classes) = tree_filter::join_facades(&voxels, parts, classes);
        named.push(Named {
            object: object.object,
            classes,
            several: object.several,
            doublings: voxels.doublings + parts.doublings,
            unsettled: parts.unsettled,
            points: object.size.points,
            lo: object.size.lo,
            hi: object.size.hi,
        });
        if parts.count > 1 {
            let of_voxels = PartOfVoxel { edge: voxels.edge, keys: voxels.key, parts: parts.of };
            sections.push(codec::encode(&of_voxels)?);
        }
    }
    sections.insert(0, codec::encode(&named)?);
    Ok(Mapped::payload(codec::pack(&sections)))
}

/// Largest number of voxels of an object in memory, per voxel of a graph: a voxel takes 44 bytes, and 2 to 5
/// KB in a graph. Chosen: 1,000,000 voxels are about 2.5 km of trees that touch each other.
const KEPT: usize = 50;

/// The voxels of the objects, from all tiles. Tiles are read one after the other.
fn gather(
    tile: &dyn TileWindow,
    assigned: &[Assigned],
    config: &NormalizedCutConfig,
    edge: u32,
) -> Result<Vec<Voxels>> {
    let mut of_tile: BTreeMap<TileId, Vec<(usize, u32)>> = BTreeMap::new();
    for (number, object) in assigned.iter().enumerate() {
        for &(near, label) in &object.parts {
            of_tile.entry(near).or_default().push((number, label));
        }
    }
    let most = usize::try_from(config.max_voxels).unwrap_or(usize::MAX).saturating_mul(KEPT);
    let mut voxels = vec![Voxels::new(edge.into()); assigned.len()];
    for (near, labels) in of_tile {
        let pieces = clusters::load_pieces(tile, near)?.unpacked();
        for (number, label) in labels {
            voxels[number].add(&pieces, label, most);
        }
    }
    Ok(voxels)
}

/// The place of the objects of each tile after the cut, and the figures of the drive.
pub(super) fn reduce(drive: &dyn DriveWindow, edge: u32) -> Result<Vec<u8>> {
    let lattice = drive.lattice();
    let mut figures = Figures::default();
    let objects = clusters::count(drive)?;
    let mut placed: Vec<Option<Placed>> = vec![None; objects as usize];
    let mut next_group = 1;
    for tile in TileId::first(drive.tiles()) {
        let payload = drive.payload(STEP_CUT, tile)?;
        let named: Vec<Named> = codec::decode(codec::section(&payload, 0)?)?;
        let mut section = 0;
        for one in named {
            let parts = in_u32(one.classes.len(), "parts of an object");
            figures.objects += 1;
            figures.several += u64::from(one.several);
            figures.parts += u64::from(parts);
            figures.unsettled += u64::from(one.unsettled);
            if one.several && one.doublings > 0 {
                figures.coarse.push(coarse(&one, lattice, edge));
            }
            let cut = (parts > 1).then(|| {
                section += 1;
                (tile, section)
            });
            let place = placed.get_mut((one.object as usize).wrapping_sub(1));
            let place =
                place.ok_or_else(|| Error::bug(format!("{NAME}: there is no object {}", one.object)))?;
            *place = Some(Placed { first_group: next_group, classes: one.classes, cut });
            next_group += parts;
        }
    }
    // This order does not depend on the tiles.
    figures.coarse.sort_by_key(|coarse| (coarse.at, coarse.points));
    let mut slices = Vec::new();
    for tile in TileId::first(drive.tiles()) {
        let labels = clusters::objects(drive, tile)?.of_label;
        let place = |&object: &u32| (object as usize).checked_sub(1).and_then(|at| placed[at].clone());
        slices.push(labels.iter().map(place).collect::<Vec<Option<Placed>>>());
    }
    sliced::encode(&figures, &slices)
}

fn coarse(one: &Named, lattice: Lattice, edge: u32) -> Coarse {
    let side = |axis: usize| lattice.metres(one.hi[axis] - one.lo[axis]);
    Coarse {
        at: one.lo,
        points: one.points,
        length_m: side(0).max(side(1)),
        voxel_m: lattice.metres(i64::from(edge) << one.doublings),
    }
}

/// The figures of the step.
pub(super) fn figures(drive: &dyn DriveWindow) -> Result<Figures> {
    sliced::head(drive.global(STEP_CUT))
}

/// Warnings about objects that were too large for the finest voxels.
pub(super) fn warnings(drive: &dyn DriveWindow) -> Result<Vec<String>> {
    let coarse = figures(drive)?.coarse;
    let Some(widest) = coarse.iter().map(|one| one.voxel_m).reduce(f64::max) else { return Ok(Vec::new()) };
    let many = coarse.len() as u64;
    let verb = if many == 1 { "was" } else { "were" };
    Ok(vec![format!(
        "{} with more voxels than {NAME}.max_voxels {verb} cut on coarser ones, of up to {widest:.2} m: report.json says \
         where (`cut on coarser voxels`)",
        words::counted(many, "cluster")
    )])
}

/// The place of the object of each label of a tile. `None` for objects with too few or too many points.
pub(super) fn placed(drive: &(impl DriveWindow + ?Sized), tile: TileId) -> Result<Vec<Option<Placed>>> {
    sliced::slice(drive.global(STEP_CUT), tile)
}

/// The parts of the voxels in a section of the payload of a tile.
pub(super) fn load_parts(payload: &[u8], section: u32) -> Result<PartOfVoxel> {
    codec::decode(codec::section(payload, section as usize)?)
}

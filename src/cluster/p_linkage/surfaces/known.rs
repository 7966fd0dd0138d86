//! The surfaces of the points of a tile and around it, after the slices or a contest. Other tiles have
//! stored, by id, the surfaces of their points that this tile reads (`seams`).

use super::around::Around;
use super::contested;
use super::payload;
use super::settings::{NAME, STEP_SLICES};
use super::stage_slices::surface_of_tree;
use crate::cluster::{DriveWindow, TileWindow};
use crate::error::{Error, Result};
use crate::model::{PointId, TileId};

/// The surface of each point that a tile owns after a step, 0 for none, in the order of [`Around`].
pub(super) fn own(drive: &(impl DriveWindow + ?Sized), tile: TileId, step: usize) -> Result<Vec<u32>> {
    if step != STEP_SLICES {
        return contested::own(drive, tile, step);
    }
    let surfaces = surface_of_tree(drive, tile)?;
    let mut trees = payload::load_labels(drive, tile)?;
    trees.iter_mut().for_each(|tree| *tree = of_tree(&surfaces, *tree));
    Ok(trees)
}

/// The surfaces of the points of a tile that other tiles read, after a step, in ascending order of ids.
fn near(drive: &(impl DriveWindow + ?Sized), tile: TileId, step: usize) -> Result<Vec<(PointId, u32)>> {
    if step != STEP_SLICES {
        return contested::near(drive, tile, step);
    }
    let surfaces = surface_of_tree(drive, tile)?;
    let mut near = payload::load_near(drive, tile)?;
    near.iter_mut().for_each(|point| point.1 = of_tree(&surfaces, point.1));
    Ok(near)
}

fn of_tree(surfaces: &[u32], tree: u32) -> u32 {
    (tree as usize).checked_sub(1).and_then(|tree| surfaces.get(tree)).copied().unwrap_or(0)
}

/// The surfaces of all points within `reach` of a tile, after a step.
pub(super) fn around(tile: &dyn TileWindow, around: &Around, reach: i64, step: usize) -> Result<Vec<u32>> {
    let here = tile.tile();
    let mut own = own(tile, here, step)?.into_iter();
    let mut of_others = Vec::new();
    for other in tile.near(reach).into_iter().filter(|other| *other != here) {
        of_others.extend(near(tile, other, step)?);
    }
    // The list of each tile is sorted already. A stable sort is fast on such runs.
    of_others.sort();
    let mut of_others = of_others.into_iter().peekable();
    let lost = |point: usize| {
        let id = around.id[point];
        Error::bug(format!("{NAME}: tile {here} does not know the surface of point {id}"))
    };
    let mut surfaces = vec![0; around.len()];
    for point in (0..around.len()).filter(|point| around.is_core(*point)) {
        surfaces[point] = own.next().ok_or_else(|| lost(point))?;
    }
    let mut foreign: Vec<usize> = (0..around.len()).filter(|point| !around.is_core(*point)).collect();
    foreign.sort_unstable_by_key(|point| around.id[*point]);
    for point in foreign {
        let id = around.id[point];
        while of_others.next_if(|other| other.0 < id).is_some() {}
        let found = of_others.next_if(|other| other.0 == id).map(|other| other.1);
        surfaces[point] = found.ok_or_else(|| lost(point))?;
    }
    Ok(surfaces)
}

//! Step `surfaces`: the label of every point, from the surface of its tree. Its reduction gives the planes.

use std::collections::BTreeMap;

use serde_json::json;

use super::payload;
use super::settings::{NAME, STEP_SURFACES};
use super::stage_links;
use super::stage_slices::{self, surface_of_tree};
use crate::cluster::{DriveWindow, Figures, Grouped, Labelled, Mapped, TileWindow};
use crate::codec;
use crate::error::{Error, Result};
use crate::model::{Plane, TileId, in_u32};

/// Labels the points of a tile.
pub(super) fn map(tile: &dyn TileWindow) -> Result<Mapped> {
    let points = tile.points(0, true)?;
    let trees = payload::load_labels(tile, tile.tile())?;
    let surfaces = surface_of_tree(tile, tile.tile())?;
    let own: Vec<usize> = (0..points.cloud.len()).filter(|&point| points.core[point]).collect();
    if own.len() != trees.len() {
        let text =
            format!("{NAME}: tile {} has {} points and {} labels", tile.tile(), own.len(), trees.len());
        return Err(Error::bug(text));
    }
    let mut labels = vec![0; points.cloud.len()];
    let mut numbers: BTreeMap<u32, u32> = BTreeMap::new();
    let mut groups: Vec<u32> = Vec::new();
    for (point, tree) in own.into_iter().zip(trees) {
        let Some(&surface) = (tree as usize).checked_sub(1).and_then(|tree| surfaces.get(tree)) else {
            continue;
        };
        if surface == 0 {
            continue;
        }
        let next = in_u32(groups.len(), "surfaces of a tile") + 1;
        let number = *numbers.entry(surface).or_insert(next);
        if number == next {
            groups.push(surface);
        }
        labels[point] = number;
    }
    let count = in_u32(groups.len(), "surfaces of a tile");
    let labelled = Labelled { points, labels, count, with_halo: false };
    Ok(Mapped { payload: codec::encode(&groups)?, labelled: Some(labelled), ..Mapped::default() })
}

/// The surfaces of the drive.
pub(super) fn reduce(drive: &dyn DriveWindow) -> Result<Grouped> {
    let mut groups = Vec::new();
    for tile in TileId::first(drive.tiles()) {
        groups.push(codec::decode::<Vec<u32>>(&drive.payload(STEP_SURFACES, tile)?)?);
    }
    let links = stage_links::head(drive)?;
    let surfaces = stage_slices::head(drive)?;
    let square_m = drive.lattice().step_m().powi(2);
    let mut figures = Figures::new();
    figures.insert(
        NAME.to_owned(),
        json!({
            "points with a normal": links.points,
            "mean flatness in m2": links.mean * square_m,
            "standard deviation of flatness in m2": links.deviation * square_m,
            "slices": surfaces.slices,
            "merged pairs of slices": surfaces.pairs,
            "surfaces of any size": surfaces.surfaces,
        }),
    );
    let planes: BTreeMap<u32, Plane> =
        (1..).zip(surfaces.planes).filter_map(|(surface, plane)| Some((surface, plane?))).collect();
    Ok(Grouped { groups, planes, figures, ..Grouped::default() })
}

//! Step `surfaces`: the label of every point, from its surface. Its reduction returns the planes.

use std::collections::BTreeMap;

use serde_json::json;

use super::around::in_order;
use super::known;
use super::settings::{NAME, STEP_SLICES};
use super::stage_contest::{self, Merged};
use super::stage_links;
use super::stage_slices;
use crate::cluster::{DriveWindow, Figures, Grouped, Labelled, Mapped, TileWindow};
use crate::codec;
use crate::error::{Error, Result};
use crate::model::{TileId, in_u32};

/// Labels the points of a tile. `step` is the number of this step.
pub(super) fn map(tile: &dyn TileWindow, step: usize) -> Result<Mapped> {
    let points = tile.points(0, true)?;
    let surfaces = known::own(tile, tile.tile(), step - 1)?;
    let own: Vec<usize> = in_order(&points.cloud).into_iter().filter(|&point| points.core[point]).collect();
    if own.len() != surfaces.len() {
        let text =
            format!("{NAME}: tile {} has {} points and {} labels", tile.tile(), own.len(), surfaces.len());
        return Err(Error::bug(text));
    }
    let mut labels = vec![0; points.cloud.len()];
    let mut numbers: BTreeMap<u32, u32> = BTreeMap::new();
    let mut groups: Vec<u32> = Vec::new();
    for (point, surface) in own.into_iter().zip(surfaces).filter(|(_, surface)| *surface != 0) {
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
pub(super) fn reduce(drive: &dyn DriveWindow, step: usize) -> Result<Grouped> {
    let mut groups = Vec::new();
    for tile in TileId::first(drive.tiles()) {
        groups.push(codec::decode::<Vec<u32>>(&drive.payload(step, tile)?)?);
    }
    let links = stage_links::head(drive)?;
    let slices = stage_slices::head(drive)?;
    let contests: Vec<Merged> =
        (STEP_SLICES + 1..step).map(|step| stage_contest::head(drive, step)).collect::<Result<_>>()?;
    let square_m = drive.lattice().step_m().powi(2);
    let mut figures = Figures::new();
    figures.insert(
        NAME.to_owned(),
        json!({
            "points with a normal": links.points,
            "mean flatness in m2": links.mean * square_m,
            "standard deviation of flatness in m2": links.deviation * square_m,
            "slices grow from points flatter than, in m2": links.limit * square_m,
            "slices": slices.slices,
            "merged pairs of slices": slices.pairs,
            "points that changed their surface in each contest":
                contests.iter().map(|contest| contest.changed).collect::<Vec<u64>>(),
            "merged pairs of surfaces in each contest":
                contests.iter().map(|contest| contest.pairs).collect::<Vec<u64>>(),
            "surfaces of any size": contests.last().map_or(slices.surfaces, |contest| contest.surfaces),
        }),
    );
    let corner = drive.extent().0;
    let of_slices = || {
        let planes = (1..).zip(&slices.moments);
        planes
            .filter_map(|(surface, sums)| Some((surface, stage_slices::plane(sums, &sums.fit()?, corner))))
            .collect()
    };
    let planes = contests.into_iter().last().map_or_else(of_slices, |contest| contest.planes);
    Ok(Grouped { groups, planes, figures, ..Grouped::default() })
}

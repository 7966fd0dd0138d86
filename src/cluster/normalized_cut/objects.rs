//! Step `objects`: the label of every point, from the part of its voxel, and the class of each part.

use std::collections::BTreeMap;

use serde_json::json;

use super::clusters;
use super::settings::{NAME, STEP_CUT};
use super::stage_cut::{self, PartOfVoxel, Placed};
use crate::cluster::columns::Voxel;
use crate::cluster::{DriveWindow, Figures, Grouped, Labelled, Mapped, TileWindow};
use crate::codec;
use crate::error::{Error, Result};
use crate::model::{Kind, TileId, in_u32};

/// Number of this step.
const STEP_OBJECTS: usize = STEP_CUT + 1;

/// Group and class of each label of a tile.
type OfLabels = Vec<(u32, u8)>;

/// Labels the points of a tile.
pub(super) fn map(tile: &dyn TileWindow) -> Result<Mapped> {
    let points = tile.points(0, true)?;
    let clusters = clusters::load_labels(tile, tile.tile())?;
    let placed = stage_cut::placed(tile, tile.tile())?;
    let cut = Cut::load(tile, &placed)?;
    let own: Vec<usize> = (0..points.cloud.len()).filter(|&point| points.core[point]).collect();
    if own.len() != clusters.len() {
        let text =
            format!("{NAME}: tile {} has {} points and {} labels", tile.tile(), own.len(), clusters.len());
        return Err(Error::bug(text));
    }
    let mut labels = vec![0; points.cloud.len()];
    let mut numbers: BTreeMap<u32, u32> = BTreeMap::new();
    let mut of_labels = OfLabels::new();
    // Cluster, voxel and part of the previous point. Consecutive points of a file mostly share them.
    let mut last: Option<(u32, Voxel, u32)> = None;
    for (point, cluster) in own.into_iter().zip(clusters) {
        let Some(placed) = (cluster as usize).checked_sub(1).and_then(|at| placed[at].as_ref()) else {
            continue;
        };
        let part = match cut.of(placed) {
            None => 0,
            Some(object) => {
                let key = object.key(points.cloud.lattice_point(point));
                match last {
                    Some((before, voxel, part)) if before == cluster && voxel == key => part,
                    _ => {
                        let part = object.part(key)?;
                        last = Some((cluster, key, part));
                        part
                    }
                }
            }
        };
        let group = placed.first_group + part;
        let next = in_u32(of_labels.len(), "objects of a tile");
        let number = *numbers.entry(group).or_insert(next);
        if number == next {
            of_labels.push((group, placed.classes[part as usize]));
        }
        labels[point] = number + 1;
    }
    let count = in_u32(of_labels.len(), "objects of a tile");
    let labelled = Labelled { points, labels, count, with_halo: false };
    Ok(Mapped { payload: codec::encode(&of_labels)?, labelled: Some(labelled), ..Mapped::default() })
}

/// The cut objects of a tile.
struct Cut {
    parts: BTreeMap<(TileId, u32), PartOfVoxel>,
}

impl Cut {
    /// Loads them from the tiles that have cut them.
    fn load(tile: &dyn TileWindow, placed: &[Option<Placed>]) -> Result<Self> {
        let mut wanted: Vec<(TileId, u32)> =
            placed.iter().flatten().filter_map(|placed| placed.cut).collect();
        wanted.sort_unstable();
        wanted.dedup();
        let mut parts = BTreeMap::new();
        for of_tile in wanted.chunk_by(|a, b| a.0 == b.0) {
            let payload = tile.payload(STEP_CUT, of_tile[0].0)?;
            for &(owner, section) in of_tile {
                parts.insert((owner, section), stage_cut::load_parts(&payload, section)?);
            }
        }
        Ok(Self { parts })
    }

    /// The parts of a cut object. `None` if it was not cut.
    fn of(&self, placed: &Placed) -> Option<&PartOfVoxel> {
        placed.cut.and_then(|place| self.parts.get(&place))
    }
}

impl PartOfVoxel {
    /// The voxel of a place. Keys of voxels fit 32 bits, because the step `clusters` has checked the keys of
    /// the finest voxels.
    #[expect(clippy::cast_possible_truncation, reason = "checked by global_indices")]
    fn key(&self, at: [i64; 3]) -> Voxel {
        at.map(|value| value.div_euclid(self.edge) as i32)
    }

    fn part(&self, key: Voxel) -> Result<u32> {
        let lost = |_| Error::bug(format!("{NAME}: voxel {key:?} has points and is in no part"));
        self.keys.binary_search(&key).map(|at| self.parts[at]).map_err(lost)
    }
}

/// The objects of the drive.
pub(super) fn reduce(drive: &dyn DriveWindow) -> Result<Grouped> {
    let mut groups = Vec::new();
    let mut kinds = BTreeMap::new();
    for tile in TileId::first(drive.tiles()) {
        let of_labels: OfLabels = codec::decode(&drive.payload(STEP_OBJECTS, tile)?)?;
        // The rules have no probabilities, so there is no confidence.
        kinds.extend(of_labels.iter().map(|&(group, class)| (group, Kind::new(class, 0))));
        groups.push(of_labels.into_iter().map(|(group, _)| group).collect());
    }
    let found = stage_cut::figures(drive)?;
    let lattice = drive.lattice();
    let coarse: Vec<serde_json::Value> = found
        .coarse
        .iter()
        .map(|one| {
            let [x, y, z] = one.at.map(|value| lattice.metres(value));
            json!({
                "min_x_m": x,
                "min_y_m": y,
                "min_z_m": z,
                "points": one.points,
                "length_m": one.length_m,
                "voxel_m": one.voxel_m,
            })
        })
        .collect();
    let mut figures = Figures::new();
    figures.insert(
        NAME.to_owned(),
        json!({
            "clusters": found.objects,
            "tall and wide": found.several,
            "parts": found.parts,
            "eigenvectors without convergence": found.unsettled,
            "cut on coarser voxels": coarse,
        }),
    );
    Ok(Grouped { groups, kinds, figures, ..Grouped::default() })
}

//! The steps `contest-1`, `contest-2`, ...: each runs one contest among surfaces and finds the surfaces that
//! touch then. The reduction merges surfaces that agree, and fits the planes of surfaces to the points that
//! are consistent with local planes.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::around::Around;
use super::contest::{Arena, Contested, Touching};
use super::contested::{self, Found, OnPlane};
use super::cubes;
use super::known;
use super::merging::{self, Known};
use super::planes::Moments;
use super::seams;
use super::settings::{CONTEST_REACHES, STEP_SLICES, SurfacesConfig};
use super::stage_slices;
use crate::cluster::{DriveWindow, Mapped, TileWindow, sliced};
use crate::error::Result;
use crate::model::{Plane, TileId, in_u32};
use crate::spatial::DisjointSets;

/// Computes the payload of a tile.
pub(super) fn map(tile: &dyn TileWindow, config: &SurfacesConfig, step: usize) -> Result<Mapped> {
    let lattice = tile.lattice();
    let zone = config.contest_zone(lattice);
    let reach = CONTEST_REACHES * zone;
    let around = Around::load(tile, zone, CONTEST_REACHES)?;
    let before = known::around(tile, &around, reach, step - 1)?;
    let neighbours = config.neighbours as usize;
    let arena = Arena::new(&around, cubes::edge(lattice), neighbours, config.reach(lattice));
    let now = arena.contest(&before, config.cosine());
    let mut found = of_own(&around, &before, &now, tile.extent().0);
    found.touching = arena.touching(&now, config.cosine(), config.border_score);
    let own: Vec<u32> =
        (0..around.len()).filter(|point| around.is_core(*point)).map(|point| now.surfaces[point]).collect();
    let near = seams::near_others(tile, &around, &own, reach);
    Ok(Mapped::payload(contested::encode(&own, &near, &found)?))
}

/// The results for the points of the tile, without touching surfaces.
fn of_own(around: &Around, before: &[u32], now: &Contested, corner: [i64; 3]) -> Found {
    let mut changed = 0;
    let mut of_surfaces: BTreeMap<u32, OnPlane> = BTreeMap::new();
    // Consecutive points are mostly in one surface.
    let mut latest = (0, OnPlane::default());
    for point in (0..around.len()).filter(|point| around.is_core(*point)) {
        let surface = now.surfaces[point];
        changed += u64::from(surface != before[point]);
        if surface == 0 {
            continue;
        }
        if surface != latest.0 {
            of_surfaces.entry(latest.0).or_default().merge(&latest.1);
            latest = (surface, OnPlane::default());
        }
        if now.on_plane[point] {
            let at = around.lattice_point(point);
            let moments = if now.amid[point] { &mut latest.1.amid } else { &mut latest.1.at_edges };
            moments.add([0, 1, 2].map(|axis| at[axis] - corner[axis]));
        }
    }
    of_surfaces.entry(latest.0).or_default().merge(&latest.1);
    of_surfaces.remove(&0);
    let surfaces = of_surfaces.keys().copied().collect();
    let moments = of_surfaces.into_iter().filter(|(_, moments)| moments.all().points > 0).collect();
    Found { surfaces, touching: Vec::new(), moments, changed }
}

/// The result of a contest for the whole drive.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Merged {
    /// The planes of surfaces that have one.
    pub(super) planes: BTreeMap<u32, Plane>,
    /// Moments of the points of surfaces that are consistent with their slices, for the next contest.
    of_slices: BTreeMap<u32, Moments>,
    /// Counts for the report: surfaces of any size, merged pairs of surfaces, and points that changed their
    /// surface.
    pub(super) surfaces: u64,
    pub(super) pairs: u64,
    pub(super) changed: u64,
}

/// Merges surfaces. A merged surface has the number of one of them.
pub(super) fn reduce(drive: &dyn DriveWindow, config: &SurfacesConfig, step: usize) -> Result<Vec<u8>> {
    let mut merged = Merged::default();
    let mut touching: BTreeMap<(u32, u32), Touching> = BTreeMap::new();
    let mut of_tiles: Vec<Vec<u32>> = Vec::new();
    let mut known: BTreeMap<u32, Known> = BTreeMap::new();
    for (surface, of_slices) in of_slices(drive, step)? {
        known.insert(surface, Known { of_slices, ..Known::default() });
    }
    // Surfaces are numbered from 1.
    let most = known.last_key_value().map_or(0, |last| *last.0);
    for tile in TileId::first(drive.tiles()) {
        let found = contested::found(drive, tile, step)?;
        merged.changed += found.changed;
        for (pair, part) in found.touching {
            touching.entry(pair).or_default().merge(&part);
        }
        for (surface, moments) in found.moments {
            known.entry(surface).or_default().now.merge(&moments);
        }
        of_tiles.push(found.surfaces);
    }
    touching.retain(|_, touching| touching.agrees(config.border_score));
    let mut sets = DisjointSets::new(in_u32(most as usize + 1, "surfaces"));
    merged.pairs = merging::merge(&touching, &mut sets, &mut known);
    let left: BTreeSet<u32> = of_tiles.iter().flatten().map(|surface| sets.find(*surface)).collect();
    known.retain(|surface, _| left.contains(surface));
    merged.surfaces = left.len() as u64;
    let corner = drive.extent().0;
    for (surface, known) in known {
        merged.of_slices.insert(surface, known.of_slices);
        let plane = known.plane().map(|(points, fit)| stage_slices::plane(&points, &fit, corner));
        merged.planes.extend(plane.map(|plane| (surface, plane)));
    }
    let mut renumbered = |surfaces: Vec<u32>| -> Vec<(u32, u32)> {
        let both = surfaces.into_iter().map(|surface| (surface, sets.find(surface)));
        both.filter(|(old, new)| old != new).collect()
    };
    let of_tiles: Vec<Vec<(u32, u32)>> = of_tiles.into_iter().map(&mut renumbered).collect();
    sliced::encode(&merged, &of_tiles)
}

/// For each surface before a contest, the moments of its points that are consistent with its slices.
fn of_slices(drive: &dyn DriveWindow, step: usize) -> Result<BTreeMap<u32, Moments>> {
    if step - 1 == STEP_SLICES {
        return Ok((1..).zip(stage_slices::head(drive)?.moments).collect());
    }
    Ok(head(drive, step - 1)?.of_slices)
}

/// The result of a contest for the whole drive.
pub(super) fn head(drive: &(impl DriveWindow + ?Sized), step: usize) -> Result<Merged> {
    sliced::head(drive.global(step))
}

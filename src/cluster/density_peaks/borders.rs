//! Stage `borders`: on points, where clusters meet: curvatures of the pairs of representatives of two clusters, the
//! labelled point nearest to each component of halo voxels, and the labels of the tile's own points. Nothing is merged
//! here: thresholds on the sums belong to the reduction.
#![expect(
    clippy::cast_possible_truncation,
    reason = "points of a tile fit u32; radii are validated settings of a few metres"
)]

use std::collections::BTreeMap;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::columns::{Border, Columns, Voxel, disc};
use super::curvature::curvature;
use super::surroundings::{FineGrid, Neighbour, Surroundings};
use super::voxelise::number;
use super::{DensityPeaksConfig, STAGE_BORDERS};
use crate::cluster::{DriveSource, Labelled, Mapped, TileSource};
use crate::codec;
use crate::error::Result;

/// Points that a curvature is computed from (chosen; the paper gives no number).
const NEIGHBOURS: usize = 20;
/// How far around representatives neighbours are read at first, in metres; further where that is not enough.
const FIRST_SEARCH_M: f64 = 1.5;

/// What is known of a component of halo voxels.
#[derive(Debug, Default, Clone, Serialize, Deserialize)]
pub(super) struct Halo {
    /// Voxels of it that the tile owns.
    pub(super) voxels: u64,
    /// The labelled point nearest to any point of the tile: squared distance, id and cluster.
    pub(super) nearest: Option<(i64, u64, u32)>,
}

/// The pairs of two clusters.
#[derive(Debug, Default, Clone, Copy, Serialize, Deserialize)]
pub(super) struct PairSum {
    pub(super) pairs: u64,
    /// Sum of both curvatures of all pairs, in steps of 2^-40.
    pub(super) curvature: i128,
}

/// What a tile keeps.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct BordersPayload {
    /// Cluster of label 1, 2, ...; the components in `halos` have the labels after these.
    pub(super) clusters: Vec<u32>,
    pub(super) halos: Vec<Halo>,
    pub(super) border: Border,
    /// Clusters that meet, the smaller first, ascending.
    pub(super) pairs: Vec<(u32, u32, PairSum)>,
}

/// Lengths in lattice units.
struct Lengths {
    pair: i64,
    reassign: i64,
}

/// How far around a tile points are read as a rule, in metres.
pub(super) fn reach_m(config: &DensityPeaksConfig) -> f64 {
    (config.d_th + FIRST_SEARCH_M).max(config.reassign).max(3.0 * config.voxel) + 0.01
}

/// The payload of a tile, and the labels of its points.
pub(super) fn map(tile: &dyn TileSource, config: &DensityPeaksConfig, edge: u32) -> Result<Mapped> {
    let lattice = tile.lattice();
    let lengths = Lengths { pair: lattice.units(config.d_th), reassign: lattice.units(config.reassign) };
    let reach = lattice.units(reach_m(config));
    let around = Surroundings::load(tile, edge, reach)?;
    let search = lattice.units(FIRST_SEARCH_M).max(lengths.reassign);
    let grid = FineGrid::new(&around, search)?;
    let mut payload = BordersPayload {
        pairs: pair_sums(tile, edge, reach, &lengths, &around, &grid)?,
        ..BordersPayload::default()
    };

    let is_halo = |voxel: usize| around.cluster[voxel] == 0;
    let component = halos(&around, is_halo, &mut payload);
    nearest_labelled(&around, &grid, &lengths, edge, &component, &mut payload.halos);

    let core = &around.points.core;
    payload.clusters =
        (0..core.len()).filter(|&point| core[point]).map(|point| around.cluster_of(point)).collect();
    payload.clusters.sort_unstable();
    payload.clusters.dedup();
    payload.clusters.retain(|&cluster| cluster != 0);
    let clusters = payload.clusters.len() as u32;
    let label = |point: usize| {
        if !core[point] {
            return 0;
        }
        match payload.clusters.binary_search(&around.cluster_of(point)) {
            Ok(place) => place as u32 + 1,
            Err(_) => clusters + 1 + component[around.voxel[point] as usize],
        }
    };
    let labels: Vec<u32> = (0..core.len()).map(label).collect();
    let count = clusters + payload.halos.len() as u32;
    let payload = codec::encode(&payload)?;
    Ok(Mapped { payload, labelled: Some(Labelled { points: around.points, labels, count }) })
}

/// Components of halo voxels, by voxel; every halo voxel that the tile owns or has a point in has one.
fn halos(around: &Surroundings, is_halo: impl Fn(usize) -> bool, payload: &mut BordersPayload) -> Vec<u32> {
    let count = around.voxels.len();
    // A voxel concerns the tile that owns it and those that own its points: these have to agree on its component.
    let (mut own, mut foreign) = (vec![false; count], vec![true; count]);
    for &voxel in &around.owned {
        own[voxel as usize] = true;
        foreign[voxel as usize] = false;
    }
    for (&voxel, &core) in around.voxel.iter().zip(&around.points.core) {
        own[voxel as usize] |= core;
        foreign[voxel as usize] |= !core;
    }
    for voxel in (0..count).filter(|&voxel| !is_halo(voxel)) {
        own[voxel] = false;
        foreign[voxel] = false;
    }
    let mut shared = around.voxels.shared(&own, &foreign);
    shared.retain(|&voxel| is_halo(voxel));
    let roots = around.voxels.components(&is_halo);
    let (component, border) = number(&around.voxels, &roots, &own, &shared);
    payload.halos = vec![Halo::default(); border.count as usize];
    payload.border = border;
    for &voxel in around.owned.iter().filter(|&&voxel| is_halo(voxel as usize)) {
        payload.halos[component[voxel as usize] as usize].voxels += 1;
    }
    component
}

/// For each component of halo voxels the labelled point nearest to its points in the core. A point is compared only
/// with what is at least as near as the best so far.
fn nearest_labelled(
    around: &Surroundings,
    grid: &FineGrid,
    lengths: &Lengths,
    edge: u32,
    component: &[u32],
    halos: &mut [Halo],
) {
    let steps = (lengths.reassign / i64::from(edge) + 1) as i32;
    let within =
        around.near(steps, |voxel| around.cluster[voxel] == 0, |_, other| around.cluster[other] != 0);
    let mut finder = grid.finder();
    let mut found: Vec<Neighbour> = Vec::new();
    let cloud = &around.points.cloud;
    for (point, &voxel) in around.voxel.iter().enumerate() {
        let voxel = voxel as usize;
        if !around.points.core[point] || !within[voxel] {
            continue;
        }
        let halo = &mut halos[component[voxel] as usize];
        let limit = halo.nearest.map_or(lengths.reassign.pow(2), |nearest| nearest.0);
        grid.nearest(&mut finder, cloud.lattice_point(point), 1, limit, &mut found);
        if let Some(&(distance, id, other)) = found.first() {
            let cluster = around.cluster_of(grid.source[other as usize] as usize);
            let candidate = (distance, id, cluster);
            halo.nearest = Some(halo.nearest.map_or(candidate, |nearest| nearest.min(candidate)));
        }
    }
}

/// A representative near another cluster.
struct Representative {
    place: [i64; 3],
    id: u64,
    cluster: u32,
    core: bool,
}

/// The sums over the pairs whose smaller id is in the core.
fn pair_sums(
    tile: &dyn TileSource,
    edge: u32,
    reach: i64,
    lengths: &Lengths,
    around: &Surroundings,
    grid: &FineGrid,
) -> Result<Vec<(u32, u32, PairSum)>> {
    let steps = (lengths.pair / i64::from(edge) + 1) as i32;
    let cluster = &around.cluster;
    let meets = |voxel: usize, other: usize| cluster[other] != 0 && cluster[other] != cluster[voxel];
    let border = around.near(steps, |voxel| cluster[voxel] != 0, meets);
    let cloud = &around.points.cloud;
    let mut kept = grid.representatives(around);
    kept.retain(|&(_, point)| border[around.voxel[point as usize] as usize]);
    let columns = Columns::new(kept.iter().map(|entry| entry.0));
    let representative = |&(_, point): &(Voxel, u32)| {
        let point = point as usize;
        let (place, id) = (cloud.lattice_point(point), cloud.id[point]);
        Representative { place, id, cluster: around.cluster_of(point), core: around.points.core[point] }
    };
    let representatives: Vec<Representative> = kept.iter().map(representative).collect();

    let mut needed = vec![false; representatives.len()];
    for_pairs(&columns, &representatives, grid, lengths.pair, |a, b| {
        needed[a] = true;
        needed[b] = true;
    });
    let curvatures = curvatures(tile, edge, reach, lengths, grid, &representatives, &needed)?;
    let mut sums = BTreeMap::<(u32, u32), PairSum>::new();
    for_pairs(&columns, &representatives, grid, lengths.pair, |a, b| {
        let (one, other) = (representatives[a].cluster, representatives[b].cluster);
        let sum = sums.entry((one.min(other), one.max(other))).or_default();
        sum.pairs += 1;
        sum.curvature += i128::from(curvatures[a]) + i128::from(curvatures[b]);
    });
    Ok(sums.into_iter().map(|((one, other), sum)| (one, other, sum)).collect())
}

/// Visits the pairs of representatives of different clusters closer than `distance` whose smaller id is in the core.
fn for_pairs(
    columns: &Columns,
    representatives: &[Representative],
    grid: &FineGrid,
    distance: i64,
    mut visit: impl FnMut(usize, usize),
) {
    let reach = distance / grid.edge() + 1;
    let steps: Vec<[i32; 2]> = disc(2 * reach.pow(2))
        .into_iter()
        .map(|step| step.1)
        .filter(|step| step.iter().all(|d| i64::from(d.abs()) <= reach))
        .collect();
    let heights = columns.heights();
    let mut finder = columns.finder();
    let mut around: Vec<Range<usize>> = Vec::new();
    for (column, &[i, j]) in columns.cells().iter().enumerate() {
        if !columns.voxels(column).any(|a| representatives[a].core) {
            continue;
        }
        around.clear();
        around.extend(
            steps.iter().map(|[di, dj]| finder.column([i + di, j + dj])).filter(|range| !range.is_empty()),
        );
        for a in columns.voxels(column).filter(|&a| representatives[a].core) {
            let (one, k) = (&representatives[a], heights[a]);
            for range in &around {
                let low = k - reach as i32;
                let start = range.start + heights[range.clone()].partition_point(|&other| other < low);
                for b in (start..range.end).take_while(|&b| heights[b] <= k + reach as i32) {
                    let other = &representatives[b];
                    if other.cluster != one.cluster && other.id > one.id {
                        let d = [0, 1, 2].map(|axis| one.place[axis] - other.place[axis]);
                        if d.iter().map(|d| d * d).sum::<i64>() < distance.pow(2) {
                            visit(a, b);
                        }
                    }
                }
            }
        }
    }
}

/// Curvatures of the representatives that are `needed`. Where the nearest points may lie outside of what was read,
/// twice as much is read for those representatives alone, until they certainly do not.
fn curvatures(
    tile: &dyn TileSource,
    edge: u32,
    reach: i64,
    lengths: &Lengths,
    grid: &FineGrid,
    representatives: &[Representative],
    needed: &[bool],
) -> Result<Vec<i64>> {
    let mut values = vec![0; representatives.len()];
    let mut found: Vec<Neighbour> = Vec::new();
    let mut finder = grid.finder();
    let mut open: Vec<usize> = Vec::new();
    let certain = (reach - lengths.pair).min(tile.lattice().units(FIRST_SEARCH_M)).pow(2);
    for number in (0..representatives.len()).filter(|&number| needed[number]) {
        let place = representatives[number].place;
        grid.nearest(&mut finder, place, NEIGHBOURS, certain, &mut found);
        if found.len() == NEIGHBOURS {
            values[number] = of_neighbours(grid, &found, place);
        } else {
            open.push(number);
        }
    }
    let mut reach = reach;
    while !open.is_empty() {
        reach *= 2;
        let around = Surroundings::load(tile, edge, reach)?;
        let grid = FineGrid::new(&around, 0)?;
        let certain = if around.points.whole { i64::MAX } else { (reach - lengths.pair).pow(2) };
        open.retain(|&number| {
            let place = representatives[number].place;
            let found = grid.nearest_of_all(place, NEIGHBOURS, certain);
            let enough = found.len() == NEIGHBOURS || around.points.whole;
            if enough {
                values[number] = of_neighbours(&grid, &found, place);
            }
            !enough
        });
    }
    Ok(values)
}

fn of_neighbours(grid: &FineGrid, found: &[Neighbour], place: [i64; 3]) -> i64 {
    let places: Vec<[i64; 3]> = found.iter().map(|neighbour| grid.relative(neighbour.2, place)).collect();
    curvature(&places)
}

/// What a tile keeps.
pub(super) fn load(drive: &dyn DriveSource, tile: u32) -> Result<BordersPayload> {
    codec::decode(&drive.payload(STAGE_BORDERS, tile)?)
}

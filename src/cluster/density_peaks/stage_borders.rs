//! Stage `borders`, on the points where clusters meet. It computes the curvatures of the pairs of
//! representatives of two clusters, the labelled point nearest to each component of halo voxels, and the
//! labels of the tile's own points. It does not merge clusters: the reduction applies the thresholds to the
//! sums.
#![expect(
    clippy::cast_possible_truncation,
    reason = "points of a tile fit u32; radii are validated settings of a few metres; a threshold of at most 1 in steps of 2^-40"
)]

use std::collections::BTreeMap;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::curvature::{ONE, curvature};
use super::labelled_points::{LabelledPoints, Neighbour, REPRESENTATIVE_M, Search};
use super::settings::{DensityPeaksConfig, STAGE_BORDERS};
use super::stage_voxels::number;
use super::surroundings::Surroundings;
use crate::cluster::columns::Border;
use crate::cluster::further::{Asking, Further};
use crate::cluster::{DriveWindow, Labelled, Mapped, TileWindow};
use crate::codec;
use crate::error::Result;
use crate::model::TileId;
use crate::spatial::Cell;

/// Number of points of a curvature (chosen; the paper gives no number).
const NEIGHBOURS: usize = 20;
/// Radius around representatives within which neighbours are searched first, in metres. It grows if there are
/// too few neighbours.
const FIRST_SEARCH_M: f64 = 1.5;

/// A component of halo voxels, as seen by a tile.
#[derive(Debug, Default, Clone, Serialize, Deserialize)]
pub(super) struct Halo {
    /// Number of its voxels that the tile owns.
    pub(super) voxels: u64,
    /// The labelled point nearest to any point of the tile.
    pub(super) nearest: Option<Nearest>,
}

/// A labelled point near a component: squared distance, lattice coordinates and cluster. The smallest value
/// is the nearest point, and of equally near ones the first in the order of places. Points in one place have
/// one cluster.
pub(super) type Nearest = (u64, [i64; 3], u32);

/// The pairs of representatives of two clusters. Every pair is counted at both of its points, each by the
/// tile that owns the point.
#[derive(Debug, Default, Clone, Copy, Serialize, Deserialize)]
pub(super) struct PairSum {
    /// Number of ends of pairs: twice the number of pairs, over the whole drive.
    pub(super) sides: u64,
    /// Sum of the curvatures at these ends, in steps of 2^-40.
    pub(super) curvature: i128,
}

/// Whether the mean curvature over the ends of all pairs is below the threshold, in exact integers.
pub(super) fn merges(sum: &PairSum, threshold: f64) -> bool {
    let limit = (threshold * ONE as f64).round() as i128;
    sum.curvature < i128::from(sum.sides) * limit
}

/// The payload of a tile.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct BordersPayload {
    /// Cluster of label 1, 2, ... The components in `halos` have the labels after these.
    pub(super) clusters: Vec<u32>,
    pub(super) halos: Vec<Halo>,
    pub(super) border: Border,
    /// Clusters with pairs, the smaller first, ascending.
    pub(super) pairs: Vec<(u32, u32, PairSum)>,
}

/// Lengths in lattice units.
struct Lengths {
    /// Edge of a voxel.
    edge: u32,
    pair: i64,
    reassign: i64,
    /// Distance around the tile up to which points have been read.
    reach: i64,
}

/// Distance around a tile up to which points are normally read, in metres. It covers the neighbours of
/// representatives, their partners with all points of the partners' cells, and the points that halo voxels
/// may join.
pub(super) fn reach_m(config: &DensityPeaksConfig) -> f64 {
    let partners = config.pair_gap_m + 2.0 * REPRESENTATIVE_M;
    FIRST_SEARCH_M.max(partners).max(config.reassign).max(3.0 * config.voxel) + 0.01
}

/// The payload of a tile, and the labels of its points.
pub(super) fn map(tile: &dyn TileWindow, config: &DensityPeaksConfig, edge: u32) -> Result<Mapped> {
    let lattice = tile.lattice();
    let lengths = Lengths {
        edge,
        pair: lattice.units(config.pair_gap_m),
        reassign: lattice.units(config.reassign),
        reach: lattice.units(reach_m(config)),
    };
    let around = Surroundings::load(tile, edge, lengths.reach)?;
    let labelled = LabelledPoints::new(&around, edge);
    let mut payload =
        BordersPayload { pairs: pair_sums(tile, &lengths, &around, &labelled)?, ..BordersPayload::default() };

    let is_halo = |voxel: usize| around.cluster[voxel] == 0;
    let component = halos(&around, is_halo, &mut payload);
    nearest_labelled(&around, &labelled, &lengths, &component, &mut payload.halos);

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
    let labelled = Labelled { points: around.points, labels, count, with_halo: false };
    Ok(Mapped { payload, labelled: Some(labelled), ..Mapped::default() })
}

/// The component of each halo voxel. Every halo voxel that the tile owns or has a point in has one.
fn halos(around: &Surroundings, is_halo: impl Fn(usize) -> bool, payload: &mut BordersPayload) -> Vec<u32> {
    let count = around.voxels.len();
    // The tile that owns a voxel and the tiles that own its points must agree on its component.
    let mut own = vec![false; count];
    let mut foreign = vec![true; count];
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

/// For each component of halo voxels, the labelled point nearest to its points in the core. A point is
/// compared only with points within the smallest distance so far.
fn nearest_labelled(
    around: &Surroundings,
    labelled: &LabelledPoints<'_>,
    lengths: &Lengths,
    component: &[u32],
    halos: &mut [Halo],
) {
    let steps = (lengths.reassign / i64::from(lengths.edge) + 1) as i32;
    let within = around.near(steps, |cluster| cluster == 0, |_, other| other != 0);
    let mut search = labelled.search(lengths.reassign);
    let cloud = &around.points.cloud;
    for (point, &voxel) in around.voxel.iter().enumerate() {
        let voxel = voxel as usize;
        if !around.points.core[point] || !within[voxel] {
            continue;
        }
        let halo = &mut halos[component[voxel] as usize];
        let limit = halo.nearest.map_or(lengths.reassign.unsigned_abs().pow(2), |nearest| nearest.0);
        let place = [cloud.x[point], cloud.y[point], cloud.z[point]];
        if let Some(&(distance, other)) = search.nearest(place, 1, limit).first() {
            let candidate = (distance, labelled.lattice_point(other), labelled.cluster(other));
            halo.nearest = Some(halo.nearest.map_or(candidate, |nearest| nearest.min(candidate)));
        }
    }
}

/// A representative with partners: its place, its cluster, and the number of its partners in each other
/// cluster.
struct Meeting {
    place: [i32; 3],
    cluster: u32,
    partners: Vec<(u32, u64)>,
}

/// A representative whose nearest labelled points may lie outside the cells that were read.
struct Open {
    meeting: Meeting,
    cell: Cell,
    /// The nearest points so far, nearest first: squared distance, and place relative to the representative.
    found: Vec<(u64, [i64; 3])>,
}

impl Open {
    /// Adds the nearest of the points in `labelled`. `place` is the place of the representative in their
    /// local coordinates.
    fn look(&mut self, labelled: &LabelledPoints<'_>, place: [i32; 3]) {
        let limit = self.found.get(NEIGHBOURS - 1).map_or(u64::MAX, |farthest| farthest.0);
        let nearest = labelled.nearest_of_all(place, NEIGHBOURS, limit);
        let found = |&(distance, point): &Neighbour| (distance, labelled.relative(point, place));
        self.found.extend(nearest.iter().map(found));
        self.found.sort_unstable();
        self.found.truncate(NEIGHBOURS);
    }
}

impl Asking for Open {
    fn cell(&self) -> Cell {
        self.cell
    }

    /// One unit more than the distance of the farthest point, because an equally far point that is not read
    /// yet may come first in the order of places.
    fn needed(&self) -> i64 {
        let farthest = self.found.get(NEIGHBOURS - 1);
        farthest.map_or(i64::MAX, |farthest| farthest.0.isqrt().cast_signed() + 2)
    }
}

/// The sums over the pairs of representatives of different clusters, counted at the points of the core.
///
/// All representatives of a voxel belong to one cluster, so whole voxels are compared. Voxels without another
/// cluster nearby are skipped. For the others, one loop counts the partners among all places of a voxel.
fn pair_sums(
    tile: &dyn TileWindow,
    lengths: &Lengths,
    around: &Surroundings,
    labelled: &LabelledPoints<'_>,
) -> Result<Vec<(u32, u32, PairSum)>> {
    let edge = i64::from(lengths.edge);
    // Points of voxels that are n indices apart are more than n - 1 edges apart.
    let steps = ((lengths.pair - 1) / edge + 1) as i32;
    // Cells of representatives may cross borders of voxels. Then the neighbouring voxels are needed as well.
    let cell = tile.lattice().units(REPRESENTATIVE_M);
    let beside = if edge % cell == 0 { 0 } else { (cell / edge + 1) as i32 };
    let other = |cluster: u32, other: u32| other != 0 && other != cluster;
    let border = around.near(steps + beside, |cluster| cluster != 0, other);
    let representatives = labelled.representatives(&border);

    let mut curvatures = Curvatures::new(tile, lengths, labelled);
    let limit = lengths.pair.unsigned_abs().pow(2);
    let voxels = &around.voxels;
    let heights = voxels.heights();
    let mut finder = voxels.finder();
    let mut others: Vec<usize> = Vec::new();
    for (column, &[i, j]) in voxels.cells().iter().enumerate() {
        let cores = |voxel: usize| representatives.places.of(voxel).filter(|&a| representatives.core[a]);
        if voxels.voxels(column).all(|voxel| cores(voxel).next().is_none()) {
            continue;
        }
        let columns: Vec<Range<usize>> = (-steps..=steps)
            .flat_map(|di| (-steps..=steps).map(move |dj| [i + di, j + dj]))
            .map(|cell| finder.column(cell))
            .filter(|range| !range.is_empty())
            .collect();
        for voxel in voxels.voxels(column) {
            let cluster = around.cluster[voxel];
            let k = heights[voxel];
            if cores(voxel).next().is_none() {
                continue;
            }
            others.clear();
            for range in &columns {
                let start =
                    range.start + heights[range.clone()].partition_point(|&height| height < k - steps);
                let near = (start..range.end).take_while(|&near| heights[near] <= k + steps);
                others.extend(near.filter(|&near| other(cluster, around.cluster[near])));
            }
            for a in cores(voxel) {
                let place = representatives.places.get(a);
                let mut partners: Vec<(u32, u64)> = Vec::new();
                for &near in &others {
                    let count = representatives.nearer(near, place, limit);
                    let cluster = around.cluster[near];
                    match partners.iter_mut().find(|partner| partner.0 == cluster) {
                        Some(partner) => partner.1 += count,
                        None if count > 0 => partners.push((cluster, count)),
                        None => {}
                    }
                }
                if !partners.is_empty() {
                    curvatures.add(Meeting { place, cluster, partners });
                }
            }
        }
    }
    curvatures.finish()
}

/// The sums of curvatures, and the search for neighbours.
struct Curvatures<'a> {
    tile: &'a dyn TileWindow,
    lengths: &'a Lengths,
    labelled: &'a LabelledPoints<'a>,
    search: Search<'a>,
    /// Squared distance around a point of the core up to which every point has been read.
    certain: u64,
    sums: BTreeMap<(u32, u32), PairSum>,
    /// Representatives whose neighbours may lie outside the cells that were read.
    open: Vec<Meeting>,
}

impl<'a> Curvatures<'a> {
    fn new(tile: &'a dyn TileWindow, lengths: &'a Lengths, labelled: &'a LabelledPoints<'a>) -> Self {
        let first = lengths.reach.min(tile.lattice().units(FIRST_SEARCH_M));
        Self {
            tile,
            lengths,
            labelled,
            search: labelled.search(first),
            certain: first.unsigned_abs().pow(2),
            sums: BTreeMap::new(),
            open: Vec::new(),
        }
    }

    /// Adds the contribution of a representative.
    fn add(&mut self, meeting: Meeting) {
        let found = self.search.nearest(meeting.place, NEIGHBOURS, self.certain);
        if found.len() == NEIGHBOURS {
            let curvature = of_neighbours(self.labelled, found, meeting.place);
            self.sum(&meeting, curvature);
        } else {
            self.open.push(meeting);
        }
    }

    fn sum(&mut self, meeting: &Meeting, curvature: i64) {
        for &(cluster, count) in &meeting.partners {
            let key = (cluster.min(meeting.cluster), cluster.max(meeting.cluster));
            let sum = self.sums.entry(key).or_default();
            sum.sides += count;
            sum.curvature += i128::from(curvature) * i128::from(count);
        }
    }

    /// The sums. Representatives whose nearest points may lie outside the cells that were read ask for more.
    fn finish(mut self) -> Result<Vec<(u32, u32, PairSum)>> {
        let tile = self.tile;
        let edge = self.lengths.edge;
        let origin = self.labelled.origin();
        let open: Vec<Open> = std::mem::take(&mut self.open)
            .into_iter()
            .map(|meeting| {
                let at = |axis: usize| origin[axis] + i64::from(meeting.place[axis]);
                // All points that were read lie in occupied cells.
                let cell = tile.grid().cell(at(0), at(1)).unwrap_or_default();
                let place = meeting.place;
                let found = Vec::new();
                let mut open = Open { meeting, cell, found };
                open.look(self.labelled, place);
                open
            })
            .collect();
        let cells = tile.cells(self.lengths.reach);
        let mut certain = Vec::new();
        Further::new(tile, &cells, self.lengths.reach).answer(
            open,
            &mut |points, cells, asking| {
                let around = Surroundings::of_cells(tile, edge, points, cells)?;
                let labelled = LabelledPoints::new(&around, edge);
                let shift = [0, 1, 2].map(|axis| origin[axis] - labelled.origin()[axis]);
                for open in asking {
                    let place = [0, 1, 2].map(|axis| i64::from(open.meeting.place[axis]) + shift[axis]);
                    // Points beyond the range of local coordinates are not near.
                    let limits = (i64::from(i32::MIN), i64::from(i32::MAX));
                    open.look(&labelled, place.map(|value| value.clamp(limits.0, limits.1) as i32));
                }
                Ok(())
            },
            &mut |open| certain.push(open),
        )?;
        for Open { meeting, found, .. } in certain {
            let places: Vec<[i64; 3]> = found.iter().map(|found| found.1).collect();
            self.sum(&meeting, curvature(&places));
        }
        Ok(self.sums.into_iter().map(|((one, other), sum)| (one, other, sum)).collect())
    }
}

fn of_neighbours(labelled: &LabelledPoints<'_>, found: &[Neighbour], place: [i32; 3]) -> i64 {
    let places: Vec<[i64; 3]> = found.iter().map(|neighbour| labelled.relative(neighbour.1, place)).collect();
    curvature(&places)
}

/// The payload of a tile, decoded.
pub(super) fn load(drive: &dyn DriveWindow, tile: TileId) -> Result<BordersPayload> {
    codec::decode(&drive.payload(STAGE_BORDERS, tile)?)
}

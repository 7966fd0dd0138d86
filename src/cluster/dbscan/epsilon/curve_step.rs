//! The step `epsilon`: sums of the distances of points to their 2nd to K-th nearest neighbours, tile by tile.
//! Its reduction is the curve from which epsilon is estimated. If no epsilon follows from K neighbours,
//! another round uses more neighbours.
//!
//! The mean is exact. A tile reads its core and a halo. If the K-th neighbour of a point may lie outside this
//! region, the point asks for more ([`Further`]). Sums are integers, so neither tiles nor threads change the
//! result.

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_64_with_seed;

use super::found::{AskingCost, Cost, DriveEpsilon, HALO_M};
use super::{Attempt, CurveSums, EpsilonConfig, LARGEST_K, estimate};
use crate::cluster::further::{Asking, Further};
use crate::cluster::method::{BytesPer, DriveWindow, Mapped, Reduced, Repeat, Step, TileWindow};
use crate::codec;
use crate::error::Result;
use crate::model::{FieldSpace, TileId};
use crate::spatial::{Cell, LookedAt, Neighbours, Points};

/// Maximum number of rounds. Each round uses at least one neighbour more than the round before, and
/// [`LARGEST_K`] is the maximum.
const MOST_ROUNDS: u32 = 200;
const _: () = assert!(MOST_ROUNDS as usize == LARGEST_K);
/// Name of the step.
pub(crate) const STEP: &str = "epsilon";
/// Largest number of points that wait before their regions are read.
const ASKING_AT_ONCE: usize = 16_384;

/// Raised when the curve changes and no setting does. Since 2, places are sampled instead of ids.
pub(crate) const EPOCH: u32 = 2;

/// Selects the points whose neighbours are searched: a share of all places, by a hash of their lattice
/// coordinates. So the selection depends neither on the order of records nor on their files. Points in one
/// place are selected together, because only their order distinguishes them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Sample {
    seed: u64,
    below: u64,
}

impl Sample {
    /// Selects about `most` of `population` points, or all points if `most` is 0.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share of 2^64, saturating"
    )]
    pub(crate) fn new(seed: u64, most: u64, population: u64) -> Self {
        let all = most == 0 || most >= population;
        let share = most as f64 / population.max(1) as f64;
        Self { seed, below: if all { u64::MAX } else { (share * 64_f64.exp2()) as u64 } }
    }

    /// Whether the points in this place are selected. The place is in lattice coordinates, which are the same
    /// in every tile.
    fn takes(&self, place: [i64; 3]) -> bool {
        let hash = || xxh3_64_with_seed(place.map(i64::to_le_bytes).as_flattened(), self.seed);
        self.below == u64::MAX || hash() < self.below
    }
}

/// The payload of a tile.
#[derive(Debug, Serialize, Deserialize)]
struct Payload {
    sums: CurveSums,
    cost: AskingCost,
}

/// The step with its parameters.
#[derive(Debug)]
pub(crate) struct CurveStep {
    space: FieldSpace,
    sample: Sample,
    /// Number of neighbours in the first round.
    first: usize,
    /// Number of neighbours per point in this round, the point itself included. At most the number of points.
    k: usize,
    /// Number of points that may be neighbours.
    population: u64,
    /// Upper limit of all distances in the space.
    diagonal: f64,
    /// Halo of a tile before any point asks for more, in lattice units.
    halo: i64,
}

/// A point that asks for more.
struct Lonely {
    place: Vec<f64>,
    cell: Cell,
    /// Bits of its smallest squared distances so far, ascending.
    found: Vec<u64>,
    /// Radius in lattice units within which every point must be known, so that these neighbours are the
    /// nearest.
    needed: i64,
}

impl Lonely {
    fn add(&mut self, more: Vec<u64>, k: usize) {
        self.found.extend(more);
        self.found.sort_unstable();
        self.found.truncate(k);
    }
}

impl Asking for Lonely {
    fn cell(&self) -> Cell {
        self.cell
    }

    fn needed(&self) -> i64 {
        self.needed
    }
}

impl CurveStep {
    /// The description of the step for the engine. Its memory is estimated: a point of objects takes 29 bytes
    /// in the cloud and 8 per field for its coordinates. The construction of the tree takes 8 more per field,
    /// and 8. Points that are read for queries across borders are added.
    pub(crate) fn step(fields: usize) -> Step {
        Step {
            name: STEP,
            settings: &["dbscan.fields", "dbscan.weights", "epsilon.*"],
            bytes: BytesPer::ObjectPoint(60 + 20 * fields as u64),
            repeat: Repeat::UntilSettled { most: MOST_ROUNDS },
        }
    }

    /// The step of this round.
    pub(crate) fn new(settings: &EpsilonConfig, space: FieldSpace, drive: &dyn DriveWindow) -> Result<Self> {
        let first = usize::try_from(settings.k).unwrap_or(usize::MAX);
        let k = if drive.again().is_empty() { first } else { codec::decode(drive.again())? };
        let population = drive.objects();
        let most = usize::try_from(population).unwrap_or(usize::MAX);
        Ok(Self {
            sample: Sample::new(settings.seed, settings.max_queries, population),
            first,
            k: k.min(most).max(1),
            population,
            diagonal: space.diagonal(drive.extent()),
            halo: drive.lattice().units(HALO_M),
            space,
        })
    }

    /// Radius in lattice units within which every point must be known, so that these neighbours are the
    /// nearest.
    fn needed(&self, found: &[u64]) -> i64 {
        match found.get(self.k - 1) {
            Some(&squared) => self.space.horizontal(f64::from_bits(squared).sqrt()),
            None => i64::MAX,
        }
    }

    fn sums(&self) -> CurveSums {
        CurveSums::new(self.k, self.diagonal * self.space.unit)
    }

    fn add(&self, sums: &mut CurveSums, found: &[u64]) {
        sums.add(found[1..].iter().map(|&squared| f64::from_bits(squared).sqrt() * self.space.unit));
    }

    /// The sums of a tile.
    pub(crate) fn map(&self, tile: &dyn TileWindow) -> Result<Mapped> {
        let gathered = tile.points(self.halo, true)?;
        let cells = tile.cells(self.halo);
        let further = Further::new(tile, &cells, self.halo);
        let cloud = &gathered.cloud;
        let core = &gathered.core;
        let points = Points::new(self.space.axes.len(), self.space.places(cloud))?;
        let neighbours = Neighbours::new(&points)?;
        let mut payload = Payload { sums: self.sums(), cost: AskingCost::default() };
        payload.cost.gathered = cloud.len() as u64;
        let mut looked_at: LookedAt<'_> = further.looked_at();
        let mut asking = Vec::new();
        let mut failure = None;
        let wanted = |point: usize| core[point] && self.sample.takes(cloud.lattice_point(point));
        neighbours.each_nearest(&neighbours.leaves(), self.k, &wanted, &mut |point, found| {
            let needed = self.needed(found);
            let [x, y, _] = cloud.lattice_point(point);
            // All gathered points lie in occupied cells.
            let cell = tile.grid().cell(x, y).unwrap_or_default();
            if needed <= self.halo || looked_at.is_clear(cell, needed) {
                return self.add(&mut payload.sums, found);
            }
            asking.push(Lonely { place: points.row(point).to_vec(), cell, found: found.to_vec(), needed });
            if asking.len() >= ASKING_AT_ONCE && failure.is_none() {
                failure = self.answer(std::mem::take(&mut asking), &further, &mut payload).err();
            }
        });
        match failure {
            Some(error) => return Err(error),
            None => self.answer(asking, &further, &mut payload)?,
        }
        codec::encode(&payload).map(Mapped::payload)
    }

    /// Reads the surroundings of the points that asked for more, until their neighbours are certain.
    fn answer(&self, asking: Vec<Lonely>, further: &Further<'_>, payload: &mut Payload) -> Result<()> {
        let Payload { sums, cost } = payload;
        cost.asked += asking.len() as u64;
        further.answer(
            asking,
            &mut |points, _, asking| {
                cost.read += points.cloud.len() as u64;
                let places = Points::new(self.space.axes.len(), self.space.places(&points.cloud))?;
                let neighbours = Neighbours::new(&places)?;
                for point in asking {
                    let limit =
                        point.found.get(self.k - 1).map_or(f64::INFINITY, |&bits| f64::from_bits(bits));
                    point.add(neighbours.nearest(&point.place, self.k, limit), self.k);
                    point.needed = self.needed(&point.found);
                }
                Ok(())
            },
            &mut |point| self.add(sums, &point.found),
        )
    }

    /// The estimate, or the number of neighbours of the next round.
    pub(crate) fn reduce(&self, step: usize, drive: &dyn DriveWindow) -> Result<Reduced> {
        let mut sums = self.sums();
        let mut cost = AskingCost::default();
        for tile in TileId::first(drive.tiles()) {
            let part: Payload = codec::decode(&drive.payload(step, tile)?)?;
            sums.merge(&part.sums);
            cost.asked += part.cost.asked;
            cost.read += part.cost.read;
            cost.gathered += part.cost.gathered;
        }
        let curve = sums.curve(self.population);
        let cost = Cost::of(cost, &curve);
        match estimate(curve, self.first, self.population)? {
            Attempt::Found(estimate) => {
                DriveEpsilon::new(*estimate, self.space.clone(), cost).encode().map(Reduced::Global)
            }
            // Goes to the largest K at once instead of one round per K. A longer curve contains every shorter
            // one.
            Attempt::Longer(longer) => codec::encode(&longer).map(Reduced::Again),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_is_about_as_large_as_asked_and_depends_on_places_and_the_seed_alone() {
        // Neighbours differ by one unit, and the street is far from the origin.
        let places: Vec<[i64; 3]> = (0..100_000)
            .map(|point| [651_000_120 + point % 400, point / 400 - 5_423_000_990, point % 7])
            .collect();
        let count = |sample: Sample| places.iter().filter(|place| sample.takes(**place)).count();
        assert_eq!(count(Sample::new(1, 0, 100_000)), 100_000);
        assert_eq!(count(Sample::new(1, 100_000, 100_000)), 100_000);
        let one = Sample::new(1, 5_000, 100_000);
        let two = Sample::new(2, 5_000, 100_000);
        assert!((4_700..5_300).contains(&count(one)) && (4_700..5_300).contains(&count(two)));
        assert!(places.iter().any(|place| one.takes(*place) != two.takes(*place)));
        // Every axis counts.
        for axis in 0..3 {
            let moved = |place: &[i64; 3]| {
                let mut moved = *place;
                moved[axis] += 1;
                moved
            };
            assert!(places.iter().any(|place| one.takes(*place) != one.takes(moved(place))), "{axis}");
        }
    }
}

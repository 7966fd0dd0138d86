//! Pass `epsilon`: sums of the distances of points to their 2nd to K-th nearest neighbours, tile by tile; and its
//! reduction, the curve that epsilon is estimated from.
//!
//! The mean is exact. A tile reads its core and a halo. A point whose K-th neighbour is further away than everything
//! around the point is known *asks for more*: the cells within that distance (at first no further than twice the halo,
//! then four times, ...) are read and searched in pieces, for these points alone, until the K-th neighbour is nearer than
//! any cell that has not been read. Sums are integers, so neither tiles nor threads change the result.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_64_with_seed;

use crate::cluster::dbscan::epsilon::{Curve, CurveSums};
use crate::codec;
use crate::error::Result;
use crate::model::FieldSpace;
use crate::run::engine::Pass;
use crate::run::held::Held;
use crate::run::tiles::Tiles;
use crate::spatial::Cell;
use crate::spatial::{Neighbours, Points};
use crate::store::PassDir;
use crate::tiling::Wanted;

/// Bytes per point of objects that a tile of this pass needs at its peak with so many fields: 29 of the cloud, 8 per field of its
/// places, 8 per field and 8 while the tree is built, and what is read for points that ask for more; estimated from these
/// sizes.
pub(crate) fn bytes_per_point(fields: usize) -> u64 {
    60 + 20 * fields as u64
}

/// Halo of this pass in metres: most points of a street have their 40 nearest neighbours within it (chosen; the share
/// that asks for more is reported).
pub(crate) const HALO_M: f64 = 2.0;
/// Points that wait until what they ask for is read.
const ASKING_AT_ONCE: usize = 16_384;
/// Points of one piece of what is read for them.
const PIECE_POINTS: u64 = 1_000_000;

/// Which points are asked for their neighbours: a share of them, by a hash of their id.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Sample {
    seed: u64,
    below: u64,
}

impl Sample {
    /// About `most` of `population` points, all of them for 0.
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

    fn takes(&self, id: u64) -> bool {
        self.below == u64::MAX || xxh3_64_with_seed(&id.to_le_bytes(), self.seed) < self.below
    }
}

/// What exactness at the borders of tiles cost.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct AskingCost {
    /// Points that asked for more than core and halo.
    pub(crate) asked: u64,
    /// Points that were read for them.
    pub(crate) read: u64,
    /// Points that were read in the first place.
    pub(crate) gathered: u64,
}

/// What a tile leaves behind.
#[derive(Debug, Serialize, Deserialize)]
struct Payload {
    sums: CurveSums,
    cost: AskingCost,
}

pub(crate) struct CurvePass<'a> {
    pub(crate) tiles: &'a Tiles<'a>,
    pub(crate) space: &'a FieldSpace,
    pub(crate) sample: Sample,
    /// Neighbours per point, itself included; not more than there are points.
    pub(crate) k: usize,
    /// Points that may be neighbours.
    pub(crate) population: u64,
    /// No distance in the space is larger.
    pub(crate) diagonal: f64,
}

/// A point that asks for more.
struct Asking {
    place: Vec<f64>,
    cell: Cell,
    /// Bits of its smallest squared distances so far, ascending.
    found: Vec<u64>,
}

impl Asking {
    fn add(&mut self, more: Vec<u64>, k: usize) {
        self.found.extend(more);
        self.found.sort_unstable();
        self.found.truncate(k);
    }
}

impl CurvePass<'_> {
    fn halo(&self) -> i64 {
        self.tiles.drive.lattice().units(HALO_M)
    }

    /// Lattice units within which everything has to be known, so that these are the nearest neighbours.
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

    fn tile(&self, unit: usize) -> Result<Payload> {
        let (plan, drive) = (self.tiles.plan, self.tiles.drive);
        let region = plan.region(unit, self.halo());
        let gathered = self.tiles.gather_region(&region, Wanted::Objects)?;
        let (cloud, core) = (&gathered.cloud, &gathered.core);
        let points = Points::new(self.space.axes.len(), self.space.places(cloud))?;
        let neighbours = Neighbours::new(&points)?;
        let mut payload = Payload { sums: self.sums(), cost: AskingCost::default() };
        payload.cost.gathered = cloud.len() as u64;
        let mut held = Held::of(plan, &region);
        let (mut asking, mut failure) = (Vec::new(), None);
        let wanted = |point: usize| core[point] && self.sample.takes(cloud.id[point]);
        neighbours.each_nearest(&neighbours.leaves(), self.k, &wanted, &mut |point, found| {
            let needed = self.needed(found);
            let [x, y, _] = cloud.lattice_point(point);
            // Gathered points lie in cells.
            let cell = drive.grid.cell(x, y).unwrap_or_default();
            if needed <= self.halo() || held.is_clear(cell, needed) {
                return self.add(&mut payload.sums, found);
            }
            asking.push(Asking { place: points.row(point).to_vec(), cell, found: found.to_vec() });
            if asking.len() >= ASKING_AT_ONCE && failure.is_none() {
                let around = Held::of(plan, &region);
                failure = self.answer(std::mem::take(&mut asking), around, &mut payload).err();
            }
        });
        match failure {
            Some(error) => return Err(error),
            None => self.answer(asking, Held::of(plan, &region), &mut payload)?,
        }
        Ok(payload)
    }

    /// Reads around the points what they ask for, until their neighbours are certain.
    fn answer(&self, mut asking: Vec<Asking>, mut held: Held<'_>, payload: &mut Payload) -> Result<()> {
        payload.cost.asked += asking.len() as u64;
        let mut reach = self.halo();
        while !asking.is_empty() {
            reach = reach.saturating_mul(2);
            let mut around = BTreeMap::new();
            for point in &asking {
                let distance = around.entry(point.cell).or_insert(0);
                *distance = reach.min(self.needed(&point.found)).max(*distance);
            }
            let cells = held.missing_within(&around);
            for piece in held.pieces(&cells, PIECE_POINTS) {
                let region = self.tiles.plan.region_of(piece);
                let cloud = self.tiles.gather_region(&region, Wanted::Objects)?.cloud;
                payload.cost.read += cloud.len() as u64;
                let neighbours =
                    Neighbours::new(&Points::new(self.space.axes.len(), self.space.places(&cloud))?)?;
                for point in &mut asking {
                    let limit =
                        point.found.get(self.k - 1).map_or(f64::INFINITY, |&bits| f64::from_bits(bits));
                    point.add(neighbours.nearest(&point.place, self.k, limit), self.k);
                }
            }
            held.add(&cells);
            asking.retain(|point| {
                let certain = held.is_clear(point.cell, self.needed(&point.found));
                if certain {
                    self.add(&mut payload.sums, &point.found);
                }
                !certain
            });
        }
        Ok(())
    }

    /// The curve and what it cost, from the finished pass.
    pub(crate) fn reduce(&self, dir: &PassDir) -> Result<(Curve, AskingCost)> {
        let (mut sums, mut cost) = (self.sums(), AskingCost::default());
        for unit in 0..self.units() {
            let part: Payload = codec::decode(&dir.payload(unit)?)?;
            sums.merge(&part.sums);
            cost.asked += part.cost.asked;
            cost.read += part.cost.read;
            cost.gathered += part.cost.gathered;
        }
        Ok((sums.curve(self.population), cost))
    }
}

impl Pass for CurvePass<'_> {
    fn name(&self) -> &'static str {
        "epsilon"
    }

    fn units(&self) -> usize {
        self.tiles.plan.tiles.len()
    }

    fn points(&self, unit: usize) -> u64 {
        self.tiles.plan.tiles[unit].points
    }

    fn bytes(&self, unit: usize) -> u64 {
        self.tiles.object_points(unit, self.halo()) * bytes_per_point(self.space.axes.len())
    }

    fn prefetch(&self, unit: usize) {
        self.tiles.prefetch(unit, self.halo());
    }

    fn run(&self, unit: usize) -> Result<Vec<u8>> {
        codec::encode(&self.tile(unit)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_is_about_as_large_as_asked_and_depends_on_the_seed_alone() {
        let count = |sample: Sample| (0..100_000).filter(|&id| sample.takes(id)).count();
        assert_eq!(count(Sample::new(1, 0, 100_000)), 100_000);
        assert_eq!(count(Sample::new(1, 100_000, 100_000)), 100_000);
        let (one, two) = (Sample::new(1, 5_000, 100_000), Sample::new(2, 5_000, 100_000));
        assert!((4_700..5_300).contains(&count(one)) && (4_700..5_300).contains(&count(two)));
        assert!((0..100_000).any(|id| one.takes(id) != two.takes(id)));
    }
}

//! Which points the report shows: one point per voxel, and as many voxels of every object as fit the budget.
//!
//! The hash of the index of a voxel decides whether the voxel is kept, so the choice does not depend on
//! tiles, threads or the order of the records. In a kept voxel, the point nearest to its centre is shown. The
//! first point of every object is always kept, beside the points of the voxels. Units of the drive collect
//! candidates with bounded memory, and [`Choice`] takes the best of all units.

use bytemuck::{Pod, Zeroable};

use crate::model::{Lattice, ObjectPart, PointClass, splitmix64};

/// Key of ground points.
pub(crate) const GROUND: u32 = 0;
/// Key of points without an object. Object k has key k + 1.
pub(crate) const LOOSE: u32 = 1;
/// Steps of shown coordinates per metre: a step is a centimetre, which is less than a pixel.
pub(crate) const STEPS_PER_M: f64 = 100.0;

/// Shares of the budget for ground points and for points without an object, if there are more points than the
/// budget. Chosen, because a street is recognised with few ground points, and readers look at objects.
const GROUND_SHARE: f64 = 0.25;
const LOOSE_SHARE: f64 = 0.05;
/// Planned points per shown point. The surface of an object is estimated from its box and can be smaller.
const SURPLUS: f64 = 2.0;
/// Number of points that each object gets before the rest is distributed by surface. Chosen: enough to see a
/// pole.
const LEAST_OF_OBJECT: f64 = 24.0;
/// [`Rule::thinning`] if every point is planned: a quarter, so that such points are shown before all others.
const FIRST: u64 = 1 << 14;
/// Smallest and largest number of candidates that one unit keeps. In a long drive, every unit shows few
/// points; in a short one, with few units, a unit may show a quarter of its points.
const UNIT_CANDIDATES: (usize, usize) = (1 << 17, 1 << 18);
/// Number of slots for the most recent voxels, a power of two. Neighbouring records are mostly in the same
/// voxels.
const SLOTS: usize = 1 << 14;

/// A shown point, as it is stored. Points are ordered as they are chosen: by rank, then by object, then by
/// content.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct SamplePoint {
    /// Rank of its voxel; 0 for the first point of an object. The smaller, the earlier it is shown.
    pub(crate) rank: u32,
    /// [`GROUND`], [`LOOSE`], or the number of the object plus one.
    pub(crate) key: u32,
    /// Squared distance from the centre of the voxel, where 20,000 is the square of half of its edge.
    pub(crate) apart: u16,
    /// Intensity.
    pub(crate) intensity: u16,
    /// Coordinates from the origin, in steps of [`STEPS_PER_M`].
    pub(crate) place: [i32; 3],
}

impl SamplePoint {
    const NONE: Self = Self { rank: u32::MAX, key: u32::MAX, apart: u16::MAX, intensity: 0, place: [0; 3] };

    /// Rank and key identify a voxel: the rank comes from 32 bits of a hash of the voxel, the key is the
    /// object.
    fn voxel(&self) -> (u32, u32) {
        (self.rank, self.key)
    }
}

/// The size and the share of the voxels of one object, of the ground, or of the points without an object.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Rule {
    /// Binary logarithm of the edge of a voxel in lattice units.
    shift: u8,
    /// Voxels per planned point in steps of 2^-16. Below 1 if every point is planned: such points are shown
    /// first.
    thinning: u64,
}

impl Rule {
    /// The rule that keeps about `quota` of `points` points on a surface.
    fn of(points: f64, quota: f64, surface_units2: f64) -> Self {
        if quota >= points {
            return Self { shift: 0, thinning: FIRST };
        }
        let edge = (surface_units2 / quota.max(1.0)).sqrt().clamp(1.0, 1e9);
        let mut shift = 0_u8;
        while f64::from(2_u32 << shift) <= edge {
            shift += 1;
        }
        let voxels = (surface_units2 / f64::from(1_u32 << shift).powi(2)).min(points);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "1 to about 4 times 2^16"
        )]
        let thinning = ((voxels / quota.max(1.0)).clamp(1.0, 1e6) * 65_536.0) as u64;
        Self { shift, thinning }
    }
}

/// The known facts of a drive before its points are sampled.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SampledDrive<'a> {
    /// The objects, in ascending order of their ids.
    pub(crate) objects: &'a [ObjectPart],
    /// Ground points.
    pub(crate) ground_points: u64,
    /// Points that are neither ground nor noise.
    pub(crate) object_points: u64,
    /// Number of points of a unit of the pass that samples.
    pub(crate) unit_points: u64,
    /// Occupied area of the drive in square lattice units.
    pub(crate) area_units2: f64,
    /// Smallest lattice coordinates of the drive.
    pub(crate) origin: [i64; 3],
    /// The lattice.
    pub(crate) lattice: Lattice,
}

/// The rules by which the points of a drive are sampled.
#[derive(Debug)]
pub(crate) struct Sampling {
    budget: usize,
    /// By key.
    rules: Vec<Rule>,
    /// Number of the first point of every object, ascending.
    first_points: Vec<u64>,
    origin: [i64; 3],
    steps_per_unit: f64,
    /// Candidates that one unit keeps.
    candidates: usize,
}

impl Sampling {
    /// The rules to show at most `budget` points of a drive.
    pub(crate) fn new(drive: &SampledDrive<'_>, budget: usize) -> Self {
        let in_objects: u64 = drive.objects.iter().map(|object| object.points).sum();
        let loose_points = drive.object_points.saturating_sub(in_objects) as f64;
        let [ground_points, in_objects] = [drive.ground_points, in_objects].map(|points| points as f64);
        let planned = budget as f64 * SURPLUS;
        let loose = loose_points.min((planned * LOOSE_SHARE).max(planned - ground_points - in_objects));
        let ground = ground_points.min((planned * GROUND_SHARE).max(planned - loose - in_objects));
        let quotas = quotas(drive.objects, drive.lattice, (planned - loose - ground).max(0.0));
        let mut rules = vec![
            Rule::of(ground_points, ground, drive.area_units2),
            Rule::of(loose_points, loose, drive.area_units2),
        ];
        let square_m = f64::from(drive.lattice.units_per_m()).powi(2);
        rules.extend(drive.objects.iter().zip(&quotas).map(|(object, &quota)| {
            Rule::of(object.points as f64, quota, surface_m2(object, drive.lattice) * square_m)
        }));
        let units = (drive.ground_points + drive.object_points) / drive.unit_points + 1;
        let (least, most) = UNIT_CANDIDATES;
        let candidates = usize::try_from(2 * budget as u64 / units).unwrap_or(most).clamp(least, most);
        Self {
            candidates,
            budget,
            rules,
            first_points: drive.objects.iter().map(|object| object.first_id.number()).collect(),
            origin: drive.origin,
            steps_per_unit: STEPS_PER_M / f64::from(drive.lattice.units_per_m()),
        }
    }

    /// Bytes that the sampler of one unit needs at most.
    pub(crate) fn unit_bytes(&self) -> u64 {
        ((SLOTS + 4 * self.candidates) * size_of::<SamplePoint>()) as u64
    }

    /// Number of points to be shown at most.
    pub(crate) fn budget(&self) -> usize {
        self.budget
    }

    /// A lattice point in steps from the origin; `None` for a stray point that is too far away (21,000 km).
    fn place(&self, point: [i64; 3]) -> Option<[i32; 3]> {
        let mut place = [0; 3];
        for (axis, place) in place.iter_mut().enumerate() {
            let steps = ((point[axis] - self.origin[axis]) as f64 * self.steps_per_unit).round();
            #[expect(clippy::cast_possible_truncation, reason = "in range, or the point is left out")]
            let whole = steps as i32;
            if (f64::from(whole) - steps).abs() > 0.5 {
                return None;
            }
            *place = whole;
        }
        Some(place)
    }
}

/// Surface of the box of an object in square metres, but at least 0.25, for small things.
fn surface_m2(object: &ObjectPart, lattice: Lattice) -> f64 {
    let [dx, dy, dz] = [0, 1, 2].map(|axis| lattice.metres((object.hi[axis] - object.lo[axis]).max(0)));
    (2.0 * (dx + dy) * dz + dx * dy).max(0.25)
}

/// Planned points of every object: a few for each, and the rest in proportion to a power below 1 of the
/// surface, so that small objects are denser. The sum is at most `planned`, or all points.
fn quotas(objects: &[ObjectPart], lattice: Lattice, planned: f64) -> Vec<f64> {
    let least = LEAST_OF_OBJECT.min(planned / objects.len().max(1) as f64);
    // Roots instead of a power: they are exact, so every machine computes the same.
    let weights: Vec<f64> = objects
        .iter()
        .map(|object| {
            let root = surface_m2(object, lattice).sqrt();
            root * root.sqrt()
        })
        .collect();
    let quota = |factor: f64, at: usize| (least + factor * weights[at]).min(objects[at].points as f64);
    let sum = |factor: f64| (0..objects.len()).map(|at| quota(factor, at)).sum::<f64>();
    // The largest factor whose sum fits, by bisection. Objects with few points leave their share to the
    // others.
    let (mut low, mut high) = (0.0, 1e9);
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if sum(middle) <= planned { low = middle } else { high = middle }
    }
    (0..objects.len()).map(|at| quota(low, at)).collect()
}

/// Collects the candidates of a unit of the drive.
#[derive(Debug)]
pub(crate) struct Sampler<'a> {
    sampling: &'a Sampling,
    recent: Vec<SamplePoint>,
    found: Vec<SamplePoint>,
    /// Ranks from this one on are dropped.
    limit: u64,
}

impl<'a> Sampler<'a> {
    /// A sampler without candidates.
    pub(crate) fn new(sampling: &'a Sampling) -> Self {
        Self {
            sampling,
            recent: vec![SamplePoint::NONE; SLOTS],
            found: Vec::new(),
            limit: u64::from(u32::MAX),
        }
    }

    /// Adds a point by its number in the drive, its place on the lattice, its class and object, and its
    /// intensity.
    #[inline]
    pub(crate) fn add(
        &mut self,
        number: u64,
        point: [i64; 3],
        class: PointClass,
        object: u32,
        intensity: u16,
    ) {
        let key = match class {
            PointClass::Ground => GROUND,
            PointClass::Object => object + 1,
            PointClass::LowNoise | PointClass::HighNoise | PointClass::Withheld => return,
        };
        let Some(rule) = self.sampling.rules.get(key as usize) else { return };
        let voxel = point.map(|value| value >> rule.shift);
        #[expect(clippy::cast_sign_loss, reason = "bits of a hash")]
        let bits = (voxel[0] as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)
            ^ (voxel[1] as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f)
            ^ (voxel[2] as u64).wrapping_mul(0x1656_67b1_9e37_79f9)
            ^ u64::from(key).wrapping_mul(0xff51_afd7_ed55_8ccd);
        let hash = splitmix64(bits);
        let rank = (((hash >> 32) * rule.thinning) >> 16).max(1);
        let first = key > LOOSE && self.sampling.first_points[key as usize - 2] == number;
        if rank >= self.limit && !first {
            return;
        }
        let edge = 1_i64 << rule.shift;
        // Twice the distance along each axis, so that the centre is an integer.
        let squared: f64 = (0..3)
            .map(|axis| (2 * (point[axis] - (voxel[axis] << rule.shift)) + 1 - edge) as f64 / edge as f64)
            .map(|share| share * share)
            .sum();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 3 times 20,000")]
        let apart = (squared * 20_000.0) as u16;
        #[expect(clippy::cast_possible_truncation, reason = "the lowest bits of a hash")]
        let slot = &mut self.recent[hash as usize & (SLOTS - 1)];
        let same = u64::from(slot.rank) == rank && slot.key == key;
        // Most points are in a recent voxel, and further from its centre than the point that was kept.
        if same && slot.apart < apart && !first {
            return;
        }
        let Some(place) = self.sampling.place(point) else { return };
        let mut sample = SamplePoint { rank: 0, key, apart, intensity, place };
        if first {
            // Not for its voxel, too: the point would be shown twice, because the ranks differ.
            self.found.push(sample);
            return;
        }
        #[expect(clippy::cast_possible_truncation, reason = "below the limit, which is below 2^32")]
        let narrow = rank as u32;
        sample.rank = narrow;
        if same {
            *slot = (*slot).min(sample);
            return;
        }
        let before = std::mem::replace(slot, sample);
        if before.rank != u32::MAX {
            self.found.push(before);
            if self.found.len() >= 2 * self.sampling.candidates {
                self.limit = keep_best(&mut self.found, self.sampling.candidates);
            }
        }
    }

    /// The candidates, best first.
    pub(crate) fn finish(mut self) -> Vec<SamplePoint> {
        self.found.extend(self.recent.iter().filter(|sample| sample.rank != u32::MAX));
        keep_best(&mut self.found, self.sampling.candidates);
        self.found
    }
}

/// Sorts candidates, and keeps the best one of each voxel and the best `count` of these. Returns the rank
/// from which on no candidate is needed.
fn keep_best(candidates: &mut Vec<SamplePoint>, count: usize) -> u64 {
    candidates.sort_unstable();
    candidates.dedup_by_key(|sample| sample.voxel());
    if candidates.len() <= count {
        return u64::from(u32::MAX);
    }
    candidates.truncate(count);
    candidates.last().map_or(0, |last| u64::from(last.rank) + 1)
}

/// Takes the best points of all units.
#[derive(Debug)]
pub(crate) struct Choice {
    budget: usize,
    best: Vec<SamplePoint>,
}

impl Choice {
    /// A choice without points, which takes at most `budget`.
    pub(crate) fn new(budget: usize) -> Self {
        // Allocated at once, because a list that grows is in memory twice while it grows.
        Self { budget, best: Vec::with_capacity(budget + budget / 2 + UNIT_CANDIDATES.1) }
    }

    /// Adds the candidates of a unit.
    pub(crate) fn add(&mut self, candidates: &[SamplePoint]) {
        if self.best.len() + candidates.len() > self.best.capacity() {
            keep_best(&mut self.best, self.budget);
        }
        self.best.extend_from_slice(candidates);
    }

    /// The chosen points, best first.
    pub(crate) fn finish(mut self) -> Vec<SamplePoint> {
        keep_best(&mut self.best, self.budget);
        self.best.shrink_to_fit();
        self.best
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;
    use crate::model::{PointId, in_u32};

    struct Seen {
        points: Vec<(u64, [i64; 3], PointClass, u32, u16)>,
        objects: Vec<ObjectPart>,
    }

    /// Ground of 60 m by 60 m, and objects of very different sizes.
    fn scene(points: u64) -> Seen {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(7);
        let sizes = [[100, 100, 6_000], [30_000, 300, 9_000], [4_000, 1_800, 1_500], [40, 40, 40]];
        let mut objects = vec![ObjectPart::empty(); sizes.len()];
        let mut all = Vec::new();
        for number in 0..points {
            let id = in_u32(usize::try_from(number % 7).unwrap(), "objects");
            let object = id as usize;
            let intensity = random.random_range(0..60_000_u16);
            let Some(size) = sizes.get(object).filter(|_| object != 3 || number < 70) else {
                let place = [random.random_range(0..60_000), random.random_range(0..60_000), 0];
                let class = if object == 4 { PointClass::Object } else { PointClass::Ground };
                all.push((number, place, class, 0, intensity));
                continue;
            };
            let place =
                [0, 1, 2].map(|axis| 1_000 * (i64::from(id) + 1) + random.random_range(0..size[axis]));
            let part = &mut objects[object];
            part.points += 1;
            part.first_id = part.first_id.min(PointId::new(number));
            for (axis, &value) in place.iter().enumerate() {
                part.lo[axis] = part.lo[axis].min(value);
                part.hi[axis] = part.hi[axis].max(value);
            }
            all.push((number, place, PointClass::Object, id + 1, intensity));
        }
        Seen { points: all, objects }
    }

    fn sampling(seen: &Seen, budget: usize) -> Sampling {
        let of = |class| seen.points.iter().filter(|point| point.2 == class).count() as u64;
        let drive = SampledDrive {
            objects: &seen.objects,
            ground_points: of(PointClass::Ground),
            object_points: of(PointClass::Object),
            unit_points: 1_000_000,
            area_units2: 3.6e9,
            origin: [0; 3],
            lattice: Lattice::MILLIMETRE,
        };
        Sampling::new(&drive, budget)
    }

    /// The choice, if the points come in units of this length.
    fn chosen(seen: &Seen, budget: usize, unit: usize) -> Vec<SamplePoint> {
        let sampling = sampling(seen, budget);
        let mut choice = Choice::new(budget);
        for points in seen.points.chunks(unit) {
            let mut sampler = Sampler::new(&sampling);
            points.iter().for_each(|point| sampler.add(point.0, point.1, point.2, point.3, point.4));
            choice.add(&sampler.finish());
        }
        choice.finish()
    }

    #[test]
    fn the_choice_does_not_depend_on_units_or_order() {
        let mut seen = scene(120_000);
        let whole = chosen(&seen, 5_000, usize::MAX);
        assert!(whole.len() > 2_500 && whole.len() <= 5_000, "{}", whole.len());
        assert_eq!(whole, chosen(&seen, 5_000, 1_000));
        seen.points.reverse();
        assert_eq!(whole, chosen(&seen, 5_000, 7_777));
    }

    #[test]
    fn every_object_is_kept_however_small_the_budget() {
        let seen = scene(60_000);
        for budget in [4, 40, 400, 4_000] {
            let chosen = chosen(&seen, budget, 10_000);
            assert!(chosen.len() <= budget);
            let kept = |key| chosen.iter().any(|sample| sample.key == key);
            assert!((2..6).all(kept), "budget {budget}");
        }
        // Small objects are denser than large ones: all ten points of the smallest, each once.
        let few = chosen(&seen, 4_000, 10_000);
        assert_eq!(few.iter().filter(|sample| sample.key == 5).count(), 10);
        assert_eq!(few.iter().filter(|sample| sample.key == 5 && sample.rank == 0).count(), 1);
    }

    #[test]
    fn a_drive_within_the_budget_is_kept_whole() {
        let seen = scene(3_000);
        let chosen = chosen(&seen, 10_000, 500);
        let shown: std::collections::BTreeSet<_> =
            chosen.iter().map(|sample| (sample.key, sample.place)).collect();
        // Points within one centimetre are the same on the page.
        assert!(shown.len() > 2_900, "{}", shown.len());
        // No point is there twice, and the first points of the objects, which their numbers choose, neither.
        let places: std::collections::BTreeSet<_> =
            seen.points.iter().map(|point| (point.3, point.1)).collect();
        assert_eq!((places.len(), chosen.len()), (3_000, 3_000));
    }

    #[test]
    fn noise_and_strays_are_left_out() {
        let seen = scene(100);
        let sampling = sampling(&seen, 100);
        let mut sampler = Sampler::new(&sampling);
        sampler.add(0, [5, 5, 5], PointClass::LowNoise, 0, 1);
        sampler.add(1, [1 << 45, 5, 5], PointClass::Ground, 0, 1);
        assert!(sampler.finish().is_empty());
    }
}

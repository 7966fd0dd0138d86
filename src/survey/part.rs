//! The contribution of some consecutive blocks of a file to the survey. Parts merge exactly, in any order.

use std::collections::BTreeMap;

use rustc_hash::FxHashSet;
use serde::{Deserialize, Serialize};

use crate::model::{Lattice, LatticeTransform, RecordView, record_xyz};
use crate::spatial::{BlockZone, Cell, CellCounter, CellGrid, CellMap};

/// Seconds of GPS time per bin. At 30 km/h, this is about 4 m of driving, which is short compared with any
/// bend of a road.
pub const TIME_BIN_S: f64 = 0.5;

/// Largest number of bins with points: 36 hours of scanning, in 30 MB. If there are more, the times are not
/// seconds, and the bins are dropped.
pub(super) const BINS_MAX: usize = 1 << 18;

/// Largest number of zone-map cells kept for a block. A block with more (shuffled, or airborne) is described
/// by its box alone.
const ZONE_CELLS_MAX: usize = 192;

/// Largest extent of the points of a time bin in metres (chosen: twice the reach of a vehicle scanner, which
/// is some hundred metres, and the way of half a second).
const SCANNED_M: f64 = 2_000.0;

/// Sum and extent of the positions of the points of one time bin, in lattice units, and their times.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TimeBin {
    /// Points in the bin.
    pub count: u64,
    /// Sum of the lattice x.
    pub sum_x: i128,
    /// Sum of the lattice y.
    pub sum_y: i128,
    /// Smallest lattice x and y.
    pub lo: [i64; 2],
    /// Largest lattice x and y.
    pub hi: [i64; 2],
    /// First GPS time in seconds.
    pub first: f64,
    /// Last GPS time in seconds.
    pub last: f64,
}

impl Default for TimeBin {
    fn default() -> Self {
        let (lo, hi) = ([i64::MAX; 2], [i64::MIN; 2]);
        let (first, last) = (f64::INFINITY, f64::NEG_INFINITY);
        Self { count: 0, sum_x: 0, sum_y: 0, lo, hi, first, last }
    }
}

impl TimeBin {
    /// Adds a point.
    #[inline]
    fn add(&mut self, time: f64, [x, y, _]: [i64; 3]) {
        self.count += 1;
        self.sum_x += i128::from(x);
        self.sum_y += i128::from(y);
        self.lo = [self.lo[0].min(x), self.lo[1].min(y)];
        self.hi = [self.hi[0].max(x), self.hi[1].max(y)];
        self.first = self.first.min(time);
        self.last = self.last.max(time);
    }

    /// Adds points.
    fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.sum_x += other.sum_x;
        self.sum_y += other.sum_y;
        self.lo = [0, 1].map(|k| self.lo[k].min(other.lo[k]));
        self.hi = [0, 1].map(|k| self.hi[k].max(other.hi[k]));
        self.first = self.first.min(other.first);
        self.last = self.last.max(other.last);
    }

    /// Whether a scanner can have measured all points of the bin within half a second. If not, their mean is
    /// no place on the road: a single point at the origin of a coordinate system is 5,000 km away, and moves
    /// the mean of 50,000 others by 100 m.
    pub(super) fn is_of_one_place(&self, lattice: Lattice) -> bool {
        let most = lattice.units(SCANNED_M);
        (0..2).all(|k| self.hi[k].saturating_sub(self.lo[k]) <= most)
    }
}

/// Largest coordinate in metres. Eastings of Gauss-Krueger zones begin with the number of the zone, which is
/// at most 120, in millions of metres. Beyond 2^31 cells of a method, a tile would fail.
const EARTH_M: f64 = 2e8;

/// A record with an absurd position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OutOfRange {
    /// Index of the record in its block.
    pub record: usize,
    /// Its coordinates as stored.
    pub xyz: [i32; 3],
}

/// The contribution of some consecutive blocks of a file.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct SurveyPart {
    /// One entry per block, in file order.
    pub zones: Vec<BlockZone>,
    /// Points per occupied cell, in ascending cell. Withheld points count, because tiles own them.
    pub occupancy: Vec<(Cell, u32)>,
    /// Withheld points per cell that has any, in ascending cell.
    pub withheld: Vec<(Cell, u32)>,
    /// Positions per bin of GPS time, without withheld points. Empty in spite of times if these are
    /// in too many bins to be seconds.
    pub time_bins: BTreeMap<i64, TimeBin>,
    /// Smallest and largest lattice coordinates, of withheld points as well.
    pub extent: Option<([i64; 3], [i64; 3])>,
    /// Smallest and largest finite GPS time in seconds, without withheld points.
    pub time: Option<(f64, f64)>,
    /// Records whose GPS time is not a finite number, without withheld points.
    pub bad_times: u64,
    /// XXH3 of the content of the blocks, folded in file order.
    pub content: u64,
}

impl SurveyPart {
    /// Surveys `blocks` of one file.
    ///
    /// # Errors
    /// The index of the block, and the record whose position is absurd.
    pub fn survey<'a>(
        blocks: impl Iterator<Item = RecordView<'a>>,
        transform: &LatticeTransform,
        grid: CellGrid,
        lattice: Lattice,
    ) -> Result<Self, (usize, OutOfRange)> {
        let mut collector = Collector::new(grid, lattice);
        for (index, view) in blocks.enumerate() {
            collector.block(&view, transform).map_err(|error| (index, error))?;
        }
        Ok(collector.finish())
    }

    /// Number of points.
    #[must_use]
    pub fn points(&self) -> u64 {
        self.zones.iter().map(|zone| u64::from(zone.count)).sum()
    }

    /// Whether the times were in too many bins.
    fn has_scattered_times(&self) -> bool {
        self.time.is_some() && self.time_bins.is_empty()
    }
}

/// Running state over the blocks of a part. A part can also be fed block by block, see
/// [`SurveyPart::survey`].
#[derive(Debug)]
pub struct Collector {
    grid: CellGrid,
    /// Largest coordinate in lattice units.
    limit: i64,
    counter: CellCounter,
    withheld: CellCounter,
    part: SurveyPart,
    coarse: FxHashSet<Cell>,
    bin: i64,
    bin_sum: TimeBin,
    /// Whether the times are in too many bins.
    scattered: bool,
}

impl Collector {
    /// A collector that counts in the cells of `grid`.
    #[must_use]
    pub fn new(grid: CellGrid, lattice: Lattice) -> Self {
        Self {
            grid,
            limit: lattice.units(EARTH_M),
            counter: CellCounter::default(),
            withheld: CellCounter::default(),
            part: SurveyPart::default(),
            coarse: FxHashSet::default(),
            bin: i64::MIN,
            bin_sum: TimeBin::default(),
            scattered: false,
        }
    }

    /// Adds one block.
    ///
    /// # Errors
    /// The record whose position is outside all occupancy cells, or nowhere on earth.
    pub fn block(&mut self, view: &RecordView<'_>, transform: &LatticeTransform) -> Result<(), OutOfRange> {
        let mut lo = [i64::MAX; 3];
        let mut hi = [i64::MIN; 3];
        let mut last_coarse = [i32::MIN; 2];
        self.coarse.clear();
        let mut count = 0_u32;
        let mut withheld = 0_u32;
        let mut first = f64::INFINITY;
        let mut last = f64::NEG_INFINITY;
        for (record, bytes) in view.bytes.chunks_exact(view.stride).enumerate() {
            let xyz = record_xyz(bytes);
            let point = transform.apply(xyz);
            let cell = self.grid.cell(point[0], point[1]).ok_or(OutOfRange { record, xyz })?;
            for axis in 0..3 {
                lo[axis] = lo[axis].min(point[axis]);
                hi[axis] = hi[axis].max(point[axis]);
            }
            self.counter.add(cell);
            let coarse = BlockZone::coarse_of(cell);
            if coarse != last_coarse {
                last_coarse = coarse;
                if self.coarse.len() <= ZONE_CELLS_MAX {
                    self.coarse.insert(coarse);
                }
            }
            if view.is_withheld(bytes) {
                self.withheld.add(cell);
                withheld += 1;
            } else if let Some(offset) = view.gps_time
                && let Some(time) = self.time(&bytes[offset..offset + 8], point)
            {
                first = first.min(time);
                last = last.max(time);
            }
            count += 1;
        }
        if count > 0 && (0..3).any(|axis| !self.is_on_earth(lo[axis]) || !self.is_on_earth(hi[axis])) {
            let mut records = view.xyz().enumerate();
            let absurd =
                records.find(|(_, xyz)| !transform.apply(*xyz).iter().all(|value| self.is_on_earth(*value)));
            if let Some((record, xyz)) = absurd {
                return Err(OutOfRange { record, xyz });
            }
        }
        self.zone([count, withheld], lo, hi, (first <= last).then_some((first, last)));
        let mut hasher = xxhash_rust::xxh3::Xxh3::new();
        hasher.update(&self.part.content.to_le_bytes());
        hasher.update(view.bytes);
        self.part.content = hasher.digest();
        Ok(())
    }

    fn is_on_earth(&self, value: i64) -> bool {
        value.abs() <= self.limit
    }

    /// Adds a point to its time bin. Returns its time if it is finite.
    #[inline]
    fn time(&mut self, bytes: &[u8], point: [i64; 3]) -> Option<f64> {
        let time = f64::from_le_bytes(bytes.try_into().ok()?);
        // Beyond 10^15 s, a double no longer resolves half a second.
        if !time.is_finite() || time.abs() >= 1e15 {
            self.part.bad_times += 1;
            return None;
        }
        #[expect(clippy::cast_possible_truncation, reason = "below 2 * 10^15")]
        let whole = (time / TIME_BIN_S) as i64;
        let bin = whole - i64::from(time < whole as f64 * TIME_BIN_S);
        if bin != self.bin {
            self.flush_bin();
            self.bin = bin;
        }
        self.bin_sum.add(time, point);
        Some(time)
    }

    fn flush_bin(&mut self) {
        if self.bin_sum.count > 0 && !self.scattered {
            self.scattered = add_bin(&mut self.part.time_bins, self.bin, &self.bin_sum);
        }
        self.bin_sum = TimeBin::default();
    }

    fn zone(&mut self, [count, withheld]: [u32; 2], lo: [i64; 3], hi: [i64; 3], time: Option<(f64, f64)>) {
        if count == 0 {
            let (lo, hi) = ([0; 2], [0; 2]);
            self.part.zones.push(BlockZone { count, withheld, lo, hi, time: None, coarse: Vec::new() });
            return;
        }
        let corner = |point: [i64; 3]| self.grid.cell(point[0], point[1]).unwrap_or_default();
        let mut coarse = Vec::new();
        if self.coarse.len() <= ZONE_CELLS_MAX {
            coarse.extend(self.coarse.drain());
            coarse.sort_unstable();
        }
        let (low, high) = (corner(lo), corner(hi));
        self.part.zones.push(BlockZone { count, withheld, lo: low, hi: high, time, coarse });
        self.part.extent = merge_extent(self.part.extent, Some((lo, hi)));
        self.part.time = merge_time(self.part.time, time);
    }

    /// Finishes the part.
    #[must_use]
    pub fn finish(mut self) -> SurveyPart {
        self.flush_bin();
        self.part.occupancy = self.counter.into_map().entries();
        self.part.withheld = self.withheld.into_map().entries();
        self.part
    }
}

/// Adds to a bin. If there are too many then, drops all and returns true. Whether the bins of a drive are too
/// many depends on their number alone, so it is the same in any order of records, parts and files.
fn add_bin(bins: &mut BTreeMap<i64, TimeBin>, bin: i64, sum: &TimeBin) -> bool {
    bins.entry(bin).or_default().merge(sum);
    let too_many = bins.len() > BINS_MAX;
    if too_many {
        bins.clear();
    }
    too_many
}

type Extent = Option<([i64; 3], [i64; 3])>;

fn merge_extent(one: Extent, two: Extent) -> Extent {
    match (one, two) {
        (Some((lo, hi)), Some((lo2, hi2))) => {
            let pick = |a: [i64; 3], b: [i64; 3], f: fn(i64, i64) -> i64| {
                [f(a[0], b[0]), f(a[1], b[1]), f(a[2], b[2])]
            };
            Some((pick(lo, lo2, i64::min), pick(hi, hi2, i64::max)))
        }
        (some, None) | (None, some) => some,
    }
}

fn merge_time(one: Option<(f64, f64)>, two: Option<(f64, f64)>) -> Option<(f64, f64)> {
    match (one, two) {
        (Some(a), Some(b)) => Some((a.0.min(b.0), a.1.max(b.1))),
        (some, None) | (None, some) => some,
    }
}

/// The survey of a whole drive: all parts together.
#[derive(Debug, Default)]
pub struct Survey {
    /// Points per cell, withheld ones included. Counts saturate at 2^32 - 1.
    pub occupancy: CellMap<u32>,
    /// Withheld points per cell that has any.
    pub withheld_by_cell: CellMap<u32>,
    /// Zone map: blocks of each file in file order.
    pub zones: Vec<Vec<BlockZone>>,
    /// Positions by bin of GPS time, without withheld points; none if the times are in too many bins.
    pub time_bins: BTreeMap<i64, TimeBin>,
    /// Smallest and largest lattice coordinates, of withheld points as well.
    pub extent: Extent,
    /// Smallest and largest finite GPS time in seconds, without withheld points.
    pub time: Option<(f64, f64)>,
    /// Records whose GPS time is not a finite number, without withheld points.
    pub bad_times: u64,
    /// Content hashes of the parts of each file, in file order.
    pub content: Vec<Vec<u64>>,
    scattered: bool,
}

impl Survey {
    /// Adds the next part of file number `file`; parts of a file come in file order.
    pub fn add(&mut self, file: usize, part: SurveyPart) {
        self.scattered |= part.has_scattered_times();
        while self.zones.len() <= file {
            self.zones.push(Vec::new());
            self.content.push(Vec::new());
        }
        for (counts, total) in
            [(part.occupancy, &mut self.occupancy), (part.withheld, &mut self.withheld_by_cell)]
        {
            for (cell, count) in counts {
                let total = total.entry(cell);
                *total = total.saturating_add(count);
            }
        }
        if self.scattered {
            self.time_bins.clear();
        }
        for (bin, sum) in &part.time_bins {
            self.scattered = self.scattered || add_bin(&mut self.time_bins, *bin, sum);
        }
        self.zones[file].extend(part.zones);
        self.content[file].push(part.content);
        self.extent = merge_extent(self.extent, part.extent);
        self.time = merge_time(self.time, part.time);
        self.bad_times += part.bad_times;
    }

    /// Whether the times are in too many bins to be seconds.
    pub(super) fn has_scattered_times(&self) -> bool {
        self.scattered
    }

    /// Number of points.
    #[must_use]
    pub fn points(&self) -> u64 {
        self.zones.iter().flatten().map(|zone| u64::from(zone.count)).sum()
    }

    /// Number of withheld points.
    #[must_use]
    pub fn withheld(&self) -> u64 {
        self.zones.iter().flatten().map(|zone| u64::from(zone.withheld)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::AxisTransform;

    fn records(points: &[([i32; 3], f64)]) -> Vec<u8> {
        let mut bytes = Vec::new();
        for (xyz, time) in points {
            xyz.iter().for_each(|value| bytes.extend_from_slice(&value.to_le_bytes()));
            bytes.extend_from_slice(&time.to_le_bytes());
        }
        bytes
    }

    fn survey(points: &[([i32; 3], f64)]) -> SurveyPart {
        let bytes = records(points);
        let axis = AxisTransform::new(0.001, 0.0, 1.0, Lattice::MILLIMETRE);
        let view = RecordView { bytes: &bytes, stride: 20, gps_time: Some(12), withheld: None };
        SurveyPart::survey(
            [view].into_iter(),
            &LatticeTransform { axes: [axis; 3] },
            CellGrid::new(1_000),
            Lattice::MILLIMETRE,
        )
        .unwrap()
    }

    #[test]
    fn counts_cells_times_and_extent() {
        let part = survey(&[([-1, 0, 5], 10.1), ([0, 999, 7], 10.4), ([1_000, 0, -3], f64::NAN)]);
        assert_eq!(part.occupancy, [([-1, 0], 1), ([0, 0], 1), ([1, 0], 1)]);
        let sums = TimeBin { count: 2, sum_x: -1, sum_y: 999, ..part.time_bins[&20] };
        assert_eq!(
            part.time_bins[&20],
            TimeBin { lo: [-1, 0], hi: [0, 999], first: 10.1, last: 10.4, ..sums }
        );
        assert_eq!(part.extent, Some(([-1, 0, -3], [1_000, 999, 7])));
        assert_eq!((part.time, part.bad_times), (Some((10.1, 10.4)), 1));
        assert_eq!(part.zones[0].coarse, [[-1, 0], [0, 0]]);
    }

    #[test]
    fn withheld_points_have_a_cell_and_an_extent_but_no_time() {
        let bytes = records(&[([0, 0, 0], 10.1), ([9, 9, 9], -10.5), ([-1, 0, -5], f64::NAN)]);
        let axis = AxisTransform::new(0.001, 0.0, 1.0, Lattice::MILLIMETRE);
        // The sign of the time is the flag. That of not a number is not set.
        let flag = crate::model::FlagPlace { offset: 19, mask: 0x80 };
        let view = RecordView { bytes: &bytes, stride: 20, gps_time: Some(12), withheld: Some(flag) };
        let transform = LatticeTransform { axes: [axis; 3] };
        let grid = CellGrid::new(1_000);
        let part = SurveyPart::survey([view].into_iter(), &transform, grid, Lattice::MILLIMETRE).unwrap();
        assert_eq!(part.occupancy, [([-1, 0], 1), ([0, 0], 2)]);
        assert_eq!(part.withheld, [([0, 0], 1)]);
        assert_eq!(part.extent, Some(([-1, 0, -5], [9, 9, 9])));
        assert_eq!((part.time, part.bad_times), (Some((10.1, 10.1)), 1));
        assert_eq!((part.zones[0].count, part.zones[0].withheld), (3, 1));
        assert_eq!(part.time_bins.keys().copied().collect::<Vec<_>>(), [20]);
    }

    /// As many bins as are kept, in two parts with one bin more or with none.
    #[test]
    fn bins_of_time_are_limited_whatever_the_order() {
        let bins = |range: std::ops::Range<usize>| {
            let time = |bin: usize| bin as f64 * TIME_BIN_S;
            survey(&range.map(|bin| ([0, 0, 0], time(bin))).collect::<Vec<_>>())
        };
        let of_drive = |parts: [&SurveyPart; 2]| {
            let mut drive = Survey::default();
            parts.into_iter().for_each(|part| drive.add(0, part.clone()));
            (drive.time_bins.len(), drive.has_scattered_times())
        };
        let half = BINS_MAX / 2;
        let [first, second, more] = [bins(0..half), bins(half..BINS_MAX), bins(half..BINS_MAX + 1)];
        let all = bins(0..BINS_MAX + 1);
        assert_eq!((all.time_bins.len(), all.has_scattered_times()), (0, true));
        for (one, other, expected) in
            [(&first, &second, (BINS_MAX, false)), (&first, &more, (0, true)), (&all, &first, (0, true))]
        {
            assert_eq!(of_drive([one, other]), expected);
            assert_eq!(of_drive([other, one]), expected);
        }
        let without_times = survey(&[([0, 0, 0], f64::NAN)]);
        assert_eq!(of_drive([&without_times, &first]), (half, false));
    }
}

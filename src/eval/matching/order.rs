//! Counts points if both sides have them in the same order, and finds the first point that differs.

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::eval::matching::parts::Parts;
use crate::eval::matching::sides::{Files, Idle, PredictionFields, Readers, ReferenceFields, Run, time_bits};
use crate::eval::table::{Cell, Counter, Table};
use crate::input::{Catalog, InputFile, record_xyz};
use crate::model::{AxisTransform, Lattice, PointId};

/// Number of blocks of the prediction that one thread takes at a time. They are many enough that a block of
/// the reference across their ends is rarely decoded twice, and few enough that all threads are occupied.
const BLOCKS_AT_A_TIME: usize = 8;

/// Both sides of a comparison of two sets of files.
#[derive(Debug)]
pub(super) struct Pair<'a> {
    pub(super) prediction: Files<'a, PredictionFields>,
    pub(super) reference: Files<'a, ReferenceFields>,
    /// Whether GPS times are compared.
    pub(super) with_time: bool,
}

/// Result of one thread: the table of its part; `None` if a point in it differs between the sides.
type Part = Result<Option<Table>>;

/// Counts every point of both labels in one set of files.
///
/// # Errors
/// A block that cannot be read, an invalid label, [`EvalError::Scratch`](crate::eval::EvalError::Scratch).
pub(super) fn count_same_files(
    prediction: &Files<'_, PredictionFields>,
    reference: &Files<'_, ReferenceFields>,
    parts: Parts<'_>,
) -> Result<Table> {
    let count = |runs: &[Run], [reader, _]: &mut Readers| -> Result<()> {
        let mut counter = Counter::default();
        for run in runs {
            let file = prediction.file(run);
            let records = reader.records(file, run)?;
            let predicted = &prediction.fields[run.file];
            let referred = &reference.fields[run.file];
            for (record, index) in records.chunks_exact(file.layout().record_len).zip(run.first.onward()) {
                if file.layout().withheld.is_set(record) {
                    continue;
                }
                let (segment, predicted, named) =
                    predicted.read(record).map_err(|label| prediction.wrong(run, index, label))?;
                let (object, class) =
                    referred.read(record).map_err(|label| reference.wrong(run, index, label))?;
                let cell = Cell { object, segment, class, predicted, named };
                counter.add(cell, file.transform().apply(record_xyz(record)));
            }
            file.release(run.block);
        }
        parts.add(counter.finish())
    };
    let idle = Idle::default();
    let chunks = prediction.runs.par_chunks(BLOCKS_AT_A_TIME);
    chunks.try_for_each(|runs| idle.lend(|readers| count(runs, readers)))?;
    drop(idle);
    parts.finish()
}

impl Pair<'_> {
    /// Counts the points of both sides in order; `None` if their order or their points differ.
    ///
    /// # Errors
    /// A block that cannot be read, an invalid label,
    /// [`EvalError::Scratch`](crate::eval::EvalError::Scratch).
    pub(super) fn count_in_order(&self, parts: Parts<'_>) -> Result<Option<Table>> {
        // A difference stops the other threads, as an error does.
        let idle = Idle::default();
        let count = |runs: &[Run]| {
            let part = idle.lend(|readers| self.count_part(runs, readers));
            parts.add(part.map_err(Stop::Failed)?.ok_or(Stop::Differs)?).map_err(Stop::Failed)
        };
        let counted = self.prediction.runs.par_chunks(BLOCKS_AT_A_TIME).try_for_each(count);
        drop(idle);
        match counted {
            Ok(()) => parts.finish().map(Some),
            Err(Stop::Differs) => Ok(None),
            Err(Stop::Failed(error)) => Err(error),
        }
    }

    fn count_part(&self, runs: &[Run], readers: &mut Readers) -> Part {
        let mut counter = Counter::default();
        let different = self.walk(runs, readers, |stretch| {
            let predicted = &self.prediction.fields[stretch.runs.0.file];
            let referred = &self.reference.fields[stretch.runs.1.file];
            let same = SamePoint::new(self, stretch.files);
            let withheld = [stretch.files.0, stretch.files.1].map(|file| file.layout().withheld);
            for ((left, right), index) in stretch.records().zip(stretch.first.onward()) {
                let Some(at) = same.position(left, right) else { return Ok(Some(index)) };
                if withheld[0].is_set(left) || withheld[1].is_set(right) {
                    continue;
                }
                let (segment, predicted, named) = predicted
                    .read(left)
                    .map_err(|label| self.prediction.wrong(stretch.runs.0, index, label))?;
                let (object, class) = referred
                    .read(right)
                    .map_err(|label| self.reference.wrong(stretch.runs.1, index, label))?;
                counter.add(Cell { object, segment, class, predicted, named }, at);
            }
            Ok(None)
        })?;
        Ok(different.is_none().then(|| counter.finish()))
    }

    /// Index of the first point that differs, among the indices that both sides have; `None` if none differs.
    ///
    /// # Errors
    /// A block that cannot be read.
    pub(super) fn first_difference(&self) -> Result<Option<PointId>> {
        let idle = Idle::default();
        let difference = |stretch: &Stretch<'_>| {
            let same = SamePoint::new(self, stretch.files);
            let mut pairs = stretch.records().zip(stretch.first.onward());
            let different = pairs.find(|((left, right), _)| same.position(left, right).is_none());
            Ok(different.map(|found| found.1))
        };
        let find = |runs: &[Run]| idle.lend(|readers| self.walk(runs, readers, difference)).transpose();
        self.prediction.runs.par_chunks(BLOCKS_AT_A_TIME).find_map_first(find).transpose()
    }

    /// Visits the records of `runs` of the prediction together with the records of the same indices of the
    /// reference, as far as there are any. Stops if `visit` returns an index.
    fn walk(
        &self,
        runs: &[Run],
        [left, right]: &mut Readers,
        mut visit: impl FnMut(&Stretch<'_>) -> Result<Option<PointId>>,
    ) -> Result<Option<PointId>> {
        for run in runs {
            let file = self.prediction.file(run);
            let records = left.records(file, run)?;
            let end = run.first + run.count;
            let overlapping =
                self.reference.runs.partition_point(|other| other.first + other.count <= run.first);
            for other in self.reference.runs[overlapping..].iter().take_while(|other| other.first < end) {
                let other_file = self.reference.file(other);
                let first = run.first.max(other.first);
                let last = end.min(other.first + other.count);
                let stretch = Stretch {
                    runs: (run, other),
                    files: (file, other_file),
                    first,
                    bytes: (
                        part(records, file, run, first..last),
                        part(right.records(other_file, other)?, other_file, other, first..last),
                    ),
                };
                let found = visit(&stretch)?;
                if found.is_some() {
                    return Ok(found);
                }
                if other.first + other.count <= end {
                    other_file.release(other.block);
                }
            }
            file.release(run.block);
        }
        Ok(None)
    }
}

enum Stop {
    Failed(Error),
    Differs,
}

/// The bytes of the records of these indices.
#[expect(clippy::cast_possible_truncation, reason = "below the number of records of a block, a u32")]
fn part<'b>(records: &'b [u8], file: &InputFile, run: &Run, indices: std::ops::Range<PointId>) -> &'b [u8] {
    let byte = |index: PointId| (index - run.first) as usize * file.layout().record_len;
    &records[byte(indices.start)..byte(indices.end)]
}

/// Records of the same indices on both sides, each from one block.
struct Stretch<'b> {
    runs: (&'b Run, &'b Run),
    files: (&'b InputFile, &'b InputFile),
    /// Index of the first record.
    first: PointId,
    bytes: (&'b [u8], &'b [u8]),
}

impl<'b> Stretch<'b> {
    fn records(&self) -> impl Iterator<Item = (&'b [u8], &'b [u8])> {
        let of = |bytes: &'b [u8], file: &InputFile| bytes.chunks_exact(file.layout().record_len);
        of(self.bytes.0, self.files.0).zip(of(self.bytes.1, self.files.1))
    }
}

/// For each side, the number of units of the finer of both lattices in one unit of its own lattice.
pub(super) fn multiples(prediction: &Catalog, reference: &Catalog) -> (i64, i64) {
    let units = |lattice: Lattice| i64::from(lattice.units_per_m());
    let left = units(prediction.lattice());
    let right = units(reference.lattice());
    // There are two lattices, and one is a multiple of the other.
    let finest = left.max(right);
    (finest / left, finest / right)
}

/// Compares records of two files: whether they are the same point.
struct SamePoint<'b> {
    files: (&'b InputFile, &'b InputFile),
    multiples: (i64, i64),
    /// Whether equal record coordinates mean equal positions: the common case, and the fast one.
    same_lattice: bool,
    /// Largest difference of coordinates, in units of the finer lattice.
    tolerance: [i64; 3],
    times: Option<(usize, usize)>,
}

impl<'b> SamePoint<'b> {
    fn new(pair: &Pair<'_>, files: (&'b InputFile, &'b InputFile)) -> Self {
        let multiples = multiples(pair.prediction.catalog, pair.reference.catalog);
        let axes = (files.0.transform().axes, files.1.transform().axes);
        let same_lattice = axes.0 == axes.1 && multiples.0 == multiples.1;
        let tolerance =
            [0, 1, 2].map(|axis| tolerance((axes.0[axis], multiples.0), (axes.1[axis], multiples.1)));
        let times = files.0.layout().gps_time.zip(files.1.layout().gps_time).filter(|_| pair.with_time);
        Self { files, multiples, same_lattice, tolerance, times }
    }

    /// The position on the lattice of the reference, if both records have the same position and time.
    #[inline]
    fn position(&self, left: &[u8], right: &[u8]) -> Option<[i64; 3]> {
        let stored = (record_xyz(left), record_xyz(right));
        let at = self.files.1.transform().apply(stored.1);
        let near = || {
            let other = self.files.0.transform().apply(stored.0);
            (0..3).all(|axis| {
                (at[axis] * self.multiples.1 - other[axis] * self.multiples.0).abs() <= self.tolerance[axis]
            })
        };
        let same_place = self.same_lattice && stored.0 == stored.1 || near();
        let same_time = self.times.is_none_or(|(from, to)| time_bits(left, from) == time_bits(right, to));
        (same_place && same_time).then_some(at)
    }
}

/// Largest difference of a coordinate that was stored again with another scale or offset: half a step of each
/// file, and a unit for the lattice. It is 0 if every step of one file is a step of the other.
#[expect(
    clippy::cast_possible_truncation,
    reason = "scales are at most kilometres, a tolerance for rounding"
)]
fn tolerance(left: (AxisTransform, i64), right: (AxisTransform, i64)) -> i64 {
    let step = |(axis, multiple): (AxisTransform, i64)| match axis {
        AxisTransform::Integer { factor, .. } => (factor * multiple) as f64,
        AxisTransform::Real { factor, .. } => factor * multiple as f64,
    };
    match (left.0, right.0) {
        (AxisTransform::Integer { factor: a, shift: s }, AxisTransform::Integer { factor: b, shift: t })
            if a * left.1 == b * right.1 && (s * left.1 - t * right.1) % (a * left.1) == 0 =>
        {
            0
        }
        (AxisTransform::Real { .. }, AxisTransform::Real { .. }) if left == right => 0,
        _ => (0.5 * (step(left) + step(right))).ceil() as i64 + 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_other_steps_need_a_tolerance() {
        let millimetres =
            |scale: f64, offset: f64| AxisTransform::new(scale, offset, 1.0, Lattice::MILLIMETRE);
        for (left, right, expected) in [
            ((0.001, 0.0), (0.001, 0.0), 0),
            ((0.001, 0.0), (0.001, 530_000.0), 0),
            ((0.01, 0.0), (0.01, 0.5), 0),
            ((0.01, 0.0), (0.01, 0.505), 11),
            // 1 mm stored again with 1 cm: half a step of 1 cm (5 mm), half a step of 1 mm, rounded up, and
            // the unit.
            ((0.001, 0.0), (0.01, 0.0), 7),
            ((0.0017, 0.0), (0.0017, 0.0), 0),
        ] {
            let axes = (millimetres(left.0, left.1), millimetres(right.0, right.1));
            assert_eq!(tolerance((axes.0, 1), (axes.1, 1)), expected, "{left:?} {right:?}");
        }
        let fine = AxisTransform::new(0.0001, 0.0, 1.0, Lattice::TENTH_MILLIMETRE);
        // In tenths of a millimetre: half a step of 10, half a step of 1, rounded up, and the unit.
        assert_eq!(tolerance((millimetres(0.001, 0.0), 10), (fine, 1)), 7);
    }
}

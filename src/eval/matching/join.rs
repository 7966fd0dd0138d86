//! Matches the points of both sides by coordinates and time if their orders differ, out of core.
//!
//! Both sides are partitioned into buckets on disk by a hash of the key. Then one bucket after the other is
//! sorted and joined in memory. Points of the same key are matched in their order of appearance. Memory: four
//! buckets per thread. Points that all have the same key cannot be partitioned. Disk: 16 bytes per point and
//! side.
//!
//! Two different keys are confused if both bucket and hash agree. Together these have 64 bits for 200 million
//! points: in one of a thousand such drives, two points may exchange their labels.

use rayon::prelude::*;
use xxhash_rust::xxh3::xxh3_128;

use crate::error::Result;
use crate::eval::error::EvalError;
use crate::eval::matching::labels::{Label, Met, Numbers, join_places};
use crate::eval::matching::order::{Pair, multiples};
use crate::eval::matching::scratch::{Batch, Buckets, Entry, Taken};
use crate::eval::matching::sides::{BlockReader, Files, LabelFields, time_bits};
use crate::eval::table::{Cell, Place, Predicted, Table, Tally};
use crate::input::{Catalog, record_xyz};
use crate::model::PointId;
use crate::scratch_folder::ScratchFolder;

/// Minimum number of buckets that a thread joins before its counts are merged with those of others.
const BUCKETS_AT_A_TIME: usize = 4;

/// The coarsest scale of coordinates in any file, in the units of the files.
fn coarsest_scale(catalog: &Catalog) -> f64 {
    catalog.files().iter().flat_map(|file| file.header().scaling.scale).fold(0.0, f64::max)
}

impl Pair<'_> {
    /// Counts the points of both sides, matched by coordinates and time.
    ///
    /// # Errors
    /// [`EvalError::Unmatched`] if a point has no counterpart; errors of a block that cannot be read, of an
    /// invalid label, of scratch files that cannot be written.
    pub(super) fn count_by_key(&self, folder: &ScratchFolder) -> Result<Table> {
        let points = self.prediction.catalog.point_count();
        let left = Buckets::new(folder, "prediction", points);
        let right = Buckets::new(folder, "reference", points);
        let multiples = multiples(self.prediction.catalog, self.reference.catalog);
        let predicted = self.part(&self.prediction, multiples.0, &left)?;
        let referred = self.part(&self.reference, multiples.1, &right)?;
        let worker = || (Joined::default(), Taken::default(), Taken::default());
        let workers = (0..left.count()).into_par_iter().with_min_len(BUCKETS_AT_A_TIME).try_fold(
            worker,
            |(mut joined, mut ours, mut theirs), bucket| -> Result<_> {
                left.take(bucket, &mut ours)?;
                right.take(bucket, &mut theirs)?;
                joined.join(ours.entries(), theirs.entries());
                Ok((joined, ours, theirs))
            },
        );
        let joined = workers
            .map(|worker| worker.map(|worker| worker.0))
            .try_reduce(Joined::default, |a, b| Ok(a.merge(b)))?;
        match joined.unmatched {
            Unmatched { count, first: [Some(prediction), Some(reference)] } => Err(EvalError::Unmatched {
                unmatched: count,
                points,
                prediction: Box::new(self.prediction.site(prediction, self.with_time)?),
                reference: Box::new(self.reference.site(reference, self.with_time)?),
                scales: [self.prediction.catalog, self.reference.catalog].map(coarsest_scale),
            }
            .into()),
            // Both sides have the same number of points, so a surplus point on one side implies one on the
            // other.
            _ => Ok(table(joined.pairs, &predicted, &referred)),
        }
    }

    /// Partitions one side into buckets. Its lattice unit is `multiple` units of the finer lattice. Returns
    /// its labels by number, with their places.
    fn part<F: LabelFields + Sync>(
        &self,
        files: &Files<'_, F>,
        multiple: i64,
        buckets: &Buckets<'_>,
    ) -> Result<Vec<(Label, Place)>> {
        let of_reference = multiples(self.prediction.catalog, self.reference.catalog).1;
        let numbers = Numbers::default();
        let worker =
            || Worker { reader: BlockReader::default(), met: Met::new(&numbers), batch: Batch::default() };
        let workers = files.runs.par_iter().try_fold(worker, |mut worker, run| -> Result<_> {
            let Worker { reader, met, batch } = &mut worker;
            let file = files.file(run);
            let fields = &files.fields[run.file];
            let time = file.layout().gps_time.filter(|_| self.with_time);
            let records = reader.records(file, run)?.chunks_exact(file.layout().record_len);
            for (record, index) in records.zip(run.first.onward()) {
                let label = match file.layout().withheld.is_set(record) {
                    true => Label::WITHHELD,
                    false => fields.label(record).map_err(|label| files.wrong(run, index, label))?,
                };
                let at = file.transform().apply(record_xyz(record)).map(|units| units * multiple);
                // Places are means on the lattice of the reference. If both sides have the same points, this
                // division leaves no remainder.
                let number = met.add(label, at.map(|units| units / of_reference));
                let hash = hash(at, time.map_or(0, |offset| time_bits(record, offset)));
                batch.push(buckets.of(hash), Entry::new(hash, index, number));
            }
            buckets.add(batch)?;
            file.release(run.block);
            Ok(worker)
        });
        let places = workers
            .map(|worker| worker.map(|worker| worker.met.into_places()))
            .try_reduce(Vec::new, |a, b| Ok(join_places(a, b)))?;
        Ok(numbers.into_labels().into_iter().zip(places).collect())
    }
}

/// The state that a thread keeps between blocks while it partitions a side.
struct Worker<'a> {
    reader: BlockReader,
    met: Met<'a>,
    batch: Batch,
}

/// Hash of the key of a point: its coordinates in units of the finer lattice, and its time.
fn hash(at: [i64; 3], time: u64) -> u128 {
    let mut bytes = [0_u8; 32];
    for (place, units) in bytes.chunks_exact_mut(8).zip(at) {
        place.copy_from_slice(&units.to_le_bytes());
    }
    bytes[24..].copy_from_slice(&time.to_le_bytes());
    xxh3_128(&bytes)
}

/// Result of one thread that joins buckets.
#[derive(Debug, Default)]
struct Joined {
    /// Points per pair of numbers of labels.
    pairs: Tally<[u32; 2], u64>,
    unmatched: Unmatched,
}

impl Joined {
    /// Joins sorted entries of the prediction and of the reference.
    fn join(&mut self, mut left: &[Entry], mut right: &[Entry]) {
        while let Some(key) = left.first().into_iter().chain(right.first()).map(Entry::key).min() {
            let (ours, rest) = left.split_at(run_length(left, key));
            let (theirs, their_rest) = right.split_at(run_length(right, key));
            for (predicted, referred) in ours.iter().zip(theirs) {
                self.pairs.add([predicted.label(), referred.label()], 1);
            }
            let common = ours.len().min(theirs.len());
            self.unmatched.note(0, &ours[common..]);
            self.unmatched.note(1, &theirs[common..]);
            (left, right) = (rest, their_rest);
        }
    }

    fn merge(mut self, other: Self) -> Self {
        other.pairs.into_sorted().into_iter().for_each(|(pair, points)| self.pairs.add(pair, points));
        self.unmatched = self.unmatched.merge(other.unmatched);
        self
    }
}

fn run_length(entries: &[Entry], key: u64) -> usize {
    entries.iter().take_while(|entry| entry.key() == key).count()
}

/// The table of pairs of labels, without points that are withheld on either side.
fn table(pairs: Tally<[u32; 2], u64>, predicted: &[(Label, Place)], referred: &[(Label, Place)]) -> Table {
    let codes = [Predicted::Other, Predicted::Ground, Predicted::Noise];
    let cell = |[left, right]: [u32; 2]| {
        let ours = predicted[left as usize].0;
        let theirs = referred[right as usize].0;
        let predicted = codes.into_iter().find(|code| *code as u16 == ours.class).unwrap_or_default();
        Cell { object: theirs.id, segment: ours.id, class: theirs.class, predicted, named: ours.named }
    };
    let places = |labels: &[(Label, Place)]| {
        let mut places = Tally::default();
        labels
            .iter()
            .filter(|(label, _)| label.id > 0)
            .for_each(|(label, place)| places.add(label.id, *place));
        places.into_sorted()
    };
    let is_used = |[left, right]: [u32; 2]| {
        predicted[left as usize].0 != Label::WITHHELD && referred[right as usize].0 != Label::WITHHELD
    };
    let pairs = pairs.into_sorted().into_iter().filter(|(pair, _)| is_used(*pair));
    let mut cells: Vec<_> = pairs.map(|(pair, points)| (cell(pair), points)).collect();
    cells.sort_unstable_by_key(|entry| entry.0);
    Table { cells, objects: places(referred), segments: places(predicted) }
}

/// Points without a counterpart: their number in the prediction, and their smallest index on each side.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Unmatched {
    count: u64,
    first: [Option<PointId>; 2],
}

impl Unmatched {
    fn note(&mut self, side: usize, entries: &[Entry]) {
        self.count += if side == 0 { entries.len() as u64 } else { 0 };
        if let Some(entry) = entries.first() {
            self.first[side] = smaller(self.first[side], Some(entry.index()));
        }
    }

    fn merge(self, other: Self) -> Self {
        Self {
            count: self.count + other.count,
            first: [0, 1].map(|side| smaller(self.first[side], other.first[side])),
        }
    }
}

fn smaller(a: Option<PointId>, b: Option<PointId>) -> Option<PointId> {
    a.into_iter().chain(b).min()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn join(left: &[(u64, u64, u32)], right: &[(u64, u64, u32)]) -> Joined {
        let entries = |side: &[(u64, u64, u32)]| -> Vec<Entry> {
            let entry = |&(key, index, label): &(u64, u64, u32)| {
                Entry::new(u128::from(key) << 72, PointId::new(index), label)
            };
            side.iter().map(entry).collect()
        };
        let mut joined = Joined::default();
        joined.join(&entries(left), &entries(right));
        joined
    }

    #[test]
    fn equal_keys_are_matched_in_order_of_appearance() {
        let joined = join(&[(1, 4, 10), (2, 0, 20), (2, 9, 21)], &[(1, 0, 5), (2, 2, 6), (2, 3, 7)]);
        assert_eq!(joined.unmatched, Unmatched::default());
        assert_eq!(joined.pairs.into_sorted(), [([10, 5], 1), ([20, 6], 1), ([21, 7], 1)]);
    }

    #[test]
    fn points_without_counterpart_are_found_on_both_sides() {
        // Key 1 is only on the left (index 4), keys 3 and 4 are only on the right, and key 2 is once too
        // often on the left.
        let found = join(&[(1, 4, 1), (2, 7, 1), (2, 8, 1)], &[(2, 1, 1), (3, 2, 1), (4, 3, 1)]).unmatched;
        assert_eq!(found, Unmatched { count: 2, first: [4, 2].map(|index| Some(PointId::new(index))) });
        assert_eq!(join(&[], &[]).unmatched, Unmatched::default());
    }

    #[test]
    fn labels_of_one_object_with_two_classes_have_one_place() {
        let label = |id, class| (Label { id, class, named: 0 }, Place::of([id + i64::from(class), 0, 0]));
        let mut pairs = Tally::default();
        pairs.add([0, 1], 3);
        pairs.add([1, 0], 2);
        let found = table(pairs, &[label(8, 1), label(0, 2)], &[label(5, 2), label(5, 4)]);
        let cells: Vec<_> =
            found.cells.iter().map(|(cell, n)| (cell.segment, cell.object, cell.class, *n)).collect();
        assert_eq!(cells, [(0, 5, 2, 2), (8, 5, 4, 3)]);
        assert_eq!(
            (found.cells[1].0.predicted, found.cells[0].0.predicted),
            (Predicted::Ground, Predicted::Noise)
        );
        assert_eq!(found.objects[0].1.sum[0], 7 + 9);
        assert_eq!((found.objects.len(), found.segments.len()), (1, 1));
    }
}

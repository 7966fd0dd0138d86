//! Matching the points of both sides by coordinates and time where their orders differ, out of core.
//!
//! Both sides are sorted into buckets on disk by a 128-bit hash of the key (two different keys are taken for the same
//! with a probability below 10^-21 at 200 million points); then one bucket after the other is joined in memory.
//! Points of the same key are matched in their order of appearance. Memory: two buckets per thread; only points that
//! all have one key cannot be parted. Disk: 40 bytes per point and side.

use rayon::prelude::*;
use xxhash_rust::xxh3::xxh3_128;

use crate::error::Result;
use crate::eval::error::EvalError;
use crate::eval::order::{Pair, multiples};
use crate::eval::scratch::{Buckets, Entry, ScratchFolder};
use crate::eval::sides::{BlockReader, Files, Run, time_bits};
use crate::eval::table::{Cell, Counter, Predicted, Table};
use crate::input::{InputFile, record_xyz};

impl Pair<'_> {
    /// Counts the points of both sides, matched by coordinates and time.
    ///
    /// # Errors
    /// [`EvalError::Unmatched`] when a point has no counterpart; a block that cannot be read; a label that is none;
    /// scratch files that cannot be written.
    pub(super) fn count_by_key(&self, folder: &ScratchFolder) -> Result<Table> {
        let points = self.prediction.catalog.point_count();
        let left = Buckets::new(folder, "prediction", points);
        let right = Buckets::new(folder, "reference", points);
        let places = self.part_prediction(&left)?.merge(self.part_reference(&right)?);
        let join = |bucket| -> Result<(Table, Unmatched)> {
            Ok(join(&left.take_sorted(bucket)?, &right.take_sorted(bucket)?))
        };
        let merge = |a: (Table, Unmatched), b: (Table, Unmatched)| Ok((a.0.merge(b.0), a.1.merge(b.1)));
        let (table, unmatched) =
            (0..left.count()).into_par_iter().map(join).try_reduce(Default::default, merge)?;
        match (unmatched.count, unmatched.first) {
            (count, [Some(prediction), Some(reference)]) => Err(EvalError::Unmatched {
                unmatched: count,
                points,
                prediction: Box::new(self.prediction.site(prediction, self.with_time)?),
                reference: Box::new(self.reference.site(reference, self.with_time)?),
            }
            .into()),
            // As many points on both sides: one side alone cannot have a point too many.
            _ => Ok(table.merge(places)),
        }
    }

    fn part_prediction(&self, buckets: &Buckets<'_>) -> Result<Table> {
        let multiple = multiples(self.prediction.catalog, self.reference.catalog).0;
        self.part(&self.prediction, buckets, |run, record, index, counter| {
            let label = self.prediction.fields[run.file].read(record);
            let (id, predicted) = label.map_err(|label| self.prediction.wrong(run, index, label))?;
            let file = self.prediction.file(run);
            let at = file.transform().apply(record_xyz(record));
            // Places are means on the lattice of the reference; the finer lattice divides without a remainder
            // where the points of both sides are the same.
            let on_reference = multiples(self.prediction.catalog, self.reference.catalog);
            counter.add_segment(id, at.map(|units| units * on_reference.0 / on_reference.1));
            Ok(Entry { key: self.key(file, record, at, multiple), index, id, class: predicted as u64 })
        })
    }

    fn part_reference(&self, buckets: &Buckets<'_>) -> Result<Table> {
        let multiple = multiples(self.prediction.catalog, self.reference.catalog).1;
        self.part(&self.reference, buckets, |run, record, index, counter| {
            let label = self.reference.fields[run.file].read(record);
            let (id, class) = label.map_err(|label| self.reference.wrong(run, index, label))?;
            let file = self.reference.file(run);
            let at = file.transform().apply(record_xyz(record));
            counter.add_object(id, at);
            Ok(Entry { key: self.key(file, record, at, multiple), index, id, class: class.into() })
        })
    }

    /// Sorts one side into buckets; returns the table of its places alone.
    fn part<F: Sync>(
        &self,
        files: &Files<'_, F>,
        buckets: &Buckets<'_>,
        entry: impl Fn(&Run, &[u8], u64, &mut Counter) -> Result<Entry, EvalError> + Sync,
    ) -> Result<Table> {
        let part = |run: &Run| -> Result<Table> {
            let (mut counter, mut reader) = (Counter::default(), BlockReader::default());
            let file = files.file(run);
            let records = reader.records(file, run)?.chunks_exact(file.layout().record_len);
            let mut entries = records
                .zip(run.first..)
                .map(|(record, index)| entry(run, record, index, &mut counter))
                .collect::<Result<Vec<_>, _>>()?;
            buckets.add(&mut entries)?;
            file.release(run.block);
            Ok(counter.finish())
        };
        files.runs.par_iter().map(part).try_reduce(Table::default, |a, b| Ok(a.merge(b)))
    }

    /// Hash of what a point is recognised by: its coordinates in units of the finer lattice, and its time.
    #[expect(clippy::cast_possible_truncation, reason = "a hash is cut in two halves")]
    fn key(&self, file: &InputFile, record: &[u8], at: [i64; 3], multiple: i64) -> [u64; 2] {
        let mut bytes = [0_u8; 32];
        for (place, units) in bytes.chunks_exact_mut(8).zip(at) {
            place.copy_from_slice(&(units * multiple).to_le_bytes());
        }
        if let Some(offset) = file.layout().gps_time.filter(|_| self.with_time) {
            bytes[24..].copy_from_slice(&time_bits(record, offset).to_le_bytes());
        }
        let hash = xxh3_128(&bytes);
        [hash as u64, (hash >> 64) as u64]
    }
}

/// Points without a counterpart: how many of the prediction, and the smallest index on each side.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Unmatched {
    count: u64,
    first: [Option<u64>; 2],
}

impl Unmatched {
    fn note(&mut self, side: usize, entries: &[Entry]) {
        self.count += if side == 0 { entries.len() as u64 } else { 0 };
        if let Some(entry) = entries.first() {
            self.first[side] = smaller(self.first[side], Some(entry.index));
        }
    }

    fn merge(self, other: Self) -> Self {
        Self {
            count: self.count + other.count,
            first: [0, 1].map(|side| smaller(self.first[side], other.first[side])),
        }
    }
}

fn smaller(a: Option<u64>, b: Option<u64>) -> Option<u64> {
    a.into_iter().chain(b).min()
}

/// Joins two sorted buckets.
fn join(mut left: &[Entry], mut right: &[Entry]) -> (Table, Unmatched) {
    let (mut counter, mut unmatched) = (Counter::default(), Unmatched::default());
    while let Some(key) = left.first().into_iter().chain(right.first()).map(|entry| entry.key).min() {
        let (ours, rest) = left.split_at(run_length(left, key));
        let (theirs, their_rest) = right.split_at(run_length(right, key));
        for (predicted, referred) in ours.iter().zip(theirs) {
            counter.cells.add(cell(predicted, referred), 1);
        }
        let common = ours.len().min(theirs.len());
        unmatched.note(0, &ours[common..]);
        unmatched.note(1, &theirs[common..]);
        (left, right) = (rest, their_rest);
    }
    (counter.finish(), unmatched)
}

fn run_length(entries: &[Entry], key: [u64; 2]) -> usize {
    entries.iter().take_while(|entry| entry.key == key).count()
}

fn cell(predicted: &Entry, referred: &Entry) -> Cell {
    let codes = [Predicted::Other, Predicted::Ground, Predicted::Noise];
    let predicted_class = codes.into_iter().find(|code| *code as u64 == predicted.class).unwrap_or_default();
    Cell {
        object: referred.id,
        segment: predicted.id,
        #[expect(clippy::cast_possible_truncation, reason = "it was made from a u16")]
        class: referred.class as u16,
        predicted: predicted_class,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(key: u64, index: u64, id: i64) -> Entry {
        Entry { key: [key, 0], index, id, class: 1 }
    }

    #[test]
    fn equal_keys_are_matched_in_order_of_appearance() {
        let left = [entry(1, 4, 10), entry(2, 0, 20), entry(2, 9, 21)];
        let right = [entry(1, 0, 5), entry(2, 2, 6), entry(2, 3, 7)];
        let (table, unmatched) = join(&left, &right);
        assert_eq!(unmatched, Unmatched::default());
        let pairs: Vec<_> = table.cells.iter().map(|(cell, n)| (cell.object, cell.segment, *n)).collect();
        assert_eq!(pairs, [(5, 10, 1), (6, 20, 1), (7, 21, 1)]);
    }

    #[test]
    fn points_without_counterpart_are_found_on_both_sides() {
        // Key 1 only on the left (index 4), key 3 only on the right (index 2), key 2 once too often on the left.
        let left = [entry(1, 4, 1), entry(2, 7, 1), entry(2, 8, 1)];
        let right = [entry(2, 1, 1), entry(3, 2, 1), entry(4, 3, 1)];
        let (_, unmatched) = join(&left, &right);
        assert_eq!(unmatched, Unmatched { count: 2, first: [Some(4), Some(2)] });
        assert_eq!(join(&[], &[]).1, Unmatched::default());
    }
}

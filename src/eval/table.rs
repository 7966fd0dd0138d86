//! The sparse contingency table: the number of points of every combination of labels.
//!
//! It grows with objects and segments, not with points. While points are counted, most of it is on disk
//! (`parts.rs`). Counts and sums are integers, so that neither the order of counting nor the number of
//! threads can change them.

use std::hash::Hash;
use std::ops::AddAssign;

use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

/// What the prediction says about a point besides its segment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default, Serialize, Deserialize)]
pub enum Predicted {
    /// Neither ground nor noise.
    #[default]
    Other,
    /// Ground.
    Ground,
    /// Isolated noise.
    Noise,
}

/// One combination of labels; ids of 0 mean none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default, Serialize, Deserialize)]
pub struct Cell {
    /// Reference object.
    pub object: i64,
    /// Predicted segment.
    pub segment: i64,
    /// Reference class.
    pub class: u16,
    /// What the prediction says about the point besides its segment.
    pub predicted: Predicted,
    /// Class that the prediction gives the object of the point; 0 is none.
    pub named: u16,
}

/// Number and coordinate sums of a set of points, in lattice units.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Place {
    /// Points.
    pub points: u64,
    /// Sums of their x, y and z.
    pub sum: [i128; 3],
}

impl Place {
    /// One point.
    #[inline]
    #[must_use]
    pub fn of(at: [i64; 3]) -> Self {
        Self { points: 1, sum: at.map(i128::from) }
    }

    /// Mean position in lattice units; the origin if there is no point.
    #[must_use]
    pub fn centroid(&self) -> [f64; 3] {
        self.sum.map(|sum| if self.points == 0 { 0.0 } else { sum as f64 / self.points as f64 })
    }
}

impl AddAssign for Place {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        self.points += other.points;
        for axis in 0..3 {
            self.sum[axis] += other.sum[axis];
        }
    }
}

/// Sums per key. Scans run along surfaces, so a point mostly has the same key as the previous point. A run of
/// equal keys is summed outside the map.
#[derive(Debug)]
pub struct Tally<K, V> {
    sums: FxHashMap<K, V>,
    run: Option<(K, V)>,
}

impl<K, V> Default for Tally<K, V> {
    fn default() -> Self {
        Self { sums: FxHashMap::default(), run: None }
    }
}

impl<K: Copy + Ord + Hash, V: Default + AddAssign> Tally<K, V> {
    /// Adds `value` to the sum of `key`.
    #[inline]
    pub fn add(&mut self, key: K, value: V) {
        match &mut self.run {
            Some((current, sum)) if *current == key => *sum += value,
            _ => {
                self.close_run();
                self.run = Some((key, value));
            }
        }
    }

    fn close_run(&mut self) {
        if let Some((key, sum)) = self.run.take() {
            *self.sums.entry(key).or_default() += sum;
        }
    }

    /// The sums in the order of their keys.
    #[must_use]
    pub fn into_sorted(mut self) -> Vec<(K, V)> {
        self.close_run();
        let mut sorted: Vec<(K, V)> = self.sums.into_iter().collect();
        sorted.sort_unstable_by_key(|entry| entry.0);
        sorted
    }
}

/// Sorts entries and adds up those with the same key.
fn add_up<K: Copy + Ord, V: Copy + AddAssign>(entries: &mut Vec<(K, V)>) {
    entries.sort_unstable_by_key(|entry| entry.0);
    entries.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        if same {
            kept.1 += next.1;
        }
        same
    });
    entries.shrink_to_fit();
}

/// Counts points into a [`Table`].
#[derive(Debug, Default)]
pub struct Counter {
    /// Points per combination of labels.
    pub cells: Tally<Cell, u64>,
    /// Where the reference objects are.
    pub objects: Tally<i64, Place>,
    /// Where the predicted segments are.
    pub segments: Tally<i64, Place>,
}

impl Counter {
    /// Counts one point with both its labels, at a lattice position.
    #[inline]
    pub fn add(&mut self, cell: Cell, at: [i64; 3]) {
        self.cells.add(cell, 1);
        self.add_object(cell.object, at);
        self.add_segment(cell.segment, at);
    }

    /// Notes the position of a point of a reference object (0: no object).
    #[inline]
    pub fn add_object(&mut self, object: i64, at: [i64; 3]) {
        if object > 0 {
            self.objects.add(object, Place::of(at));
        }
    }

    /// Notes the position of a point of a predicted segment (0: no segment).
    #[inline]
    pub fn add_segment(&mut self, segment: i64, at: [i64; 3]) {
        if segment > 0 {
            self.segments.add(segment, Place::of(at));
        }
    }

    /// The table of what was counted.
    #[must_use]
    pub fn finish(self) -> Table {
        Table {
            cells: self.cells.into_sorted(),
            objects: self.objects.into_sorted(),
            segments: self.segments.into_sorted(),
        }
    }
}

/// The sparse contingency table of a drive, sorted.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Table {
    /// Points per combination of labels.
    pub cells: Vec<(Cell, u64)>,
    /// Where the reference objects are, by id.
    pub objects: Vec<(i64, Place)>,
    /// Where the predicted segments are, by id.
    pub segments: Vec<(i64, Place)>,
}

impl Table {
    /// Appends the entries of another part. The table is valid again after [`Table::add_up`].
    pub(super) fn append(&mut self, mut other: Self) {
        self.cells.append(&mut other.cells);
        self.objects.append(&mut other.objects);
        self.segments.append(&mut other.segments);
    }

    /// Sorts the entries and adds up those with the same labels.
    pub(super) fn add_up(&mut self) {
        add_up(&mut self.cells);
        add_up(&mut self.objects);
        add_up(&mut self.segments);
    }

    /// Entries in all.
    pub(super) fn len(&self) -> usize {
        self.cells.len() + self.objects.len() + self.segments.len()
    }

    /// Points in all.
    #[must_use]
    pub fn points(&self) -> u64 {
        self.cells.iter().map(|cell| cell.1).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(points: &[(i64, i64)]) -> Table {
        let mut counter = Counter::default();
        for &(object, segment) in points {
            counter.add(Cell { object, segment, ..Cell::default() }, [object, segment, 1]);
        }
        counter.finish()
    }

    #[test]
    fn counting_in_parts_gives_the_table_of_the_whole() {
        let points = [(1, 5), (1, 5), (2, 5), (1, 5), (0, 7), (2, 0), (2, 5), (1, 9)];
        let whole = count(&points);
        for cut in 0..=points.len() {
            let (head, tail) = points.split_at(cut);
            for (first, second) in [(head, tail), (tail, head)] {
                let mut table = count(first);
                table.append(count(second));
                table.add_up();
                assert_eq!(table, whole);
            }
        }
        let of_1_and_5 = Cell { object: 1, segment: 5, ..Cell::default() };
        assert!(whole.cells.contains(&(of_1_and_5, 3)));
        assert_eq!(whole.points(), 8);
    }

    #[test]
    fn places_are_means_and_leave_out_the_points_of_none() {
        let table = count(&[(2, 4), (2, 8), (0, 8)]);
        assert_eq!(table.objects.len(), 1);
        assert_eq!(table.objects[0].1.centroid().map(f64::to_bits), [2.0, 6.0, 1.0].map(f64::to_bits));
        assert_eq!(table.segments[1].1.centroid().map(f64::to_bits), [1.0, 8.0, 1.0].map(f64::to_bits));
    }
}

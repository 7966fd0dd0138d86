//! The sparse contingency table: how many points every combination of labels has. Not: what that means.
//!
//! It is the only thing that grows with the drive, and it grows with objects and segments, not with points.
//! Counts and sums are integers, so that no order of counting and no number of threads can change them.

use std::hash::Hash;
use std::ops::AddAssign;

use rustc_hash::FxHashMap;

/// What the prediction says about a point besides its segment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct Cell {
    /// Reference object.
    pub object: i64,
    /// Predicted segment.
    pub segment: i64,
    /// Reference class.
    pub class: u16,
    /// Predicted class.
    pub predicted: Predicted,
}

/// Number and coordinate sums of a set of points, in lattice units.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
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

    /// Mean position in lattice units; the origin where there is no point.
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

/// Sums per key. Scans run along surfaces, so the key of a point is mostly that of the point before: a run is
/// summed outside the map.
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

/// Joins two sorted tallies; sums of equal keys are added.
fn merge_sorted<K: Copy + Ord, V: AddAssign>(left: Vec<(K, V)>, right: Vec<(K, V)>) -> Vec<(K, V)> {
    if left.is_empty() {
        return right;
    }
    let mut merged: Vec<(K, V)> = Vec::with_capacity(left.len() + right.len());
    let (mut left, mut right) = (left.into_iter().peekable(), right.into_iter().peekable());
    while let Some(next) = match (left.peek(), right.peek()) {
        (Some(a), Some(b)) if b.0 < a.0 => right.next(),
        (None, _) => right.next(),
        _ => left.next(),
    } {
        match merged.last_mut() {
            Some(last) if last.0 == next.0 => last.1 += next.1,
            _ => merged.push(next),
        }
    }
    merged.shrink_to_fit();
    merged
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

    /// Notes the position of a point of a reference object (0: of none).
    #[inline]
    pub fn add_object(&mut self, object: i64, at: [i64; 3]) {
        if object > 0 {
            self.objects.add(object, Place::of(at));
        }
    }

    /// Notes the position of a point of a predicted segment (0: of none).
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
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Table {
    /// Points per combination of labels.
    pub cells: Vec<(Cell, u64)>,
    /// Where the reference objects are, by id.
    pub objects: Vec<(i64, Place)>,
    /// Where the predicted segments are, by id.
    pub segments: Vec<(i64, Place)>,
}

impl Table {
    /// The table of both parts together.
    #[must_use]
    pub fn merge(self, other: Self) -> Self {
        Self {
            cells: merge_sorted(self.cells, other.cells),
            objects: merge_sorted(self.objects, other.objects),
            segments: merge_sorted(self.segments, other.segments),
        }
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
            assert_eq!(count(head).merge(count(tail)), whole);
            assert_eq!(count(tail).merge(count(head)), whole);
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

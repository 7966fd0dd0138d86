//! The labels of one side by number, and where their points are. Which point has which label is not known
//! here.

use std::sync::{Mutex, PoisonError};

use rustc_hash::FxHashMap;

use crate::eval::table::Place;

/// The label that one side gives a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub(super) struct Label {
    /// Object or segment; 0 is none.
    pub(super) id: i64,
    /// In the reference: class. In the prediction: code of ground, noise or neither.
    pub(super) class: u16,
    /// In the prediction: class of the object; 0 is none.
    pub(super) named: u16,
}

impl Label {
    /// The label of a withheld point. No other label has this class in the prediction, or this class of the
    /// object in the reference.
    pub(super) const WITHHELD: Self = Self { id: 0, class: u16::MAX, named: u16::MAX };
}

/// Numbers of labels, from 0, shared by all threads. Which label gets which number depends on the threads.
#[derive(Debug, Default)]
pub(super) struct Numbers(Mutex<FxHashMap<Label, u32>>);

impl Numbers {
    #[expect(clippy::cast_possible_truncation, reason = "memory does not hold 2^32 labels")]
    fn of(&self, label: Label) -> u32 {
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let next = known.len() as u32;
        *known.entry(label).or_insert(next)
    }

    /// The labels by number.
    pub(super) fn into_labels(self) -> Vec<Label> {
        let mut known: Vec<_> =
            self.0.into_inner().unwrap_or_else(PoisonError::into_inner).into_iter().collect();
        known.sort_unstable_by_key(|entry| entry.1);
        known.into_iter().map(|entry| entry.0).collect()
    }
}

/// The labels that one thread has read.
#[derive(Debug)]
pub(super) struct Met<'a> {
    numbers: &'a Numbers,
    known: FxHashMap<Label, u32>,
    last: Option<(Label, u32)>,
    /// By number.
    places: Vec<Place>,
}

impl<'a> Met<'a> {
    pub(super) fn new(numbers: &'a Numbers) -> Self {
        Self { numbers, known: FxHashMap::default(), last: None, places: Vec::new() }
    }

    /// Notes a point with its label at a lattice position; returns the number of the label.
    #[inline]
    pub(super) fn add(&mut self, label: Label, at: [i64; 3]) -> u32 {
        let number = match self.last {
            Some((last, number)) if last == label => number,
            _ => self.number(label),
        };
        if label.id > 0 {
            self.places[number as usize] += Place::of(at);
        }
        number
    }

    fn number(&mut self, label: Label) -> u32 {
        let numbers = self.numbers;
        let number = *self.known.entry(label).or_insert_with(|| numbers.of(label));
        if self.places.len() <= number as usize {
            self.places.resize(number as usize + 1, Place::default());
        }
        self.last = Some((label, number));
        number
    }

    /// Where the points of the labels are, by number.
    pub(super) fn into_places(self) -> Vec<Place> {
        self.places
    }
}

/// Merges the places of two threads.
pub(super) fn join_places(mut left: Vec<Place>, mut right: Vec<Place>) -> Vec<Place> {
    if left.len() < right.len() {
        std::mem::swap(&mut left, &mut right);
    }
    left.iter_mut().zip(right).for_each(|(sum, place)| *sum += place);
    left
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threads_agree_on_numbers_and_their_places_add_up() {
        let numbers = Numbers::default();
        let label = |id: i64| Label { id, class: 2, named: 0 };
        let mut one = Met::new(&numbers);
        let mut other = Met::new(&numbers);
        assert_eq!(
            [one.add(label(7), [1; 3]), one.add(label(7), [2; 3]), one.add(label(0), [9; 3])],
            [0, 0, 1]
        );
        assert_eq!([other.add(label(5), [4; 3]), other.add(label(7), [6; 3])], [2, 0]);
        let places = join_places(one.into_places(), other.into_places());
        assert_eq!(
            places.iter().map(|place| (place.points, place.sum[0])).collect::<Vec<_>>(),
            [
                (3, 9),
                (0, 0), // of no object
                (1, 4),
            ]
        );
        assert_eq!(numbers.into_labels(), [label(7), label(0), label(5)]);
    }
}

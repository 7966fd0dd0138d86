//! How an object relates to the others: which objects it touches, and which stand in the same place.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::inventory::measures::BUILDING;
use crate::inventory::object::Object;

/// Place and class of an object, by which it is recognised in other runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Place {
    /// Class of the object.
    pub(super) class: u8,
    /// Where the object stands, in steps of 0.1 m. For a building, the mean of its points: its front depends
    /// on the axis, and an axis that is found from the points depends on the other files.
    pub(super) decimetres: [i64; 2],
    /// Orders the objects in one place. Follows from their points alone: lowest corner, highest corner,
    /// number of points.
    order: ([i64; 3], [i64; 3], u64),
}

impl Place {
    /// The place of an object.
    #[must_use]
    pub fn of(object: &Object<'_>) -> Self {
        let place = match object.kind.class {
            BUILDING => [0, 1].map(|axis| object.site.lattice.metres(object.centre[axis])),
            _ => object.foot.place,
        };
        #[expect(clippy::cast_possible_truncation, reason = "lattice coordinates are below 2^50")]
        let decimetres = place.map(|metres| (metres * 10.0).round() as i64);
        let part = object.part;
        Self { class: object.kind.class, decimetres, order: (part.lo, part.hi, part.points) }
    }
}

/// How all objects of a drive relate to each other.
#[derive(Debug, Default)]
pub struct Among {
    /// Number of an object among those in its place, from 1. The first of a place is left out.
    twins: BTreeMap<u32, u32>,
    /// Pairs of objects that touch each other, in both orders, ascending.
    touching: Vec<(u32, u32)>,
}

impl Among {
    /// Objects 1, 2, ... at these places, and pairs of objects that touch each other, in any order.
    #[must_use]
    pub fn new(places: &[Place], pairs: impl IntoIterator<Item = (u32, u32)>) -> Self {
        let mut sorted: Vec<(Place, u32)> = places.iter().copied().zip(1..).collect();
        sorted.sort_unstable();
        let mut twins = BTreeMap::new();
        for group in sorted.chunk_by(|(a, _), (b, _)| (a.class, a.decimetres) == (b.class, b.decimetres)) {
            twins.extend(group.iter().zip(1..).skip(1).map(|((_, id), number)| (*id, number)));
        }
        let mut touching: Vec<(u32, u32)> = pairs.into_iter().flat_map(|(a, b)| [(a, b), (b, a)]).collect();
        touching.sort_unstable();
        touching.dedup();
        Self { twins, touching }
    }

    /// Number of an object among those in its place, from 1.
    pub(super) fn number(&self, id: u32) -> u32 {
        self.twins.get(&id).copied().unwrap_or(1)
    }

    /// The objects that an object touches, ascending.
    pub(super) fn touched(&self, id: u32) -> impl Iterator<Item = u32> {
        let first = self.touching.partition_point(|pair| pair.0 < id);
        self.touching[first..].iter().take_while(move |pair| pair.0 == id).map(|pair| pair.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_in_one_place_are_numbered_by_their_points_and_not_by_their_ids() {
        let place = |class, x, low| Place { class, decimetres: [x, 5], order: ([low, 0, 0], [9; 3], 3) };
        let places = [place(2, 7, 40), place(3, 7, 10), place(2, 7, 30), place(2, 7, 50), place(2, 8, 0)];
        let among = Among::new(&places, []);
        assert_eq!([1, 2, 3, 4, 5].map(|id| among.number(id)), [2, 1, 1, 3, 1]);
    }

    #[test]
    fn touching_goes_both_ways() {
        let among = Among::new(&[], [(1, 2), (2, 1), (2, 9), (1, 2)]);
        let touched = |id| among.touched(id).collect::<Vec<_>>();
        assert_eq!([touched(1), touched(2), touched(9), touched(3)], [vec![2], vec![1, 9], vec![2], vec![]]);
    }
}

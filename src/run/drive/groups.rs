//! Where the points of each group are in the section of a unit that holds its points grouped.

use std::ops::Range;

use serde::{Deserialize, Serialize};

/// The position of each group in a unit: (group, first point), ascending, and the end.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct Groups<K> {
    first: Vec<(K, u64)>,
    end: u64,
}

impl<K: Copy + Ord> Groups<K> {
    /// The groups of points in their order. Points of a group follow each other.
    pub(crate) fn of(points: impl IntoIterator<Item = K>) -> Self {
        let (mut first, mut end) = (Vec::new(), 0);
        for (at, group) in (0_u64..).zip(points) {
            if first.last().is_none_or(|(last, _)| *last != group) {
                first.push((group, at));
            }
            end = at + 1;
        }
        Self { first, end }
    }

    /// The bytes of the points of a group, of `stride` bytes each. Empty if it has none.
    pub(crate) fn bytes(&self, group: K, stride: usize) -> Range<u64> {
        let Ok(at) = self.first.binary_search_by_key(&group, |first| first.0) else { return 0..0 };
        let end = self.first.get(at + 1).map_or(self.end, |next| next.1);
        self.first[at].1 * stride as u64..end * stride as u64
    }

    /// The groups, and the number of points of each.
    pub(crate) fn counts(&self) -> impl Iterator<Item = (K, u64)> {
        let ends = self.first.iter().skip(1).map(|(_, at)| *at).chain([self.end]);
        self.first.iter().zip(ends).map(|((group, at), end)| (*group, end - at))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_group_has_the_bytes_of_its_points() {
        let groups = Groups::of([2, 2, 5, 7, 7, 7]);
        assert_eq!(groups.bytes(2, 10), 0..20);
        assert_eq!(groups.bytes(5, 10), 20..30);
        assert_eq!(groups.bytes(7, 10), 30..60);
        assert_eq!(groups.counts().collect::<Vec<_>>(), [(2, 2), (5, 1), (7, 3)]);
        assert_eq!(Groups::<u32>::of([]).counts().count(), 0);
        assert!(groups.bytes(3, 10).is_empty() && Groups::of([]).bytes(3, 10).is_empty());
    }
}

//! The nearest place in the plane. Only this file uses the kd-tree crate for positions in metres.

use kiddo::{ImmutableKdTree, SquaredEuclidean};

/// An index over places in the plane, in metres.
#[derive(Debug)]
pub struct NearestIndex {
    tree: Option<ImmutableKdTree<f64, 2>>,
}

impl NearestIndex {
    /// Indexes `places`; an item is a position in the slice.
    #[must_use]
    pub fn new(places: &[[f64; 2]]) -> Self {
        // Construction fails only if u32 cannot count the items. The index then finds nothing, which is
        // noticed.
        let tree = if places.is_empty() { None } else { ImmutableKdTree::new_from_slice(places).ok() };
        Self { tree }
    }

    /// Approximate memory in bytes: places and their numbers.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let entry = size_of::<[f64; 2]>() + size_of::<u32>();
        self.tree.as_ref().map_or(0, |tree| (tree.size() * entry) as u64)
    }

    /// The place nearest to `query`. Among equally near ones, the first of the slice.
    #[must_use]
    pub fn nearest(&self, query: [f64; 2]) -> Option<usize> {
        let tree = self.tree.as_ref()?;
        let best = tree.query(&query).nearest_one::<SquaredEuclidean<f64>>().execute();
        let ties = tree.query(&query).within::<SquaredEuclidean<f64>>(best.distance).unsorted().execute();
        let item = ties.iter().map(|tie| tie.item).min().unwrap_or(best.item);
        Some(item as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_of_equally_near_places_wins() {
        let index = NearestIndex::new(&[[4.0, 0.0], [0.0, 2.0], [2.0, 0.0], [0.0, 2.0]]);
        assert_eq!(index.nearest([0.0, 0.0]), Some(1));
        assert_eq!(index.nearest([3.5, 0.0]), Some(0));
        assert_eq!(NearestIndex::new(&[]).nearest([0.0, 0.0]), None);
    }
}

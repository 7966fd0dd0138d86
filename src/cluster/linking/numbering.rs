//! From sets of points to numbered clusters.

use std::ops::RangeInclusive;

use crate::model::PointId;

/// Numbers the clusters of points 1, 2, ... by their smallest row. `name[i]` is any number that is the same
/// for all points of a cluster, `None` for noise. Clusters whose size is not in `size` become noise. Returns
/// the labels (0: noise) and the number of clusters.
pub(crate) fn number(names: &[Option<u32>], size: &RangeInclusive<u64>) -> (Vec<u32>, u32) {
    let slots = names.iter().flatten().max().map_or(0, |&name| name as usize + 1);
    let mut points = vec![0_u64; slots];
    names.iter().flatten().for_each(|&name| points[name as usize] += 1);
    let mut label_of = vec![0_u32; slots];
    let mut clusters = 0;
    let label = |name: &Option<u32>| {
        let Some(name) = name.map(|name| name as usize).filter(|&name| size.contains(&points[name])) else {
            return 0;
        };
        if label_of[name] == 0 {
            clusters += 1;
            label_of[name] = clusters;
        }
        label_of[name]
    };
    let labels = names.iter().map(label).collect();
    (labels, clusters)
}

/// The same for clusters of any size, in the order of the smallest of the `ids` of their points.
pub(crate) fn number_by_id(names: &[Option<u32>], ids: &[PointId]) -> (Vec<u32>, u32) {
    let slots = names.iter().flatten().max().map_or(0, |&name| name as usize + 1);
    let mut smallest = vec![PointId::BEYOND_ALL; slots];
    for (name, &id) in names.iter().zip(ids) {
        if let Some(name) = *name {
            smallest[name as usize] = smallest[name as usize].min(id);
        }
    }
    let (label_of, clusters) = number_sets(smallest);
    (names.iter().map(|name| name.map_or(0, |name| label_of[name as usize])).collect(), clusters)
}

/// Numbers sets of points 1, 2, ... in the order of the smallest ids of their points, so that the order of
/// the points does not matter. Sets without points have [`PointId::BEYOND_ALL`], and get 0. Returns the label
/// of each set, and the number of labels.
pub(crate) fn number_sets(smallest: Vec<PointId>) -> (Vec<u32>, u32) {
    let mut labels = vec![0_u32; smallest.len()];
    let mut order: Vec<(PointId, usize)> =
        smallest.into_iter().zip(0..).filter(|(id, _)| *id != PointId::BEYOND_ALL).collect();
    order.sort_unstable();
    let mut count = 0;
    for (_, set) in order {
        count += 1;
        labels[set] = count;
    }
    (labels, count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clusters_are_numbered_by_their_first_row_and_sizes_decide() {
        let names = [None, Some(7), Some(2), Some(7), Some(5), Some(2), Some(7)];
        assert_eq!(number(&names, &(1..=u64::MAX)), (vec![0, 1, 2, 1, 3, 2, 1], 3));
        assert_eq!(number(&names, &(2..=2)), (vec![0, 0, 1, 0, 0, 1, 0], 1));
        assert_eq!(number(&[], &(1..=9)), (vec![], 0));
        assert_eq!(
            number_by_id(&names, &[9, 8, 7, 6, 5, 4, 3].map(PointId::new)),
            (vec![0, 1, 2, 1, 3, 2, 1], 3)
        );
        assert_eq!(
            number_by_id(&names, &[9, 8, 7, 6, 1, 4, 9].map(PointId::new)),
            (vec![0, 3, 2, 3, 1, 2, 3], 3)
        );
    }
}

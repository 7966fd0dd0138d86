//! Adjusted Rand index (Hubert and Arabie 1985, doi:10.1007/BF01908075) over the points of evaluated objects.
//!
//! Points without a segment count as one group, as in every implementation that receives the label 0 for
//! them. The four pair counts are exact integers. The formula, and its result 1 for a single group, are those
//! of scikit-learn's `adjusted_rand_score`.

use std::collections::BTreeMap;

use crate::eval::metrics::overlaps::{Object, Scene};

/// The index over the points of the objects that `counts` accepts; `None` if there is no such point.
#[must_use]
pub fn adjusted_rand_index(scene: &Scene, counts: impl Fn(&Object) -> bool) -> Option<f64> {
    let mut sums = PairSums::default();
    let mut columns: BTreeMap<usize, u64> = BTreeMap::new();
    let mut unassigned = 0;
    for object in scene.objects.iter().filter(|object| counts(object)) {
        sums.points += i128::from(object.points);
        sums.rows += square(object.points);
        sums.cells += square(object.unassigned);
        unassigned += object.unassigned;
        for overlap in object.overlaps.iter() {
            sums.cells += square(overlap.points);
            *columns.entry(overlap.index).or_default() += overlap.points;
        }
    }
    sums.columns = square(unassigned) + columns.into_values().map(square).sum::<i128>();
    (sums.points > 0).then(|| sums.index())
}

fn square(points: u64) -> i128 {
    let points = i128::from(points);
    points * points
}

/// Largest number of points whose products of pairs fit an i128. With more, the products are rounded.
const MOST_EXACT: i128 = 3_000_000_000;

/// Sums of squares over the cells, rows and columns of a contingency table.
#[derive(Debug, Default)]
struct PairSums {
    points: i128,
    cells: i128,
    rows: i128,
    columns: i128,
}

impl PairSums {
    /// Ordered pairs of points that are together in both (tp), in the segments only (fp), in the objects only
    /// (fn), in neither (tn). Every sum below stays under 2 n^4.
    fn index(&self) -> f64 {
        let tp = self.cells - self.points;
        let fp = self.columns - self.cells;
        let fn_ = self.rows - self.cells;
        let tn = self.points * self.points - self.rows - self.columns + self.cells;
        if fp == 0 && fn_ == 0 {
            return 1.0;
        }
        if self.points > MOST_EXACT {
            let [tp, fp, fn_, tn] = [tp, fp, fn_, tn].map(|pairs| pairs as f64);
            return 2.0 * (tp * tn - fn_ * fp) / ((tp + fn_) * (fn_ + tn) + (tp + fp) * (fp + tn));
        }
        let numerator = 2 * (tp * tn - fn_ * fp);
        let denominator = (tp + fn_) * (fn_ + tn) + (tp + fp) * (fp + tn);
        numerator as f64 / denominator as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eval::metrics::overlaps::tests::scene_of;

    fn index(parts: &[(i64, i64, u64)]) -> Option<f64> {
        adjusted_rand_index(&scene_of(parts, |_| 2), |_| true)
    }

    #[test]
    fn billions_of_points_have_the_index_of_thousands() {
        // Objects of 40 and 40 points, segments of 50 and 30, cells of 40, 10 and 30 points.
        let of = |times: u64| {
            let sums = |sizes: &[u64]| sizes.iter().map(|size| square(size * times)).sum();
            let points = i128::from(80 * times);
            let [cells, rows, columns] = [sums(&[40, 10, 30]), sums(&[40, 40]), sums(&[50, 30])];
            PairSums { points, cells, rows, columns }.index()
        };
        let (few, most, many) = (of(1_000), of(37_000_000), of(1_000_000_000));
        assert!((few - most).abs() < 1e-4 && (most - many).abs() < 1e-7, "{few} {most} {many}");
    }

    #[test]
    fn hand_made_cases() {
        assert_eq!(index(&[(1, 2, 50), (2, 1, 50)]), Some(1.0), "swapped names");
        assert_eq!(index(&[(1, 1, 50), (2, 1, 50)]), Some(0.0), "merged");
        assert_eq!(index(&[(1, 0, 50), (2, 0, 50)]), Some(0.0), "empty");
        assert_eq!(index(&[(0, 1, 50)]), None, "no object");
        assert_eq!(index(&[(1, 1, 50), (0, 1, 50)]), Some(1.0), "only points of objects count");
        // Two objects of 40 points; a segment of 50 with 40 + 10 of them, and one of 30. Unordered pairs: tp
        // = 780 + 45 + 435 = 1260, rows 1560, columns 1225 + 435 = 1660, all 3160. Expected e = 1560 * 1660 /
        // 3160; the index is (1260 - e) / (1610 - e).
        let expected = 1560.0 * 1660.0 / 3160.0;
        let by_hand = (1260.0 - expected) / (1610.0 - expected);
        let found = index(&[(1, 1, 40), (2, 1, 10), (2, 2, 30)]).unwrap();
        assert!((found - by_hand).abs() < 1e-12, "{found} {by_hand}");
    }
}

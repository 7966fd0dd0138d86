//! The lowest value within a horizontal radius of every column. The noise filter and ground filters use it.
#![expect(clippy::cast_possible_truncation, reason = "indices of columns fit u32, see VoxelIndex")]

use crate::spatial::VoxelIndex;

/// Means "this column has none". Above every k.
pub(super) const NONE: u32 = u32::MAX;

/// For every column of `index`, the smallest of the `lows` of the columns whose centres are within
/// `radius_units` (inclusive), itself included. `lows` has one k, or [`NONE`], per column.
///
/// A sliding minimum along each pair of rows: O(columns * radius / edge), whatever the shape of the scan.
pub(super) fn lowest_within(index: &VoxelIndex, radius_units: i64, lows: &[u32]) -> Vec<u32> {
    let edge = i64::from(index.grid().edge);
    // (di^2 + dj^2) edge^2 <= radius^2, in whole numbers: di^2 + dj^2 <= floor(radius^2 / edge^2).
    let limit = radius_units.pow(2) / edge.pow(2);
    let rows = limit.isqrt();
    let j = |column: u32| i64::from(index.columns()[column as usize][1]);
    let mut lowest = vec![NONE; lows.len()];
    // Columns of the other row that can still be a minimum: j ascending, k ascending.
    let mut window: Vec<u32> = Vec::new();
    for di in -rows..=rows {
        let half_width = (limit - di * di).isqrt();
        index.row_pairs(di, |row, other_row| {
            window.clear();
            let (mut head, mut next) = (0, other_row.start as u32);
            for column in row.start as u32..row.end as u32 {
                let here = j(column);
                while next < other_row.end as u32 && j(next) <= here + half_width {
                    let low = lows[next as usize];
                    while window.len() > head && lows[window[window.len() - 1] as usize] >= low {
                        window.pop();
                    }
                    if low != NONE {
                        window.push(next);
                    }
                    next += 1;
                }
                while head < window.len() && j(window[head]) < here - half_width {
                    head += 1;
                }
                if let Some(&best) = window.get(head) {
                    let slot = &mut lowest[column as usize];
                    *slot = lows[best as usize].min(*slot);
                }
            }
        });
    }
    lowest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Lattice, TileCloud};

    #[test]
    fn the_radius_is_inclusive_and_round() {
        // Columns at (0, 0), (3, 4), (4, 4), (0, 5), (0, 6) of edge 10, with these lows.
        let points = [[0, 0, 0], [0, 50, 0], [0, 60, 0], [30, 40, 0], [40, 40, 0]];
        let lows = [9, 5, 1, 4, 3];
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, &points);
        let index = VoxelIndex::build("test", &cloud, 10).unwrap();
        assert_eq!(index.columns(), [[0, 0], [0, 5], [0, 6], [3, 4], [4, 4]]);
        // Radius 50: (0, 5) and (3, 4) are exactly 5 columns from (0, 0), (4, 4) and (0, 6) are further; (0,
        // 6) is sqrt(13) from (3, 4) and sqrt(20) from (4, 4).
        assert_eq!(lowest_within(&index, 50, &lows), [4, 1, 1, 1, 1]);
        assert_eq!(lowest_within(&index, 49, &lows), [9, 1, 1, 1, 1]);
        // Radius 10: only neighbours along an axis.
        assert_eq!(lowest_within(&index, 10, &lows), [9, 1, 1, 3, 3]);
        assert_eq!(lowest_within(&index, 0, &lows), lows);
        assert_eq!(lowest_within(&index, 10, &[9, NONE, 1, NONE, NONE]), [9, 1, 1, NONE, NONE]);
    }

    #[test]
    fn the_sliding_minimum_forgets_what_it_has_passed() {
        let points: Vec<[i64; 3]> = (0..7).map(|j| [0, j, 0]).collect();
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, &points);
        let index = VoxelIndex::build("test", &cloud, 1).unwrap();
        assert_eq!(lowest_within(&index, 1, &[1, 5, 4, 3, 9, 9, 7]), [1, 1, 3, 3, 3, 7, 7]);
    }
}

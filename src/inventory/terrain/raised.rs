//! Raised cells of the terrain: small patches above the ground around them, where the ground was not seen.
//!
//! Behind a parked car or a hedge, the lowest points lie on the car, the hedge or a floor. They are flat, and
//! no ground was seen below them, so every filter classifies some of them as ground. Heights of objects
//! beside them would be too small.
//!
//! Cells that touch and differ by less than a step are a patch. A patch is raised if it is short, and if
//! there is a step down in most pairs of one of its cells and a nearby cell of another patch.
//!
//! Chosen on nine labelled scenes and drives of `synth`, in which 3,500 cells are more than 0.2 m wrong. The
//! rule finds 1,580 of them, and calls 42 other cells raised. It cannot tell a short terrace from a hedge. On
//! the real street `kitti_street_22`, which has such gardens, it finds 72 of 129, and calls 116 others
//! raised.
//!
//! Each cell is decided from its own patch, without sets over the whole drive. So only the short patches need
//! memory in addition to the heights.

use rustc_hash::FxHashMap;

use crate::spatial::{Cell, PackedCells, PackedCursor};

/// Largest extent of a raised patch along x and y, in cells: the strip behind two parked cars.
const LONGEST: i32 = 9;
/// Largest distance of the surroundings of a patch from it, in cells.
const AROUND: i32 = 2;

/// The cells without those that are raised. Values and `step` are in lattice units.
pub(super) fn without_raised(heights: &PackedCells, step: u32) -> PackedCells {
    let mut search = Search { heights: heights.cursor(), step, known: FxHashMap::default() };
    heights.map(|cell, height| if search.is_raised(cell, height) { 0 } else { height })
}

struct Search<'a> {
    heights: PackedCursor<'a>,
    step: u32,
    /// Whether each cell is raised, for the cells of the short patches that have been examined.
    known: FxHashMap<Cell, bool>,
}

impl Search<'_> {
    fn is_raised(&mut self, cell: Cell, height: u32) -> bool {
        // Most ground is long along an axis.
        if [[1, 0], [0, 1]].into_iter().any(|way| self.is_long(cell, height, way)) {
            return false;
        }
        if let Some(&raised) = self.known.get(&cell) {
            return raised;
        }
        let Some(patch) = self.short_patch(cell, height) else { return false };
        let raised = self.is_above_its_surroundings(&patch);
        self.known.extend(patch.into_iter().map(|(cell, _)| (cell, raised)));
        raised
    }

    /// Whether more than [`LONGEST`] cells in a row through this cell belong to its patch.
    fn is_long(&mut self, cell: Cell, height: u32, [di, dj]: [i32; 2]) -> bool {
        let mut run = 1;
        for sign in [-1, 1] {
            let (mut at, mut here) = (cell, height);
            loop {
                at = [at[0] + sign * di, at[1] + sign * dj];
                let next = self.heights.get(at);
                if next == 0 || next.abs_diff(here) >= self.step {
                    break;
                }
                run += 1;
                if run > LONGEST {
                    return true;
                }
                here = next;
            }
        }
        false
    }

    /// The cells of the patch of a cell with their heights. `None` if the patch is too long.
    fn short_patch(&mut self, cell: Cell, height: u32) -> Option<Vec<(Cell, u32)>> {
        let mut patch = vec![(cell, height)];
        let mut ends = [cell, cell];
        let mut next = 0;
        while let Some(&(at, height)) = patch.get(next) {
            next += 1;
            for beside in square(at, 1) {
                let other = self.heights.get(beside);
                let is_new = || !patch.iter().any(|(known, _)| *known == beside);
                if other > 0 && other.abs_diff(height) < self.step && is_new() {
                    patch.push((beside, other));
                    for axis in [0, 1] {
                        ends[0][axis] = ends[0][axis].min(beside[axis]);
                        ends[1][axis] = ends[1][axis].max(beside[axis]);
                        if ends[1][axis] - ends[0][axis] >= LONGEST {
                            return None;
                        }
                    }
                }
            }
        }
        Some(patch)
    }

    fn is_above_its_surroundings(&mut self, patch: &[(Cell, u32)]) -> bool {
        let (mut pairs, mut down) = (0, 0);
        for &(cell, height) in patch {
            for beside in square(cell, AROUND) {
                let other = self.heights.get(beside);
                if other > 0 && !patch.iter().any(|(known, _)| *known == beside) {
                    pairs += 1;
                    down += u32::from(height > other + self.step);
                }
            }
        }
        2 * down > pairs
    }
}

/// The cells up to `reach` away from a cell along both axes, itself included.
fn square(cell: Cell, reach: i32) -> impl Iterator<Item = Cell> {
    (-reach..=reach).flat_map(move |di| (-reach..=reach).map(move |dj| [cell[0] + di, cell[1] + dj]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spatial::CellMap;

    /// The raised cells of a field of 30 x 30 cells; `height` gives the height of each cell.
    fn raised(height: impl Fn(i32, i32) -> Option<u32>) -> Vec<Cell> {
        let mut map = CellMap::<u32>::default();
        let cells = || (0..30).flat_map(|i| (0..30).map(move |j| [i, j]));
        cells()
            .filter_map(|[i, j]| Some(([i, j], height(i, j)?)))
            .for_each(|(cell, height)| *map.entry(cell) = height);
        let all = PackedCells::from(map);
        let kept = without_raised(&all, 250);
        assert!(kept.iter().all(|(cell, height)| all.get(cell) == height));
        cells().filter(|&cell| all.get(cell) > 0 && kept.get(cell) == 0).collect()
    }

    fn is_within(i: i32, j: i32, length: i32) -> bool {
        (10..10 + length).contains(&i) && (10..13).contains(&j)
    }

    #[test]
    fn a_short_patch_above_the_ground_around_it_is_raised() {
        // Level ground, and ground that falls by a fifth.
        for fall in [0, 200] {
            let ground = |i: i32| 20_000 - fall * i.unsigned_abs();
            let patch = |length: i32| {
                move |i: i32, j: i32| Some(ground(i) + if is_within(i, j, length) { 600 } else { 0 })
            };
            assert_eq!(raised(patch(9)).len(), 27, "{fall}");
            assert_eq!(raised(patch(10)), [[0; 2]; 0], "{fall}: it is long");
        }
    }

    #[test]
    fn ground_is_not_raised() {
        assert_eq!(raised(|_, _| Some(5_000)), [[0; 2]; 0]);
        // A pit, a slope of 60 % (each cell differs by more than a step from its neighbours along x), and a
        // terrace.
        assert_eq!(raised(|i, j| Some(if is_within(i, j, 3) { 4_000 } else { 5_000 })), [[0; 2]; 0]);
        assert_eq!(raised(|i, _| Some(1_000 + 600 * i.unsigned_abs())), [[0; 2]; 0]);
        assert_eq!(raised(|i, _| Some(if i < 5 { 6_000 } else { 5_000 })), [[0; 2]; 0]);
        // Cells with nothing around them.
        assert_eq!(raised(|i, j| is_within(i, j, 3).then_some(5_000)), [[0; 2]; 0]);
    }

    #[test]
    fn a_gap_around_a_patch_changes_nothing() {
        let gap = |i: i32, j: i32| (9..14).contains(&i) && (9..14).contains(&j) && !is_within(i, j, 3);
        let found = raised(|i, j| (!gap(i, j)).then(|| if is_within(i, j, 3) { 5_251 } else { 5_000 }));
        assert_eq!(found.len(), 9);
        let found = raised(|i, j| (!gap(i, j)).then(|| if is_within(i, j, 3) { 5_250 } else { 5_000 }));
        assert_eq!(found, [[0; 2]; 0], "less than a step");
    }
}

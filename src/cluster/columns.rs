//! Voxels as sorted columns with global indices, and the search for voxels that touch. This file knows no
//! points and no densities. The methods that work on voxels share it.
#![expect(
    clippy::cast_possible_truncation,
    reason = "voxels of a tile fit u32 (VoxelIndex), differences of indices are small"
)]

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::model::AlgorithmError;
use crate::spatial::{Cell, CellCursor, CellMap, DisjointSets, VoxelIndex};

/// Global index (i, j, k) of a voxel.
pub(super) type Voxel = [i32; 3];

/// Global indices of the voxels of `index` that are `wanted`, ascending.
/// `method` is the caller's name for the error.
pub(super) fn global_indices(
    method: &'static str,
    index: &VoxelIndex,
    wanted: impl Fn(usize) -> bool,
) -> Result<Vec<(Voxel, u32)>, AlgorithmError> {
    let grid = index.grid();
    let too_many = || AlgorithmError::TooManyCells {
        method,
        cells: grid.base.iter().map(|value| value.unsigned_abs()).max().unwrap_or(0),
        edge_units: grid.edge,
        limit: i32::MAX as u64,
    };
    let global = |axis: usize, local: u32| {
        i32::try_from(grid.base[axis] + i64::from(local)).ok().filter(|index| index.abs() < i32::MAX / 2)
    };
    let mut voxels = Vec::new();
    for (column, &[i, j]) in index.columns().iter().enumerate() {
        for voxel in index.column_voxels(column).filter(|&voxel| wanted(voxel)) {
            let at = [global(0, i), global(1, j), global(2, index.heights()[voxel])];
            let [Some(i), Some(j), Some(k)] = at else { return Err(too_many()) };
            voxels.push(([i, j, k], voxel as u32));
        }
    }
    Ok(voxels)
}

/// Voxels (or other things with an index), sorted by (i, j, k).
#[derive(Debug, Default)]
pub(super) struct Columns {
    cells: Vec<Cell>,
    first: Vec<u32>,
    k: Vec<i32>,
    /// Number of each column, plus one.
    places: CellMap<u32>,
}

impl Columns {
    /// Takes indices in ascending order. Repeated indices are kept.
    pub(super) fn new(sorted: impl Iterator<Item = Voxel>) -> Self {
        let mut columns = Self::default();
        for [i, j, k] in sorted {
            if columns.cells.last() != Some(&[i, j]) {
                columns.first.push(columns.k.len() as u32);
                columns.cells.push([i, j]);
                *columns.places.entry([i, j]) = columns.cells.len() as u32;
            }
            columns.k.push(k);
        }
        columns.first.push(columns.k.len() as u32);
        columns
    }

    /// Number of voxels.
    pub(super) fn len(&self) -> usize {
        self.k.len()
    }

    /// (i, j) of every column.
    pub(super) fn cells(&self) -> &[Cell] {
        &self.cells
    }

    /// k of every voxel.
    pub(super) fn heights(&self) -> &[i32] {
        &self.k
    }

    /// The voxels of a column, from the lowest up.
    pub(super) fn voxels(&self, column: usize) -> Range<usize> {
        self.first[column] as usize..self.first[column + 1] as usize
    }

    /// A fast look-up for the voxels at (i, j).
    pub(super) fn finder(&self) -> Finder<'_> {
        Finder { columns: self, places: self.places.cursor() }
    }

    /// The set of every voxel, named by its smallest member. The sets are the 26-connected components of the
    /// voxels that `keep` accepts. Every other voxel is a set of its own.
    pub(super) fn components(&self, keep: impl Fn(usize) -> bool) -> Vec<u32> {
        let mut sets = DisjointSets::new(self.len() as u32);
        self.touching(|a, b| {
            if keep(a) && keep(b) {
                sets.union(a as u32, b as u32);
            }
        });
        (0..self.len() as u32).map(|voxel| sets.find(voxel)).collect()
    }

    /// Visits every pair of different voxels that touch, each once.
    pub(super) fn touching(&self, mut visit: impl FnMut(usize, usize)) {
        let mut finder = self.finder();
        for (column, &[i, j]) in self.cells.iter().enumerate() {
            let voxels = self.voxels(column);
            for voxel in voxels.clone().skip(1) {
                if self.k[voxel] - self.k[voxel - 1] <= 1 {
                    visit(voxel - 1, voxel);
                }
            }
            for [di, dj] in [[0, 1], [1, -1], [1, 0], [1, 1]] {
                let others = finder.column([i + di, j + dj]);
                let mut low = others.start;
                for voxel in voxels.clone() {
                    while low < others.end && self.k[low] < self.k[voxel] - 1 {
                        low += 1;
                    }
                    for other in (low..others.end).take_while(|&other| self.k[other] <= self.k[voxel] + 1) {
                        visit(voxel, other);
                    }
                }
            }
        }
    }

    /// Voxels whose components tiles must agree on. They are in or beside (26 neighbours) an own voxel, and
    /// in or beside a foreign one. A voxel may be both. If two voxels touch and belong to different tiles,
    /// both tiles name both of them here. So equal names join the parts of a component in different tiles.
    pub(super) fn shared(&self, own: &[bool], foreign: &[bool]) -> Vec<usize> {
        let mut near_own = own.to_vec();
        let mut near_foreign = foreign.to_vec();
        self.touching(|a, b| {
            near_own[a] |= own[b];
            near_own[b] |= own[a];
            near_foreign[a] |= foreign[b];
            near_foreign[b] |= foreign[a];
        });
        (0..self.len()).filter(|&voxel| near_own[voxel] && near_foreign[voxel]).collect()
    }

    /// Index of every voxel, in order.
    pub(super) fn indices(&self) -> impl Iterator<Item = Voxel> + '_ {
        self.cells
            .iter()
            .enumerate()
            .flat_map(move |(column, &[i, j])| self.voxels(column).map(move |voxel| [i, j, self.k[voxel]]))
    }
}

/// See [`Columns::finder`]. Remembers the position of the last search.
pub(super) struct Finder<'a> {
    columns: &'a Columns,
    places: CellCursor<'a, u32>,
}

impl Finder<'_> {
    /// The voxels at (i, j); empty where there are none.
    #[inline]
    pub(super) fn column(&mut self, cell: Cell) -> Range<usize> {
        self.number(cell).map_or(0..0, |number| self.columns.voxels(number))
    }

    /// The number of the column at (i, j).
    #[inline]
    pub(super) fn number(&mut self, cell: Cell) -> Option<usize> {
        self.places.get(cell).checked_sub(1).map(|number| number as usize)
    }
}

/// Steps (di, dj) whose squared length is at most `most`, shortest first.
pub(super) fn disc(most: i64) -> Vec<(i64, [i32; 2])> {
    let reach = most.isqrt() as i32;
    let mut steps: Vec<(i64, [i32; 2])> = (-reach..=reach)
        .flat_map(|di| {
            (-reach..=reach).map(move |dj| (i64::from(di).pow(2) + i64::from(dj).pow(2), [di, dj]))
        })
        .filter(|step| step.0 <= most)
        .collect();
    steps.sort_unstable();
    steps
}

/// Local components of each tile, and the shared voxels that join components over the drive.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Border {
    /// Local components.
    pub(super) count: u32,
    /// Shared voxels and their local component.
    pub(super) shared: Vec<(Voxel, u32)>,
}

/// Joins the components of tiles that are added one after the other. The caller need not keep a border.
#[derive(Debug, Default)]
pub(super) struct Joining {
    named: Vec<(Voxel, u32)>,
    /// First component of each tile, and their number.
    starts: Vec<u32>,
    count: u32,
}

impl Joining {
    /// Adds the next tile.
    pub(super) fn add(&mut self, border: &Border) {
        let first = self.count;
        self.named.extend(border.shared.iter().map(|(voxel, local)| (*voxel, first + local)));
        self.starts.push(first);
        self.count += border.count;
    }

    /// The component over the whole drive of every local component of every tile.
    pub(super) fn finish(mut self) -> Vec<Vec<u32>> {
        self.named.sort_unstable();
        let mut sets = DisjointSets::new(self.count);
        for pair in self.named.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
            sets.union(pair[0].1, pair[1].1);
        }
        self.starts.push(self.count);
        let mut component = |ends: &[u32]| (ends[0]..ends[1]).map(|node| sets.find(node)).collect();
        self.starts.windows(2).map(&mut component).collect()
    }
}

/// The component over the whole drive of every local component of every tile.
pub(super) fn join(borders: &[Border]) -> Vec<Vec<u32>> {
    let mut joining = Joining::default();
    borders.iter().for_each(|border| joining.add(border));
    joining.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn voxels_touch_at_corners_in_every_direction_and_not_over_a_gap() {
        for di in -1..=1 {
            for dj in -1..=1 {
                for dk in -1..=1 {
                    for (scale, expected) in [(1, 1), (2, 2)] {
                        let mut voxels = vec![[0, 0, 0], [di * scale, dj * scale, dk * scale]];
                        voxels.sort_unstable();
                        voxels.dedup();
                        let columns = Columns::new(voxels.iter().copied());
                        let mut roots = columns.components(|_| true);
                        roots.dedup();
                        assert_eq!(roots.len(), expected.min(voxels.len()), "{di} {dj} {dk} {scale}");
                    }
                }
            }
        }
    }

    #[test]
    fn tiles_name_the_voxels_on_both_sides_of_a_border() {
        let columns = Columns::new((0..5).map(|i| [i, 0, 0]));
        // 0, 1 and 2 are own voxels, 3 and 4 are foreign; 2 and 3 touch.
        let own = [true, true, true, false, false];
        let foreign = own.map(|own| !own);
        assert_eq!(columns.shared(&own, &foreign), [2, 3]);
        assert_eq!(columns.shared(&foreign, &own), [2, 3]);
    }

    #[test]
    fn equal_names_join_components_over_tiles() {
        let border = |count, shared: &[(Voxel, u32)]| Border { count, shared: shared.to_vec() };
        let joined = join(&[
            border(2, &[([1, 0, 0], 0), ([5, 0, 0], 1)]),
            border(1, &[([9, 9, 9], 0)]),
            border(2, &[([1, 0, 0], 1), ([5, 0, 0], 1)]),
        ]);
        assert_eq!(joined, [vec![0, 0], vec![2], vec![3, 0]]);
    }
}

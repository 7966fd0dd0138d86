//! Blocks of columns: the heights at which ground can lie in a block, derived from the blocks around it.
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "numbers of columns fit u32 (see VoxelIndex), ranks are below them, rises are some hundred metres"
)]

use rustc_hash::FxHashMap;

use super::lowest::NONE;
use super::stems;
use crate::spatial::VoxelIndex;

/// The height at which the ground of a block begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Floor {
    pub(super) at: u32,
    /// Whether nothing but stems was seen there.
    pub(super) of_stems: bool,
}

/// The columns of an index, grouped into square blocks. Blocks lie at multiples of their edge in the
/// coordinates of the drive.
pub(super) struct Blocks {
    /// Number of columns along the edge of a block.
    span: i64,
    /// Block of each column.
    of: Vec<u32>,
    /// Place of each block.
    place: Vec<[i64; 2]>,
    number: FxHashMap<[i64; 2], u32>,
    /// Columns, sorted by block. `first` has the position of the first column of each block, and the end.
    columns: Vec<u32>,
    first: Vec<u32>,
}

impl Blocks {
    /// Blocks of `span` x `span` columns, `span` above 0.
    pub(super) fn new(index: &VoxelIndex, span: i64) -> Self {
        let base = index.grid().base;
        let (mut place, mut number) = (Vec::new(), FxHashMap::default());
        let mut last = None;
        let mut of = Vec::with_capacity(index.columns().len());
        for column in index.columns() {
            let at = [0, 1].map(|axis| (base[axis] + i64::from(column[axis])).div_euclid(span));
            let block = match last {
                Some((known, block)) if known == at => block,
                _ => *number.entry(at).or_insert_with(|| {
                    place.push(at);
                    place.len() as u32 - 1
                }),
            };
            last = Some((at, block));
            of.push(block);
        }
        let mut first = vec![0_u32; place.len() + 1];
        of.iter().for_each(|&block| first[block as usize + 1] += 1);
        for block in 0..place.len() {
            first[block + 1] += first[block];
        }
        let mut next = first.clone();
        let mut columns = vec![0; of.len()];
        for (column, &block) in (0_u32..).zip(&of) {
            let slot = &mut next[block as usize];
            columns[*slot as usize] = column;
            *slot += 1;
        }
        Self { span, of, place, number, columns, first }
    }

    /// The block of a column.
    pub(super) fn of(&self, column: usize) -> usize {
        self.of[column] as usize
    }

    fn columns(&self, block: usize) -> &[u32] {
        &self.columns[self.first[block] as usize..self.first[block + 1] as usize]
    }

    /// The block at an offset from another one, if it has columns.
    fn beside(&self, block: usize, [di, dj]: [i64; 2]) -> Option<usize> {
        let [i, j] = self.place[block];
        self.number.get(&[i + di, j + dj]).map(|&block| block as usize)
    }

    /// For every block, the height at which its ground begins: the quantile of the `lows` of the columns in
    /// the blocks up to `reach` away along each axis; [`NONE`] where no column has a low. Where only stems
    /// were seen below the quantile, it is the foot of the lowest stem, see `stems.rs`. `is_stem` says which
    /// columns are stems, and `depth` how far ground may lie from the quantile.
    pub(super) fn floors(
        &self,
        lows: &[u32],
        is_stem: &[bool],
        reach: i64,
        quantile: f64,
        depth: u32,
    ) -> Vec<Floor> {
        let (mut around, mut stems) = (Vec::new(), Vec::new());
        let mut of_block = |block| {
            around.clear();
            stems.clear();
            for di in -reach..=reach {
                for other in (-reach..=reach).filter_map(|dj| self.beside(block, [di, dj])) {
                    let columns = self.columns(other).iter().map(|&column| column as usize);
                    for column in columns.filter(|&column| lows[column] != NONE) {
                        around.push(lows[column]);
                        if is_stem[column] {
                            stems.push(lows[column]);
                        }
                    }
                }
            }
            let rank = (quantile * around.len() as f64) as usize;
            let level = if around.is_empty() { NONE } else { *around.select_nth_unstable(rank).1 };
            let feet = stems::feet(level, &around, &mut stems, depth);
            Floor { at: feet.unwrap_or(level), of_stems: feet.is_some() }
        };
        (0..self.place.len()).map(&mut of_block).collect()
    }

    /// For every block, the share of columns with points among all columns in the blocks up to `reach` away
    /// along each axis.
    pub(super) fn filled(&self, reach: i64) -> Vec<f64> {
        let all = ((2 * reach + 1) * self.span).pow(2) as f64;
        let of_block = |block| {
            let rows = (-reach..=reach).flat_map(|di| (-reach..=reach).map(move |dj| [di, dj]));
            let around = rows.filter_map(|offset| self.beside(block, offset));
            around.map(|other| self.columns(other).len()).sum::<usize>() as f64 / all
        };
        (0..self.place.len()).map(of_block).collect()
    }

    /// The ceiling of every block. Each block within `radius` (in blocks, distance of centres, inclusive)
    /// allows its low plus the `rise` of the block for each block of distance, and once more for the slope
    /// inside the block. The smallest of these values counts; [`NONE`] where there is none.
    pub(super) fn ceilings(&self, lows: &[u32], radius: i64, rise: impl Fn(usize) -> f64) -> Vec<u32> {
        let low_of = |block| self.columns(block).iter().map(|&column| lows[column as usize]).min();
        let lows: Vec<u32> = (0..self.place.len()).map(|block| low_of(block).unwrap_or(NONE)).collect();
        let mut cone = Vec::new();
        for di in -radius..=radius {
            for dj in -radius..=radius {
                let squared = di * di + dj * dj;
                if squared <= radius * radius {
                    cone.push(([di, dj], (squared as f64).sqrt() + 1.0));
                }
            }
        }
        let of_block = |block| {
            let rise = rise(block);
            let around = cone.iter().filter_map(|&(offset, distance)| {
                self.beside(block, offset).map(|other| lows[other].saturating_add((rise * distance) as u32))
            });
            around.min().unwrap_or(NONE)
        };
        (0..self.place.len()).map(of_block).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Lattice, TileCloud};

    /// One point per column (i, j) of edge 10, in blocks of 2 x 2 columns.
    fn blocks(columns: &[[i64; 2]]) -> Blocks {
        let points: Vec<_> = columns.iter().map(|&[i, j]| [i * 10, j * 10, 0]).collect();
        let cloud = TileCloud::from_lattice_points(Lattice::MILLIMETRE, &points);
        Blocks::new(&VoxelIndex::build("test", &cloud, 10).unwrap(), 2)
    }

    #[test]
    fn columns_are_grouped_by_blocks_at_multiples_of_their_edge() {
        // Columns -1 and 0 are neighbours in different blocks.
        let blocks = blocks(&[[-1, 0], [0, 0], [0, 1], [1, 1], [2, 0]]);
        assert_eq!((0..5).map(|column| blocks.of(column)).collect::<Vec<_>>(), [0, 1, 1, 1, 2]);
        assert_eq!(blocks.columns(1), [1, 2, 3]);
        assert_eq!(blocks.beside(1, [1, 0]), Some(2));
        assert_eq!(blocks.beside(1, [0, 1]), None);
    }

    #[test]
    fn quantiles_are_of_the_blocks_around() {
        let blocks = blocks(&[[0, 0], [1, 0], [2, 0], [3, 0], [4, 0]]);
        let lows = [5, 9, 7, NONE, 1];
        let floors = |lows: &[u32], reach, quantile| {
            let floors = blocks.floors(lows, &[false; 5], reach, quantile, 1);
            floors.into_iter().map(|floor| floor.at).collect::<Vec<_>>()
        };
        assert_eq!(floors(&lows, 0, 0.0), [5, 7, 1]);
        assert_eq!(floors(&lows, 1, 0.0), [5, 1, 1]);
        assert_eq!(floors(&lows, 1, 0.5), [7, 7, 7]);
        assert_eq!(floors(&[NONE; 5], 1, 0.5), [NONE; 3]);
    }

    #[test]
    fn blocks_are_filled_by_the_columns_around_them() {
        // Two adjacent blocks with 3 and 1 of four columns, and a block with one column three blocks further.
        let blocks = blocks(&[[0, 0], [0, 1], [1, 0], [2, 0], [8, 0]]);
        assert_eq!(blocks.filled(0), [0.75, 0.25, 0.25]);
        assert_eq!(blocks.filled(1), [4.0 / 36.0, 4.0 / 36.0, 1.0 / 36.0]);
    }

    #[test]
    fn ceilings_rise_with_the_distance_as_far_as_the_radius() {
        let blocks = blocks(&[[0, 0], [2, 0], [4, 0], [2, 2]]);
        assert_eq!(blocks.ceilings(&[0, 100, 100, 100], 1, |_| 10.0), [10, 20, 110, 110]);
        // The diagonal, third in the order of columns, is 1.41 blocks long.
        assert_eq!(blocks.ceilings(&[0, 100, 100, 100], 2, |_| 10.0), [10, 20, 24, 30]);
        assert_eq!(blocks.ceilings(&[NONE, NONE, 100, 100], 1, |_| 10.0), [NONE, 120, 110, 110]);
        let rises = |block| [0.0, 0.0, 10.0, 0.0][block];
        assert_eq!(blocks.ceilings(&[0, 100, 100, 100], 2, rises), [0, 0, 24, 0], "each block has its own");
    }
}

//! A division of the plane into squares: of the cells of the raster, as many in a square as have few points.

/// Squares of several levels that cover the plane of the cube without gaps. Empty ones belong to them: the
/// written coordinates of a point can lie a little beside the cell that counted it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Squares {
    /// Level of single cells.
    cells: u32,
    /// Code of the first cell of each square, ascending, and the level of the square.
    list: Vec<(u64, u32)>,
}

impl Squares {
    /// Divides the plane until squares have at most `most` points, or are single cells, which have the level
    /// `cells`. `counts` are codes of cells with their points, ascending.
    pub(crate) fn divide(counts: &[(u64, u64)], cells: u32, most: u64) -> Self {
        let mut list = Vec::new();
        let mut open = vec![(0_u64, 0_u32, counts)];
        while let Some((first, level, inside)) = open.pop() {
            let points: u64 = inside.iter().map(|(_, points)| points).sum();
            if points <= most || level >= cells {
                list.push((first, level));
                continue;
            }
            let quarter = 1 << (2 * (cells - level - 1));
            for part in (0..4).rev() {
                let start = first + part * quarter;
                let place = |code: u64| inside.partition_point(|(cell, _)| *cell < code);
                open.push((start, level + 1, &inside[place(start)..place(start + quarter)]));
            }
        }
        Self { cells, list }
    }

    /// The code of a cell, from its distance to the corner of the cube along both axes.
    pub(crate) fn code(cells: u32, [x, y]: [u64; 2]) -> u64 {
        (0..cells).rev().fold(0, |code, digit| code << 2 | (x >> digit & 1) << 1 | (y >> digit & 1))
    }

    /// Level of single cells.
    pub(crate) fn cells(&self) -> u32 {
        self.cells
    }

    /// The number of the square that has a cell, by the code of the cell.
    pub(crate) fn of(&self, code: u64) -> usize {
        self.list.partition_point(|(first, _)| *first <= code).saturating_sub(1)
    }

    /// The level of a square.
    pub(crate) fn level(&self, square: usize) -> u32 {
        self.list[square].1
    }

    /// The largest level of all squares.
    pub(crate) fn deepest(&self) -> u32 {
        self.list.iter().map(|(_, level)| *level).max().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_cover_the_plane_and_are_as_small_as_asked() {
        // Three rows of 300 cells in a plane of 512 by 512.
        let cells = 9;
        let mut counts: Vec<(u64, u64)> = (0..300)
            .flat_map(|x| (0..3).map(move |y| [x, y + 7]))
            .map(|at| (Squares::code(cells, at), 400 + 200 * u64::from(at[0] > 200)))
            .collect();
        counts.sort_unstable();
        let all: u64 = counts.iter().map(|(_, points)| points).sum();
        let mut coarser: Option<Squares> = None;
        for most in [u64::MAX, 100_000, 60_000, 500, 1] {
            let squares = Squares::divide(&counts, cells, most);
            let mut points = vec![0; squares.list.len()];
            for (code, count) in &counts {
                points[squares.of(*code)] += count;
            }
            let small = |(square, points): (usize, &u64)| *points <= most || squares.level(square) == cells;
            assert!(points.iter().enumerate().all(small), "{most}: {points:?}");
            assert_eq!(squares.list.len() == 1, most >= all);
            // Every cell of the plane is in the square that starts before it.
            let mut next = 0;
            for (square, (first, level)) in squares.list.iter().enumerate() {
                assert_eq!(*first, next);
                next += 1 << (2 * (cells - level));
                assert_eq!([squares.of(*first), squares.of(next - 1)], [square; 2]);
                // No square is larger than the one of a coarser division that has it.
                assert!(coarser.as_ref().is_none_or(|coarser| coarser.level(coarser.of(*first)) <= *level));
            }
            assert_eq!(next, 1 << (2 * cells));
            coarser = Some(squares);
        }
    }
}

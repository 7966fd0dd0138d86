//! Features of the raster of 0.3 m columns around a voxel: highest and lowest voxel, occupied cubes by
//! height, occupied columns, tall columns, the slice at the height of the voxel, and elongation in the plane.
//!
//! A tile is processed in square blocks. Each block has dense rasters with a margin, and is small enough for
//! the cache. A stray voxel far away costs one block. The division into blocks does not change any feature,
//! because the margin contains every window.
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    reason = "positions in a raster of about a hundred cells per edge, counts below 2^24"
)]

use super::cells::Cells;
use super::raster::{Rows, Sums, half_widths, spread};
use crate::model::Lattice;

/// Cells of the inner part of a block, per edge: 28.8 m.
const CORE: i32 = 96;
/// Cells of the margin: the largest window, plus one.
const MARGIN: i32 = 13;
const SIDE: usize = (CORE + 2 * MARGIN) as usize;

/// Limits of the height bands above ground in metres.
const BANDS_M: [f64; 7] = [0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0];
const BANDS: usize = BANDS_M.len() + 1;
/// Height given to columns without voxels, in metres.
const EMPTY_M: f64 = -1.0;
/// Cubes of 0.3 m per level.
const LEVEL: i32 = 2;
/// Smallest number of levels of a tall column.
const TALL: u32 = 4;

/// Number of features of a column.
pub(crate) const COLUMN: usize = 43;
/// Reaches of the windows in the slice at the height of a voxel, in cells.
pub(crate) const SLICES: [i32; 4] = [1, 2, 5, 10];

/// Marks a cell of the raster without a wanted column.
const NONE: u32 = u32::MAX;

/// Cubes in one cell of the raster and at one level.
#[derive(Debug, Clone, Copy)]
struct Entry {
    level: i32,
    /// Cell of the raster.
    place: u32,
    /// First cube, and number of cubes.
    cube: u32,
    cubes: u32,
}

/// The features of a block.
#[derive(Debug)]
pub(crate) struct Block<'a> {
    cells: &'a Cells,
    /// Height above ground of each voxel in lattice units.
    heights: &'a [i32],
    /// Lowest and highest voxel of each cube above ground.
    extremes: Vec<[i32; 2]>,
    lattice: Lattice,
    bands: [i32; BANDS_M.len()],
    /// Wanted columns of the inner part: number of the column, and cell of the raster.
    pub(crate) wanted: Vec<(u32, u32)>,
    /// Features of the wanted columns.
    pub(crate) column: Vec<[f32; COLUMN]>,
    /// Cubes in the windows [`SLICES`] at the level of each cube. Only cubes of wanted columns have values.
    pub(crate) slices: Vec<[u16; SLICES.len()]>,
    /// Index in `wanted` of each cell of the raster.
    number: Vec<u32>,
    highest: Vec<i32>,
    lowest: Vec<i32>,
    voxels: Vec<u32>,
    levels: Vec<u32>,
    profile: Vec<[u32; BANDS]>,
    entries: Vec<Entry>,
    /// Levels occupied within one cell of each wanted column: the number of levels with at most one further
    /// cell in the ring around, and the number of all.
    around: Vec<[u32; 2]>,
    stamps: Vec<u32>,
    marked: Vec<bool>,
    profile_sums: Sums<BANDS>,
    occupied_sums: Sums<2>,
    level_sums: Sums<1>,
    rows: Rows,
    tall_rows: Rows,
}

/// Blocks that contain wanted columns, ascending.
pub(crate) fn blocks(cells: &Cells, wanted: impl Fn(usize) -> bool) -> Vec<[i32; 2]> {
    let columns = cells.columns.cells().iter().enumerate().filter(|(column, _)| wanted(*column));
    let mut blocks: Vec<[i32; 2]> =
        columns.map(|(_, cell)| cell.map(|index| index.div_euclid(CORE))).collect();
    blocks.dedup();
    blocks.sort_unstable();
    blocks.dedup();
    blocks
}

impl<'a> Block<'a> {
    /// Takes cubes of 0.3 m and the heights of voxels. The rasters are empty.
    pub(crate) fn new(cells: &'a Cells, heights: &'a [i32], lattice: Lattice) -> Self {
        let limit = |metres: f64| lattice.units(metres) as i32;
        let mut extremes = vec![[i32::MAX, i32::MIN]; cells.len()];
        for (&cube, &height) in cells.of_voxel.iter().zip(heights) {
            let [low, high] = &mut extremes[cube as usize];
            *low = height.min(*low);
            *high = height.max(*high);
        }
        Self {
            cells,
            heights,
            extremes,
            lattice,
            bands: BANDS_M.map(limit),
            wanted: Vec::new(),
            column: Vec::new(),
            slices: vec![[0; SLICES.len()]; cells.len()],
            number: vec![NONE; SIDE * SIDE],
            highest: Vec::new(),
            lowest: Vec::new(),
            voxels: Vec::new(),
            levels: Vec::new(),
            profile: Vec::new(),
            entries: Vec::new(),
            around: Vec::new(),
            stamps: Vec::new(),
            marked: vec![false; SIDE * SIDE],
            profile_sums: Sums::default(),
            occupied_sums: Sums::default(),
            level_sums: Sums::default(),
            rows: Rows::default(),
            tall_rows: Rows::default(),
        }
    }

    /// Computes the features of a block.
    pub(crate) fn compute(&mut self, block: [i32; 2], wanted: impl Fn(usize) -> bool) {
        self.fill(block, wanted);
        self.slices();
        self.columns();
    }

    /// Fills the rasters.
    fn fill(&mut self, block: [i32; 2], wanted: impl Fn(usize) -> bool) {
        let empty = self.lattice.units(EMPTY_M) as i32;
        reset(&mut self.number, NONE);
        reset(&mut self.highest, empty);
        reset(&mut self.lowest, i32::MAX);
        reset(&mut self.voxels, 0);
        reset(&mut self.levels, 0);
        reset(&mut self.profile, [0; BANDS]);
        self.wanted.clear();
        self.entries.clear();
        let columns = self.cells.columns.cells();
        let [i, j] = block.map(|index| index * CORE - MARGIN);
        let end = j + SIDE as i32;
        let core = MARGIN..MARGIN + CORE;
        for row in 0..SIDE as i32 {
            let first = columns.partition_point(|&cell| cell < [i + row, j]);
            for (column, cell) in columns.iter().enumerate().skip(first) {
                if cell[0] != i + row || cell[1] >= end {
                    break;
                }
                let place = row as usize * SIDE + (cell[1] - j) as usize;
                if core.contains(&row) && core.contains(&(cell[1] - j)) && wanted(column) {
                    self.number[place] = self.wanted.len() as u32;
                    self.wanted.push((column as u32, place as u32));
                }
                self.fill_column(column, place);
            }
        }
    }

    fn fill_column(&mut self, column: usize, place: usize) {
        for cube in self.cells.columns.voxels(column) {
            let level = self.cells.columns.heights()[cube].div_euclid(LEVEL);
            let height = self.heights[self.cells.first[cube] as usize];
            self.profile[place][self.bands.partition_point(|&limit| limit <= height)] += 1;
            self.voxels[place] += self.cells.voxels[cube];
            match self.entries.last_mut() {
                Some(entry) if entry.place == place as u32 && entry.level == level => entry.cubes += 1,
                _ => {
                    self.levels[place] += 1;
                    self.entries.push(Entry { level, place: place as u32, cube: cube as u32, cubes: 1 });
                }
            }
        }
    }

    /// The windows of all levels.
    fn slices(&mut self) {
        // Levels are independent of each other, and the order within a level does not matter.
        self.entries.sort_unstable_by_key(|entry| entry.level);
        reset(&mut self.stamps, 0);
        self.around.clear();
        self.around.resize(self.wanted.len(), [0; 2]);
        let entries = std::mem::take(&mut self.entries);
        for (level, stamp) in entries.chunk_by(|a, b| a.level == b.level).zip(1_u32..) {
            self.slice(level, stamp);
        }
        self.entries = entries;
    }

    /// The windows of a level. Its raster is the rectangle that contains its entries.
    fn slice(&mut self, level: &[Entry], stamp: u32) {
        let position = |place: u32| [place / SIDE as u32, place % SIDE as u32].map(|index| index as i32);
        let mut lo = [i32::MAX; 2];
        let mut hi = [i32::MIN; 2];
        for entry in level {
            let at = position(entry.place);
            self.marked[entry.place as usize] = true;
            for axis in 0..2 {
                lo[axis] = lo[axis].min(at[axis]);
                hi[axis] = hi[axis].max(at[axis]);
            }
        }
        let [height, width] = [0, 1].map(|axis| (hi[axis] - lo[axis] + 1) as usize);
        let start = lo[0] as usize * SIDE + lo[1] as usize;
        let marked = &self.marked;
        self.level_sums.fill(height, width, |row, column| [u32::from(marked[start + row * SIDE + column])]);
        let sums = &self.level_sums;
        for entry in level {
            self.marked[entry.place as usize] = false;
            let [row, column] = position(entry.place);
            if self.number[entry.place as usize] != NONE {
                let counts = SLICES.map(|reach| sums.window(row - lo[0], column - lo[1], reach)[0] as u16);
                self.slices[entry.cube as usize..][..entry.cubes as usize].fill(counts);
            }
            // The columns around, each once per level.
            for row in (row - 1).max(0)..=(row + 1).min(SIDE as i32 - 1) {
                for column in (column - 1).max(0)..=(column + 1).min(SIDE as i32 - 1) {
                    let place = row as usize * SIDE + column as usize;
                    let number = self.number[place];
                    if number == NONE || self.stamps[place] == stamp {
                        continue;
                    }
                    self.stamps[place] = stamp;
                    let at = [row - lo[0], column - lo[1]];
                    let near = sums.window(at[0], at[1], 1)[0];
                    let ring = sums.window(at[0], at[1], 2)[0] - near;
                    let around = &mut self.around[number as usize];
                    around[0] += u32::from(ring <= 1);
                    around[1] += 1;
                }
            }
        }
    }

    /// The features of the wanted columns.
    fn columns(&mut self) {
        self.tops();
        let levels = &self.levels;
        let tall = |place: usize| if levels[place] >= TALL { levels[place] } else { 0 };
        self.rows.fill(SIDE, |place| levels[place]);
        self.tall_rows.fill(SIDE, tall);
        let profile = &self.profile;
        self.profile_sums.fill(SIDE, SIDE, |row, column| profile[row * SIDE + column]);
        self.occupied_sums.fill(SIDE, SIDE, |row, column| {
            let place = row * SIDE + column;
            [u32::from(levels[place] > 0), u32::from(tall(place) > 0)]
        });
        // Windows of 5, 11 and 21 cells from smaller ones: 3 and 3 shifted by 1; 5 by 3; 11 by 5.
        let three = spread(&self.highest, SIDE, 1, true);
        let tops2 = spread(&three, SIDE, 1, false);
        let tops5 = spread(&tops2, SIDE, 3, true);
        let tops10 = spread(&tops5, SIDE, 5, false);
        let discs = [5, 12, 8].map(half_widths);
        let step = self.lattice.step_m() as f32;
        let metres = |units: i32| units as f32 * step;
        self.column.clear();
        for (&(_, place), around) in self.wanted.iter().zip(&self.around) {
            let place = place as usize;
            let row = (place / SIDE) as i32;
            let column = (place % SIDE) as i32;
            let mut out = Row { values: [0.0; COLUMN], at: 0 };
            out.push(metres(self.highest[place]));
            out.push(metres(self.lowest[place]));
            out.count(self.voxels[place]);
            let near = self.profile_sums.window(row, column, 1);
            let far = self.profile_sums.window(row, column, 5);
            near.iter().chain(&far).for_each(|&count| out.count(count));
            let occupied = SLICES.map(|reach| self.occupied_sums.window(row, column, reach)[0]);
            occupied.iter().for_each(|&count| out.count(count));
            [&tops2, &tops5, &tops10].iter().for_each(|tops| out.push(metres(tops[place])));
            around.iter().for_each(|&count| out.count(count));
            let planes = [&self.rows, &self.rows, &self.tall_rows].into_iter().zip(&discs);
            for (number, (rows, half)) in planes.enumerate() {
                // A column that is not tall has no elongation among tall ones.
                let plane = rows.disc(row as usize, column as usize, half);
                let known = number < 2 || levels[place] >= TALL;
                (if known { plane.features() } else { [0.0; 4] })
                    .into_iter()
                    .for_each(|value| out.push(value));
            }
            out.count(self.occupied_sums.window(row, column, 4)[1]);
            out.count(levels[place]);
            out.push(far.iter().sum::<u32>() as f32 / occupied[2] as f32);
            self.column.push(out.values);
        }
    }

    /// Highest and lowest voxel of each column above ground.
    fn tops(&mut self) {
        for entry in &self.entries {
            let place = entry.place as usize;
            for cube in entry.cube..entry.cube + entry.cubes {
                let [low, high] = self.extremes[cube as usize];
                self.highest[place] = self.highest[place].max(high);
                self.lowest[place] = self.lowest[place].min(low);
            }
        }
    }
}

/// Values that are filled in one by one.
struct Row {
    values: [f32; COLUMN],
    at: usize,
}

impl Row {
    fn push(&mut self, value: f32) {
        self.values[self.at] = value;
        self.at += 1;
    }

    fn count(&mut self, value: u32) {
        self.push(value as f32);
    }
}

fn reset<T: Clone>(raster: &mut Vec<T>, value: T) {
    raster.clear();
    raster.resize(SIDE * SIDE, value);
}

//! The section of a drive between two chainages: which cells are processed for it, and where objects are
//! whole.
//!
//! Three areas enclose each other. *Inside* are the cells whose chainage is in the section: an object of the
//! section has points there. All cells beside one half of a gap in the recording are inside if any chainage
//! of this half is in the section, because a tile has them all. Within `tiling.beyond` of these cells,
//! objects are followed and are the same as in the whole drive. Around that, points are read only because
//! they decide on ground and objects; an object that reaches them is marked as cut. The areas are dilations
//! in the plane, as halos are: on a loop, a near place can have a very different chainage.

use std::collections::BTreeSet;
use std::sync::Arc;

use crate::config::{Config, TilingConfig};
use crate::error::Result;
use crate::model::Lattice;
use crate::run::error::RunError;
use crate::spatial::{Cell, CellGrid, CellMap, PackedCells};
use crate::survey::Axis;

/// Edge of the squares in which areas are dilated, in cells. Chosen: 8 m are short against the distances, and
/// there are few squares.
const SQUARE_CELLS: i32 = 8;
/// Distance by which cells outside the section still count as inside: this many metres, and [`AROUND_EDGES`]
/// edges of a cell. A cell has the chainage of the vertex of the axis nearest to its centre. So a point of
/// the section can be in a cell that is half a vertex and half a cell outside. The distance is twice that,
/// for the inside of bends.
const AROUND_M: f64 = 1.0;
/// See [`AROUND_M`].
const AROUND_EDGES: f64 = std::f64::consts::SQRT_2;

/// A section of a drive.
#[derive(Debug)]
pub(crate) struct Section {
    /// Chainage where it begins and ends, in metres.
    pub(crate) from_m: f64,
    pub(crate) to_m: f64,
    /// Whether the cells whose nearest vertex of the axis this is are inside. They include every cell with
    /// points of the section.
    pub(crate) inside: Vec<bool>,
    /// Points of the cells that are processed.
    pub(crate) cells: Arc<PackedCells>,
    /// The squares in which objects are whole.
    whole: BTreeSet<Cell>,
}

impl Section {
    /// The section that the settings choose; `None` for the whole drive. Points within `deciding` lattice
    /// units decide on an object.
    pub(crate) fn chosen(
        config: &TilingConfig,
        axis: &Axis,
        all: &PackedCells,
        grid: CellGrid,
        lattice: Lattice,
        deciding: i64,
    ) -> Result<Option<Self>> {
        let Some((from_m, to_m)) = config.section() else { return Ok(None) };
        let edge_m = lattice.metres(grid.edge());
        let around_m = AROUND_M + AROUND_EDGES * edge_m;
        let inside: Vec<bool> = (0..axis.vertices().len())
            .map(|vertex| axis.span_m(vertex))
            .map(|(first, last)| last >= from_m - around_m && first <= to_m + around_m)
            .collect();
        let is_inside = |cell: Cell| {
            let centre = cell.map(|index| (f64::from(index) + 0.5) * edge_m);
            inside[axis.nearest(centre)]
        };
        let squares: BTreeSet<Cell> =
            all.iter().filter(|(cell, _)| is_inside(*cell)).map(|(cell, _)| square(cell)).collect();
        if squares.is_empty() {
            return Err(RunError::NoSection { from_m, to_m, length_m: axis.length_m() }.into());
        }
        let square_units = grid.edge() * i64::from(SQUARE_CELLS);
        #[expect(clippy::cast_possible_truncation, reason = "some hundred metres in squares")]
        let steps = |units: i64| units.div_euclid(square_units) as i32 + 1;
        let beyond = steps(lattice.units_up(config.beyond));
        let whole = dilated(&squares, beyond);
        let processed = dilated(&squares, beyond + steps(deciding));
        let mut cells = CellMap::default();
        for (cell, points) in all.iter().filter(|(cell, _)| processed.contains(&square(*cell))) {
            *cells.entry(cell) = points;
        }
        Ok(Some(Self { from_m, to_m, inside, cells: Arc::new(PackedCells::from(cells)), whole }))
    }

    /// Whether an object that reaches no further than this cell is the same in the whole drive.
    pub(crate) fn is_whole(&self, cell: Cell) -> bool {
        self.whole.contains(&square(cell))
    }
}

impl TilingConfig {
    /// Start and end of the section; `None` for the whole drive.
    pub(crate) fn section(&self) -> Option<(f64, f64)> {
        let to = if self.to > 0.0 { self.to } else { f64::INFINITY };
        (self.from > 0.0 || self.to > 0.0).then_some((self.from, to))
    }
}

/// The chainage of a section as values that a pass depends on; empty for the whole drive.
pub(crate) fn depends(config: &Config) -> Vec<(&'static str, String)> {
    let TilingConfig { from, to, beyond, .. } = config.tiling;
    let values = [("tiling.from", from), ("tiling.to", to), ("tiling.beyond", beyond)];
    match config.tiling.section() {
        Some(_) => values.into_iter().map(|(key, metres)| (key, metres.to_string())).collect(),
        None => Vec::new(),
    }
}

fn square(cell: Cell) -> Cell {
    cell.map(|index| index.div_euclid(SQUARE_CELLS))
}

/// The squares at most `steps` squares away from some squares, along both axes.
fn dilated(squares: &BTreeSet<Cell>, steps: i32) -> BTreeSet<Cell> {
    let along = |squares: &BTreeSet<Cell>, axis: usize| -> BTreeSet<Cell> {
        let moved = |cell: &Cell, by: i32| {
            let mut cell = *cell;
            cell[axis] = cell[axis].saturating_add(by);
            cell
        };
        squares.iter().flat_map(|cell| (-steps..=steps).map(move |by| moved(cell, by))).collect()
    };
    along(&along(squares, 0), 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::survey::AxisSource;

    #[test]
    fn what_decides_lies_around_what_is_whole() {
        let lattice = Lattice::MILLIMETRE;
        let grid = CellGrid::new(1_000);
        // A street of 500 m to the east, and a way that comes back beside it, 30 m to the north.
        let mut cells = CellMap::default();
        for i in 0..500 {
            *cells.entry([i, 0]) = 1;
            *cells.entry([i, 30]) = 1;
        }
        let all = PackedCells::from(cells);
        let there = (0..=500).map(|x| [f64::from(x), 0.5]);
        let back = (0..=500).rev().map(|x| [f64::from(x), 30.5]);
        let axis =
            Axis::from_positions(AxisSource::Trajectory, &there.chain(back).collect::<Vec<_>>()).unwrap();
        let chosen = |from: f64, to: f64| {
            let config = TilingConfig { cell: 1.0, tile_length: 0.0, from, to, beyond: 40.0 };
            Section::chosen(&config, &axis, &all, grid, lattice, 20_000)
        };
        assert!(chosen(0.0, 0.0).unwrap().is_none());
        let section = chosen(100.0, 200.0).unwrap().unwrap();
        for i in 0..500 {
            let away = (100 - i).max(i - 200).max(0);
            // The other way is near in the plane, though far in chainage.
            for cell in [[i, 0], [i, 30]] {
                let is_read = section.cells.get(cell) > 0;
                assert!(!section.is_whole(cell) || is_read);
                assert!(away > 40 || section.is_whole(cell), "{cell:?}");
                assert!(away > 60 || is_read, "{cell:?}");
                assert!(away <= 60 + 3 * 8 || !is_read, "{cell:?}");
            }
            // The cells that are not read are further from the whole cells than the deciding reach.
            let next = (i..500).take_while(|&far| section.cells.get([far, 0]) > 0).count();
            assert!(!section.is_whole([i, 0]) || i + i32::try_from(next).unwrap() == 500 || next > 20, "{i}");
        }
        let error = chosen(2_000.0, 2_100.0).unwrap_err().to_string();
        assert!(error.starts_with("there are no points from 2000 to 2100 m: "), "{error}");
    }

    /// The recording stops at 200 m and goes on 200 m further, where the street has turned.
    #[test]
    fn a_section_of_a_gap_in_the_recording_has_the_cells_beside_it() {
        let grid = CellGrid::new(1_000);
        let mut cells = CellMap::default();
        (0..270).for_each(|i| *cells.entry([i, 2]) = 1);
        (0..150).for_each(|j| *cells.entry([341, 150 + j]) = 1);
        let all = PackedCells::from(cells);
        let first: Vec<[f64; 2]> = (0..=200).map(|x| [f64::from(x), 0.0]).collect();
        let second: Vec<[f64; 2]> = (0..=100).map(|y| [341.0, 200.0 + f64::from(y)]).collect();
        let axis = Axis::from_runs(AxisSource::Trajectory, vec![first, second]).unwrap();
        let inside = |from: f64, to: f64, cell: Cell| {
            let config = TilingConfig { cell: 1.0, tile_length: 0.0, from, to, beyond: 1.0 };
            let section =
                Section::chosen(&config, &axis, &all, grid, Lattice::MILLIMETRE, 0).unwrap().unwrap();
            section.inside[axis.nearest(cell.map(|index| f64::from(index) + 0.5))]
        };
        // An object here has the chainage 250 m, and belongs to each section with this chainage.
        let (chainage_m, _) = axis.locate([250.0, 2.5]);
        assert!((chainage_m - 250.0).abs() < 1e-6, "{chainage_m}");
        for (from, to, expected) in [(240.0, 260.0, true), (100.0, 230.0, true), (150.0, 190.0, false)] {
            assert_eq!(inside(from, to, [250, 2]), expected, "{from} to {to}");
        }
        // Behind the gap, chainage is 400 m. The second half of the gap begins at 300 m.
        for (from, to, expected) in [(240.0, 260.0, false), (310.0, 320.0, true), (450.0, 460.0, false)] {
            assert_eq!(inside(from, to, [341, 170]), expected, "{from} to {to}");
        }
    }
}

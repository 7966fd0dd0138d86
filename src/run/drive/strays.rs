//! Points far from all others: usually errors of the scanner or of a merge. They are processed like other
//! points, but the axis does not follow single ones.

use crate::run::drive::Drive;
use crate::run::drive::quantiles::Rows;
use crate::spatial::{Cell, CellMap, PackedCells};
use crate::survey::{Axis, Survey};
use crate::words;

/// Share of the occupied cells beyond which those on one side of a drive may be far from all others.
const OUTER_SHARE: f64 = 0.01;
/// Distance from the other cells, as a multiple of their extent or of [`LEAST_EXTENT_M`], from which a cell
/// is far from them.
const FAR: f64 = 5.0;
/// See [`FAR`], in metres.
const LEAST_EXTENT_M: f64 = 100.0;

/// Where nearly all occupied cells of a drive are. All others are far away.
#[derive(Debug)]
pub(super) struct Usual {
    /// Smallest and largest coordinate on both axes, in metres.
    reach_m: [(f64, f64); 2],
    edge_m: f64,
}

impl Usual {
    /// Where nearly all of these cells are.
    pub(super) fn of(drive: &Drive, cells: &PackedCells) -> Self {
        let edge_m = drive.lattice().metres(drive.grid.edge());
        let reach_m = [0, 1].map(|k| {
            let rows = Rows::of(cells, k);
            let [low, high] =
                [OUTER_SHARE, 1.0 - OUTER_SHARE].map(|share| f64::from(rows.quantile(share)) * edge_m);
            let margin = (high - low).max(LEAST_EXTENT_M) * FAR;
            (low - margin, high + margin)
        });
        Self { reach_m, edge_m }
    }

    fn has_place(&self, place: [f64; 2]) -> bool {
        (0..2).all(|k| (self.reach_m[k].0..=self.reach_m[k].1).contains(&place[k]))
    }

    fn has(&self, cell: Cell) -> bool {
        self.has_place(cell.map(|index| f64::from(index) * self.edge_m))
    }

    /// The cells without those far from all others; `None` if there are none of these.
    pub(super) fn without_far(&self, cells: &PackedCells) -> Option<PackedCells> {
        if cells.iter().all(|(cell, _)| self.has(cell)) {
            return None;
        }
        let mut near = CellMap::default();
        cells
            .iter()
            .filter(|(cell, _)| self.has(*cell))
            .for_each(|(cell, points)| *near.entry(cell) = points);
        Some(PackedCells::from(near))
    }

    /// The warning about points far from all others.
    pub(super) fn warn(
        &self,
        drive: &Drive,
        survey: &Survey,
        cells: &PackedCells,
        axis: &Axis,
        warnings: &mut Vec<String>,
    ) {
        let Some((lo, hi)) = survey.extent else { return };
        let far: u64 =
            cells.iter().filter(|(cell, _)| !self.has(*cell)).map(|(_, points)| u64::from(points)).sum();
        if far == 0 {
            return;
        }
        let [x_km, y_km] = [0, 1].map(|k| drive.lattice().metres(hi[k] - lo[k]) / 1e3);
        let (lie, they, them) = if far == 1 { ("lies", "it is", "it") } else { ("lie", "they are", "them") };
        let axis = if axis.vertices().iter().all(|vertex| self.has_place(*vertex)) {
            format!("the axis does not follow {them}")
        } else {
            "the axis leads there as well".to_owned()
        };
        warnings.push(format!(
            "{} {lie} far from all others: the drive spans {x_km:.1} x {y_km:.1} km, and {they} processed like any other; \
             {axis}",
            words::counted(far, "point")
        ));
    }
}

//! Height of the ground at a place, from the mean heights of the cells around it.
//!
//! A plane is fitted by least squares. Cells far above or below it are left out, and it is fitted again, with
//! narrower limits in each round. So cells in which a stem or the underside of a car was classified as ground
//! do not count, and neither do cells beyond a kerb or a wall.

use nalgebra::{Matrix3, Vector3};

/// Distance in metres at which a cell has half the weight of one at the place.
const HALF_WEIGHT_M: f64 = 0.5;
/// Largest distance of a cell from the plane in metres, by round (chosen: a slope of 1 in 5 differs by 0.6 m
/// over 3 m; a kerb is 0.15 m).
const LIMITS_M: [f64; 5] = [0.6, 0.4, 0.25, 0.2, 0.2];
/// Rounds in which near cells weigh no more than far ones, because the nearest may be wrong.
const EVEN_ROUNDS: usize = 2;
/// Smallest number of nearby cells at the height of the nearest cell, itself included, if it is ground.
/// Otherwise it is a stem or a car.
const LEAST_SUPPORT: usize = 4;
/// Distance from the place within which cells are nearby, in metres.
const SUPPORT_M: f64 = 1.5;
/// Largest height difference of a cell from the nearest cell that counts as the same height, in metres.
const SAME_HEIGHT_M: f64 = 0.3;
/// Smallest number of cells from which a slope is fitted.
const LEAST_CELLS: usize = 5;
/// Smallest variance of the places of these cells in any direction, in square metres. With less, the cells
/// are a row.
const LEAST_VARIANCE_M2: f64 = 0.15;

/// A cell of the terrain: the offset of its middle from the place, and its height, in metres.
#[derive(Debug, Clone, Copy)]
pub(super) struct Near {
    pub(super) away: [f64; 2],
    pub(super) height: f64,
}

impl Near {
    fn squared(&self) -> f64 {
        self.away[0] * self.away[0] + self.away[1] * self.away[1]
    }
}

/// Height of the ground in metres amid these cells. `nearest` is the height of the nearest one.
pub(super) fn height_amid(cells: &[Near], nearest: f64) -> f64 {
    plane_amid(cells, nearest)[0]
}

/// The plane of the ground amid these cells: its height at the place, and its rise per metre along x and y.
/// If there are too few cells for a slope, the plane is level. `nearest` is the height of the nearest cell.
pub(super) fn plane_amid(cells: &[Near], nearest: f64) -> [f64; 3] {
    if cells.len() < LEAST_CELLS {
        return [nearest, 0.0, 0.0];
    }
    let beside = |cell: &&Near| {
        cell.squared() <= SUPPORT_M * SUPPORT_M && (cell.height - nearest).abs() <= SAME_HEIGHT_M
    };
    let start =
        if cells.iter().filter(beside).count() >= LEAST_SUPPORT { nearest } else { lower_third(cells) };
    let mut plane = Vector3::new(start, 0.0, 0.0);
    for (round, limit) in LIMITS_M.into_iter().enumerate() {
        let over = |cell: &Near| cell.height - plane.dot(&Vector3::new(1.0, cell.away[0], cell.away[1]));
        let kept: Vec<Near> = cells.iter().copied().filter(|cell| over(cell).abs() <= limit).collect();
        match fitted(&kept, round >= EVEN_ROUNDS, start) {
            Some(next) => plane = next,
            None => return [start, 0.0, 0.0],
        }
    }
    plane.into()
}

/// Height that a third of the cells do not exceed.
fn lower_third(cells: &[Near]) -> f64 {
    let mut heights: Vec<f64> = cells.iter().map(|cell| cell.height).collect();
    heights.sort_unstable_by(f64::total_cmp);
    heights[heights.len() / 3]
}

/// The plane through cells: its height at the place and its slopes. `None` if there are too few cells, or if
/// they are a row.
fn fitted(cells: &[Near], nearer_counts_more: bool, around: f64) -> Option<Vector3<f64>> {
    if cells.len() < LEAST_CELLS {
        return None;
    }
    let mut matrix = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for cell in cells {
        let far = if nearer_counts_more { cell.squared() / (HALF_WEIGHT_M * HALF_WEIGHT_M) } else { 0.0 };
        let weight = 1.0 / (1.0 + far);
        let terms = Vector3::new(1.0, cell.away[0], cell.away[1]);
        matrix += terms * terms.transpose() * weight;
        // Relative to `around`, because heights above sea level are large numbers.
        right += terms * (weight * (cell.height - around));
    }
    if least_variance(&matrix) < LEAST_VARIANCE_M2 {
        return None;
    }
    Some(matrix.try_inverse()? * right + Vector3::new(around, 0.0, 0.0))
}

/// Smallest variance of places in any direction. `sums` has their weighted sums of 1, x, y and the products
/// of these.
fn least_variance(sums: &Matrix3<f64>) -> f64 {
    let weight = sums[(0, 0)];
    let mean = [sums[(0, 1)] / weight, sums[(0, 2)] / weight];
    let xx = sums[(1, 1)] / weight - mean[0] * mean[0];
    let yy = sums[(2, 2)] / weight - mean[1] * mean[1];
    let xy = sums[(1, 2)] / weight - mean[0] * mean[1];
    f64::midpoint(xx, yy) - ((xx - yy) / 2.0).hypot(xy)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells of 1 m within 4 m of a place in the middle of one, at these heights.
    fn around(height: impl Fn(f64, f64) -> f64) -> Vec<Near> {
        let all = (-4..=4).flat_map(|i| (-4..=4).map(move |j| [f64::from(i), f64::from(j)]));
        all.filter(|[x, y]| x * x + y * y <= 16.0)
            .map(|away| Near { away, height: height(away[0], away[1]) })
            .collect()
    }

    #[test]
    fn a_stem_that_was_taken_for_ground_does_not_count() {
        // A slope of 1 in 10 with the ground at 430 m; the place itself and two cells beside it are a stem.
        let ground = |x: f64, y: f64| 430.0 + 0.1 * x - 0.05 * y;
        let cells = around(|x, y| match (x.abs() + y.abs(), x) {
            (0.0, _) => 431.9,
            (1.0, 1.0) => 431.2,
            (1.0, -1.0) => 430.6,
            _ => ground(x, y),
        });
        let found = height_amid(&cells, 431.9);
        assert!((found - 430.0).abs() < 1e-6, "{found}");
    }

    #[test]
    fn an_object_on_a_terrace_stands_on_the_terrace() {
        // The ground is 1 m lower beyond a wall 2 m to the east of the place.
        let cells = around(|x, _| if x > 1.5 { -1.0 } else { 0.0 });
        assert!(height_amid(&cells, 0.0).abs() < 1e-6);
        // The place is below the wall.
        let cells = around(|x, _| if x > 1.5 { 1.0 } else { 0.0 });
        assert!(height_amid(&cells, 0.0).abs() < 1e-6);
    }

    #[test]
    fn a_kerb_is_not_levelled() {
        // The place is on the footway, 0.5 m from the kerb.
        let cells = around(|x, _| if x < -0.5 { -0.15 } else { 0.0 });
        let found = height_amid(&cells, 0.0);
        assert!((-0.05..=0.02).contains(&found), "{found}");
    }

    #[test]
    fn few_cells_have_the_height_of_the_nearest() {
        let cells = around(|_, _| 3.0);
        assert!((height_amid(&cells[..4], 7.0) - 7.0).abs() < 1e-12);
    }
}

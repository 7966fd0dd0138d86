//! Warnings about a drive that do not prevent a run: headers that do not match, files far from each other.

use crate::run::drive::Drive;
use crate::survey::Survey;
use crate::words;

/// Largest distance outside the box of a header that counts as rounding, in metres.
const BOX_TOLERANCE_M: f64 = 0.01;

/// Points outside the box of the header. LAZ has no checksums, and damage that can still be decoded shows as
/// such points.
pub(super) fn warn_of_header_boxes(drive: &Drive, survey: &Survey, warnings: &mut Vec<String>) {
    let Some((lo, hi)) = survey.extent else { return };
    let files = drive.catalog.files().iter().filter(|file| file.point_count() > 0);
    let boxes: Vec<_> = files.map(|file| (file.credible_extent(), file.units_m())).collect();
    let outermost = |end: usize, axis: usize, pick: fn(f64, f64) -> f64| {
        boxes
            .iter()
            .filter_map(|(extent, units_m)| Some(extent[end][axis]? * units_m[axis]))
            .reduce(pick)
            .unwrap_or(f64::NAN)
    };
    let beyond = (0..3)
        .map(|axis| {
            let below = outermost(0, axis, f64::min) - drive.lattice().metres(lo[axis]);
            let above = drive.lattice().metres(hi[axis]) - outermost(1, axis, f64::max);
            below.max(above)
        })
        .fold(0.0, f64::max);
    if beyond > BOX_TOLERANCE_M {
        warnings.push(format!(
            "points lie up to {} m outside the boxes that the headers give: a header was not updated, or records \
             are damaged",
            words::decimal(beyond, 2)
        ));
    }
}

/// Largest distance between neighbouring files of one drive without a warning, in metres. A vehicle that
/// stops recording in a tunnel or between two streets resumes within this distance.
const APART_M: f64 = 10_000.0;

/// Files far from each other are usually not one drive, and an axis through all of them is meaningless.
pub(super) fn warn_of_files_apart(drive: &Drive, warnings: &mut Vec<String>) {
    let files = drive.catalog.files().iter().filter(|file| file.point_count() > 0);
    let boxes: Vec<[[f64; 2]; 2]> = files
        .filter_map(|file| {
            let ([low, high], units_m) = (file.credible_extent(), file.units_m());
            let corner = |ends: [Option<f64>; 3]| Some([ends[0]? * units_m[0], ends[1]? * units_m[1]]);
            Some([corner(low)?, corner(high)?])
        })
        .collect();
    let apart_m = largest_step(&boxes);
    if apart_m > APART_M {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a distance on the earth"
        )]
        let apart_km = words::separated((apart_m / 1e3).round() as u64);
        warnings.push(format!(
            "the files lie {apart_km} km apart (the largest gap between neighbours): is this one drive?"
        ));
    }
}

/// The longest step, in metres, of the shortest way to connect all boxes (minimum spanning tree; Prim 1957,
/// "Shortest connection networks and some generalizations", doi:10.1002/j.1538-7305.1957.tb01515.x).
fn largest_step(boxes: &[[[f64; 2]; 2]]) -> f64 {
    let gap = |a: &[[f64; 2]; 2], b: &[[f64; 2]; 2]| {
        let along = |axis: usize| (a[0][axis] - b[1][axis]).max(b[0][axis] - a[1][axis]).max(0.0);
        along(0).hypot(along(1))
    };
    let Some((first, others)) = boxes.split_first() else { return 0.0 };
    let mut left: Vec<(f64, &[[f64; 2]; 2])> =
        others.iter().map(|other| (gap(first, other), other)).collect();
    let mut largest = 0.0_f64;
    while let Some(at) = (0..left.len()).min_by(|&a, &b| left[a].0.total_cmp(&left[b].0)) {
        let (step, next) = left.swap_remove(at);
        largest = largest.max(step);
        left.iter_mut().for_each(|(step, other)| *step = step.min(gap(next, other)));
    }
    largest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_connected_by_the_shortest_steps() {
        let at = |x: f64| [[x, 0.0], [x + 1.0, 1.0]];
        assert!(largest_step(&[]) == 0.0 && largest_step(&[at(0.0)]) == 0.0);
        // In any order: the steps are 9, 4 and 0 (two boxes overlap).
        for order in [[0.0, 10.0, 15.0, 15.5], [15.5, 0.0, 15.0, 10.0]] {
            assert!((largest_step(&order.map(at)) - 9.0).abs() < 1e-12);
        }
    }
}

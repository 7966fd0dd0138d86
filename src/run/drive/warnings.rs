//! What is odd about a drive and makes no run impossible: headers that do not fit, points far from all others.

use crate::run::drive::Drive;
use crate::run::drive::quantiles::Rows;
use crate::spatial::PackedCells;
use crate::survey::Survey;

/// How far points may lie outside the boxes of the headers, in metres: less is rounding.
const BOX_TOLERANCE_M: f64 = 0.01;

/// LAZ has no checksums: damage that still decodes shows at points outside the box of the header.
pub(super) fn warn_of_header_boxes(drive: &Drive, survey: &Survey, warnings: &mut Vec<String>) {
    let Some((lo, hi)) = survey.extent else { return };
    let files = drive.catalog.files().iter().filter(|file| file.point_count() > 0);
    let boxes: Vec<_> = files.map(|file| (file.header_extent(), file.units_m())).collect();
    let outermost = |end: usize, axis: usize, pick: fn(f64, f64) -> f64| {
        boxes
            .iter()
            .map(|(extent, units_m)| extent[end][axis] * units_m[axis])
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
            "points lie up to {beyond:.2} m outside the boxes that the headers give: a header was not kept up to \
             date, or records are damaged"
        ));
    }
}

/// Points far from all others are usually errors of the scanner or of a merge; they are processed like any other.
pub(super) fn warn_of_strays(survey: &Survey, cells: &PackedCells, edge_m: f64, warnings: &mut Vec<String>) {
    let Some((lo, hi)) = survey.extent else { return };
    let mut far = 0;
    let reach = [0, 1].map(|k| {
        let rows = Rows::of(cells, k);
        let [low, high] = [0.01, 0.99].map(|share| f64::from(rows.quantile(share)) * edge_m);
        let margin = (high - low).max(100.0) * 5.0;
        (low - margin, high + margin)
    });
    for (cell, points) in cells.iter() {
        let out = (0..2).any(|k| {
            let at = f64::from(cell[k]) * edge_m;
            at < reach[k].0 || at > reach[k].1
        });
        far += if out { u64::from(points) } else { 0 };
    }
    if far > 0 {
        let extent = [0, 1].map(|k| (hi[k] - lo[k]) as f64 / 1e6);
        warnings.push(format!(
            "{far} points lie far from all others (the drive spans {:.1} x {:.1} million lattice units with them); \
             they are processed like any other",
            extent[0], extent[1]
        ));
    }
}

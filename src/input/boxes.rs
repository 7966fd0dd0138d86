//! The boxes that headers give: whether they can be those of the points. Damaged and unfinished headers have
//! values that are not numbers, or that no record can have.

use super::file::InputFile;
use super::header::Scaling;
use crate::words::{counted, decimal};

/// Largest number of files that are named.
const NAMED: usize = 5;
/// Names of the axes.
const AXES: [&str; 3] = ["x", "y", "z"];

impl InputFile {
    /// Minimum and maximum of x, y and z from the header, in units of the file; `None` where the records
    /// cannot reach this far.
    pub(crate) fn credible_extent(&self) -> [[Option<f64>; 3]; 2] {
        let Scaling { scale, offset } = self.header().scaling;
        let [low, high] = self.header_extent();
        let within = |axis: usize, value: f64| {
            // A step more than the integers of a record, because the box is computed and rounded.
            let reach = scale[axis] * (2_f64.powi(31) + 1.0);
            (value.is_finite(), value >= offset[axis] - reach, value <= offset[axis] + reach)
        };
        let low = [0, 1, 2].map(|axis| {
            let (is_number, is_above, _) = within(axis, low[axis]);
            (is_number && is_above).then_some(low[axis])
        });
        let high = [0, 1, 2].map(|axis| {
            let (is_number, _, is_below) = within(axis, high[axis]);
            (is_number && is_below).then_some(high[axis])
        });
        [low, high]
    }

    /// The axes on which no points can have the box of the header, with its numbers; `None` if there are
    /// none.
    fn impossible_axes(&self) -> Option<String> {
        let [low, high] = self.header_extent();
        let ends = self.credible_extent();
        let axes: Vec<String> = (0..3)
            .filter(|&axis| match [ends[0][axis], ends[1][axis]] {
                [Some(low), Some(high)] => low > high,
                _ => true,
            })
            .map(|axis| format!("{} {} to {}", AXES[axis], decimal(low[axis], 2), decimal(high[axis], 2)))
            .collect();
        (!axes.is_empty()).then(|| axes.join(", "))
    }
}

/// Warns about boxes that cannot be those of the points.
pub(super) fn note_boxes(files: &[InputFile], warnings: &mut Vec<String>) {
    let filled = files.iter().filter(|file| file.point_count() > 0);
    let mut impossible = filled.filter_map(|file| Some((file, file.impossible_axes()?)));
    for (file, axes) in impossible.by_ref().take(NAMED) {
        warnings.push(format!(
            "{}: the box in the header is {axes}, which is impossible; the coordinates of the points are used instead, but \
             other programs need the box: rewrite the header (pdal translate, or lasinfo -repair_bb)",
            file.name()
        ));
    }
    let others = impossible.count();
    if others > 0 {
        warnings.push(format!(
            "the headers of {} are wrong in the same way",
            counted(others as u64, "more file")
        ));
    }
}

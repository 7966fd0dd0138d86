//! The objects of a report as CSV, one row each.

use std::io::{self, Write};

use crate::eval::report::rows::{ObjectRow, SmallRow};
use crate::eval::report::values::Report;

impl Report<'_> {
    /// Writes every reference object with its outcome under each metric, as CSV by id, with one column of
    /// Hoover's classes per tolerance. Objects that are too small to be evaluated have no outcome.
    ///
    /// # Errors
    /// Errors of the writer `to`.
    pub fn write_objects_csv(&self, to: &mut dyn Write) -> io::Result<()> {
        write!(
            to,
            "object,class,class_name,chainage_m,x_m,y_m,z_m,points,segment,segment_points,points_in_segment,best_iou,\
             best_iou_segment,matched,under_segmented,shares_with,over_segmented,second_segment,"
        )?;
        let tolerances = &self.settings.hoover_tolerances;
        for tolerance in tolerances {
            write!(to, "hoover_{tolerance:.2},")?;
        }
        write!(to, "points_without_segment,points_predicted_ground,points_predicted_noise,")?;
        // There are columns for classes if the prediction has classes.
        let named = self.object_classes.is_some();
        writeln!(to, "{}what", if named { "called,class_right," } else { "" })?;
        let mut small = self.small_objects.iter().peekable();
        let small_line = |row: &SmallRow| {
            small_csv_line(row, tolerances.len() + if named { 2 } else { 0 }, self.settings.min_points)
        };
        for row in self.objects.iter() {
            while let Some(before) = small.next_if(|small| small.object < row.object) {
                to.write_all(small_line(&before).as_bytes())?;
            }
            to.write_all(csv_line(&row, named).as_bytes())?;
        }
        small.try_for_each(|row| to.write_all(small_line(&row).as_bytes()))
    }
}

/// The row of an object that is not evaluated, with the columns of an evaluated one. `tolerances` is the
/// number of columns that not every file has.
fn small_csv_line(row: &SmallRow, tolerances: usize, min_points: u64) -> String {
    let [x, y, z] = row.at_m;
    // Ten columns before the columns of the tolerances, three after them, and the words.
    let empty = ",".repeat(10 + tolerances + 3 + 1);
    format!(
        "{},{},{},{:.3},{x:.3},{y:.3},{z:.3},{}{empty}fewer than {min_points} points: not evaluated\n",
        row.object,
        row.class,
        quoted(&row.class_name),
        row.chainage_m,
        row.points
    )
}

fn csv_line(row: &ObjectRow, named: bool) -> String {
    let id = |id: Option<i64>| id.map_or(String::new(), |id| id.to_string());
    let fields = [
        row.object.to_string(),
        row.class.to_string(),
        quoted(&row.class_name),
        format!("{:.3}", row.chainage_m),
        format!("{:.3}", row.x_m),
        format!("{:.3}", row.y_m),
        format!("{:.3}", row.z_m),
        row.points.to_string(),
        id(row.segment),
        row.segment_points.to_string(),
        row.points_in_segment.to_string(),
        format!("{:.6}", row.best_iou),
        id(row.best_iou_segment),
        row.matched.to_string(),
        row.under_segmented.to_string(),
        id(row.shares_with),
        row.over_segmented.to_string(),
        id(row.second_segment),
        row.hoover.join(","),
        row.points_without_segment.to_string(),
        row.points_predicted_ground.to_string(),
        row.points_predicted_noise.to_string(),
        row.named.to_string(),
        (row.matched && row.named == row.class).to_string(),
        quoted(&row.what),
    ];
    // Without tolerances there are no columns for them.
    let present = fields.into_iter().enumerate().filter(|(at, _)| match at {
        18 => !row.hoover.is_empty(),
        22 | 23 => named,
        _ => true,
    });
    present.map(|field| field.1).collect::<Vec<_>>().join(",") + "\n"
}

/// A CSV field (RFC 4180), in quotes if necessary.
fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", field.replace('"', "\"\""))
    } else {
        field.to_owned()
    }
}

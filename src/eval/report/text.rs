//! The report as a table for a person at a terminal.

use std::fmt::Write;

use crate::eval::report::rows::ObjectRow;
use crate::eval::report::values::{ConfusionView, FiguresView, HitsView, Report, ScoreView};
use crate::words::{counted, separated};

/// Width of the column of names.
const NAME: usize = 26;
/// Smallest width of a column of counts.
const COUNT: usize = 10;

impl Report<'_> {
    /// The figures for a person, followed by the `worst` unmatched objects with the smallest best IoU.
    #[must_use]
    pub fn text(&self, worst: usize) -> String {
        let blocks =
            [head(self), shares(self), hoover(self), scores(self), named(self), worst_objects(self, worst)];
        blocks.into_iter().filter(|block| !block.is_empty()).collect::<Vec<_>>().join("\n")
    }
}

/// A share with three decimals, or `-` if there is nothing to count.
fn cell(share: Option<f64>) -> String {
    match share.map(|share| format!("{share:.3}")) {
        None => "-".to_owned(),
        // A Rand index a little below chance.
        Some(zero) if zero == "-0.000" => "0.000".to_owned(),
        Some(text) => text,
    }
}

fn head(report: &Report<'_>) -> String {
    let counts = &report.counts;
    let min = report.settings.min_points;
    let withheld = match report.compared.points_withheld {
        0 => String::new(),
        points => format!(" ({} withheld left out)", separated(points)),
    };
    let mut text = format!(
        "{}{withheld}, matched by {}\n{} with at least {min} points ({} smaller left out), {}\n",
        counted(counts.points, "point"),
        report.compared.matched_by,
        counted(counts.objects, "object"),
        separated(counts.objects_too_small),
        counted(counts.segments, "segment")
    );
    text += &format!(
        "PQ leaves out {} with fewer than {min} points and {} mostly outside of objects\n",
        counted(counts.segments_too_small, "segment"),
        counted(counts.segments_mostly_unlabelled, "segment")
    );
    if report.overall.without_segment > 0 {
        text += &format!(
            "{} in no segment: USR, OSR and OA do not count this as an error\n",
            counted(report.overall.without_segment, "object")
        );
    }
    text
}

/// Class name and figures of every line of a table, the overall line last.
fn lines<'r>(report: &'r Report<'_>) -> Vec<(String, &'r FiguresView)> {
    let classes =
        report.classes.iter().map(|class| (format!("{} {}", class.class, class.name), &class.figures));
    classes.chain([("overall".to_owned(), &report.overall)]).collect()
}

fn shares(report: &Report<'_>) -> String {
    let titles = ["USR", "OSR", "OA", "F1", "F1*", "PQ", "SQ", "RQ", "mIoU", "ARI"];
    let mut text = format!("{:NAME$} {:>7}", "class", "objects");
    titles.iter().for_each(|title| text += &format!(" {title:>6}"));
    for (name, row) in lines(report) {
        text += &format!("\n{name:NAME$} {:>7}", row.objects);
        let values = [
            row.usr,
            row.osr,
            row.oa,
            row.f1,
            row.f1_without_false_positives,
            row.pq,
            row.sq,
            row.rq,
            row.mean_best_iou,
            row.ari,
        ];
        values.into_iter().for_each(|value| text += &format!(" {:>6}", cell(value)));
    }
    text += &format!("\nmean over classes: PQ {}\n", cell(report.overall.pq_class_mean));
    // Two figures per class are called F1, and they can differ a lot.
    text + "F1 counts a false positive in the class of the object with most of its points; F1* counts no false positives\n"
}

fn hoover(report: &Report<'_>) -> String {
    if report.settings.hoover_tolerances.is_empty() {
        return String::new();
    }
    let mut text = format!("{:NAME$}", "Hoover");
    for tolerance in &report.settings.hoover_tolerances {
        text += &format!("  T = {tolerance:.2}: correct   over  under missed  noise");
    }
    for (name, row) in lines(report) {
        text += &format!("\n{name:NAME$}");
        for at in &row.hoover {
            text += &format!(
                "{:>19} {:>6} {:>6} {:>6} {:>6}",
                at.correct, at.over, at.under, at.missed, at.noise
            );
        }
    }
    text + "\n"
}

fn scores(report: &Report<'_>) -> String {
    let mut text =
        format!("{:NAME$} {:>9} {:>7} {:>6} {:>12}\n", "points", "precision", "recall", "IoU", "reference");
    let mut line = |name: &str, score: &ScoreView| {
        let [precision, recall, iou] = [score.precision, score.recall, score.iou].map(cell);
        // Writing to a string cannot fail.
        let _ =
            writeln!(text, "{name:NAME$} {precision:>9} {recall:>7} {iou:>6} {:>12}", score.reference_points);
    };
    line("ground", &report.ground);
    line("noise", &report.noise);
    text
}

/// The table of how well classes are distinguished.
fn named(report: &Report<'_>) -> String {
    let Some(named) = &report.object_classes else { return String::new() };
    let titles = ["objects", "matched", "class right", "F1+class", "points F1", "prec.", "recall"];
    let mut text = format!("{:NAME$}", "classes");
    titles.iter().for_each(|title| text += &format!(" {title:>11}"));
    let line = |name: &str, objects: &HitsView, points: [Option<f64>; 3]| {
        let [f1, precision, recall] = points.map(cell);
        format!(
            "\n{name:NAME$} {:>11} {:>11} {:>11} {:>11} {f1:>11} {precision:>11} {recall:>11}",
            objects.objects,
            objects.matched,
            cell(objects.class_right_of_matched),
            cell(objects.f1_with_class)
        )
    };
    for class in &named.classes {
        let points = [class.point_f1, class.point_precision, class.point_recall];
        text += &line(&format!("{} {}", class.class, class.name), &class.objects, points);
    }
    text += &line("overall", &named.overall, [None; 3]);
    text += &format!("\naccuracy {} of {} points\n", cell(named.accuracy), named.points);
    text +=
        "class right: share of the matched objects. F1+class counts a match of another class as two errors\n";
    text += &confusion("points by true class (rows) and predicted class (columns)", &named.point_confusion);
    text + &confusion(
        "matched objects by true class (rows) and predicted class (columns)",
        &named.object_confusion,
    )
}

/// The counts of a confusion as a table, a row per class.
fn confusion(title: &str, counts: &[ConfusionView]) -> String {
    let mut called: Vec<&str> = Vec::new();
    counts.iter().for_each(|entry| {
        if !called.contains(&entry.called.as_str()) {
            called.push(&entry.called);
        }
    });
    let width = |name: &str| {
        let counts = counts.iter().filter(|entry| entry.called == name).map(|entry| digits(&entry.count));
        counts.max().unwrap_or(0).max(name.len()).max(COUNT)
    };
    let mut text = format!("{title}\n{:NAME$}", "");
    called.iter().for_each(|name| text += &format!(" {name:>0$}", width(name)));
    for row in counts.chunk_by(|a, b| a.class == b.class) {
        text += &format!("\n{:NAME$}", format!("{} {}", row[0].class, row[0].name));
        for name in &called {
            let count = row.iter().find(|entry| entry.called == *name).map_or(0, |entry| entry.count);
            text += &format!(" {count:>0$}", width(name));
        }
    }
    text + "\n"
}

/// The objects with the smallest best IoU among the unmatched ones.
fn worst_objects(report: &Report<'_>, worst: usize) -> String {
    let mut unmatched = report.objects.unmatched();
    // The sort is stable: equal values stay in the order of their ids.
    unmatched.sort_by(|&a, &b| report.objects.best_iou(a).total_cmp(&report.objects.best_iou(b)));
    let shown = unmatched.len().min(worst);
    if shown == 0 {
        return String::new();
    }
    let text = format!(
        "{shown} of {} without a match, smallest IoU first (chainage along the {}; --objects writes all)\n",
        counted(unmatched.len() as u64, "object"),
        report.compared.chainage_along
    );
    let rows: Vec<ObjectRow> = unmatched[..shown].iter().map(|&index| report.objects.row(index)).collect();
    text + &list(&rows)
}

/// A line per object.
fn list(rows: &[ObjectRow]) -> String {
    let width = |least: usize, of: fn(&ObjectRow) -> usize| rows.iter().map(of).fold(least, usize::max);
    let id = width(8, |row| digits(&row.object));
    let name = width(NAME, |row| row.class_name.chars().count());
    let points = width(8, |row| digits(&row.points));
    let line = |row: &ObjectRow| {
        format!(
            "{:>id$}  {:name$} at {:>10.1} m  {:>points$} points  {}\n",
            row.object, row.class_name, row.chainage_m, row.points, row.what
        )
    };
    rows.iter().map(line).collect()
}

/// Width of a number as text.
fn digits(number: &impl ToString) -> usize {
    number.to_string().len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_cell_is_a_negative_zero() {
        for (share, shown) in [(-0.0, "0.000"), (-0.0004, "0.000"), (-0.0006, "-0.001"), (0.6, "0.600")] {
            assert_eq!(cell(Some(share)), shown);
        }
        assert_eq!(cell(None), "-");
    }

    #[test]
    fn lines_of_objects_are_aligned_whatever_their_ids() {
        let row = |object, points| ObjectRow {
            object,
            points,
            class_name: "tree".into(),
            what: "no segment".into(),
            ..ObjectRow::default()
        };
        let rows = [row(7, 90), row(12_345_678_901, 1_234_567_890), row(-1, 3)];
        let text = list(&rows);
        let at = |word: &str| text.lines().map(|line| line.find(word).unwrap()).collect::<Vec<_>>();
        for word in ["tree", " at ", " m ", " points", "no segment"] {
            assert!(at(word).windows(2).all(|pair| pair[0] == pair[1]), "{word}:\n{text}");
        }
        // Short ones have the width that they have in every table.
        assert!(list(&rows[..1]).starts_with("       7  tree "), "{text}");
    }

    #[test]
    fn columns_of_a_confusion_are_as_wide_as_their_counts() {
        let entry = |class: u16, called: &str, count| ConfusionView {
            class,
            name: format!("class {class}"),
            called: called.into(),
            count,
        };
        let text = confusion("points", &[entry(2, "tree", 7), entry(3, "tree", 987_654_321_000)]);
        let ends: Vec<usize> = text.lines().skip(1).map(str::len).collect();
        assert!(ends.windows(2).all(|pair| pair[0] == pair[1]), "{text}");
    }
}

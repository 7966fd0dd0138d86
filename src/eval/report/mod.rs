//! The result of an evaluation as values to show: figures, findings and the outcome of every object. Not: any
//! decision about the figures.

mod findings;
mod rows;
mod text;

use std::io::{self, Write};

use serde::Serialize;

use crate::eval::axis::Axis;
use crate::eval::metrics::{Evaluation, Figures, MetricSettings, PointScore};
use crate::eval::panoptic::SegmentRole;

pub use findings::{Behind, Finding, Findings, HooverFindings};
pub use rows::{ObjectRow, ObjectRows, SmallRow, SmallRows};

/// Version of the JSON form; raised when a key changes its meaning or goes away.
const VERSION: u32 = 1;

/// What was compared with what; for the head of a report.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Provenance {
    /// Files of the prediction.
    pub prediction: Vec<String>,
    /// Files of the reference; those of the prediction when they hold the reference too.
    pub reference: Vec<String>,
    /// Dimension of the segments.
    pub prediction_dim: String,
    /// Dimension of the objects.
    pub reference_dim: String,
    /// Dimension of the classes; none when the reference has none.
    pub class_dim: Option<String>,
    /// How the points of both sides were matched.
    pub matched_by: String,
    /// What chainages are measured along: the trajectory file, or the principal axis.
    pub chainage_along: String,
}

/// The result of an evaluation, in the order in which the JSON has it.
#[derive(Debug, Clone, Serialize)]
pub struct Report<'a> {
    format: &'static str,
    version: u32,
    compared: Provenance,
    settings: SettingsView,
    counts: CountsView,
    overall: FiguresView,
    classes: Vec<ClassView>,
    ground: ScoreView,
    noise: ScoreView,
    /// The objects and segments behind every figure.
    pub behind: Behind<'a>,
    /// Every evaluated object.
    pub objects: ObjectRows<'a>,
    /// Every reference object with too few points to be evaluated.
    pub small_objects: SmallRows<'a>,
}

#[derive(Debug, Clone, Serialize)]
struct SettingsView {
    min_points: u64,
    hoover_tolerances: Vec<f64>,
}

#[derive(Debug, Clone, Serialize)]
struct CountsView {
    points: u64,
    objects: u64,
    objects_too_small: u64,
    segments: u64,
    segments_too_small: u64,
    segments_mostly_unlabelled: u64,
    segments_without_object: u64,
}

#[derive(Debug, Clone, Serialize)]
struct ClassView {
    class: u16,
    name: String,
    #[serde(flatten)]
    figures: FiguresView,
}

#[derive(Debug, Clone, Serialize)]
struct FiguresView {
    objects: u64,
    points: u64,
    without_segment: u64,
    usr: Option<f64>,
    osr: Option<f64>,
    oa: Option<f64>,
    true_positives: u64,
    false_positives: u64,
    false_negatives: u64,
    precision: Option<f64>,
    recall: Option<f64>,
    f1: Option<f64>,
    f1_without_false_positives: Option<f64>,
    pq: Option<f64>,
    sq: Option<f64>,
    rq: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pq_class_mean: Option<f64>,
    mean_best_iou: Option<f64>,
    ari: Option<f64>,
    hoover: Vec<HooverView>,
}

#[derive(Debug, Clone, Serialize)]
struct HooverView {
    tolerance: f64,
    correct: u64,
    over: u64,
    under: u64,
    missed: u64,
    noise: u64,
}

#[derive(Debug, Clone, Serialize)]
struct ScoreView {
    reference_points: u64,
    predicted_points: u64,
    points_of_both: u64,
    precision: Option<f64>,
    recall: Option<f64>,
    iou: Option<f64>,
}

/// Six decimals: one point in a million.
fn share(value: Option<f64>) -> Option<f64> {
    // Plus zero: the sum of no IoU is -0.0 in Rust, and no figure is a negative zero.
    value.map(|value| (value * 1e6).round() / 1e6 + 0.0)
}

/// Three decimals of metres.
fn millimetres(value_m: f64) -> f64 {
    // Plus zero: -0.0 is written as 0.0.
    (value_m * 1e3).round() / 1e3 + 0.0
}

impl FiguresView {
    fn new(figures: &Figures) -> Self {
        Self {
            objects: figures.objects,
            points: figures.points,
            without_segment: figures.without_segment,
            usr: share(figures.usr()),
            osr: share(figures.osr()),
            oa: share(figures.oa()),
            true_positives: figures.true_positives,
            false_positives: figures.false_positives,
            false_negatives: figures.false_negatives(),
            precision: share(figures.precision()),
            recall: share(figures.recall()),
            f1: share(figures.f1()),
            f1_without_false_positives: share(figures.f1_without_false_positives()),
            pq: share(figures.pq()),
            sq: share(figures.sq()),
            rq: share(figures.rq()),
            pq_class_mean: None,
            mean_best_iou: share(figures.mean_best_iou()),
            ari: share(figures.ari),
            hoover: figures
                .hoover
                .iter()
                .map(|counts| HooverView {
                    tolerance: counts.tolerance.share(),
                    correct: counts.correct,
                    over: counts.over,
                    under: counts.under,
                    missed: counts.missed,
                    noise: counts.noise,
                })
                .collect(),
        }
    }
}

impl ScoreView {
    fn new(score: &PointScore) -> Self {
        Self {
            reference_points: score.reference,
            predicted_points: score.predicted,
            points_of_both: score.both,
            precision: share(score.precision()),
            recall: share(score.recall()),
            iou: share(score.iou()),
        }
    }
}

impl CountsView {
    fn new(evaluation: &Evaluation) -> Self {
        let scene = &evaluation.judged.scene;
        let roles = &evaluation.judged.panoptic.segments;
        let of_role = |role| roles.iter().filter(|&&other| other == role).count() as u64;
        Self {
            points: evaluation.points,
            objects: scene.objects.len() as u64,
            objects_too_small: scene.small_objects.len() as u64,
            segments: scene.segments.len() as u64,
            segments_too_small: of_role(SegmentRole::Small),
            segments_mostly_unlabelled: of_role(SegmentRole::Unlabelled),
            segments_without_object: scene.segments.iter().filter(|s| s.overlaps.is_empty()).count() as u64,
        }
    }
}

impl<'a> Report<'a> {
    /// The report of an evaluation; chainages along `axis`.
    #[must_use]
    pub fn new(
        evaluation: &'a Evaluation,
        settings: &'a MetricSettings,
        axis: &'a Axis,
        compared: Provenance,
    ) -> Self {
        let judged = &evaluation.judged;
        let objects = ObjectRows::new(judged, settings, axis);
        let class = |(code, figures): &(u16, Figures)| ClassView {
            class: *code,
            name: settings.classes.name(*code),
            figures: FiguresView::new(figures),
        };
        let pq_class_mean = share(evaluation.pq_class_mean());
        Self {
            format: "chainage-eval",
            version: VERSION,
            compared,
            settings: SettingsView {
                min_points: settings.min_points,
                hoover_tolerances: settings.hoover.iter().map(|tolerance| tolerance.share()).collect(),
            },
            counts: CountsView::new(evaluation),
            overall: FiguresView { pq_class_mean, ..FiguresView::new(&evaluation.overall) },
            classes: evaluation.classes.iter().map(class).collect(),
            ground: ScoreView::new(&evaluation.ground),
            noise: ScoreView::new(&evaluation.noise),
            behind: findings::behind(judged, settings, axis, &objects),
            objects,
            small_objects: SmallRows { judged, settings, axis },
        }
    }

    /// Writes the whole report as JSON, keys in a fixed order.
    ///
    /// # Errors
    /// What `to` answers.
    pub fn write_json(&self, to: &mut dyn Write) -> io::Result<()> {
        serde_json::to_writer_pretty(&mut *to, self)?;
        to.write_all(b"\n")
    }

    /// Writes every reference object with its outcome under each metric, as CSV by id; objects that are too small to be
    /// evaluated have none.
    ///
    /// # Errors
    /// What `to` answers.
    pub fn write_objects_csv(&self, to: &mut dyn Write) -> io::Result<()> {
        rows::write_csv(self, to)
    }

    /// The figures for a person, with the `worst` objects of smallest best IoU below.
    #[must_use]
    pub fn text(&self, worst: usize) -> String {
        text::text(self, worst)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_figure_is_a_negative_zero() {
        for (value, written) in [(-0.0, "0.0"), (-4e-7, "0.0"), (-0.25, "-0.25"), (0.1234567, "0.123457")] {
            assert_eq!(serde_json::to_string(&share(Some(value))).unwrap(), written);
        }
        assert_eq!(serde_json::to_string(&millimetres(-1e-9)).unwrap(), "0.0");
    }
}

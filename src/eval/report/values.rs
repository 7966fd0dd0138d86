//! The result of an evaluation as values to show: figures, findings and the outcome of every object. The
//! figures are decided elsewhere.

use std::collections::BTreeSet;

use serde::Serialize;

use crate::eval::classes::ClassTable;
use crate::eval::metrics::named::{Called, Counts, Hits, Named};
use crate::eval::metrics::panoptic::SegmentRole;
use crate::eval::metrics::{Evaluation, Figures, MetricSettings, PointScore};

use crate::eval::report::findings::{self, Behind};
use crate::eval::report::rounding::share;
use crate::eval::report::rows::{ObjectRows, SmallRows};
use crate::survey::Axis;

/// Version of the JSON form; raised if a key changes its meaning or is removed.
const VERSION: u32 = 1;

/// Both sides of the comparison and how they were compared, for the top of a report.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Provenance {
    /// Files of the prediction.
    pub prediction: Vec<String>,
    /// Files of the reference; the files of the prediction if these contain the reference as well.
    pub reference: Vec<String>,
    /// Dimension of the segments.
    pub prediction_dim: String,
    /// Dimension of the objects.
    pub reference_dim: String,
    /// Dimension of the classes; none when the reference has none.
    pub class_dim: Option<String>,
    /// Dimension of the predicted classes of objects, if they are compared.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub named_dim: Option<String>,
    /// How the points of both sides were matched.
    pub matched_by: String,
    /// Number of points that are withheld on either side, and therefore left out.
    #[serde(skip_serializing_if = "is_zero")]
    pub points_withheld: u64,
    /// The line along which chainages are measured: the trajectory file, or the principal axis.
    pub chainage_along: String,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde calls")]
fn is_zero(number: &u64) -> bool {
    *number == 0
}

/// The result of an evaluation, in the order of the JSON.
#[derive(Debug, Clone, Serialize)]
pub struct Report<'a> {
    format: &'static str,
    version: u32,
    pub(super) compared: Provenance,
    pub(super) settings: SettingsView,
    pub(super) counts: CountsView,
    pub(super) overall: FiguresView,
    pub(super) classes: Vec<ClassView>,
    pub(super) ground: ScoreView,
    pub(super) noise: ScoreView,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) object_classes: Option<NamedView>,
    /// The objects and segments behind every figure.
    pub behind: Behind<'a>,
    /// Every evaluated object.
    pub objects: ObjectRows<'a>,
    /// Every reference object with too few points to be evaluated.
    pub small_objects: SmallRows<'a>,
}

#[derive(Debug, Clone, Serialize)]
pub(super) struct SettingsView {
    pub(super) min_points: u64,
    pub(super) hoover_tolerances: Vec<f64>,
}

#[derive(Debug, Clone, Serialize)]
pub(super) struct CountsView {
    pub(super) points: u64,
    pub(super) objects: u64,
    pub(super) objects_too_small: u64,
    pub(super) segments: u64,
    pub(super) segments_too_small: u64,
    pub(super) segments_mostly_unlabelled: u64,
    pub(super) segments_without_object: u64,
}

#[derive(Debug, Clone, Serialize)]
pub(super) struct ClassView {
    pub(super) class: u16,
    pub(super) name: String,
    #[serde(flatten)]
    pub(super) figures: FiguresView,
}

#[derive(Debug, Clone, Serialize)]
pub(super) struct FiguresView {
    pub(super) objects: u64,
    pub(super) points: u64,
    pub(super) without_segment: u64,
    pub(super) usr: Option<f64>,
    pub(super) osr: Option<f64>,
    pub(super) oa: Option<f64>,
    pub(super) true_positives: u64,
    pub(super) false_positives: u64,
    pub(super) false_negatives: u64,
    pub(super) precision: Option<f64>,
    pub(super) recall: Option<f64>,
    pub(super) f1: Option<f64>,
    pub(super) f1_without_false_positives: Option<f64>,
    pub(super) pq: Option<f64>,
    pub(super) sq: Option<f64>,
    pub(super) rq: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) pq_class_mean: Option<f64>,
    pub(super) mean_best_iou: Option<f64>,
    pub(super) ari: Option<f64>,
    pub(super) hoover: Vec<HooverView>,
}

#[derive(Debug, Clone, Serialize)]
pub(super) struct HooverView {
    pub(super) tolerance: f64,
    pub(super) correct: u64,
    pub(super) over: u64,
    pub(super) under: u64,
    pub(super) missed: u64,
    pub(super) noise: u64,
}

#[derive(Debug, Clone, Serialize)]
pub(super) struct ScoreView {
    pub(super) reference_points: u64,
    pub(super) predicted_points: u64,
    pub(super) points_of_both: u64,
    pub(super) precision: Option<f64>,
    pub(super) recall: Option<f64>,
    pub(super) iou: Option<f64>,
}

/// How well classes are distinguished.
#[derive(Debug, Clone, Serialize)]
pub(super) struct NamedView {
    pub(super) points: u64,
    pub(super) points_right: u64,
    pub(super) accuracy: Option<f64>,
    pub(super) overall: HitsView,
    pub(super) classes: Vec<NamedClassView>,
    /// Points by their class and by the name that the prediction gives.
    pub(super) point_confusion: Vec<ConfusionView>,
    /// Matched objects by their class and by the name that the prediction gives.
    pub(super) object_confusion: Vec<ConfusionView>,
}

#[derive(Debug, Clone, Serialize)]
pub(super) struct NamedClassView {
    pub(super) class: u16,
    pub(super) name: String,
    pub(super) point_precision: Option<f64>,
    pub(super) point_recall: Option<f64>,
    pub(super) point_f1: Option<f64>,
    #[serde(flatten)]
    pub(super) objects: HitsView,
}

#[derive(Debug, Clone, Serialize)]
pub(super) struct HitsView {
    pub(super) objects: u64,
    pub(super) matched: u64,
    pub(super) class_right: u64,
    pub(super) class_right_of_matched: Option<f64>,
    pub(super) f1_with_class: Option<f64>,
}

#[derive(Debug, Clone, Serialize)]
pub(super) struct ConfusionView {
    pub(super) class: u16,
    pub(super) name: String,
    pub(super) called: String,
    pub(super) count: u64,
}

impl NamedView {
    fn new(named: &Named, classes: &ClassTable) -> Self {
        let right = named.right_points();
        let confusion = |counts: &Counts| {
            let view = |(&(class, called), &count): (&(u16, Called), &u64)| ConfusionView {
                class,
                name: classes.name(class),
                called: called.name(classes),
                count,
            };
            counts.iter().map(view).collect()
        };
        let hits = |list: &[(u16, Hits)], code: u16| {
            list.iter().find(|entry| entry.0 == code).map_or_else(Hits::default, |entry| entry.1)
        };
        let codes: BTreeSet<u16> =
            named.of_points.iter().chain(&named.of_objects).map(|entry| entry.0).collect();
        let class = |code: u16| {
            let points = hits(&named.of_points, code);
            NamedClassView {
                class: code,
                name: classes.name(code),
                point_precision: share(points.precision()),
                point_recall: share(points.recall()),
                point_f1: share(points.f1()),
                objects: HitsView::new(&hits(&named.of_objects, code)),
            }
        };
        Self {
            points: right.of_class,
            points_right: right.right,
            accuracy: share(named.accuracy()),
            overall: HitsView::new(&named.all_objects),
            classes: codes.into_iter().map(class).collect(),
            point_confusion: confusion(&named.points),
            object_confusion: confusion(&named.objects),
        }
    }
}

impl HitsView {
    fn new(hits: &Hits) -> Self {
        Self {
            objects: hits.of_class,
            matched: hits.matched,
            class_right: hits.right,
            class_right_of_matched: share(hits.right_of_matched()),
            f1_with_class: share(hits.f1()),
        }
    }
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
    /// The report of an evaluation, with chainages along `axis`.
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
            object_classes: evaluation.named.as_ref().map(|named| NamedView::new(named, &settings.classes)),
            behind: findings::behind(judged, settings, axis, &objects),
            objects,
            small_objects: SmallRows { judged, settings, axis },
        }
    }
}

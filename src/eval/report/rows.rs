//! One row per reference object: its place and its outcome under each metric. Rows are made while they are
//! written, so that a report of a long drive stays small.

use std::sync::Arc;

use rayon::prelude::*;
use serde::{Serialize, Serializer};

use crate::eval::metrics::overlaps::{Object, SmallObject};
use crate::eval::metrics::panoptic::Iou;
use crate::eval::metrics::{Judged, MetricSettings};
use crate::eval::report::rounding::{millimetres, share};
use crate::survey::Axis;

/// Outcome of one object.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(Default))]
pub struct ObjectRow {
    /// Id in the reference.
    pub object: i64,
    /// Class code.
    pub class: u16,
    /// Name of the class.
    pub class_name: String,
    /// Distance along the axis, in metres.
    pub chainage_m: f64,
    /// Mean position, in metres.
    pub x_m: f64,
    /// Mean position, in metres.
    pub y_m: f64,
    /// Mean position, in metres.
    pub z_m: f64,
    /// Points of the object.
    pub points: u64,
    /// S(o), the segment that contains most of it.
    pub segment: Option<i64>,
    /// Points of that segment.
    pub segment_points: u64,
    /// Points of the object in that segment.
    pub points_in_segment: u64,
    /// Largest IoU with a segment; 0 without any.
    pub best_iou: f64,
    /// The segment of that IoU.
    pub best_iou_segment: Option<i64>,
    /// Class that the prediction gives that segment; 0 is none.
    #[serde(skip)]
    pub named: u16,
    /// Whether it is matched at IoU > 0.5.
    pub matched: bool,
    /// Whether S(o) is also S(o') of another object, or contains much of another object.
    pub under_segmented: bool,
    /// That object.
    pub shares_with: Option<i64>,
    /// Whether a second segment contains much of it.
    pub over_segmented: bool,
    /// That segment.
    pub second_segment: Option<i64>,
    /// Hoover's class at each tolerance.
    pub hoover: Vec<&'static str>,
    /// Points without a segment.
    pub points_without_segment: u64,
    /// Points that the prediction calls ground.
    pub points_predicted_ground: u64,
    /// Points that the prediction calls noise.
    pub points_predicted_noise: u64,
    /// What went wrong, in words; empty if nothing did.
    pub what: String,
}

/// A reference object with too few points to be evaluated.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SmallRow {
    /// Id in the reference.
    pub object: i64,
    /// Class code.
    pub class: u16,
    /// Name of the class.
    pub class_name: String,
    /// Distance along the axis, in metres.
    pub chainage_m: f64,
    /// Mean position, in metres.
    pub at_m: [f64; 3],
    /// Points of the object.
    pub points: u64,
}

/// Chainage of a place in metres.
pub(super) fn chainage_m(axis: &Axis, [x, y, _]: [f64; 3]) -> f64 {
    axis.locate([x, y]).0
}

/// The rows of the objects that are too small, by id.
#[derive(Debug, Clone)]
pub struct SmallRows<'a> {
    pub(super) judged: &'a Judged,
    pub(super) settings: &'a MetricSettings,
    pub(super) axis: &'a Axis,
}

impl SmallRows<'_> {
    /// The rows.
    pub fn iter(&self) -> impl Iterator<Item = SmallRow> {
        let row = |object: &SmallObject| SmallRow {
            object: object.id,
            class: object.class,
            class_name: self.settings.classes.name(object.class),
            chainage_m: millimetres(chainage_m(self.axis, object.centroid_m)),
            at_m: object.centroid_m.map(millimetres),
            points: object.points,
        };
        self.judged.scene.small_objects.iter().map(row)
    }
}

impl Serialize for SmallRows<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.iter())
    }
}

/// The rows of all evaluated objects, by id.
#[derive(Debug, Clone)]
pub struct ObjectRows<'a> {
    judged: &'a Judged,
    settings: &'a MetricSettings,
    /// Chainage per object. Stored, because a chainage along a trajectory takes as long to compute as a
    /// hundred rows.
    chainages_m: Arc<[f64]>,
}

impl<'a> ObjectRows<'a> {
    pub(super) fn new(judged: &'a Judged, settings: &'a MetricSettings, axis: &Axis) -> Self {
        let chainage_of = |object: &Object| millimetres(chainage_m(axis, object.centroid_m));
        Self { judged, settings, chainages_m: judged.scene.objects.par_iter().map(chainage_of).collect() }
    }

    /// The rows.
    pub fn iter(&self) -> impl Iterator<Item = ObjectRow> {
        (0..self.judged.scene.objects.len()).map(|index| self.row(index))
    }

    /// Indices of the objects that are not matched.
    pub(super) fn unmatched(&self) -> Vec<usize> {
        (0..self.judged.scene.objects.len()).filter(|&index| !self.judged.panoptic.matched[index]).collect()
    }

    /// Largest IoU of an object with a segment; 0 without any.
    pub(super) fn best_iou(&self, index: usize) -> f64 {
        share(self.judged.panoptic.best[index].map(Iou::value)).unwrap_or(0.0)
    }

    /// The row of one object.
    pub(super) fn row(&self, index: usize) -> ObjectRow {
        let Self { judged, settings, chainages_m } = self;
        let scene = &judged.scene;
        let object = &scene.objects[index];
        let outcome = &judged.segmentation[index];
        let main = object.main();
        let segment_id = |segment: usize| scene.segments[segment].id;
        let [x_m, y_m, z_m] = object.centroid_m.map(millimetres);
        ObjectRow {
            object: object.id,
            class: object.class,
            class_name: settings.classes.name(object.class),
            chainage_m: chainages_m[index],
            x_m,
            y_m,
            z_m,
            points: object.points,
            segment: main.map(|main| segment_id(main.index)),
            segment_points: main.map_or(0, |main| scene.segments[main.index].points),
            points_in_segment: main.map_or(0, |main| main.points),
            best_iou: self.best_iou(index),
            best_iou_segment: judged.panoptic.best[index].map(|iou| segment_id(iou.segment)),
            named: judged.panoptic.best[index].map_or(0, |iou| scene.segments[iou.segment].named),
            matched: judged.panoptic.matched[index],
            under_segmented: outcome.is_under(),
            shares_with: outcome.shared_with.map(|other| scene.objects[other.index].id),
            over_segmented: outcome.is_over(),
            second_segment: outcome.second.map(|second| segment_id(second.index)),
            hoover: judged.hoover.iter().map(|hoover| hoover.objects[index].word()).collect(),
            points_without_segment: object.unassigned,
            points_predicted_ground: object.predicted_ground,
            points_predicted_noise: object.predicted_noise,
            what: what_went_wrong(judged, settings, index).join("; "),
        }
    }
}

impl Serialize for ObjectRows<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.iter())
    }
}

fn percent(part: u64, whole: u64) -> String {
    format!("{:.1} %", 100.0 * part as f64 / whole as f64)
}

/// What went wrong with an object, one phrase per fact.
fn what_went_wrong(judged: &Judged, settings: &MetricSettings, index: usize) -> Vec<String> {
    let scene = &judged.scene;
    let object = &scene.objects[index];
    let outcome = &judged.segmentation[index];
    let mut phrases = Vec::new();
    if let Some((main, other)) = object.main().zip(outcome.shared_with) {
        let shared = &scene.objects[other.index];
        phrases.push(format!(
            "segment {} also contains {} of object {} ({})",
            scene.segments[main.index].id,
            percent(other.points, shared.points),
            shared.id,
            settings.classes.name(shared.class)
        ));
    }
    if let Some(second) = outcome.second {
        let id = scene.segments[second.index].id;
        phrases.push(format!("segment {id} contains {} of it", percent(second.points, object.points)));
    }
    if !judged.panoptic.matched[index] {
        phrases.push(match judged.panoptic.best[index] {
            None => "in no segment".to_owned(),
            Some(best) if best.is_match() => {
                format!("segment {} is too small to be counted", scene.segments[best.segment].id)
            }
            Some(best) => {
                format!("best IoU {:.3} with segment {}", best.value(), scene.segments[best.segment].id)
            }
        });
    }
    let lost = [
        (object.predicted_ground, "classified as ground"),
        (object.predicted_noise, "classified as noise"),
        (object.unassigned, "in no segment"),
    ];
    // The threshold is a tenth, as for over-segmentation: a smaller part does not change the object.
    phrases.extend(
        lost.into_iter()
            .filter(|(points, _)| 10 * points >= object.points)
            .map(|(points, how)| format!("{} of it {how}", percent(points, object.points))),
    );
    phrases
}

//! The objects and segments behind each figure: id, class, place and what went wrong. Lists contain indices.
//! The words of an entry are made when it is written, so that a report of a long drive stays small.

use serde::{Serialize, Serializer};

use crate::eval::metrics::hoover::Detection;
use crate::eval::metrics::panoptic::SegmentRole;
use crate::eval::metrics::{Judged, MetricSettings};
use crate::eval::report::rounding::millimetres;
use crate::eval::report::rows::{ObjectRows, chainage_m};
use crate::survey::Axis;
use crate::words::counted;

/// An object or a segment that lowers a figure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// Id of the reference object, if the finding is an object.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub object: Option<i64>,
    /// Id of the predicted segment, if the finding is a segment.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub segment: Option<i64>,
    /// Class code; none for a segment that contains no point of an object.
    pub class: Option<u16>,
    /// Name of the class.
    pub class_name: Option<String>,
    /// Distance along the axis, in metres.
    pub chainage_m: f64,
    /// Mean position, in metres.
    pub at_m: [f64; 3],
    /// Points.
    pub points: u64,
    /// What went wrong.
    pub what: String,
}

/// A list of findings.
#[derive(Debug, Clone)]
pub struct Findings<'a> {
    collect: Collect<'a>,
    /// Indices of objects, or of segments.
    of: Vec<usize>,
    segments: bool,
}

impl Findings<'_> {
    /// The findings in the order of their ids.
    pub fn iter(&self) -> impl Iterator<Item = Finding> {
        let one =
            |&index| if self.segments { self.collect.segment(index) } else { self.collect.object(index) };
        self.of.iter().map(one)
    }
}

impl Serialize for Findings<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.iter())
    }
}

/// The findings that lower each figure.
#[derive(Debug, Clone, Serialize)]
pub struct Behind<'a> {
    /// USR: under-segmented objects.
    pub under_segmented: Findings<'a>,
    /// OSR: over-segmented objects.
    pub over_segmented: Findings<'a>,
    /// Objects that USR and OSR do not count as errors, because no segment contains a point of them.
    pub without_segment: Findings<'a>,
    /// F1, PQ, RQ: objects without a match.
    pub false_negatives: Findings<'a>,
    /// F1, PQ, RQ: segments without a match.
    pub false_positives: Findings<'a>,
    /// SQ: objects that are matched with an IoU below 0.8.
    pub matched_poorly: Findings<'a>,
    /// Segments that PQ leaves out because more than half of them belongs to no object.
    pub mostly_unlabelled: Findings<'a>,
    /// Hoover's classes, one entry per tolerance.
    pub hoover: Vec<HooverFindings<'a>>,
}

/// The findings behind Hoover's classes at one tolerance.
#[derive(Debug, Clone, Serialize)]
pub struct HooverFindings<'a> {
    /// The tolerance.
    pub tolerance: f64,
    /// Objects in several segments.
    pub over: Findings<'a>,
    /// Objects that share a segment.
    pub under: Findings<'a>,
    /// Objects that are missed.
    pub missed: Findings<'a>,
    /// Noise segments with at least as many points as an object needs. Smaller ones are only counted: there
    /// can be millions of them.
    pub noise: Findings<'a>,
}

/// IoU below which a match is listed as poor: the tolerance of Wang et al. 2019 (doi:10.3390/s19010172),
/// because no other value is established.
const POOR_IOU: f64 = 0.8;

/// Collects the objects and segments that lower the figures. `rows` are the rows of the evaluated objects.
pub(super) fn behind<'a>(
    judged: &'a Judged,
    settings: &'a MetricSettings,
    axis: &'a Axis,
    rows: &ObjectRows<'a>,
) -> Behind<'a> {
    let collect = Collect { judged, settings, axis, rows: rows.clone() };
    let Judged { scene, segmentation, panoptic, hoover } = judged;
    let role = |role| collect.segments(|index| panoptic.segments[index] == role);
    Behind {
        under_segmented: collect.objects(|index| segmentation[index].is_under()),
        over_segmented: collect.objects(|index| segmentation[index].is_over()),
        without_segment: collect.objects(|index| scene.objects[index].overlaps.is_empty()),
        false_negatives: collect.objects(|index| !panoptic.matched[index]),
        false_positives: role(SegmentRole::FalsePositive),
        matched_poorly: collect.objects(|index| panoptic.matched[index] && rows.best_iou(index) < POOR_IOU),
        mostly_unlabelled: role(SegmentRole::Unlabelled),
        hoover: (0..hoover.len()).map(|at| collect.hoover(at)).collect(),
    }
}

#[derive(Debug, Clone)]
struct Collect<'a> {
    judged: &'a Judged,
    settings: &'a MetricSettings,
    axis: &'a Axis,
    rows: ObjectRows<'a>,
}

impl<'a> Collect<'a> {
    fn hoover(&self, at: usize) -> HooverFindings<'a> {
        let hoover = &self.judged.hoover[at];
        let detected = |holds: fn(Detection) -> bool| self.objects(|index| holds(hoover.objects[index]));
        HooverFindings {
            tolerance: hoover.tolerance.share(),
            over: detected(|detection| matches!(detection, Detection::Over { .. })),
            under: detected(|detection| matches!(detection, Detection::Under { .. })),
            missed: detected(|detection| detection == Detection::Missed),
            noise: self.segments(|index| {
                hoover.noise[index] && self.judged.scene.segments[index].points >= self.settings.min_points
            }),
        }
    }

    fn objects(&self, holds: impl Fn(usize) -> bool) -> Findings<'a> {
        let of = (0..self.judged.scene.objects.len()).filter(|&index| holds(index)).collect();
        Findings { collect: self.clone(), of, segments: false }
    }

    fn object(&self, index: usize) -> Finding {
        let row = self.rows.row(index);
        Finding {
            object: Some(row.object),
            segment: None,
            class: Some(row.class),
            class_name: Some(row.class_name),
            chainage_m: row.chainage_m,
            at_m: [row.x_m, row.y_m, row.z_m],
            points: row.points,
            what: row.what,
        }
    }

    fn segments(&self, holds: impl Fn(usize) -> bool) -> Findings<'a> {
        let of = (0..self.judged.scene.segments.len()).filter(|&index| holds(index)).collect();
        Findings { collect: self.clone(), of, segments: true }
    }

    fn segment(&self, index: usize) -> Finding {
        let scene = &self.judged.scene;
        let segment = &scene.segments[index];
        let class = scene.segment_class(segment);
        Finding {
            object: None,
            segment: Some(segment.id),
            class,
            class_name: class.map(|code| self.settings.classes.name(code)),
            chainage_m: millimetres(chainage_m(self.axis, segment.centroid_m)),
            at_m: segment.centroid_m.map(millimetres),
            points: segment.points,
            what: self.segment_in_words(index),
        }
    }

    fn segment_in_words(&self, index: usize) -> String {
        let scene = &self.judged.scene;
        let segment = &scene.segments[index];
        let percent = |points: u64| 100.0 * points as f64 / segment.points as f64;
        let Some(main) = segment.main() else { return "contains no point of an object".to_owned() };
        let object = &scene.objects[main.index];
        let mut words = format!(
            "{:.1} % of its points belong to object {} ({}), {:.1} % of that object",
            percent(main.points),
            object.id,
            self.settings.classes.name(object.class),
            100.0 * main.points as f64 / object.points as f64
        );
        if segment.overlaps.len() > 1 {
            words += &format!("; overlaps {}", counted(segment.overlaps.len() as u64 - 1, "more object"));
        }
        if segment.labelled < segment.points {
            words += &format!("; {:.1} % belong to no object", percent(segment.points - segment.labelled));
        }
        words
    }
}

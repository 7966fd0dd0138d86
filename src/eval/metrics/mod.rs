//! The figures per class and overall: counts over the results of the metrics for every object and segment.
//!
//! A figure is `None` if there is nothing to count, never 0 or NaN. If there are objects but no match, SQ is
//! 0, as in the reference code of panoptic quality. A false positive or a noise segment counts in the class
//! of the object that has most points in it. Noise without points of any object counts overall only.
//! Published figures per class often count false positives in no class, because their segments have no class.
//! F1 is given in this way as well.

pub mod hoover;
pub mod named;
pub mod overlaps;
pub mod panoptic;
pub mod rand_index;
pub mod segmentation;

use crate::eval::classes::ClassTable;
use crate::eval::table::{Predicted, Table};
use crate::model::Lattice;
use hoover::{Detection, Hoover, Tolerance};
use named::Named;
use overlaps::{Object, Scene, Segment};
use panoptic::{Iou, Panoptic, SegmentRole};
use rand_index::adjusted_rand_index;
use segmentation::Segmentation;

/// The settings of the metrics.
#[derive(Debug, Clone, PartialEq)]
pub struct MetricSettings {
    /// Smallest number of points of an object that counts, and for PQ also of a segment.
    pub min_points: u64,
    /// Tolerances of Hoover's classes.
    pub hoover: Vec<Tolerance>,
    /// Class codes of the reference.
    pub classes: ClassTable,
}

/// Counts of Hoover's classes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HooverCounts {
    /// The tolerance.
    pub tolerance: Tolerance,
    /// Objects detected correctly.
    pub correct: u64,
    /// Objects in several segments.
    pub over: u64,
    /// Objects that share a segment.
    pub under: u64,
    /// Objects of none of these classes.
    pub missed: u64,
    /// Segments without an object.
    pub noise: u64,
}

/// The figures of one class, or of all.
#[derive(Debug, Clone, PartialEq)]
pub struct Figures {
    /// Evaluated objects.
    pub objects: u64,
    /// Their points.
    pub points: u64,
    /// Objects without a point in any segment: USR, OSR and OA do not count them as errors.
    pub without_segment: u64,
    /// Under-segmented objects.
    pub under: u64,
    /// Over-segmented objects.
    pub over: u64,
    /// Objects matched at IoU > 0.5.
    pub true_positives: u64,
    /// Segments that count and match no object.
    pub false_positives: u64,
    /// Sum of the IoU of the matches.
    pub iou_sum: f64,
    /// Sum over the objects of their best IoU.
    pub best_iou_sum: f64,
    /// Adjusted Rand index over the points of the objects.
    pub ari: Option<f64>,
    /// One entry per tolerance.
    pub hoover: Vec<HooverCounts>,
}

fn ratio(part: f64, whole: f64) -> Option<f64> {
    (whole > 0.0).then(|| part / whole)
}

impl Figures {
    /// Share of under-segmented objects.
    #[must_use]
    pub fn usr(&self) -> Option<f64> {
        ratio(self.under as f64, self.objects as f64)
    }

    /// Share of over-segmented objects.
    #[must_use]
    pub fn osr(&self) -> Option<f64> {
        ratio(self.over as f64, self.objects as f64)
    }

    /// 1 - (USR + OSR) / 2.
    #[must_use]
    pub fn oa(&self) -> Option<f64> {
        ratio((2 * self.objects - self.under - self.over) as f64, 2.0 * self.objects as f64)
    }

    /// Objects without a match.
    #[must_use]
    pub fn false_negatives(&self) -> u64 {
        self.objects - self.true_positives
    }

    /// Share of the counted segments that match an object.
    #[must_use]
    pub fn precision(&self) -> Option<f64> {
        ratio(self.true_positives as f64, (self.true_positives + self.false_positives) as f64)
    }

    /// Share of the objects that match a segment.
    #[must_use]
    pub fn recall(&self) -> Option<f64> {
        ratio(self.true_positives as f64, self.objects as f64)
    }

    /// Recognition quality, TP / (TP + FP / 2 + FN / 2).
    #[must_use]
    pub fn rq(&self) -> Option<f64> {
        let matched = 2 * self.true_positives;
        let all = self.objects + self.true_positives + self.false_positives;
        ratio(matched as f64, all as f64)
    }

    /// F1 of the matches, 2 P R / (P + R): the same number as RQ.
    #[must_use]
    pub fn f1(&self) -> Option<f64> {
        self.rq()
    }

    /// F1 of the matches if no false segment counts, 2 R / (1 + R). Authors whose segments have no class
    /// report this figure, because they count false segments in no class.
    #[must_use]
    pub fn f1_without_false_positives(&self) -> Option<f64> {
        ratio((2 * self.true_positives) as f64, (self.objects + self.true_positives) as f64)
    }

    /// Segmentation quality: mean IoU of the matches.
    #[must_use]
    pub fn sq(&self) -> Option<f64> {
        self.rq()?;
        Some(ratio(self.iou_sum, self.true_positives as f64).unwrap_or(0.0))
    }

    /// Panoptic quality: sum of IoU / (TP + FP / 2 + FN / 2).
    #[must_use]
    pub fn pq(&self) -> Option<f64> {
        ratio(2.0 * self.iou_sum, (self.objects + self.true_positives + self.false_positives) as f64)
    }

    /// Mean over the objects of the best IoU of any segment.
    #[must_use]
    pub fn mean_best_iou(&self) -> Option<f64> {
        ratio(self.best_iou_sum, self.objects as f64)
    }
}

/// Scores of a set of points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PointScore {
    /// Points in the reference.
    pub reference: u64,
    /// Points in the prediction.
    pub predicted: u64,
    /// Points in both.
    pub both: u64,
}

impl PointScore {
    /// Counts the points of `reference` and the points that the prediction calls `predicted`. If no class of
    /// the reference has this role (`known` is false), nothing is counted, because the prediction cannot be
    /// judged.
    fn count(table: &Table, known: bool, reference: impl Fn(u16) -> bool, predicted: Predicted) -> Self {
        let mut score = Self::default();
        for (cell, points) in table.cells.iter().filter(|_| known) {
            let in_reference = reference(cell.class);
            let in_prediction = cell.predicted == predicted;
            score.reference += if in_reference { *points } else { 0 };
            score.predicted += if in_prediction { *points } else { 0 };
            score.both += if in_reference && in_prediction { *points } else { 0 };
        }
        score
    }

    /// Share of the predicted points that are right.
    #[must_use]
    pub fn precision(&self) -> Option<f64> {
        ratio(self.both as f64, self.predicted as f64)
    }

    /// Share of the reference points that were found.
    #[must_use]
    pub fn recall(&self) -> Option<f64> {
        ratio(self.both as f64, self.reference as f64)
    }

    /// Points of both over points of either.
    #[must_use]
    pub fn iou(&self) -> Option<f64> {
        ratio(self.both as f64, (self.reference + self.predicted - self.both) as f64)
    }
}

/// Results of the metrics for every object and segment.
#[derive(Debug, Clone, PartialEq)]
pub struct Judged {
    /// Objects, segments and overlaps.
    pub scene: Scene,
    /// Under- and over-segmentation per object.
    pub segmentation: Vec<Segmentation>,
    /// Matches at IoU > 0.5.
    pub panoptic: Panoptic,
    /// Hoover's classes, one entry per tolerance.
    pub hoover: Vec<Hoover>,
}

/// Results of all metrics for a drive.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    /// Points compared.
    pub points: u64,
    /// Per object and segment.
    pub judged: Judged,
    /// Figures per class that has objects, by code.
    pub classes: Vec<(u16, Figures)>,
    /// Figures of all objects.
    pub overall: Figures,
    /// Ground points.
    pub ground: PointScore,
    /// Stray returns.
    pub noise: PointScore,
    /// Classes of points and objects, if the prediction gives objects classes.
    pub named: Option<Named>,
}

impl Evaluation {
    /// Evaluates a table. `lattice` converts positions to metres.
    #[must_use]
    pub fn of(table: Table, settings: &MetricSettings, lattice: Lattice) -> Self {
        let classes = &settings.classes;
        let points = table.points();
        let is_ground = |code| classes.is_ground(code);
        let is_noise = |code| classes.is_noise(code);
        let ground = PointScore::count(&table, classes.has_ground(), is_ground, Predicted::Ground);
        let noise = PointScore::count(&table, classes.has_noise(), is_noise, Predicted::Noise);
        let named = Named::of_points(&table, classes);
        let scene = Scene::build(&table, classes, lattice, settings.min_points);
        // The results take as much memory again.
        drop(table);
        let judged = Judged::of(scene, settings);
        let name = |points| Named::new(points, &judged.scene, &judged.panoptic, &settings.classes);
        let named = named.map(name);
        let classes = judged.codes().into_iter().map(|code| (code, judged.of_class(code))).collect();
        Self { points, classes, overall: judged.figures(|_| true, |_| true), ground, noise, named, judged }
    }

    /// Mean of PQ over the classes, as the paper reports it; each class counts the same.
    #[must_use]
    pub fn pq_class_mean(&self) -> Option<f64> {
        let values: Vec<f64> = self.classes.iter().filter_map(|class| class.1.pq()).collect();
        ratio(values.iter().sum(), values.len() as f64)
    }
}

impl Judged {
    fn of(scene: Scene, settings: &MetricSettings) -> Self {
        Self {
            segmentation: segmentation::judge(&scene),
            panoptic: panoptic::judge(&scene, settings.min_points),
            hoover: settings.hoover.iter().map(|&tolerance| hoover::judge(&scene, tolerance)).collect(),
            scene,
        }
    }

    fn codes(&self) -> Vec<u16> {
        let mut codes: Vec<u16> = self.scene.objects.iter().map(|object| object.class).collect();
        codes.sort_unstable();
        codes.dedup();
        codes
    }

    fn of_class(&self, code: u16) -> Figures {
        self.figures(|object| object.class == code, |segment| self.scene.segment_class(segment) == Some(code))
    }

    fn figures(&self, of_object: impl Fn(&Object) -> bool, of_segment: impl Fn(&Segment) -> bool) -> Figures {
        let objects: Vec<usize> = indices(&self.scene.objects, &of_object);
        let segments: Vec<usize> = indices(&self.scene.segments, &of_segment);
        let count =
            |holds: &dyn Fn(usize) -> bool| objects.iter().filter(|&&index| holds(index)).count() as u64;
        let iou_sum = |holds: &dyn Fn(usize) -> bool| {
            let ious =
                objects.iter().filter(|&&index| holds(index)).filter_map(|&index| self.panoptic.best[index]);
            // `sum` is not used, because the sum of no values is -0.0.
            ious.map(Iou::value).fold(0.0, |sum, iou| sum + iou)
        };
        let is_false = |index: &&usize| self.panoptic.segments[**index] == SegmentRole::FalsePositive;
        Figures {
            objects: objects.len() as u64,
            points: objects.iter().map(|&index| self.scene.objects[index].points).sum(),
            without_segment: count(&|index| self.scene.objects[index].overlaps.is_empty()),
            under: count(&|index| self.segmentation[index].is_under()),
            over: count(&|index| self.segmentation[index].is_over()),
            true_positives: count(&|index| self.panoptic.matched[index]),
            false_positives: segments.iter().filter(is_false).count() as u64,
            iou_sum: iou_sum(&|index| self.panoptic.matched[index]),
            best_iou_sum: iou_sum(&|_| true),
            ari: adjusted_rand_index(&self.scene, &of_object),
            hoover: self.hoover.iter().map(|hoover| hoover_counts(hoover, &objects, &segments)).collect(),
        }
    }
}

fn indices<T>(items: &[T], holds: &impl Fn(&T) -> bool) -> Vec<usize> {
    (0..items.len()).filter(|&index| holds(&items[index])).collect()
}

fn hoover_counts(hoover: &Hoover, objects: &[usize], segments: &[usize]) -> HooverCounts {
    let mut counts =
        HooverCounts { tolerance: hoover.tolerance, correct: 0, over: 0, under: 0, missed: 0, noise: 0 };
    for &object in objects {
        *match hoover.objects[object] {
            Detection::Correct { .. } => &mut counts.correct,
            Detection::Over { .. } => &mut counts.over,
            Detection::Under { .. } => &mut counts.under,
            Detection::Missed => &mut counts.missed,
        } += 1;
    }
    counts.noise = segments.iter().filter(|&&segment| hoover.noise[segment]).count() as u64;
    counts
}

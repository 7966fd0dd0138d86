//! Scores of a segmentation against reference labels, from arrays.

use chainage::eval::metrics::Figures;
use chainage::eval::table::{Cell, Counter, Predicted};
use chainage::eval::{ClassTable, Evaluation, MetricSettings};
use chainage::model::Lattice;
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use serde_json::{Value, json};

use crate::failure::bug;

fn figures(of: &Figures) -> Value {
    json!({
        "objects": of.objects, "points": of.points, "without_segment": of.without_segment,
        "under": of.under, "over": of.over, "usr": of.usr(), "osr": of.osr(), "oa": of.oa(),
        "true_positives": of.true_positives, "false_positives": of.false_positives,
        "false_negatives": of.false_negatives(), "precision": of.precision(), "recall": of.recall(),
        "f1": of.f1(), "rq": of.rq(), "sq": of.sq(), "pq": of.pq(),
        "mean_best_iou": of.mean_best_iou(), "ari": of.ari,
    })
}

/// Scores labels, which the Python part has checked. `class` are codes of the reference; without them all
/// objects are of one class.
#[pyfunction]
#[pyo3(signature = (pred, reference, class, min_points))]
pub(crate) fn evaluate(
    py: Python<'_>,
    pred: PyReadonlyArray1<'_, i64>,
    reference: PyReadonlyArray1<'_, i64>,
    class: Option<PyReadonlyArray1<'_, u16>>,
    min_points: u64,
) -> PyResult<String> {
    let classes = if class.is_some() { ClassTable::default() } else { ClassTable::unclassified() };
    let pred: Vec<i64> = pred.as_array().to_vec();
    let reference: Vec<i64> = reference.as_array().to_vec();
    let class: Option<Vec<u16>> = class.map(|class| class.as_array().to_vec());
    let text = py.detach(|| {
        let mut counter = Counter::default();
        for (row, (&segment, &object)) in pred.iter().zip(&reference).enumerate() {
            let class = class.as_ref().map_or(0, |class| class[row]);
            let cell = Cell { object, segment, class, predicted: Predicted::Other, named: 0 };
            counter.add(cell, [0; 3]);
        }
        let hoover = ["0.8", "0.5"].iter().filter_map(|share| share.parse().ok()).collect();
        let settings = MetricSettings { min_points, hoover, classes };
        let found = Evaluation::of(counter.finish(), &settings, Lattice::MILLIMETRE);
        let by_class: serde_json::Map<String, Value> =
            found.classes.iter().map(|(code, of)| (settings.classes.name(*code), figures(of))).collect();
        let pq_class_mean = found.pq_class_mean();
        let overall = figures(&found.overall);
        json!({ "points": found.points, "overall": overall, "classes": by_class, "pq_class_mean": pq_class_mean })
    });
    serde_json::to_string(&text).map_err(bug)
}

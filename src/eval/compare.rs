//! From two sets of files to one contingency table. Not: what the table means.

use std::path::PathBuf;

use crate::error::Result;
use crate::eval::error::{EvalError, PointSite};
use crate::eval::order::{self, Pair};
use crate::eval::parts::Parts;
use crate::eval::scratch::ScratchFolder;
use crate::eval::sides::Files;
use crate::eval::table::Table;
use crate::input::Catalog;
use crate::model::Lattice;

/// Which dimensions hold the labels, and how points are matched.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CompareSettings {
    /// Dimension of the predicted segments.
    pub prediction_dim: String,
    /// Dimension of the reference objects.
    pub reference_dim: String,
    /// Dimension of the reference classes; none when there are no classes.
    pub class_dim: Option<String>,
    /// LAS classes of the prediction that are ground.
    pub ground_classes: Vec<u16>,
    /// LAS classes of the prediction that are isolated noise.
    pub noise_classes: Vec<u16>,
    /// Whether points are recognised by coordinates alone, though both sides have times.
    pub ignore_time: bool,
    /// Folder for scratch files.
    pub scratch: PathBuf,
}

impl Default for CompareSettings {
    fn default() -> Self {
        Self {
            prediction_dim: "cluster_id".to_owned(),
            reference_dim: "gt_instance".to_owned(),
            class_dim: Some("gt_class".to_owned()),
            ground_classes: vec![2],
            noise_classes: vec![7, 18],
            ignore_time: false,
            scratch: std::env::temp_dir(),
        }
    }
}

/// How the points of both sides were matched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Matching {
    /// Both labels are in the same records.
    SameRecords,
    /// The sides have their points in the same order.
    RecordOrder,
    /// By coordinates and GPS time.
    CoordinatesAndTime,
    /// By coordinates alone.
    Coordinates,
}

impl Matching {
    /// In words.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::SameRecords => "record (both labels are in the same files)",
            Self::RecordOrder => "record order",
            Self::CoordinatesAndTime => "coordinates and time",
            Self::Coordinates => "coordinates",
        }
    }
}

/// A table and what its positions mean.
#[derive(Debug, Clone)]
pub struct Counted {
    /// The contingency table.
    pub table: Table,
    /// Lattice of its positions.
    pub lattice: Lattice,
    /// How the points were matched.
    pub matching: Matching,
}

/// Counts all points of the prediction against the reference (the prediction itself, when there is none). `note` is
/// told when the points have to be matched by coordinates, which takes scratch space and time.
///
/// # Errors
/// A dimension that is missing or holds no labels, files that cannot be read, points that differ, scratch files that
/// cannot be written.
pub fn count(
    prediction: &Catalog,
    reference: Option<&Catalog>,
    settings: &CompareSettings,
    note: &dyn Fn(&str),
) -> Result<Counted> {
    let parts = Parts::new(&settings.scratch);
    let predicted = Files::prediction(prediction, settings)?;
    let Some(reference) = reference else {
        let table = order::count_same_files(&predicted, &Files::reference(prediction, settings)?, parts)?;
        return Ok(Counted { table, lattice: prediction.lattice(), matching: Matching::SameRecords });
    };
    let referred = Files::reference(reference, settings)?;
    let with_time = predicted.has_time() && referred.has_time() && !settings.ignore_time;
    let pair = Pair { prediction: predicted, reference: referred, with_time };
    same_counts(&pair)?;
    let (table, matching) = match pair.count_in_order(parts)? {
        Some(table) => (table, Matching::RecordOrder),
        None => (by_key(&pair, settings, note)?, pair.matching_by_key()),
    };
    Ok(Counted { table, lattice: reference.lattice(), matching })
}

fn by_key(pair: &Pair<'_>, settings: &CompareSettings, note: &dyn Fn(&str)) -> Result<Table> {
    let points = pair.prediction.catalog.point_count();
    // 16 bytes per point and side, see scratch.rs.
    let gigabytes = points as f64 * 32e-9;
    note(&format!(
        "the two sides are in different orders: matching {points} points by {}, with up to {gigabytes:.1} GB of \
         scratch files in {}",
        pair.matching_by_key().name(),
        settings.scratch.display()
    ));
    pair.count_by_key(&ScratchFolder::create(&settings.scratch)?)
}

impl Pair<'_> {
    fn matching_by_key(&self) -> Matching {
        if self.with_time { Matching::CoordinatesAndTime } else { Matching::Coordinates }
    }
}

/// Refuses sides of different numbers of points, with the first point that differs.
fn same_counts(pair: &Pair<'_>) -> Result<()> {
    let counts = [pair.prediction.catalog.point_count(), pair.reference.catalog.point_count()];
    if counts[0] == counts[1] {
        return Ok(());
    }
    // Where all common points agree, the first that differs is the first that one side has more.
    let first = pair.first_difference()?.unwrap_or_else(|| counts[0].min(counts[1]));
    let site = |found: Result<PointSite>| found.map(Box::new);
    let prediction =
        (first < counts[0]).then(|| site(pair.prediction.site(first, pair.with_time))).transpose()?;
    let reference =
        (first < counts[1]).then(|| site(pair.reference.site(first, pair.with_time))).transpose()?;
    Err(EvalError::PointCounts { counts, prediction, reference }.into())
}

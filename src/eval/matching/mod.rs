//! Makes one contingency table from two sets of files. The meaning of the table is not known here.

mod dims;
mod join;
mod labels;
mod order;
mod parts;
mod scratch;
mod settings;
mod sides;

use crate::error::Result;
use crate::eval::error::{EvalError, PointSite};
use crate::eval::table::Table;
use crate::input::Catalog;
use crate::model::{Lattice, PointId};

use order::Pair;
use parts::Parts;
use sides::Files;

pub use settings::CompareSettings;

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
    /// The matching in words.
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

/// A table, the lattice of its positions, and how its points were matched.
#[derive(Debug, Clone)]
pub struct Counted {
    /// The contingency table.
    pub table: Table,
    /// Number of points that are withheld on either side. The table leaves them out.
    pub withheld: u64,
    /// Lattice of its positions.
    pub lattice: Lattice,
    /// How the points were matched.
    pub matching: Matching,
    /// The dimension of the predicted segments.
    pub prediction_dim: String,
    /// The dimension of the predicted classes of objects, if they were compared.
    pub named_dim: Option<String>,
}

/// Counts all points of the prediction against the reference; without a reference, against the prediction
/// itself. `note` is called if the points must be matched by coordinates, which takes scratch space and time.
///
/// # Errors
/// A dimension that is missing or contains no labels, files that cannot be read, points that differ, scratch
/// files that cannot be written.
pub fn count(
    prediction: &Catalog,
    reference: Option<&Catalog>,
    settings: &CompareSettings,
    note: &dyn Fn(&str),
) -> Result<Counted> {
    let parts = Parts::new(&settings.scratch);
    let without = |table: &Table| prediction.point_count() - table.points();
    let predicted = Files::prediction(prediction, settings)?;
    let prediction_dim = settings.prediction_dim_in(prediction).to_owned();
    let named_dim = settings.named_dim_in(prediction).map(str::to_owned);
    let Some(reference) = reference else {
        let table = order::count_same_files(&predicted, &Files::reference(prediction, settings)?, parts)?;
        let (withheld, lattice) = (without(&table), prediction.lattice());
        let matching = Matching::SameRecords;
        return Ok(Counted { table, withheld, lattice, matching, prediction_dim, named_dim });
    };
    let referred = Files::reference(reference, settings)?;
    let with_time = predicted.has_time() && referred.has_time() && !settings.ignore_time;
    let pair = Pair { prediction: predicted, reference: referred, with_time };
    same_counts(&pair)?;
    let (table, matching) = match pair.count_in_order(parts)? {
        Some(table) => (table, Matching::RecordOrder),
        None => (by_key(&pair, settings, note)?, pair.matching_by_key()),
    };
    let (withheld, lattice) = (without(&table), reference.lattice());
    Ok(Counted { table, withheld, lattice, matching, prediction_dim, named_dim })
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
    pair.count_by_key(&scratch::folder(&settings.scratch)?)
}

impl Pair<'_> {
    fn matching_by_key(&self) -> Matching {
        if self.with_time { Matching::CoordinatesAndTime } else { Matching::Coordinates }
    }
}

/// Refuses sides with different numbers of points, and names the first point that differs.
fn same_counts(pair: &Pair<'_>) -> Result<()> {
    let counts = [pair.prediction.catalog.point_count(), pair.reference.catalog.point_count()];
    if counts[0] == counts[1] {
        return Ok(());
    }
    // If all common points agree, the first difference is the first surplus point of one side.
    let first = pair.first_difference()?.unwrap_or_else(|| PointId::new(counts[0].min(counts[1])));
    let site = |found: Result<PointSite>| found.map(Box::new);
    let prediction = (first.number() < counts[0])
        .then(|| site(pair.prediction.site(first, pair.with_time)))
        .transpose()?;
    let reference =
        (first.number() < counts[1]).then(|| site(pair.reference.site(first, pair.with_time))).transpose()?;
    Err(EvalError::PointCounts { counts, prediction, reference }.into())
}

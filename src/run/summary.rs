//! The result of a run: points by class, objects, times, warnings.

use serde::Serialize;

use crate::cluster::Figures;
use crate::cluster::dbscan::epsilon::DriveEpsilon;
use crate::run::drive::Surveyed;
use crate::run::engine::PassFigures;

/// Points of a drive by class.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Neither ground nor noise.
    pub object: u64,
    /// Ground.
    pub ground: u64,
    /// Isolated noise near or below the ground.
    pub low_noise: u64,
    /// Isolated noise high above.
    pub high_noise: u64,
    /// Withheld in the input, so in no other class. Left out of the JSON if there are none.
    #[serde(skip_serializing_if = "is_none")]
    pub withheld: u64,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_none(points: &u64) -> bool {
    *points == 0
}

/// The section of a drive that was processed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SectionFacts {
    /// Chainage where it begins in metres.
    pub from_m: f64,
    /// Chainage where it ends in metres.
    pub to_m: f64,
    /// Length of the axis of the drive in metres.
    pub length_m: f64,
}

impl SectionFacts {
    pub(crate) fn of(surveyed: &Surveyed) -> Option<Self> {
        let length_m = surveyed.axis.length_m();
        surveyed.section_m().map(|(from_m, to_m)| Self { from_m, to_m: to_m.min(length_m), length_m })
    }
}

/// The result of a run.
#[derive(Debug, Clone, Serialize)]
pub struct RunSummary {
    /// Points of the drive, or of its processed section.
    pub points: u64,
    /// The processed section. `None` if it is the whole drive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub section: Option<SectionFacts>,
    /// Points by class.
    pub counts: Counts,
    /// Objects.
    pub objects: usize,
    /// Tiles.
    pub tiles: usize,
    /// Wall time of this call in seconds.
    pub seconds: f64,
    /// Whether the objects are surfaces, so that tables of surfaces are written. Left out of the JSON if not.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub surfaces: bool,
    /// Names of the charts that this call wrote.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub charts: Vec<String>,
    /// Whether every output existed already.
    pub nothing_to_do: bool,
    /// Figures of the steps of the clustering method by name, if it has any: `stages` of `density-peaks`, and
    /// the estimated `epsilon` with its curve.
    #[serde(flatten)]
    pub figures: Figures,
    /// Passes with their times.
    pub passes: Vec<PassFigures>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
    /// Peak resident set in bytes, mapped pages included, if the system reports it.
    pub peak_resident_bytes: Option<u64>,
}

impl RunSummary {
    /// The estimated epsilon with its curve, if the method asked for an estimate.
    #[must_use]
    pub fn epsilon(&self) -> Option<DriveEpsilon> {
        self.figures.get("epsilon").and_then(|value| serde_json::from_value(value.clone()).ok())
    }
}

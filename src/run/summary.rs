//! The result of a run: points by class, objects, times, warnings.

use serde::Serialize;

use crate::cluster::Figures;
use crate::cluster::dbscan::epsilon::DriveEpsilon;
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
}

/// The result of a run.
#[derive(Debug, Clone, Serialize)]
pub struct RunSummary {
    /// Points of the drive.
    pub points: u64,
    /// Points by class.
    pub counts: Counts,
    /// Objects.
    pub objects: usize,
    /// Tiles.
    pub tiles: usize,
    /// Wall time of this call in seconds.
    pub seconds: f64,
    /// Whether every output had been there already.
    pub nothing_to_do: bool,
    /// Figures of the steps of the clustering method by name, where it has any: `stages` of `density-peaks`, and the
    /// `epsilon` that was estimated with its curve.
    #[serde(flatten)]
    pub figures: Figures,
    /// Passes with their times.
    pub passes: Vec<PassFigures>,
    /// What the user should know.
    pub warnings: Vec<String>,
    /// Peak resident set in bytes, mapped pages included, where the system says.
    pub peak_resident_bytes: Option<u64>,
}

impl RunSummary {
    /// The epsilon that was estimated, with its curve, where the method asked for one.
    #[must_use]
    pub fn epsilon(&self) -> Option<DriveEpsilon> {
        self.figures.get("epsilon").and_then(|value| serde_json::from_value(value.clone()).ok())
    }
}

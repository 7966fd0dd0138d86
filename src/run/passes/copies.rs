//! Which labelled copies a run writes, and which points it shows: for a section, only those in it and around it.

use crate::output::LabelledFile;
use crate::run::drive::Tiled;
use crate::tiling::Plan;

/// The labelled copies, and whether they are written. If not, records are read for the samples only.
pub(crate) struct Copies<'a> {
    pub(super) labelled: Vec<LabelledFile>,
    /// Whether a file has points that are processed.
    pub(super) processed: Vec<bool>,
    pub(super) writes: bool,
    pub(super) shown: Shown<'a>,
}

impl<'a> Copies<'a> {
    /// The copies of the files that have points in tiles.
    pub(crate) fn of(labelled: Vec<LabelledFile>, tiled: &Tiled<'a>, writes: bool) -> Self {
        let section = tiled.surveyed.section.as_ref().map(|_| tiled.plan);
        let blocks = |file: usize| 0..tiled.drive.file(file).blocks().len();
        let has_points = |file| section.is_none() || tiled.may_meet_tiles(file, blocks(file));
        let processed = (0..labelled.len()).map(has_points).collect();
        Self { labelled, processed, writes, shown: Shown(section) }
    }
}

/// The points of no object that the report shows: those of the section with this plan, or all.
pub(super) struct Shown<'a>(Option<&'a Plan>);

impl Shown<'_> {
    pub(super) fn contains(&self, [x, y, _]: [i64; 3]) -> bool {
        let is_inside = |plan: &Plan| plan.grid().cell(x, y).is_some_and(|cell| plan.is_inside(cell));
        self.0.is_none_or(is_inside)
    }
}

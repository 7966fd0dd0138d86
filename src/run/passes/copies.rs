//! Which labelled copies a run writes, and which points it shows: for a section, only points in it and around
//! it.

use crate::error::Result;
use crate::model::Kind;
use crate::output::LabelledFile;
use crate::run::drive::Tiled;
use crate::run::passes::relabel::PointColumns;
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
        let shown = Shown::of(tiled);
        let blocks = |file: usize| 0..tiled.drive.file(file).blocks().len();
        let has_points = |file| shown.0.is_none() || tiled.may_meet_tiles(file, blocks(file));
        let processed = (0..labelled.len()).map(has_points).collect();
        Self { labelled, processed, writes, shown }
    }
}

/// Objects and classes of consecutive records, read from the columns of the drive.
pub(super) struct Labels<'a> {
    columns: &'a PointColumns,
    of_objects: &'a [Kind],
    pub(super) objects: Vec<u32>,
    pub(super) classes: Vec<u8>,
    /// Class and confidence of the object of each record. Empty if the method does not classify.
    pub(super) kinds: Vec<Kind>,
}

impl<'a> Labels<'a> {
    /// Labels with the class and confidence of object 1, 2, ...; `of_objects` is empty if the method does not
    /// classify.
    pub(super) fn of(columns: &'a PointColumns, of_objects: &'a [Kind]) -> Self {
        Self { columns, of_objects, objects: Vec::new(), classes: Vec::new(), kinds: Vec::new() }
    }

    /// Reads the labels of some records of a file.
    pub(super) fn read(&mut self, file: usize, first: u64, count: usize) -> Result<()> {
        self.objects.resize(count, 0);
        self.classes.resize(count, 0);
        self.columns.objects.read(file, first, &mut self.objects)?;
        self.columns.classes.read(file, first, &mut self.classes)?;
        self.kinds.clear();
        if !self.of_objects.is_empty() {
            let kind = |label: &u32| {
                let object = (*label as usize).checked_sub(1);
                object.and_then(|object| self.of_objects.get(object)).copied().unwrap_or_default()
            };
            self.kinds.extend(self.objects.iter().map(kind));
        }
        Ok(())
    }
}

/// Which points without an object are shown: those inside the section of this plan, or all if there is no
/// section.
#[derive(Clone, Copy)]
pub(crate) struct Shown<'a>(Option<&'a Plan>);

impl<'a> Shown<'a> {
    /// The shown points of a drive in tiles.
    pub(crate) fn of(tiled: &Tiled<'a>) -> Self {
        Self(tiled.surveyed.section.as_ref().map(|_| tiled.plan))
    }

    pub(super) fn contains(self, [x, y, _]: [i64; 3]) -> bool {
        let is_inside = |plan: &Plan| plan.grid().cell(x, y).is_some_and(|cell| plan.is_inside(cell));
        self.0.is_none_or(is_inside)
    }
}

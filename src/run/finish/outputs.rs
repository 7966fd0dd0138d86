//! The last step of a run: the report, the page, and the mark that every output is complete.

use std::time::Instant;

use crate::error::Result;
use crate::output::LabelledFile;
use crate::run::cloud::Cloud;
use crate::run::engine::{PassFigures, peak_resident_bytes};
use crate::run::finish::{mark, names, page, report};
use crate::run::flow::{Outcome, Planned};
use crate::run::open::Opened;
use crate::run::summary::{RunSummary, SectionFacts};
use crate::store::RunDir;

/// What the process knows of its own part in the run.
pub(crate) struct Course {
    pub(crate) started: Instant,
    pub(crate) warnings: Vec<String>,
    pub(crate) passes: Vec<PassFigures>,
}

/// Names of labelled copies.
pub(crate) fn names_of(labelled: &[LabelledFile]) -> Vec<String> {
    labelled.iter().map(|file| file.name().to_owned()).collect()
}

/// Writes what is left after the last pass, unless it was written before. `copies` are the names of the
/// labelled copies.
pub(crate) fn finish(
    run_dir: &RunDir,
    open: &Opened<'_>,
    planned: &Planned,
    outcome: Outcome,
    copies: &[String],
    course: Course,
) -> Result<RunSummary> {
    let Course { started, mut warnings, passes } = course;
    warnings.extend(outcome.warnings);
    let summary = RunSummary {
        points: planned.plan.points_inside(),
        section: SectionFacts::of(&planned.surveyed),
        counts: outcome.counts,
        objects: outcome.objects,
        tiles: planned.plan.tiles.iter().filter(|tile| tile.inside).count(),
        seconds: started.elapsed().as_secs_f64(),
        surfaces: open.chain.method.finds_surfaces(),
        nothing_to_do: outcome.unmarked.is_none(),
        figures: outcome.figures,
        passes,
        warnings,
        peak_resident_bytes: peak_resident_bytes(),
    };
    let cloud = Cloud::outlines(&outcome.export).map(|pass| run_dir.pass(&pass.folder, pass.depends));
    let export = run_dir.pass(&outcome.export.folder, outcome.export.depends);
    let Some(finished) = outcome.unmarked else {
        // An earlier call may have been killed after the mark.
        mark::clear(run_dir, &export, &cloud)?;
        return Ok(summary);
    };
    let report = report::report(&open.drive, open.config, &planned.surveyed, &summary);
    report::write_report(run_dir, &report)?;
    page::write_page(run_dir, open, &planned.surveyed, &planned.plan, outcome.page, report)?;
    let surfaces = open.chain.method.finds_surfaces();
    names::remove_left_out(run_dir, open.config, surfaces, copies, &finished.files)?;
    mark::mark_finished(run_dir, &export, &cloud, &finished, &names::beside(open.config, surfaces))?;
    Ok(summary)
}

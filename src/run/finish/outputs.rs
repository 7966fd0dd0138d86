//! The last step of a run: the report, the page, and the mark that every output is complete.

use std::time::Instant;

use crate::error::Result;
use crate::run::cloud::Cloud;
use crate::run::engine::{Event, Observer, PassFigures, peak_resident_bytes};
use crate::run::finish::{mark, names, page, refresh, report};
use crate::run::flow::{Outcome, Planned};
use crate::run::open::Opened;
use crate::run::summary::{RunSummary, SectionFacts};
use crate::store::RunDir;

/// Times, warnings and figures of this process for the report.
pub(crate) struct Course {
    pub(crate) started: Instant,
    pub(crate) warnings: Vec<String>,
    pub(crate) passes: Vec<PassFigures>,
}

/// Writes the remaining outputs after the last pass, and removes outputs of earlier calls that this one does
/// not have, unless an earlier call did so.
pub(crate) fn finish(
    run_dir: &RunDir,
    open: &Opened<'_>,
    planned: &Planned,
    outcome: Outcome,
    course: Course,
    observer: &dyn Observer,
) -> Result<RunSummary> {
    let Course { started, mut warnings, passes } = course;
    let surfaces = open.chain.method.finds_surfaces();
    if let Some(finished) = &outcome.unmarked {
        for text in names::remove_left_out(run_dir, open.config, surfaces, &finished.files)? {
            let event = Event::Warning { text: &text };
            observer.event(&event);
            run_dir.log_event(&event.to_json().to_string());
            warnings.push(text);
        }
    }
    let summary = RunSummary {
        points: planned.plan.points_inside(),
        section: SectionFacts::of(&planned.surveyed),
        counts: outcome.counts,
        objects: outcome.objects,
        tiles: planned.plan.tiles.iter().filter(|tile| tile.inside).count(),
        seconds: started.elapsed().as_secs_f64(),
        surfaces,
        charts: outcome.charts,
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
        let rewritten = refresh::settings(run_dir, open.config, &summary.warnings)?;
        mark::fits_also(run_dir, open.config, &names::beside(open.config, surfaces), rewritten)?;
        return Ok(summary);
    };
    let report = report::report(&open.drive, open.config, &planned.surveyed, &summary);
    report::write_report(run_dir, &report)?;
    page::write_page(run_dir, open, &planned.surveyed, &planned.plan, outcome.page, report)?;
    let beside = names::beside(open.config, surfaces);
    mark::mark_finished(run_dir, &export, &cloud, &finished, (open.config, &beside))?;
    Ok(summary)
}

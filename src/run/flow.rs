//! The flow: the one list of passes, and the walk along it. `run`, `estimate-epsilon`, `status`, `plan` and
//! `info` walk it, each with its own driver. The walk stops at a pass that is incomplete and that the driver
//! does not compute.
//!
//! The result of a pass is used to build the next value: the survey gives a plan, the plan gives tiles, and
//! the ground pass gives tiles with classes.

use crate::cluster::{DriveWindow, Figures, Method};
use crate::error::Result;
use crate::model::TileId;
use crate::output::LabelledFile;
use crate::run::cloud::{self, Cloud};
use crate::run::drive::{Surveyed, Tiled};
use crate::run::engine::{Driver, Event, Outline};
use crate::run::error::RunError;
use crate::run::finish::mark::{self, Finished};
use crate::run::finish::page::{self, PageContent};
use crate::run::finish::{names, tables};
use crate::run::open::{self, Opened};
use crate::run::passes::copies::Copies;
use crate::run::passes::export::{self, ExportPass};
use crate::run::passes::fields::{self, FieldsPass};
use crate::run::passes::ground::{self, GroundPass};
use crate::run::passes::inventory::{self, Sources};
use crate::run::passes::relabel::{self, RelabelPass};
use crate::run::passes::scatter::{self, ScatterPass};
use crate::run::passes::stitch::{self, StitchPass};
use crate::run::passes::survey::SurveyPass;
use crate::run::passes::{MethodDrive, Progress, method};
use crate::run::plan;
use crate::run::summary::Counts;
use crate::store::RunDir;
use crate::tiling::Plan;

/// Largest number of records that tiles may read per needed point before the points are grouped by tile
/// (architecture, section 3).
const LARGEST_AMPLIFICATION: f64 = 3.0;

/// A drive that was surveyed and divided into tiles.
pub(crate) struct Planned {
    pub(crate) surveyed: Surveyed,
    pub(crate) plan: Plan,
}

/// The outputs of a run.
pub(crate) struct Outcome {
    pub(crate) counts: Counts,
    pub(crate) objects: usize,
    /// The outputs to mark as finished once the report is written. `None` if an earlier call has marked them.
    pub(crate) unmarked: Option<Finished>,
    /// The outline of the export.
    pub(crate) export: Outline,
    /// Names of the charts that were written.
    pub(crate) charts: Vec<String>,
    /// What the clustering method reports about its steps.
    pub(crate) figures: Figures,
    /// What the page shows. `None` if it is not written.
    pub(crate) page: Option<PageContent>,
}

/// Surveys the drive.
pub(crate) fn survey<D: Driver>(
    open: &Opened<'_>,
    driver: &mut D,
    run_dir: Option<&RunDir>,
) -> Result<Option<Surveyed>> {
    open::refuse_empty(&open.drive.catalog)?;
    let Some(survey) = driver.complete(&SurveyPass::of(&open.drive, open.config, run_dir))? else {
        return Ok(None);
    };
    if open.config.tiling.section().is_some() && open.chain.method.reach_is_provisional() {
        return Err(RunError::EstimatedOverSection { method: open.chain.method.name().to_owned() }.into());
    }
    let deciding = open.chain.deciding_reach(open.drive.lattice());
    let mut surveyed = Surveyed::new(&open.drive, survey, open.config, deciding)?;
    if surveyed.section.is_some() {
        surveyed.warnings.extend(open.chain.method.of_a_section());
    }
    Ok(Some(surveyed))
}

/// Divides the drive into tiles that fit the budget, after the memory for data of the whole drive is
/// subtracted.
pub(crate) fn plan<D: Driver>(
    open: &Opened<'_>,
    driver: &mut D,
    surveyed: Surveyed,
) -> Result<Option<Planned>> {
    if open.config.output.writes("copc") {
        // Refused before anything is computed.
        cloud::format(open, &surveyed)?;
    }
    let budget = open.budget.beside(surveyed.held_bytes());
    driver.limit_memory(budget.memory);
    let plan = plan::settle(driver, &surveyed, &open.drive, &open.chain, open.config, &budget)?;
    Ok(plan.map(|plan| Planned { surveyed, plan }))
}

/// The passes after the plan, in order. The values that each pass depends on are known before any pass is
/// complete.
pub(crate) struct List {
    scatter: Option<Outline>,
    ground: Outline,
    fields: Option<Outline>,
    steps: Vec<Outline>,
    stitch: Outline,
    relabel: Outline,
    inventory: Outline,
    /// Whether an output has the rows of the inventory. Without one it is not computed.
    with_rows: bool,
    export: Outline,
    /// `None` if the cloud-optimised file is not written.
    cloud: Option<[Outline; 2]>,
}

impl List {
    fn of(open: &Opened<'_>, planned: &Planned, scatters: bool) -> Self {
        let Planned { surveyed, plan } = planned;
        let config = open.config;
        let chain = &open.chain;
        let method: &dyn Method = &*chain.method;
        let ground = ground::outline(surveyed, plan, config, chain);
        let steps = method::outlines(&ground, config, method);
        let stitch = stitch::outline(&steps, config, method);
        let relabel = relabel::outline(&stitch);
        let inventory = inventory::outline(&relabel, surveyed);
        let export = export::outline(&relabel, &inventory, config);
        let fields = method.fields();
        let cloud = config.output.writes("copc").then(|| Cloud::outlines(&export));
        Self {
            scatter: scatters.then(|| scatter::outline(surveyed, plan)),
            ground,
            fields: (!fields.is_empty()).then(|| fields::outline(surveyed, fields)),
            steps,
            stitch,
            relabel,
            inventory,
            with_rows: names::shows_objects(config),
            export,
            cloud,
        }
    }

    /// All passes with their numbers of units, as far as these are known.
    fn all(&self, tiled: &Tiled<'_>) -> Vec<(Outline, Option<usize>)> {
        let tiles = Some(tiled.count());
        let runs = Some(tiled.drive.block_runs().len());
        let relabelled = Some(relabel::runs(tiled).len());
        let mut all = Vec::new();
        all.extend(self.scatter.iter().map(|outline| (outline, runs)));
        all.push((&self.ground, tiles));
        all.extend(self.fields.iter().map(|outline| (outline, runs)));
        all.extend(self.steps.iter().map(|outline| (outline, tiles)));
        all.extend([(&self.stitch, Some(1)), (&self.relabel, relabelled)]);
        all.extend(self.with_rows.then_some((&self.inventory, tiles)));
        all.push((&self.export, None));
        all.extend(self.cloud.iter().flatten().map(|outline| (outline, None)));
        all.into_iter().map(|(outline, units)| (outline.clone(), units)).collect()
    }
}

/// Completes the passes from the plan to step `last` of the method, and then calls `then`.
fn through_step<D: Driver, R>(
    open: &Opened<'_>,
    driver: &mut D,
    run_dir: &RunDir,
    planned: &Planned,
    last: usize,
    then: impl FnOnce(&mut D, &List, &Progress<'_>) -> Result<Option<R>>,
) -> Result<Option<R>> {
    let Planned { surveyed, plan } = planned;
    let drive = &open.drive;
    let chain = &open.chain;
    let mut tiled = Tiled::whole_blocks(drive, surveyed, plan);
    let amplification = tiled.amplification(chain.ground_reach);
    let list = List::of(open, planned, amplification > LARGEST_AMPLIFICATION);
    driver.expect(&list.all(&tiled));

    if let Some(outline) = &list.scatter {
        let text = format!(
            "with this order of the records, tiles would read {amplification:.1} times the records that they need: \
             the points are grouped by tile first"
        );
        driver.tell(&Event::Warning { text: &text });
        let pass = ScatterPass::of(drive, plan, outline.clone());
        let Some(scattered) = driver.complete(&pass)? else { return Ok(None) };
        tiled = tiled.grouped(scattered);
    }
    let pass = GroundPass::of(&tiled, chain, list.ground.clone());
    let Some(classified) = driver.complete(&pass)? else { return Ok(None) };
    for text in &classified.warnings {
        driver.tell(&Event::Warning { text });
    }

    let mut over = MethodDrive { classified: &classified, method: &*chain.method, fields: None };
    if let Some(outline) = &list.fields {
        let pass = FieldsPass::of(drive, chain.method.fields(), outline.clone())?;
        let Some(stored) = driver.complete(&pass)? else { return Ok(None) };
        over.fields = Some(stored);
    }
    if driver.computes() {
        method::remove_others(run_dir, &list.steps)?;
    }
    let Some(progress) = method::complete(driver, &over, &list.steps, last)? else { return Ok(None) };
    then(driver, &list, &progress)
}

/// The global of a step of the method. The step is not the last.
pub(crate) fn global_of_step<D: Driver>(
    open: &Opened<'_>,
    driver: &mut D,
    run_dir: &RunDir,
    planned: &Planned,
    step: usize,
) -> Result<Option<Vec<u8>>> {
    through_step(open, driver, run_dir, planned, step, |_, _, progress| {
        Ok(progress.done.get(step).map(|(_, global)| global.clone()))
    })
}

/// The payloads of the last step of the method, by tile. They are not joined to objects.
pub(crate) fn payloads_of_last_step<D: Driver>(
    open: &Opened<'_>,
    driver: &mut D,
    run_dir: &RunDir,
    planned: &Planned,
) -> Result<Option<Vec<Vec<u8>>>> {
    let last = open.chain.method.steps().len() - 1;
    through_step(open, driver, run_dir, planned, last, |_, _, progress| {
        let payloads = TileId::first(progress.tiles()).map(|tile| progress.payload(last, tile));
        payloads.collect::<Result<_>>().map(Some)
    })
}

/// Ground, clusters, stitching, labelled copies and tables.
pub(crate) fn to_files<D: Driver>(
    open: &Opened<'_>,
    driver: &mut D,
    run_dir: &RunDir,
    planned: &Planned,
    labelled: Vec<LabelledFile>,
) -> Result<Option<Outcome>> {
    let last = open.chain.method.steps().len() - 1;
    through_step(open, driver, run_dir, planned, last, |driver, list, progress| {
        let method = progress.over.method;
        let figures = method.figures(progress)?;
        for text in method.warnings(progress)? {
            driver.tell(&Event::Warning { text: &text });
        }
        let (counts, terrain) = ground::summed_up(progress.over.classified)?;
        let beside = names::beside(open.config, method.finds_surfaces());
        let outcome = Outcome {
            counts,
            objects: 0,
            unmarked: None,
            export: list.export.clone(),
            charts: Vec::new(),
            figures,
            page: None,
        };
        if let Some(finished) = mark::already_finished(run_dir, list.export.depends.fingerprint(), &beside)? {
            return Ok(Some(Outcome { objects: finished.objects, ..outcome }));
        }
        let pass = StitchPass::of(progress, list.stitch.clone());
        let Some(objects) = driver.complete(&pass)? else { return Ok(None) };
        let pass = RelabelPass::of(progress, &objects, list.relabel.clone())?;
        let Some(columns) = driver.complete(&pass)? else { return Ok(None) };
        if !driver.walks_to_files() {
            return Ok(None);
        }
        let sources = Sources { progress, objects: &objects, columns: &columns, terrain: &terrain };
        Outputs { open, run_dir, list, sources }.complete(driver, labelled, outcome)
    })
}

/// The sources of the outputs, once every point has its object.
struct Outputs<'a> {
    open: &'a Opened<'a>,
    run_dir: &'a RunDir,
    list: &'a List,
    sources: Sources<'a>,
}

impl Outputs<'_> {
    /// Writes the outputs, and adds the results to `outcome`.
    fn complete<D: Driver>(
        &self,
        driver: &mut D,
        labelled: Vec<LabelledFile>,
        outcome: Outcome,
    ) -> Result<Option<Outcome>> {
        let Self { open, run_dir, list, sources } = *self;
        let Sources { progress, objects, columns, .. } = sources;
        let mut found = None;
        if list.with_rows {
            found = inventory::complete(driver, sources, list.inventory.clone())?;
            if found.is_none() {
                return Ok(None);
            }
        }
        let tiled = progress.over.classified.tiled;
        let limit = names::page_limit_bytes(open.config);
        let sampling =
            limit.map(|limit| page::sampling(open, tiled.surveyed, objects, &outcome.counts, limit));
        let for_cloud = list.cloud.as_ref().map(|outlines| (outlines, labelled.clone()));
        let copies = Copies::of(labelled, tiled, open.config.output.writes("points"));
        let pass = ExportPass::of(
            &open.drive,
            columns,
            &objects.kinds,
            sampling.as_ref(),
            copies,
            run_dir,
            list.export.clone(),
        );
        let Some(exported) = driver.complete(&pass)? else { return Ok(None) };
        if let Some((outlines, labelled)) = &for_cloud {
            let kinds = &objects.kinds;
            let cloud = Cloud { open, tiled, columns, kinds, labelled, run_dir, outlines };
            let Some(()) = cloud.complete(driver)? else { return Ok(None) };
        }
        let mut table = None;
        if let Some(found) = &found {
            let rows = inventory::rows(sources, list.inventory.clone(), found)?;
            table = tables::write_tables(
                run_dir,
                &open.drive,
                tiled.surveyed,
                tiled.plan,
                objects,
                &rows,
                open.config,
            )?;
        }
        let page = table.map(|table| PageContent { table, points: exported.points });
        let charts = tables::write_charts(run_dir, &objects.charts, open.config)?;
        let mut figures = outcome.figures;
        figures.extend(objects.figures.clone());
        let count = objects.objects.len();
        let files = [&exported.names[..], &charts].concat();
        let unmarked = Some(Finished { objects: count, files });
        Ok(Some(Outcome { objects: count, unmarked, charts, figures, page, ..outcome }))
    }
}

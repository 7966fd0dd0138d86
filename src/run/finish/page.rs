//! The page of a run: which points are sampled for it, what it says about the drive, and when it is written.

use serde_json::{Value, json};

use crate::error::Result;
use crate::output::report::{
    Page, PageFrame, PageStretch, PageTable, SamplePoint, SampledDrive, Sampling, point_budget,
};
use crate::run::drive::Surveyed;
use crate::run::finish::frame::{cloud, frame, origin, unit_names};
use crate::run::finish::names::{PAGE, page_limit_bytes};
use crate::run::finish::tables::{processed_stretches, write_whole};
use crate::run::open::Opened;
use crate::run::passes::export::UNIT_POINTS;
use crate::run::passes::stitch::Objects;
use crate::run::summary::Counts;
use crate::store::RunDir;
use crate::tiling::Plan;

/// Largest number of vertices of the axis on the page. A vertex takes about 25 bytes.
const MOST_VERTICES: usize = 4_000;

/// The content of the page that was collected while the outputs were written.
pub(crate) struct PageContent {
    pub(crate) table: PageTable,
    /// The shown points, best first.
    pub(crate) points: Vec<SamplePoint>,
}

/// The rules by which points are sampled.
pub(crate) fn sampling(
    open: &Opened<'_>,
    surveyed: &Surveyed,
    objects: &Objects,
    counts: &Counts,
    limit_bytes: u64,
) -> Sampling {
    let drive = &open.drive;
    let cell_units2 = (drive.grid.edge() as f64).powi(2);
    let sampled = SampledDrive {
        objects: &objects.objects,
        ground_points: counts.ground,
        object_points: counts.object,
        unit_points: UNIT_POINTS,
        area_units2: surveyed.processed().len() as f64 * cell_units2,
        origin: origin(drive, surveyed),
        lattice: drive.lattice(),
    };
    Sampling::new(&sampled, point_budget(limit_bytes))
}

/// Writes the page with the values of the report, unless it is left out.
pub(crate) fn write_page(
    run_dir: &RunDir,
    open: &Opened<'_>,
    surveyed: &Surveyed,
    plan: &Plan,
    content: Option<PageContent>,
    report: Value,
) -> Result<()> {
    let (Some(content), Some(limit_bytes)) = (content, page_limit_bytes(open.config)) else {
        return Ok(());
    };
    let mut run = report;
    run["tiles"] = json!(plan.tiles.iter().filter(|tile| tile.inside).collect::<Vec<_>>());
    let files = open.drive.catalog.files();
    let names: Vec<&str> = files.iter().map(|file| file.name()).collect();
    let (title, files) = match names.as_slice() {
        [one] => ((*one).to_owned(), String::new()),
        [first, .., last] => (format!("{first} to {last}"), format!("{} files", names.len())),
        [] => Default::default(),
    };
    let page = Page {
        title,
        files,
        units: unit_names(&open.drive),
        axis: stretches(surveyed, frame(&open.drive, surveyed)),
        table: &content.table,
        points: content.points,
        cloud: open.config.output.writes("copc").then(|| cloud(&open.drive, surveyed)),
        csv: open.config.output.writes("csv"),
        all_points: plan.points_inside(),
        run: &run,
        limit_bytes,
    };
    write_whole(run_dir, PAGE, |out| page.write(out))?;
    Ok(())
}

/// The processed part of the axis, with only every n-th vertex and the last vertex of each stretch.
fn stretches(surveyed: &Surveyed, frame: PageFrame) -> Vec<PageStretch> {
    let shown = processed_stretches(surveyed);
    let every = shown.iter().map(Vec::len).sum::<usize>().div_ceil(MOST_VERTICES).max(1);
    let rounded = |metres: f64| (metres * 100.0).round() / 100.0 + 0.0;
    let mut stretches = Vec::new();
    for vertices in &shown {
        let mut stretch = PageStretch::default();
        for (at, (vertex, s)) in vertices.iter().enumerate() {
            if at % every == 0 || at + 1 == vertices.len() {
                stretch.s.push(rounded(*s));
                stretch.x.push(rounded(vertex[0] - frame.origin_m[0]));
                stretch.y.push(rounded(vertex[1] - frame.origin_m[1]));
            }
        }
        stretches.push(stretch);
    }
    stretches
}

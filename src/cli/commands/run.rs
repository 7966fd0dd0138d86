//! `chainage run`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use chainage::config::{Config, OutputConfig};
use chainage::output::objects;
use chainage::run::{
    CancelToken, Registries, RunRequest, RunSummary, is_output, memory_budget, plan_of, run,
};
use chainage::words::percent;

use crate::allocator;
use crate::cli::commands::plan;
use crate::cli::drive_args::{Inputs, SectionArgs, Settings};
use crate::cli::exit::{CliError, Outcome};
use crate::cli::print::JsonOutput;
use crate::cli::progress::{Progress, ProgressChoice, Show};
use crate::cli::{exit, interrupt, print};

#[derive(Debug, clap::Args)]
pub(crate) struct RunArgs {
    #[command(flatten)]
    inputs: Inputs,
    /// Output directory; a run in it resumes
    #[arg(
        short,
        long,
        value_name = "DIRECTORY",
        value_parser = print::folder(),
        required_unless_present = "dry_run"
    )]
    out: Option<PathBuf>,
    /// Start again: discard the state of an earlier run in the output directory
    #[arg(long)]
    fresh: bool,
    /// Show the tiles and estimates of `chainage plan`, and write nothing
    #[arg(long, conflicts_with = "fresh")]
    dry_run: bool,
    #[command(flatten)]
    show: Show,
    #[command(flatten)]
    json: JsonOutput,
    #[command(flatten)]
    output: OutputSettings,
    #[command(flatten)]
    section: SectionArgs,
    #[command(flatten)]
    settings: Settings,
}

#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Output")]
struct OutputSettings {
    /// Format of the labelled copies [default: same]
    #[arg(long, value_name = "same|las|laz")]
    output_format: Option<String>,
    /// Do not change the classification of the points
    #[arg(long)]
    keep_classification: bool,
    /// Store the original class of every point in the extra dimension `original_classification`
    #[arg(long)]
    keep_original: bool,
    #[arg(long, value_name = "LIST", value_delimiter = ',', help = outputs())]
    outputs: Vec<String>,
    /// Write all points (with --from or --to, those of the section) as one cloud-optimised file as well,
    /// drive.copc.laz, for viewers that stream
    #[arg(long)]
    copc: bool,
    /// Do not write report.html, the page with a 3D view, a plan, a table and statistics
    #[arg(long)]
    no_report: bool,
    /// Stop at the first tile that fails; without this, the other tiles are finished
    #[arg(long)]
    fail_fast: bool,
}

/// The help of --outputs.
fn outputs() -> String {
    let tables: Vec<&str> = objects::REGISTRY.iter().map(objects::ObjectFormatEntry::name).collect();
    format!(
        "Write only these: points (labelled copies), {}, ply (only p-linkage writes it), charts (of \
         density-peaks, as SVG), copc, report [default: all but copc]",
        tables.join(", ")
    )
}

impl OutputSettings {
    fn assignments(&self) -> Vec<(&'static str, String)> {
        let mut list = Vec::new();
        if let Some(format) = &self.output_format {
            list.push(("output.format", format!("{format:?}")));
        }
        if self.keep_classification {
            list.push(("output.classification", "\"keep\"".to_owned()));
        }
        if self.keep_original {
            list.push(("output.original_classification", "true".to_owned()));
        }
        if !self.outputs.is_empty() {
            let names: Vec<&str> = self.outputs.iter().map(|name| name.trim()).collect();
            list.push(("output.files", format!("{names:?}")));
        }
        if self.copc {
            list.push(("output.copc", "true".to_owned()));
        }
        if self.no_report {
            list.push(("output.report", "false".to_owned()));
        }
        if self.fail_fast {
            list.push(("run.fail_fast", "true".to_owned()));
        }
        list
    }
}

impl RunArgs {
    pub(crate) fn run(&self) -> Outcome {
        let progress = self.show.progress();
        let extra: Vec<_> =
            self.output.assignments().into_iter().chain(self.section.assignments()?).collect();
        let config = self.settings.resolve(&extra)?;
        if let Some(out) = &self.out {
            self.json.spares(out, is_output)?;
        }
        let inputs = self.inputs.files()?;
        let Some(out) = self.out.as_deref().filter(|_| !self.dry_run) else {
            let plan = plan_of(&inputs, self.out.as_deref(), &config, &Registries::default())?;
            self.json.show(&plan, || plan::page(&plan))?;
            return Ok(exit::DONE);
        };
        if self.show.verbose() {
            show_settings(&config)?;
        }
        let output = config.output.clone();
        let summary = process(inputs, out, config, self.fresh, progress)?;
        self.json.show(&summary, || page(&summary, out, &output))?;
        Ok(exit::DONE)
    }
}

/// Shows the settings that differ from the defaults.
pub(super) fn show_settings(config: &Config) -> Result<(), CliError> {
    for line in config.differences().map_err(chainage::Error::from)? {
        print::note(&format!("setting {line}"));
    }
    Ok(())
}

/// Runs a drive under Ctrl-C.
pub(super) fn process(
    inputs: Vec<PathBuf>,
    out: &Path,
    config: Config,
    fresh: bool,
    progress: ProgressChoice,
) -> Result<RunSummary, CliError> {
    allocator::keep_blocks_within(memory_budget(&config.run));
    let cancel = Arc::new(CancelToken::default());
    interrupt::listen(&cancel)?;
    let progress = Progress::new(progress);
    let request =
        RunRequest { inputs, out: out.to_owned(), config, fresh, registries: Registries::default() };
    Ok(run(&request, &progress, &cancel)?)
}

/// The result of a run, for a person.
pub(super) fn page(summary: &RunSummary, out: &Path, output: &OutputConfig) -> String {
    let share = |part: u64| percent(part, summary.points);
    let counts = &summary.counts;
    let mut text = format!(
        "  {}, {}, {}\n",
        print::counted(summary.points, "point"),
        print::counted(summary.objects as u64, if summary.surfaces { "surface" } else { "object" }),
        print::counted(summary.tiles as u64, "tile")
    );
    if let Some(section) = summary.section {
        text.push_str(&format!("  {}\n", print::section(&section)));
    }
    let withheld = match counts.withheld {
        0 => String::new(),
        points => format!(", withheld {}", share(points)),
    };
    text.push_str(&format!(
        "  ground {}, noise {}, above the ground {}{withheld}\n",
        share(counts.ground),
        share(counts.low_noise + counts.high_noise),
        share(counts.object)
    ));
    if let Some(found) = summary.epsilon() {
        text.push_str(&format!(
            "  epsilon {:.5} {}, estimated over {} points at k0 = {:.3} of K = {}\n",
            found.estimate.epsilon,
            found.unit,
            print::count(found.estimate.curve.queries),
            found.estimate.k0,
            found.estimate.k
        ));
    }
    if summary.nothing_to_do {
        text.push_str(&format!("  nothing to do: {} is up to date\n", out.display()));
        return text;
    }
    let rate = summary.points as f64 / summary.seconds.max(1e-9) / 1e6;
    text.push_str(&format!("  {:.1} s, {rate:.2} M points/s", summary.seconds));
    if let Some(peak) = summary.peak_resident_bytes {
        text.push_str(&format!(", peak memory {}", print::bytes(peak)));
    }
    let mut written = Vec::new();
    written.extend(output.writes("points").then_some("labelled copies"));
    let of_surfaces = objects::SURFACES.iter().filter(|_| summary.surfaces);
    let tables = objects::REGISTRY.iter().chain(of_surfaces).filter(|entry| output.writes(entry.name()));
    written.extend(tables.map(|entry| entry.file_name));
    written.extend(summary.charts.iter().map(String::as_str));
    written.push("report.json");
    written.extend(output.writes("report").then_some("report.html"));
    written.extend(output.writes("copc").then_some("drive.copc.laz"));
    text.push_str(&format!("\n  {}: {}\n", out.display(), written.join(", ")));
    text
}

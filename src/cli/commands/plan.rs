//! `chainage plan`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use chainage::config::{Config, ConfigError};
use chainage::run::{CancelToken, PlanFacts, Registries, RunRequest, open_for_workers, plan_of};

use crate::cli::commands::{info, next};
use crate::cli::drive_args::{Inputs, SectionArgs, Settings};
use crate::cli::exit::Outcome;
use crate::cli::print::JsonOutput;
use crate::cli::print::{deliver, is_standard_output};
use crate::cli::progress::{Progress, ProgressChoice};
use crate::cli::{exit, interrupt, print};

#[derive(Debug, clap::Args)]
pub(crate) struct PlanArgs {
    #[command(flatten)]
    inputs: Inputs,
    #[command(flatten)]
    json: JsonOutput,
    /// Write a drawing of tiles, axis and chainage marks as SVG (-: to standard output)
    #[arg(long, value_name = "FILE", value_parser = print::target())]
    svg: Option<PathBuf>,
    #[command(flatten)]
    section: SectionArgs,
    #[command(flatten)]
    shared: Shared,
    #[command(flatten)]
    settings: Settings,
}

#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Share the run among machines")]
struct Shared {
    /// Open the run for workers, and show the pass that is due with its units
    #[arg(long, requires = "out")]
    units: bool,
    /// Output directory, which all workers reach under the same name
    #[arg(short, long, value_name = "DIRECTORY", value_parser = print::folder(), requires = "units")]
    out: Option<PathBuf>,
    /// Leave the survey, which reads every record, to the workers
    #[arg(long, requires = "units")]
    leave_survey: bool,
    /// Start again: discard the state of an earlier run in the output directory
    #[arg(long, requires = "units")]
    fresh: bool,
}

impl PlanArgs {
    pub(crate) fn run(&self) -> Outcome {
        if self.svg.as_deref().is_some_and(is_standard_output) && self.json.is_asked_for() {
            let refused = ConfigError::value("--svg", "-", "a file when --json is given");
            return Err(chainage::Error::from(refused).into());
        }
        let config = self.settings.resolve(&self.section.assignments()?.collect::<Vec<_>>())?;
        if let Some(out) = &self.shared.out {
            return self.open(out, config);
        }
        let plan = plan_of(&self.inputs.files()?, None, &config, &Registries::default())?;
        if !deliver(self.svg.as_deref(), |to| to.write_all(plan.svg.as_bytes()))? {
            self.json.show(&plan, || page(&plan))?;
        }
        Ok(exit::DONE)
    }
}

impl PlanArgs {
    /// Opens the run for workers.
    fn open(&self, out: &Path, config: Config) -> Outcome {
        let cancel = Arc::new(CancelToken::default());
        interrupt::listen(&cancel)?;
        let request = RunRequest {
            inputs: self.inputs.files()?,
            out: out.to_owned(),
            config,
            fresh: self.shared.fresh,
            registries: Registries::default(),
        };
        let progress = Progress::new(ProgressChoice::None);
        let due = open_for_workers(&request, self.shared.leave_survey, &progress, &cancel)?;
        self.json.show(&due, || next::page(&due))?;
        Ok(exit::DONE)
    }
}

/// The expected time, in seconds or minutes.
fn time((least, most): (f64, f64)) -> String {
    match most {
        ..1.5 => "about 1 s".to_owned(),
        ..120.0 => format!("{:.0} to {:.0} s", least.floor().max(1.0), most.ceil()),
        _ => format!("{:.0} to {:.0} min", (least / 60.0).floor().max(1.0), (most / 60.0).ceil()),
    }
}

/// The space on disk, in words.
fn disk(plan: &PlanFacts) -> String {
    let mut text = format!("{} of state", print::bytes(plan.state_bytes));
    if plan.copies {
        text.push_str(", and the labelled copies");
    }
    if let Some(scratch) = plan.cloud_scratch_bytes {
        let scratch = print::bytes(scratch);
        text.push_str(&format!(", and drive.copc.laz, which needs {scratch} more while it is written"));
    }
    text
}

/// The plan, for a person.
pub(super) fn page(plan: &PlanFacts) -> String {
    let rows: Vec<Vec<String>> = plan
        .tiles
        .iter()
        .enumerate()
        .map(|(number, tile)| {
            vec![
                number.to_string(),
                format!("{:.0}", tile.from_m),
                format!("{:.0}", tile.to_m),
                print::count(tile.points),
                print::count(tile.points_read),
                print::bytes(tile.bytes),
                if tile.inside { "" } else { "beside the section" }.to_owned(),
            ]
        })
        .collect();
    let header = ["tile", "from m", "to m", "points", "with halo", "memory", ""];
    let inside = plan.tiles.iter().filter(|tile| tile.inside).count();
    let mut text = print::table(&header, &rows);
    text.push_str(&format!(
        "\n  {} in {} along {:.0} m of axis ({})\n",
        print::counted(plan.points, "point"),
        print::counted(inside as u64, "tile"),
        plan.axis.length_m,
        info::axis_source(&plan.axis)
    ));
    if let Some(section) = &plan.section {
        text.push_str(&format!("  section   {}\n", print::section(section)));
    }
    text.push_str(&format!(
        "  halo      {:.2} m for ground and noise, {:.2} m for clusters\n",
        plan.ground_reach_m, plan.cluster_reach_m
    ));
    text.push_str(&format!(
        "  memory    about {} in use, of a budget of {}, with {}\n",
        print::bytes(plan.memory_needed),
        print::bytes(plan.memory),
        print::counted(plan.threads as u64, "thread")
    ));
    text.push_str(&format!(
        "  disk      {}\n  reading   {:.1} records for each point\n",
        disk(plan),
        plan.read_amplification
    ));
    text.push_str(&format!("  time      {}\n", time(plan.seconds)));
    text.push_str(&print::warnings(&plan.warnings));
    text
}

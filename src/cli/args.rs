//! The commands.

use clap::{Parser, Subcommand};

use crate::cli::commands::bench::BenchArgs;
use crate::cli::commands::cluster::ClusterArgs;
use crate::cli::commands::demo::DemoArgs;
use crate::cli::commands::estimate_epsilon::EstimateArgs;
use crate::cli::commands::eval::EvalArgs;
use crate::cli::commands::info::InfoArgs;
use crate::cli::commands::pages::CompletionsArgs;
use crate::cli::commands::plan::PlanArgs;
use crate::cli::commands::run::RunArgs;
use crate::cli::commands::status::StatusArgs;
use crate::cli::commands::synth::SynthArgs;
use crate::cli::commands::train::TrainArgs;

/// Turns the LAS/LAZ files of a mobile laser scanning drive into ground and objects.
///
/// Works on drives of any length with the memory it is given, resumes after any interruption, and gives a result in
/// which nobody can tell where its tiles were.
#[derive(Debug, Parser)]
#[command(name = "chainage", version, max_term_width = 100, after_help = EXIT_CODES)]
pub(crate) struct Program {
    #[command(subcommand)]
    pub(crate) command: Command,
}

const EXIT_CODES: &str = "Exit codes: 0 done, 1 bug, 2 usage, 3 configuration, 4 input, 5 writing, 6 state does not \
match, 7 locked, 8 some tiles failed (the others are kept), 9 a check found a difference, 130 interrupted (state kept)";

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Show what is in a drive: files, extent, density, time, CRS, problems
    Info(InfoArgs),
    /// Show the tiles that `run` would work on, and estimate memory and time; changes nothing
    Plan(PlanArgs),
    /// Process a drive; on an existing output directory it resumes
    Run(RunArgs),
    /// Show what is done, what is left, what is stale and why
    Status(StatusArgs),
    /// Score a segmentation against reference labels
    Eval(EvalArgs),
    /// Make a labelled synthetic drive of any length
    Synth(SynthArgs),
    /// Cluster the rows of a table with dbscan or p-linkage
    Cluster(ClusterArgs),
    /// Estimate the radius of dbscan from the points of a drive or a table
    EstimateEpsilon(EstimateArgs),
    /// Learn the classes of street from labelled drives
    Train(TrainArgs),
    /// Run the main job on a small real sample that comes with the program
    Demo(DemoArgs),
    /// Measure throughput at one and two threads against the copy floor
    Bench(BenchArgs),
    /// List ground filters and clustering methods
    Methods,
    /// Print every setting with its unit and default
    Config,
    /// Print a completion script for a shell
    Completions(CompletionsArgs),
    /// Print the manual page
    Man,
}

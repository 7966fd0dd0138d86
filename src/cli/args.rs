//! The commands.

use clap::{CommandFactory, Parser, Subcommand};

use crate::cli::commands::bench::BenchArgs;
use crate::cli::commands::cluster::ClusterArgs;
use crate::cli::commands::config::ConfigArgs;
use crate::cli::commands::demo::DemoArgs;
use crate::cli::commands::estimate_epsilon::EstimateArgs;
use crate::cli::commands::eval::EvalArgs;
use crate::cli::commands::info::InfoArgs;
use crate::cli::commands::next::NextArgs;
use crate::cli::commands::pages::{CompletionsArgs, ManArgs};
use crate::cli::commands::plan::PlanArgs;
use crate::cli::commands::reduce::ReduceArgs;
use crate::cli::commands::run::RunArgs;
use crate::cli::commands::slurm::SlurmArgs;
use crate::cli::commands::status::StatusArgs;
use crate::cli::commands::synth::SynthArgs;
use crate::cli::commands::train::TrainArgs;
use crate::cli::commands::view::ViewArgs;
use crate::cli::commands::work::WorkArgs;

/// Separates the points of a mobile laser scanning drive (LAS/LAZ) into ground and objects.
///
/// A drive may have any length, because memory stays within a budget. An interrupted run resumes. The result
/// does not depend on tiles or threads.
#[derive(Debug, Parser)]
#[command(name = "chainage", version, max_term_width = 100, after_help = EXIT_CODES)]
pub(crate) struct Program {
    #[command(subcommand)]
    pub(crate) command: Command,
}

const EXIT_CODES: &str = "Exit codes: 0 done, 1 bug, 2 usage, 3 configuration, 4 input, 5 writing, 6 state does not \
match, 7 directory in use, 8 some tiles failed (the others are kept), 9 the compared files differ, 130 interrupted \
(the state is kept)";

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Show files, extent, density, GPS time, CRS and problems of a drive
    Info(InfoArgs),
    /// Show the tiles of a run and estimate its memory and time, or open it for workers (--units)
    Plan(PlanArgs),
    /// Process a drive, or resume an interrupted run
    // clap would leave out --out, which only --dry-run can do without.
    #[command(override_usage = "chainage run [OPTIONS] --out <DIRECTORY> <FILES>...")]
    Run(RunArgs),
    /// Show which passes of a run are done, missing or stale, and why
    Status(StatusArgs),
    /// Open the report of a run in a browser, and serve its files on 127.0.0.1
    View(ViewArgs),
    /// Show which pass of a shared run is due, and which of its units
    Next(NextArgs),
    /// Compute units of a pass of a shared run, beside other workers
    Work(WorkArgs),
    /// Complete a pass of a shared run once all its units are stored, and open the next one
    Reduce(ReduceArgs),
    /// Print a script that processes a drive on Slurm
    Slurm(SlurmArgs),
    /// Score a segmentation against reference labels
    Eval(EvalArgs),
    /// Generate a labelled synthetic drive of any length
    Synth(SynthArgs),
    /// Cluster the rows of a table by dbscan or p-linkage
    Cluster(ClusterArgs),
    /// Estimate the radius epsilon of dbscan from a drive or a table
    EstimateEpsilon(EstimateArgs),
    /// Train a model of the method street on labelled drives
    Train(TrainArgs),
    /// Process the small real sample that is part of the program
    Demo(DemoArgs),
    /// Measure the throughput of one and two threads, and compare it with copying the files
    Bench(BenchArgs),
    /// List ground filters and clustering methods
    Methods,
    /// Print every setting, the presets or the effective settings, or check a file
    Config(ConfigArgs),
    /// Print a completion script for a shell
    Completions(CompletionsArgs),
    /// Print a manual page, or write all of them
    Man(ManArgs),
}

/// The commands in the groups of the help.
const GROUPS: [(&str, &[&str]); 4] = [
    ("Work with a drive", &["info", "plan", "run", "status", "view"]),
    ("Share a run among machines (plan --units opens it)", &["next", "work", "reduce", "slurm"]),
    ("Check and measure", &["eval", "bench", "estimate-epsilon", "cluster", "train", "synth", "demo"]),
    ("Settings and pages", &["methods", "config", "completions", "man", "help"]),
];

/// The program with its commands listed in groups.
pub(crate) fn program() -> clap::Command {
    let mut program = Program::command();
    program.build();
    let about = |name: &str| {
        let command = program.find_subcommand(name);
        command.and_then(clap::Command::get_about).map(ToString::to_string).unwrap_or_default()
    };
    let mut list = String::new();
    for (title, names) in GROUPS {
        list.push_str(&format!("\n{title}:\n"));
        names.iter().for_each(|name| list.push_str(&format!("  {name:<16}  {}\n", about(name))));
    }
    let template = format!(
        "{{before-help}}{{about-with-newline}}\n{{usage-heading}} {{usage}}\n{list}\nOptions:\n{{options}}{{after-help}}"
    );
    // A negative number after an option is read as its value, so that the message says what is wrong with the
    // value.
    let negative = |arg: clap::Arg| {
        let is_value = arg.get_action().takes_values() && !arg.is_positional();
        if is_value { arg.allow_negative_numbers(true) } else { arg }
    };
    Program::command().help_template(template).mut_subcommands(|command| command.mut_args(negative))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_is_in_one_group() {
        let mut program = Program::command();
        program.build();
        let mut commands: Vec<&str> = program.get_subcommands().map(clap::Command::get_name).collect();
        let mut grouped: Vec<&str> = GROUPS.iter().flat_map(|(_, names)| names.iter().copied()).collect();
        commands.sort_unstable();
        grouped.sort_unstable();
        assert_eq!(commands, grouped);
    }
}

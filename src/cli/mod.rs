//! The command line: arguments, settings, progress, exit codes. The only user of clap, indicatif and ctrlc.

mod args;
mod colour;
mod commands;
mod drive_args;
mod exit;
mod interrupt;
mod numbers;
mod print;
mod progress;
mod quantities;
mod scratch;
mod served;
mod streamed;
mod table_points;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::FromArgMatches;

use args::{Command, Program};
use commands::pages;

/// Runs the program.
pub(crate) fn main() -> ExitCode {
    ExitCode::from(exit::guarded(run))
}

/// Runs the command, and returns its exit code.
fn run() -> u8 {
    let program = match Program::from_arg_matches_mut(&mut args::program().get_matches_from(arguments())) {
        Ok(program) => program,
        Err(error) => error.exit(),
    };
    let result = match &program.command {
        Command::Info(args) => args.run(),
        Command::Plan(args) => args.run(),
        Command::Run(args) => args.run(),
        Command::Status(args) => args.run(),
        Command::View(args) => args.run(),
        Command::Next(args) => args.run(),
        Command::Work(args) => args.run(),
        Command::Reduce(args) => args.run(),
        Command::Slurm(args) => args.run(),
        Command::Synth(args) => args.run(),
        Command::Demo(args) => args.run(),
        Command::Bench(args) => args.run(),
        Command::Cluster(args) => args.run(),
        Command::EstimateEpsilon(args) => args.run(),
        Command::Eval(args) => args.run(),
        Command::Train(args) => args.run(),
        Command::Methods => pages::methods(),
        Command::Config(args) => args.run(),
        Command::Completions(args) => args.run(args::program()),
        Command::Man(args) => args.run(&args::program()),
    };
    match result {
        Ok(code) => code,
        Err(error) if error.is_broken_pipe() => exit::DONE,
        Err(error) => {
            error.print();
            error.code()
        }
    }
}

/// The arguments, with `--json -` replaced by `--json=-`. Without this, clap would read the `-` as an
/// argument of its own, because `--json` may be given without a value.
fn arguments() -> Vec<OsString> {
    let mut arguments: Vec<OsString> = Vec::new();
    for argument in std::env::args_os() {
        match arguments.last_mut() {
            Some(last) if last == "--json" && argument == "-" => last.push("=-"),
            _ => arguments.push(argument),
        }
    }
    arguments
}

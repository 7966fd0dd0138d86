//! The command line: arguments, settings, progress, exit codes. The only user of clap, indicatif and ctrlc.

mod args;
mod bench;
mod cluster;
mod drive_args;
mod estimate;
mod eval;
mod exit;
mod info;
mod inspect;
mod pages;
mod plan;
mod print;
mod progress;
mod run;
mod synth;
mod table_points;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::Parser;

use args::{Command, Program};
use exit::CliError;

/// Runs the program.
pub(crate) fn main() -> ExitCode {
    exit::install_panic_text();
    let program = Program::parse_from(arguments());
    let result = match &program.command {
        Command::Info(args) => args.run(),
        Command::Plan(args) => args.run(),
        Command::Run(args) => args.run(),
        Command::Status(args) => args.run(),
        Command::Synth(args) => args.run(),
        Command::Demo(args) => args.run(),
        Command::Bench(args) => args.run(),
        Command::Cluster(args) => args.run(),
        Command::EstimateEpsilon(args) => args.run(),
        Command::Eval(args) => args.run(),
        Command::Methods => pages::methods(),
        Command::Config => pages::config(),
        Command::Completions(args) => args.run(),
        Command::Man => pages::man(),
    };
    match result {
        Ok(code) => ExitCode::from(code),
        Err(error) if error.is_broken_pipe() => ExitCode::from(exit::DONE),
        Err(error) => {
            error.print();
            ExitCode::from(error.code())
        }
    }
}

/// The arguments, with `--json -` as the `--json=-` that it means everywhere: where `--json` may stand alone, what
/// follows it is an argument of its own.
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

/// Result of a command: its exit code.
type Outcome = Result<u8, CliError>;

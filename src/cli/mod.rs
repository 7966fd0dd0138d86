//! The command line: arguments, settings, progress, exit codes. The only user of clap, indicatif and
//! signal-hook.

mod args;
mod colour;
mod commands;
mod drive_args;
mod exit;
mod http;
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
use std::path::Path;
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
    let given = arguments(std::env::args_os()).unwrap_or_else(|file| {
        let file = file.to_string_lossy();
        let text = format!("'--json {file}' reads no file: write '--json={file}' to write one\n");
        args::program().error(clap::error::ErrorKind::ValueValidation, text).exit()
    });
    let program = match Program::from_arg_matches_mut(&mut args::program().get_matches_from(given)) {
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
///
/// # Errors
/// The file in `--json FILE`: clap would read it as an input. No command reads JSON.
fn arguments(given: impl IntoIterator<Item = OsString>) -> Result<Vec<OsString>, OsString> {
    let mut arguments: Vec<OsString> = Vec::new();
    let mut only_values = false;
    for argument in given {
        let after_json = !only_values && arguments.last().is_some_and(|last| last == "--json");
        let path = Path::new(&argument);
        if after_json
            && path.extension().is_some_and(|end| end.eq_ignore_ascii_case("json"))
            && !path.is_dir()
        {
            return Err(argument);
        }
        only_values |= argument == "--";
        match arguments.last_mut() {
            Some(last) if after_json && argument == "-" => last.push("=-"),
            _ => arguments.push(argument),
        }
    }
    Ok(arguments)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_takes_its_file_after_an_equals_sign() {
        let read = |given: &[&str]| {
            let given = given.iter().map(OsString::from);
            arguments(given)
                .map(|all| all.iter().map(|one| one.to_string_lossy().into_owned()).collect::<Vec<_>>())
        };
        assert_eq!(
            read(&["eval", "OUT", "--json", "-"]),
            Ok(["eval", "OUT", "--json=-"].map(str::to_owned).to_vec())
        );
        for kept in [
            &["eval", "--json", "OUT"][..],
            &["eval", "OUT", "--json=x.json"],
            &["eval", "OUT", "--json", "--", "x.json"],
            &["eval", "--", "--json", "x.json"],
            &["eval", "--", "--json", "-"],
        ] {
            assert_eq!(read(kept), Ok(kept.iter().map(ToString::to_string).collect()));
        }
        assert_eq!(read(&["eval", "OUT", "--json", "no/x.json"]), Err("no/x.json".into()));
    }
}

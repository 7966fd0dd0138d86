//! The `chainage` program.

mod cli {
    pub(crate) mod eval;
}

use clap::Parser;
use std::io::Write;
use std::process::ExitCode;

#[derive(Debug, Parser)]
enum Command {
    Eval(cli::eval::EvalArgs),
}

fn main() -> ExitCode {
    let Command::Eval(args) = Command::parse();
    args.run().map_or_else(
        |error| {
            let hint = error.hint().map_or(String::new(), |hint| format!("\nhint: {hint}"));
            let _ = writeln!(std::io::stderr(), "error: {error}{hint}");
            ExitCode::from(4)
        },
        ExitCode::from,
    )
}

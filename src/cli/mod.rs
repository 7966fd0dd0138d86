//! The command line.

mod synth;

use std::io::Write;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

#[derive(Debug, Parser)]
#[command(name = "chainage", version, about)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Synth(synth::SynthArgs),
}

pub(crate) fn main() -> ExitCode {
    let Command::Synth(synth) = Cli::parse().command;
    match synth.run() {
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            let mut text = format!("error: {error}\n");
            let mut cause = std::error::Error::source(&error);
            while let Some(source) = cause {
                text += &format!("caused by: {source}\n");
                cause = source.source();
            }
            if let Some(hint) = error.hint() {
                text += &format!("hint: {hint}\n");
            }
            let _ = std::io::stderr().write_all(text.as_bytes());
            ExitCode::FAILURE
        }
    }
}

//! Pages that are generated from definitions: the settings, the methods, completions, the manual page.

use std::path::{Path, PathBuf};

use chainage::config::ConfigError;
use clap::Command;
use clap_complete::Shell;

use crate::cli::exit::{CliError, Outcome};
use crate::cli::print::deliver;
use crate::cli::{exit, print};

#[derive(Debug, clap::Args)]
pub(crate) struct CompletionsArgs {
    /// Shell
    shell: Shell,
}

impl CompletionsArgs {
    /// Prints the script for the `program`.
    pub(crate) fn run(&self, mut program: Command) -> Outcome {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut program, "chainage", &mut script);
        print::text(&String::from_utf8_lossy(&script))?;
        Ok(exit::DONE)
    }
}

/// Print the manual page of the program or of a command.
#[derive(Debug, clap::Args)]
pub(crate) struct ManArgs {
    /// The command [default: the program itself]
    #[arg(value_name = "COMMAND")]
    command: Option<String>,
    /// Write every page into a folder, as chainage.1, chainage-run.1 ...
    #[arg(long, value_name = "DIRECTORY", conflicts_with = "command")]
    all: Option<PathBuf>,
}

impl ManArgs {
    /// Prints a page of the `program`, or writes all pages.
    pub(crate) fn run(&self, program: &Command) -> Outcome {
        if let Some(folder) = &self.all {
            return write_all(program, folder);
        }
        let page = match &self.command {
            None => manual(program.clone())?,
            Some(name) => {
                let found = program.get_subcommands().find(|command| command.get_name() == name);
                let Some(command) = found else {
                    let known: Vec<&str> = program.get_subcommands().map(Command::get_name).collect();
                    let unknown = ConfigError::value("COMMAND", name, format!("one of {}", known.join(", ")));
                    return Err(chainage::Error::from(unknown).into());
                };
                manual(of_command(command))?
            }
        };
        print::text(&String::from_utf8_lossy(&page))?;
        Ok(exit::DONE)
    }
}

/// A command under the name of its page.
fn of_command(command: &Command) -> Command {
    let name: &'static str = Box::leak(format!("chainage-{}", command.get_name()).into_boxed_str());
    let usage: &'static str = Box::leak(format!("chainage {}", command.get_name()).into_boxed_str());
    command.clone().name(name).display_name(name).bin_name(usage)
}

fn manual(command: Command) -> Result<Vec<u8>, CliError> {
    let mut page = Vec::new();
    clap_mangen::Man::new(command).render(&mut page).map_err(CliError::stdout)?;
    Ok(page)
}

/// Writes the page of the program and of every command into a folder.
fn write_all(program: &Command, folder: &Path) -> Outcome {
    std::fs::create_dir_all(folder)
        .map_err(|source| CliError::Write { target: folder.display().to_string(), source })?;
    let commands = program.get_subcommands().filter(|command| command.get_name() != "help");
    for command in std::iter::once(program.clone()).chain(commands.map(of_command)) {
        let path = folder.join(format!("{}.1", command.get_name()));
        let page = manual(command)?;
        deliver(Some(&path), |to| to.write_all(&page))?;
    }
    Ok(exit::DONE)
}

/// Ground filters and clustering methods.
pub(crate) fn methods() -> Outcome {
    let ground =
        chainage::ground::REGISTRY.iter().map(|entry| ("ground", entry.name, entry.summary, entry.reference));
    let cluster = chainage::cluster::REGISTRY
        .iter()
        .map(|entry| ("cluster", entry.name, entry.summary, entry.reference));
    let mut text = String::new();
    for (kind, name, summary, reference) in ground.chain(cluster) {
        text.push_str(&format!("  {kind:<8} {name:<14} {summary}\n  {:<23} {reference}\n", ""));
    }
    print::text(&text)?;
    Ok(exit::DONE)
}

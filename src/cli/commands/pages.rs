//! Pages made from definitions: the settings, the methods, completions, the manual page.

use clap::Command;
use clap_complete::Shell;

use crate::cli::exit::{CliError, Outcome};
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

/// The manual page of the `program` and of every command.
pub(crate) fn man(program: &Command) -> Outcome {
    let mut page = Vec::new();
    let failed = CliError::stdout;
    clap_mangen::Man::new(program.clone()).render(&mut page).map_err(failed)?;
    for sub in program.get_subcommands() {
        let name: &'static str = Box::leak(format!("chainage-{}", sub.get_name()).into_boxed_str());
        clap_mangen::Man::new(sub.clone().name(name)).render(&mut page).map_err(failed)?;
    }
    print::text(&String::from_utf8_lossy(&page))?;
    Ok(exit::DONE)
}

/// Every setting with its unit and default.
pub(crate) fn config() -> Outcome {
    print::text(chainage::config::DEFAULT_TOML)?;
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

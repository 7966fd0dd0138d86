//! `chainage config`: the defaults, the presets, the effective settings, and the check of a configuration
//! file.

use std::path::PathBuf;

use chainage::config::{self, Config, Preset};
use chainage::run::{Registries, check_settings};
use chainage::words::counted;

use crate::cli::drive_args::Choices;
use crate::cli::exit::Outcome;
use crate::cli::progress::warning;
use crate::cli::{exit, print};

/// Prints every setting with its unit and default.
#[derive(Debug, clap::Args)]
pub(crate) struct ConfigArgs {
    /// List the presets and what they are for
    #[arg(long, conflicts_with_all = ["effective", "check"])]
    presets: bool,
    /// Print the settings that a run with these options would use; other options imply it
    #[arg(long, conflicts_with = "check")]
    effective: bool,
    /// Check a configuration file, and list the settings that differ from the defaults
    #[arg(long, value_name = "FILE")]
    check: Option<PathBuf>,
    #[command(flatten)]
    choices: Choices,
}

impl ConfigArgs {
    pub(crate) fn run(&self) -> Outcome {
        let text = if self.presets {
            presets()
        } else if self.effective || (self.check.is_none() && self.choices.is_any_given()) {
            self.effective()?
        } else if let Some(path) = &self.check {
            let config = self.choices.resolve_over(Some(path), &[])?;
            check_settings(&config, &Registries::default())?;
            let differences = config.differences().map_err(chainage::Error::from)?;
            let mut text = format!(
                "{}: valid, {} from the defaults\n",
                path.display(),
                match differences.len() {
                    1 => "1 setting differs".to_owned(),
                    count => format!("{} differ", counted(count as u64, "setting")),
                }
            );
            differences.iter().for_each(|line| text.push_str(&format!("  {line}\n")));
            text.push_str(&print::warnings(config.warnings()));
            text
        } else {
            config::DEFAULT_TOML.to_owned()
        };
        print::text(&text)?;
        Ok(exit::DONE)
    }

    fn effective(&self) -> chainage::Result<String> {
        let config: Config = self.choices.resolve()?;
        check_settings(&config, &Registries::default())?;
        config.warnings().iter().for_each(|text| print::note(&warning(text)));
        Ok(config.to_toml())
    }
}

/// The presets with their comments.
fn presets() -> String {
    let line = |line: &str| if line.is_empty() { "\n".to_owned() } else { format!("    {line}\n") };
    let page = |preset: &Preset| preset.summary().map(line).collect::<String>();
    config::PRESETS.iter().map(|preset| format!("  {}\n{}", preset.name, page(preset))).collect()
}

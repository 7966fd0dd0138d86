//! `chainage slurm`.

use std::path::{Path, PathBuf};

use chainage::config::{Config, ConfigError};
use chainage::input::{Catalog, InputError, InputOptions};

use crate::cli::drive_args::{Inputs, Settings};
use crate::cli::exit::{CliError, Outcome};
use crate::cli::numbers::whole;
use crate::cli::{exit, print};

/// The script, with placeholders for the values of the arguments.
const SCRIPT: &str = include_str!("slurm.sh");

#[derive(Debug, clap::Args)]
pub(crate) struct SlurmArgs {
    #[command(flatten)]
    inputs: Inputs,
    /// Output directory, which all nodes reach under the same name
    #[arg(short, long, value_name = "DIRECTORY")]
    out: PathBuf,
    /// Largest number of tasks of a job array
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = whole::<u32>(1..=100_000, 100))]
    array_size: u32,
    /// Options of sbatch for every job, for example '--partition=long --time=2:00:00'
    #[arg(long, value_name = "OPTIONS", default_value = "", allow_hyphen_values = true)]
    sbatch: String,
    #[command(flatten)]
    settings: Settings,
}

impl SlurmArgs {
    pub(crate) fn run(&self) -> Outcome {
        // Wrong settings and inputs are refused here, not only in a job.
        let config = self.settings.resolve(&[])?;
        let inputs = self.inputs.files()?;
        check_inputs(&inputs, &config)?;
        let mut plan: Vec<String> = Vec::new();
        for file in &inputs {
            plan.push(quoted(&absolute(file)?.to_string_lossy()));
        }
        plan.extend(self.settings.as_arguments(&[]).iter().map(|word| quoted(&word.to_string_lossy())));
        let sbatch = shlex::split(&self.sbatch).ok_or_else(|| {
            let refused = ConfigError::value("--sbatch", &self.sbatch, "options with every quote closed");
            CliError::from(chainage::Error::from(refused))
        })?;
        let program = std::env::current_exe().unwrap_or_else(|_| PathBuf::from("chainage"));
        let script = SCRIPT
            .replace("@PROGRAM@", &quoted(&program.to_string_lossy()))
            .replace("@OUT@", &quoted(&absolute(&self.out)?.to_string_lossy()))
            .replace("@ARRAY@", &self.array_size.to_string())
            .replace("@SBATCH@", &sbatch.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" "))
            .replace("@FOLDER@", &quoted(&absolute(Path::new("."))?.to_string_lossy()))
            .replace("@PLAN@", &plan.join(" "));
        print::text(&script)?;
        Ok(exit::DONE)
    }
}

/// Refuses files that do not exist and folders without points.
fn check_inputs(inputs: &[PathBuf], config: &Config) -> Result<(), CliError> {
    let options = InputOptions { mmap: false, unit: config.input.unit };
    Ok(Catalog::open(inputs, &options).map(|_| ()).map_err(chainage::Error::from)?)
}

/// A path that is valid in any working directory.
fn absolute(path: &Path) -> Result<PathBuf, CliError> {
    let failed = |source| chainage::Error::from(InputError::Read { path: path.to_owned(), source });
    Ok(std::path::absolute(path).map_err(failed)?)
}

/// A word, quoted for the shell.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_reach_the_shell_as_they_are() {
        for word in ["plain", "two words", "it's", "$HOME `id` \"x\"", "*.laz", ""] {
            let output = std::process::Command::new("sh")
                .args(["-c", &format!("printf '<%s>' {}", quoted(word))])
                .output()
                .unwrap();
            assert_eq!(String::from_utf8(output.stdout).unwrap(), format!("<{word}>"));
        }
    }
}

//! `chainage status`.

use std::path::PathBuf;

use chainage::run::{Registries, RunStatus, status};

use crate::cli::drive_args::Settings;
use crate::cli::exit::Outcome;
use crate::cli::print::JsonOutput;
use crate::cli::{exit, print};

#[derive(Debug, clap::Args)]
pub(crate) struct StatusArgs {
    /// Output directory of a run
    out: PathBuf,
    /// Say what has changed since stored results were computed
    #[arg(long)]
    why: bool,
    #[command(flatten)]
    json: JsonOutput,
    #[command(flatten)]
    settings: Settings,
}

impl StatusArgs {
    pub(crate) fn run(&self) -> Outcome {
        // Without settings of its own: those of the last call.
        let resolve = |last: &std::path::Path| {
            let file = self.settings.config.as_deref().or(Some(last));
            self.settings.resolve_over(file, &[])
        };
        let state = status(&self.out, &Registries::default(), resolve)?;
        self.json.show(&state, || page(&state, self.why))?;
        Ok(exit::DONE)
    }
}

fn page(state: &RunStatus, why: bool) -> String {
    let rows: Vec<Vec<String>> = state
        .passes
        .iter()
        .map(|pass| {
            let units = pass.units.map_or_else(|| "-".to_owned(), |units| units.to_string());
            vec![pass.pass.to_owned(), units, pass.done.to_string(), pass.stale.to_string()]
        })
        .collect();
    let mut text = print::table(&["pass", "units", "done", "stale"], &rows);
    if why {
        for pass in &state.passes {
            for reason in &pass.why {
                text.push_str(&format!("  {} is stale: {reason}\n", pass.pass));
            }
        }
    }
    let verdict = if state.finished {
        "finished: every output is there"
    } else {
        "not finished: the same command resumes"
    };
    text.push_str(&format!("  {verdict}\n"));
    text
}

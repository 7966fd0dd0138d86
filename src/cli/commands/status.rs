//! `chainage status`.

use std::path::PathBuf;

use chainage::run::{PassStatus, Registries, RunStatus, status};

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
        text.push_str(&reasons(&state.passes));
    }
    let verdict = if state.finished {
        "finished: every output is there"
    } else {
        "not finished: the same command resumes"
    };
    text.push_str(&format!("  {verdict}\n"));
    text
}

/// What has changed, pass by pass. Passes that only depend on changed passes before them follow these in one line.
fn reasons(passes: &[PassStatus]) -> String {
    let mut text = String::new();
    let mut following = Vec::new();
    for pass in passes.iter().filter(|pass| !pass.why.is_empty()) {
        let (before, own): (Vec<_>, Vec<_>) = pass.why.iter().partition(|reason| reason.is_of_another_pass());
        for reason in &own {
            text.push_str(&format!("  {} is stale: {reason}\n", pass.pass));
        }
        if own.is_empty() && !before.is_empty() {
            following.push(pass.pass);
        }
    }
    if !following.is_empty() {
        let verb = if following.len() == 1 { "follows" } else { "follow" };
        text.push_str(&format!("  {} {verb}\n", following.join(", ")));
    }
    text
}

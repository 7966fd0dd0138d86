//! `chainage status`.

use std::path::PathBuf;

use chainage::run::{PassStatus, Registries, RunStatus, status};

use crate::cli::drive_args::Choices;
use crate::cli::exit::Outcome;
use crate::cli::print::JsonOutput;
use crate::cli::{exit, print};

#[derive(Debug, clap::Args)]
pub(crate) struct StatusArgs {
    /// Output directory of a run
    out: PathBuf,
    /// Show which settings changed since the stored results were computed
    #[arg(long)]
    why: bool,
    #[command(flatten)]
    json: JsonOutput,
    #[command(flatten)]
    choices: Choices,
}

impl StatusArgs {
    pub(crate) fn run(&self) -> Outcome {
        let resolve = |last: &std::path::Path| self.choices.resolve_after(last);
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
            let shown =
                |count: Option<usize>| count.map_or_else(|| "-".to_owned(), |count| count.to_string());
            // Of a finished run, the state of a pass without units was removed: its outputs are complete.
            let kept = pass.units.is_some() || !state.finished;
            let [done, stale] = [pass.done, pass.stale].map(|count| shown(kept.then_some(count)));
            vec![pass.title.clone(), shown(pass.units), done, stale]
        })
        .collect();
    let mut text = print::table(&["pass", "units", "done", "stale"], &rows);
    if why {
        text.push_str(&reasons(&state.passes));
    }
    let verdict = if state.finished {
        "finished: every output is complete"
    } else {
        "not finished: the same command resumes"
    };
    text.push_str(&format!("  {verdict}\n"));
    text
}

/// Describes what has changed, pass by pass. One line names the passes that follow because an earlier pass
/// changed.
fn reasons(passes: &[PassStatus]) -> String {
    let mut text = String::new();
    let mut following = Vec::new();
    for pass in passes.iter().filter(|pass| !pass.why.is_empty()) {
        let causes = pass.causes();
        if causes.is_empty() {
            following.push(pass.pass);
        }
        for cause in causes {
            text.push_str(&format!("  {} must be redone: {cause}\n", pass.pass));
        }
    }
    if !following.is_empty() {
        let verb = if following.len() == 1 { "follows" } else { "follow" };
        text.push_str(&format!("  {} {verb}\n", following.join(", ")));
    }
    text
}

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

/// The setting that chooses the method.
const METHOD: &str = "cluster.method";

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
            // In a finished run, the state of a pass without units was removed, because its outputs are
            // complete.
            let kept = pass.units.is_some() || !state.finished;
            let [done, stale] = [pass.done, pass.stale].map(|count| shown(kept.then_some(count)));
            vec![pass.title.clone(), shown(pass.units), done, stale]
        })
        .collect();
    let mut text = match &state.missing {
        Some(missing) => format!("  the passes are not compared with the input: {missing}\n"),
        None => print::table(&["pass", "units", "done", "stale"], &rows),
    };
    if why {
        text.push_str(&reasons(state));
    }
    let verdict = match (state.finished, state.finished_before, state.same_settings) {
        (true, ..) => "finished: every output is complete",
        (false, true, _) => {
            "finished with the settings of the last call; chainage run with these settings computes what is missing or stale"
        }
        (false, false, true) => "not finished: the same command resumes",
        (false, false, false) => "not finished: chainage run with these settings resumes",
    };
    text.push_str(&format!("  {verdict}\n"));
    text
}

/// Describes what has changed, pass by pass. One line names the passes that follow because an earlier pass
/// changed.
fn reasons(state: &RunStatus) -> String {
    let mut text = String::new();
    // Passes of both methods already report the change of the method.
    let said = |pass: &PassStatus| pass.why.iter().any(|reason| reason.name == METHOD);
    if let Some(changed) = state.other_method().filter(|_| !state.passes.iter().any(said)) {
        text.push_str(&format!("  other passes are needed: {changed}\n"));
    }
    for file in &state.touched {
        text.push_str(&format!(
            "  {file} was changed or touched since the run was started: the next run compares its content\n"
        ));
    }
    let mut following = Vec::new();
    for pass in state.passes.iter().filter(|pass| !pass.why.is_empty()) {
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

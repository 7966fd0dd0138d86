//! `chainage status`.

use std::path::PathBuf;

use chainage::config::DEFAULT_TOML;
use chainage::run::{PassStatus, Registries, RunStatus, StaleReason, status};

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
        // It has no settings of its own and uses those of the last call.
        let resolve = |last: &std::path::Path| {
            let file = self.choices.config.as_deref().or(Some(last));
            self.choices.resolve_over(file, &[])
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
        "finished: every output is complete"
    } else {
        "not finished: the same command resumes"
    };
    text.push_str(&format!("  {verdict}\n"));
    text
}

/// The settings among the changed values. The tiles and the reach are derived from settings: they are named only where no
/// setting of the pass has changed.
fn causes<'a>(changed: &[&'a StaleReason]) -> Vec<&'a StaleReason> {
    let settings: Vec<_> = changed.iter().copied().filter(|reason| reason.name.contains('.')).collect();
    if settings.is_empty() { changed.to_vec() } else { settings }
}

/// A changed value with its old and its new value.
fn changed(reason: &StaleReason) -> String {
    let unit = unit(&reason.name);
    match (&reason.old, &reason.new) {
        (Some(old), Some(new)) => format!("{} changed from {old} to {new}{unit}", reason.name),
        (None, Some(new)) => format!("{} is new: {new}{unit}", reason.name),
        (Some(old), None) => format!("{} was {old}{unit} and is not used any more", reason.name),
        (None, None) => reason.name.clone(),
    }
}

/// The unit of a setting with a blank before it, as the comments of the defaults say it; empty where there is none.
fn unit(setting: &str) -> &'static str {
    let Some((section, key)) = setting.split_once('.') else { return "" };
    let header = format!("[{section}]");
    let lines = DEFAULT_TOML.lines().skip_while(|line| !line.starts_with(&header)).skip(1);
    let mut lines = lines.take_while(|line| !line.starts_with('['));
    let line = lines.find(|line| line.split('=').next().is_some_and(|name| name.trim() == key));
    let comment = line.and_then(|line| line.split_once('#')).map_or("", |(_, comment)| comment.trim());
    match comment.split([',', ' ']).next() {
        Some("m") => " m",
        Some("voxels") => " voxels",
        Some("MiB") => " MiB",
        _ => "",
    }
}

/// Describes what has changed, pass by pass. One line names the passes that follow because an earlier pass changed.
fn reasons(passes: &[PassStatus]) -> String {
    let mut text = String::new();
    let mut following = Vec::new();
    for pass in passes.iter().filter(|pass| !pass.why.is_empty()) {
        let (before, own): (Vec<_>, Vec<_>) = pass.why.iter().partition(|reason| reason.is_of_another_pass());
        let own = causes(&own);
        for reason in &own {
            text.push_str(&format!("  {} must be redone: {}\n", pass.pass, changed(reason)));
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

//! Progress on standard error: bars on a terminal, plain lines in a pipe, JSON lines on request.

use std::io::IsTerminal;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use chainage::run::{Event, Observer};
use indicatif::{ProgressBar, ProgressStyle};

use crate::allocator;
use crate::cli::colour;
use crate::cli::exit;
use crate::cli::print::{self, note};

/// How progress is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum ProgressChoice {
    /// Bars on a terminal, lines elsewhere
    Auto,
    /// Bars
    Bar,
    /// A line at the start and end of a pass, and every ten seconds
    Plain,
    /// The same, and a line for each tile
    Units,
    /// One JSON object per line for each event
    Json,
    /// Warnings only
    None,
}

impl ProgressChoice {
    /// From now on, errors are reported as lines of JSON if progress is.
    fn prepare(self) -> Self {
        if self == Self::Json {
            exit::report_as_json();
        }
        self
    }
}

/// How much a command that processes a drive says.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Display")]
pub(crate) struct Show {
    /// How progress is shown on standard error
    #[arg(long, value_enum, default_value = "auto", value_name = "KIND")]
    progress: ProgressChoice,
    /// Show warnings only: --progress none
    #[arg(short, long, conflicts_with_all = ["progress", "verbose"])]
    quiet: bool,
    /// Show the settings that differ from the defaults, and a line for each tile
    #[arg(short, long, conflicts_with = "progress")]
    verbose: bool,
}

impl Show {
    /// The kind of progress. Call it first: from then on, errors have this form as well.
    pub(crate) fn progress(&self) -> ProgressChoice {
        match (self.quiet, self.verbose) {
            (true, _) => ProgressChoice::None,
            (_, true) => ProgressChoice::Units,
            _ => self.progress.prepare(),
        }
    }

    pub(crate) fn verbose(&self) -> bool {
        self.verbose
    }
}

/// Shows the events of a run.
#[derive(Debug)]
pub(crate) struct Progress {
    kind: ProgressChoice,
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    bar: Option<ProgressBar>,
    /// Points of the pass, those done, and those done by an earlier run.
    total: u64,
    done: u64,
    begun_with: u64,
    /// Units of the pass.
    units: usize,
    started: Instant,
    last_line: Instant,
    whole: Whole,
}

/// Seconds between lines of a pass in plain progress.
const LINE_EVERY: Duration = Duration::from_secs(10);

/// The passes of the whole run, for the time that is left.
#[derive(Debug, Default)]
struct Whole {
    /// Number of the current pass, from 1.
    number: usize,
    /// Names of the passes after the survey, once they are known.
    ahead: Vec<&'static str>,
    /// Seconds of the passes that were computed, and the sum of their costs.
    seconds: f64,
    cost: f64,
}

/// Time of a pass relative to the survey, on the streets of `benches/results`. Rough: it only divides the
/// time that is left among the passes ahead.
fn cost(pass: &str) -> f64 {
    match pass {
        "survey" | "scatter" | "relabel" => 1.0,
        "stitch" => 0.1,
        "inventory" => 1.5,
        "export" => 3.0,
        // Ground, and the steps of the methods.
        _ => 2.5,
    }
}

impl Whole {
    fn start(&mut self) {
        self.number += 1;
    }

    /// Counts a pass that was computed in so many seconds.
    fn finish(&mut self, pass: &str, seconds: f64) {
        self.seconds += seconds;
        self.cost += cost(pass);
    }

    /// ` 2 of 8` once all passes are known.
    fn place(&self) -> String {
        if self.ahead.is_empty() {
            return String::new();
        }
        format!(" {} of {}", self.number, (1 + self.ahead.len()).max(self.number))
    }

    /// Seconds that are left in all, when the current pass has run for `elapsed` seconds and needs `left`
    /// more. `None` before the passes are known.
    fn left(&self, pass: &str, elapsed: f64, left: f64) -> Option<f64> {
        let at = self.ahead.iter().rposition(|name| *name == pass)?;
        let later: f64 = self.ahead[at + 1..].iter().map(|name| cost(name)).sum();
        let per_cost = (self.seconds + elapsed + left) / (self.cost + cost(pass));
        Some(left + later * per_cost)
    }
}

impl State {
    fn new() -> Self {
        let now = Instant::now();
        let whole = Whole::default();
        Self { bar: None, total: 0, done: 0, begun_with: 0, units: 0, started: now, last_line: now, whole }
    }

    fn start(&mut self, points: u64, points_done: u64, units: usize) {
        (self.total, self.done, self.begun_with, self.units) = (points, points_done, points_done, units);
        self.started = Instant::now();
        self.last_line = self.started;
        self.whole.start();
    }

    /// Points per second in this pass, and the seconds that are left in it.
    fn pace(&self) -> (f64, f64) {
        let rate = (self.done - self.begun_with) as f64 / self.started.elapsed().as_secs_f64().max(1e-9);
        (rate, (self.total - self.done) as f64 / rate.max(1e-9))
    }

    /// `, about 9 s left in all`, once this can be estimated.
    fn in_all(&self, pass: &str) -> String {
        let left = self.pace().1;
        let whole = self.whole.left(pass, self.started.elapsed().as_secs_f64(), left);
        whole.map_or_else(String::new, |seconds| format!(", about {seconds:.0} s left in all"))
    }
}

impl Progress {
    pub(crate) fn new(choice: ProgressChoice) -> Self {
        let kind = match choice {
            ProgressChoice::Auto if std::io::stderr().is_terminal() => ProgressChoice::Bar,
            ProgressChoice::Auto => ProgressChoice::Plain,
            other => other.prepare(),
        };
        Self { kind, state: Mutex::new(State::new()) }
    }

    fn bar(&self, state: &mut State, event: &Event<'_>) {
        let above = |state: &State, text: &str| match &state.bar {
            Some(bar) => bar.println(text),
            None => note(text),
        };
        match event {
            Event::PassesAhead { passes } => state.whole.ahead = passes.to_vec(),
            Event::PassStarted { pass, units, points, points_done, .. } => {
                state.start(*points, *points_done, *units);
                let bar = ProgressBar::new(*points);
                let template = "{prefix:>16} {wide_bar} {percent:>3}% {per_sec:>14} {eta:>5} left{msg}";
                if let Ok(style) = ProgressStyle::with_template(template) {
                    bar.set_style(style.with_key(
                        "per_sec",
                        |state: &indicatif::ProgressState, out: &mut dyn std::fmt::Write| {
                            let _ = write!(out, "{:.1} M points/s", state.per_sec() / 1e6);
                        },
                    ));
                }
                bar.set_prefix(format!("{pass}{}", state.whole.place()));
                bar.set_position(*points_done);
                bar.reset_eta();
                bar.enable_steady_tick(Duration::from_millis(250));
                state.bar = Some(bar);
            }
            Event::UnitFinished { pass, points, .. } => {
                state.done += points;
                let message = state.in_all(pass);
                if let Some(bar) = &state.bar {
                    bar.inc(*points);
                    bar.set_message(message);
                }
            }
            Event::PassFinished { pass, seconds } => {
                if state.done > state.begun_with {
                    state.whole.finish(pass, *seconds);
                }
                if let Some(bar) = state.bar.take() {
                    bar.set_message("");
                    bar.finish();
                }
            }
            Event::Warning { text } => above(state, &warning(text)),
            Event::UnitFailed { pass, unit, reason } => above(state, &failure(pass, *unit, reason)),
        }
    }

    fn plain(&self, state: &mut State, event: &Event<'_>) {
        match event {
            Event::PassesAhead { passes } => state.whole.ahead = passes.to_vec(),
            Event::PassStarted { pass, units, done, points, points_done } => {
                state.start(*points, *points_done, *units);
                if done < units {
                    let points = print::counted(*points, "point");
                    let units = print::counted(*units as u64, "unit");
                    let resumed = if *done > 0 { format!(", {done} already done") } else { String::new() };
                    note(&format!("{pass}{}: {points} in {units}{resumed}", state.whole.place()));
                }
            }
            Event::UnitFinished { pass, unit, points, seconds } => {
                state.done += points;
                if self.kind == ProgressChoice::Units {
                    let (number, units) = (unit + 1, state.units);
                    let points = print::counted(*points, "point");
                    note(&format!("{pass}: unit {number} of {units}, {points}, {seconds:.1} s"));
                }
                if state.last_line.elapsed() >= LINE_EVERY {
                    state.last_line = Instant::now();
                    let (rate, left) = state.pace();
                    let share = 100.0 * state.done as f64 / state.total.max(1) as f64;
                    let place = state.whole.place();
                    let in_all = state.in_all(pass);
                    let rate = rate / 1e6;
                    note(&format!(
                        "{pass}{place}: {share:.0} %, {rate:.2} M points/s, {left:.0} s left{in_all}"
                    ));
                }
            }
            Event::PassFinished { pass, seconds } => {
                let points = state.done - state.begun_with;
                if points > 0 {
                    state.whole.finish(pass, *seconds);
                    let rate = points as f64 / seconds.max(1e-9) / 1e6;
                    note(&format!("{pass}: done in {seconds:.1} s, {rate:.2} M points/s"));
                } else if state.total > 0 {
                    note(&format!("{pass}: already done"));
                } else {
                    note(&format!("{pass}: done in {seconds:.1} s"));
                }
            }
            Event::Warning { text } => note(&warning(text)),
            Event::UnitFailed { pass, unit, reason } => note(&failure(pass, *unit, reason)),
        }
    }
}

/// The line of a warning.
pub(crate) fn warning(text: &str) -> String {
    format!("{} {text}", colour::coloured("warning:", colour::YELLOW))
}

fn failure(pass: &str, unit: usize, reason: &str) -> String {
    format!("{} {pass}, unit {unit}: {reason}", colour::coloured("failed:", colour::RED))
}

impl Observer for Progress {
    fn event(&self, event: &Event<'_>) {
        if matches!(event, Event::PassStarted { .. }) {
            // Nothing is in flight between passes.
            allocator::return_free_memory();
        }
        let Ok(mut state) = self.state.lock() else { return };
        match self.kind {
            ProgressChoice::Auto | ProgressChoice::Bar => self.bar(&mut state, event),
            ProgressChoice::Plain | ProgressChoice::Units => self.plain(&mut state, event),
            ProgressChoice::Json => note(&event.to_json().to_string()),
            ProgressChoice::None => match event {
                Event::Warning { .. } | Event::UnitFailed { .. } => self.plain(&mut state, event),
                _ => {}
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_counts_the_passes_ahead() {
        let mut whole = Whole::default();
        whole.start();
        assert_eq!((whole.place(), whole.left("survey", 1.0, 1.0)), (String::new(), None));
        whole.finish("survey", 2.0);
        whole.ahead = vec!["ground", "cluster", "relabel"];
        whole.start();
        assert_eq!(whole.place(), " 2 of 4");
        // The survey took 2 s per unit of cost. Ground takes 5 s as well, and 3.5 units of cost follow.
        assert_eq!(whole.left("ground", 4.0, 1.0), Some(1.0 + 3.5 * 2.0));
    }
}

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
    /// Makes errors from now on lines of JSON if progress is shown as JSON.
    fn prepare(self) -> Self {
        if self == Self::Json {
            exit::report_as_json();
        }
        self
    }
}

/// -q, in every command that shows how far it is.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Display")]
pub(crate) struct Quiet {
    /// Show no progress, only warnings
    #[arg(short, long)]
    quiet: bool,
}

impl Quiet {
    /// Whether a command with a display of its own shows it: standard error is a terminal, and --quiet was
    /// not given.
    pub(crate) fn shows(&self) -> bool {
        !self.quiet && std::io::stderr().is_terminal()
    }
}

/// How progress is shown, in commands that process a drive.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Display")]
pub(crate) struct Kind {
    /// How progress is shown on standard error
    #[arg(long, value_enum, default_value = "auto", value_name = "KIND", conflicts_with = "quiet")]
    progress: ProgressChoice,
    #[command(flatten)]
    quiet: Quiet,
}

impl Kind {
    /// The kind of progress. Call it first: from then on, errors have this format as well.
    pub(crate) fn progress(&self) -> ProgressChoice {
        if self.quiet.quiet { ProgressChoice::None } else { self.progress.prepare() }
    }
}

/// How much a command says that processes a drive with settings.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Display")]
pub(crate) struct Show {
    #[command(flatten)]
    kind: Kind,
    /// Show the settings that differ from the defaults, and a line for each tile
    #[arg(short, long, conflicts_with_all = ["progress", "quiet"])]
    verbose: bool,
}

impl Show {
    /// The kind of progress. Call it first: from then on, errors have this format as well.
    pub(crate) fn progress(&self) -> ProgressChoice {
        if self.verbose { ProgressChoice::Units } else { self.kind.progress() }
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
    /// Points of the pass, points done so far, and points done by an earlier run.
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

/// The passes of the whole run, for the remaining time.
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

/// Times of passes relative to the survey. The remaining time is estimated from them.
///
/// Source: `passes` of `chainage run --json` on the synthetic drives downtown_ts2 (2.0 M points) and
/// suburb_ts1 (4.0 M points), every method with its default settings, means of both. The passes of `street`
/// and `p-linkage` were measured on the first only. `chains`, `cores`, `growth` and `leftovers` are means of
/// these and of a run on a quieter machine; `growth` is one of six rounds. `scatter`, `fields` and `samples`
/// were not measured.
const COSTS: [(&str, f64); 25] = [
    ("survey", 1.0),
    ("ground", 0.8),
    ("scatter", 1.0),
    ("fields", 1.0),
    // street
    ("voxels", 0.4),
    ("classes", 3.1),
    ("context", 1.4),
    ("chains", 0.15),
    ("cores", 0.4),
    ("edges", 1.3),
    ("growth", 0.1),
    ("leftovers", 0.1),
    ("objects", 1.0),
    ("samples", 1.0),
    // p-linkage
    ("links", 3.4),
    ("planes", 0.05),
    ("slices", 0.05),
    ("surfaces", 0.1),
    // density-peaks
    ("peaks", 0.3),
    ("borders", 0.6),
    // dbscan and euclidean
    ("cluster", 0.3),
    ("stitch", 0.05),
    ("relabel", 0.1),
    ("inventory", 0.6),
    ("export", 3.0),
];
/// Cost of a round of the contest of `p-linkage`.
const CONTEST: f64 = 1.1;
/// Cost of the inventory if the objects are surfaces, because their planes are fitted as well.
const INVENTORY_OF_SURFACES: f64 = 3.2;
/// Cost of a pass that was not measured.
const OTHER: f64 = 1.0;

impl Whole {
    fn start(&mut self) {
        self.number += 1;
    }

    /// Time of a pass relative to the survey.
    fn cost(&self, pass: &str) -> f64 {
        match pass {
            "inventory" if self.ahead.contains(&"surfaces") => INVENTORY_OF_SURFACES,
            _ if pass.starts_with("contest-") => CONTEST,
            _ => COSTS.iter().find(|(name, _)| *name == pass).map_or(OTHER, |(_, cost)| *cost),
        }
    }

    /// Counts a pass that was computed in `seconds`.
    fn finish(&mut self, pass: &str, seconds: f64) {
        self.seconds += seconds;
        self.cost += self.cost(pass);
    }

    /// The passes after this one, as far as they are known.
    fn after(&self, pass: &str) -> Option<&[&'static str]> {
        let at = self.ahead.iter().rposition(|name| *name == pass)?;
        Some(&self.ahead[at + 1..])
    }

    /// ` 2 of 8` once all passes are known. A pass that settles is announced once but may start several
    /// times, so the total may grow.
    fn place(&self, pass: &str) -> String {
        let all = |after: &[&str]| format!(" {} of {}", self.number, self.number + after.len());
        self.after(pass).map_or_else(String::new, all)
    }

    /// Remaining seconds of the run, if the current pass has run for `elapsed` seconds and needs `left` more.
    /// `None` before the passes are known.
    fn left(&self, pass: &str, elapsed: f64, left: f64) -> Option<f64> {
        let later: f64 = self.after(pass)?.iter().map(|name| self.cost(name)).sum();
        let per_cost = (self.seconds + elapsed + left) / (self.cost + self.cost(pass));
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

    /// Points per second in this pass, and its remaining seconds. `None` before any point of the pass is
    /// done.
    fn pace(&self, elapsed: f64) -> Option<(f64, f64)> {
        let done = (self.done - self.begun_with) as f64;
        let rate = done / elapsed.max(1e-9);
        (done > 0.0).then(|| (rate, self.total.saturating_sub(self.done) as f64 / rate))
    }

    /// `, 0.52 M points/s, 2 s left, about 9 s in all`, as far as this can be estimated.
    fn outlook(&self, pass: &str, elapsed: f64) -> String {
        let Some((rate, left)) = self.pace(elapsed) else { return String::new() };
        let mut text = format!(", {:.2} M points/s, {} left", rate / 1e6, time(left));
        if let Some(seconds) = self.whole.left(pass, elapsed, left) {
            text.push_str(&format!(", about {} in all", time(seconds)));
        }
        text
    }
}

/// A remaining time, as one number with a unit.
pub(crate) fn time(seconds: f64) -> String {
    match seconds {
        ..100.0 => format!("{seconds:.0} s"),
        ..6_000.0 => format!("{:.0} min", seconds / 60.0),
        _ => format!("{:.0} h", seconds / 3_600.0),
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
                if let Ok(style) = ProgressStyle::with_template("{prefix:>18} {wide_bar} {percent:>3} %{msg}")
                {
                    bar.set_style(style);
                }
                bar.set_prefix(format!("{pass}{}", state.whole.place(pass)));
                bar.set_position(*points_done);
                bar.enable_steady_tick(Duration::from_millis(250));
                state.bar = Some(bar);
            }
            Event::UnitFinished { pass, points, .. } => {
                state.done += points;
                let message = state.outlook(pass, state.started.elapsed().as_secs_f64());
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
                    note(&format!("{pass}{}: {points} in {units}{resumed}", state.whole.place(pass)));
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
                    let share = 100.0 * state.done as f64 / state.total.max(1) as f64;
                    let place = state.whole.place(pass);
                    let outlook = state.outlook(pass, state.started.elapsed().as_secs_f64());
                    note(&format!("{pass}{place}: {share:.0} %{outlook}"));
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
        assert_eq!((whole.place("survey"), whole.left("survey", 1.0, 1.0)), (String::new(), None));
        whole.finish("survey", 2.0);
        whole.ahead = vec!["ground", "cluster", "relabel"];
        whole.start();
        assert_eq!(whole.place("ground"), " 2 of 4");
        // The survey took 2 s per unit of cost. Ground takes 1.6 s as well, and 0.4 units of cost follow.
        let left = whole.left("ground", 1.2, 0.4).unwrap();
        assert!((left - (0.4 + 0.4 * 2.0)).abs() < 1e-9, "{left}");
    }

    #[test]
    fn a_pass_that_settles_leaves_the_passes_after_it() {
        let ahead = ["edges", "growth", "leftovers", "stitch", "export"];
        let mut whole = Whole { number: 7, ahead: ahead.to_vec(), ..Whole::default() };
        let mut places = Vec::new();
        for pass in ["edges", "growth", "growth", "growth", "leftovers", "stitch", "export"] {
            whole.start();
            places.push(whole.place(pass));
        }
        let expected =
            [" 8 of 12", " 9 of 12", " 10 of 13", " 11 of 14", " 12 of 14", " 13 of 14", " 14 of 14"];
        assert_eq!(places, expected);
    }

    /// In a run of 9 s, after the survey and the ground took 0.7 and 1.7 s, the time left must not be given
    /// as 26 s.
    #[test]
    fn the_steps_of_street_have_costs_of_their_own() {
        let ahead = [
            "ground",
            "voxels",
            "classes",
            "context",
            "chains",
            "cores",
            "edges",
            "growth",
            "leftovers",
            "objects",
            "stitch",
            "relabel",
            "inventory",
            "export",
        ];
        let mut whole = Whole { ahead: ahead.to_vec(), ..Whole::default() };
        let all: f64 = 1.0 + ahead.iter().map(|pass| whole.cost(pass)).sum::<f64>();
        assert!((12.0..16.0).contains(&all), "{all}");
        for short in ["chains", "cores", "growth", "leftovers", "stitch"] {
            assert!(whole.cost(short) <= 0.5 * whole.cost("ground"), "{short}");
        }
        assert!(whole.cost("inventory") < 1.0);
        whole.ahead.push("surfaces");
        assert!(whole.cost("inventory") > 3.0 && (whole.cost("contest-3") - CONTEST).abs() < 1e-9);
    }

    #[test]
    fn nothing_is_estimated_before_a_unit_is_done() {
        let mut state = State::new();
        state.start(1_000_000, 0, 4);
        assert_eq!(state.outlook("ground", 0.1), "");
        state.done = 250_000;
        assert_eq!(state.outlook("ground", 1.0), ", 0.25 M points/s, 3 s left");
        state.whole.ahead = vec!["ground", "scatter"];
        assert_eq!(state.outlook("ground", 1.0), ", 0.25 M points/s, 3 s left, about 8 s in all");
        assert_eq!([2.4, 250.0, 20_000.0].map(time), ["2 s", "4 min", "6 h"]);
        // Points of an earlier run say nothing about the pace of this one.
        state.start(1_000_000, 500_000, 4);
        assert_eq!(state.outlook("ground", 5.0), "");
    }
}

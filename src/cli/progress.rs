//! Progress on standard error: bars on a terminal, plain lines in a pipe, JSON lines on request.

use std::io::{IsTerminal, Write};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use chainage::run::{Event, Observer};
use indicatif::{ProgressBar, ProgressStyle};

use crate::allocator;
use crate::cli::print;

/// How progress is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum ProgressChoice {
    /// Bars on a terminal, lines elsewhere
    Auto,
    /// Bars
    Bar,
    /// A line per pass and every ten seconds
    Plain,
    /// A JSON object per event and line
    Json,
    /// Nothing but warnings
    None,
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
    done: u64,
    total: u64,
    started: Instant,
    begun_with: u64,
    last_line: Instant,
}

/// Seconds between lines of a pass in plain progress.
const LINE_EVERY: Duration = Duration::from_secs(10);

impl Progress {
    pub(crate) fn new(choice: ProgressChoice) -> Self {
        let kind = match choice {
            ProgressChoice::Auto if std::io::stderr().is_terminal() => ProgressChoice::Bar,
            ProgressChoice::Auto => ProgressChoice::Plain,
            other => other,
        };
        let now = Instant::now();
        let state = State { bar: None, done: 0, total: 0, started: now, begun_with: 0, last_line: now };
        Self { kind, state: Mutex::new(state) }
    }

    fn bar(&self, state: &mut State, event: &Event<'_>) {
        match event {
            Event::PassStarted { pass, points, points_done, .. } => {
                let bar = ProgressBar::new(*points);
                let template = "{prefix:>8} {wide_bar} {percent:>3}% {per_sec:>14} {eta:>5} left";
                if let Ok(style) = ProgressStyle::with_template(template) {
                    bar.set_style(style.with_key(
                        "per_sec",
                        |state: &indicatif::ProgressState, out: &mut dyn std::fmt::Write| {
                            let _ = write!(out, "{:.1} M points/s", state.per_sec() / 1e6);
                        },
                    ));
                }
                bar.set_prefix(*pass);
                bar.set_position(*points_done);
                bar.reset_eta();
                bar.enable_steady_tick(Duration::from_millis(250));
                state.bar = Some(bar);
            }
            Event::UnitFinished { points, .. } => {
                if let Some(bar) = &state.bar {
                    bar.inc(*points);
                }
            }
            Event::PassFinished { .. } => {
                if let Some(bar) = state.bar.take() {
                    bar.finish();
                }
            }
            Event::Warning { text } => match &state.bar {
                Some(bar) => bar.println(format!("warning: {text}")),
                None => line(&format!("warning: {text}")),
            },
            Event::UnitFailed { pass, unit, reason } => match &state.bar {
                Some(bar) => bar.println(format!("failed: {pass}, unit {unit}: {reason}")),
                None => line(&format!("failed: {pass}, unit {unit}: {reason}")),
            },
        }
    }

    fn plain(state: &mut State, event: &Event<'_>) {
        match event {
            Event::PassStarted { pass, units, done, points, points_done } => {
                *state = State {
                    bar: None,
                    done: *points_done,
                    begun_with: *points_done,
                    total: *points,
                    started: Instant::now(),
                    last_line: Instant::now(),
                };
                let resumed = if *done > 0 { format!(", {done} already there") } else { String::new() };
                line(&format!("{pass}: {} points in {units} units{resumed}", print::count(*points)));
            }
            Event::UnitFinished { pass, points, .. } => {
                state.done += points;
                if state.last_line.elapsed() >= LINE_EVERY {
                    state.last_line = Instant::now();
                    let rate = (state.done - state.begun_with) as f64 / state.started.elapsed().as_secs_f64();
                    let left = (state.total - state.done) as f64 / rate;
                    let share = 100.0 * state.done as f64 / state.total.max(1) as f64;
                    line(&format!("{pass}: {share:.0} %, {:.2} M points/s, {left:.0} s left", rate / 1e6));
                }
            }
            Event::PassFinished { pass, seconds } => {
                let rate = (state.total - state.begun_with) as f64 / seconds.max(1e-9);
                line(&format!("{pass}: done in {seconds:.1} s, {:.2} M points/s", rate / 1e6));
            }
            Event::Warning { text } => line(&format!("warning: {text}")),
            Event::UnitFailed { pass, unit, reason } => {
                line(&format!("failed: {pass}, unit {unit}: {reason}"))
            }
        }
    }
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
            ProgressChoice::Plain => Self::plain(&mut state, event),
            ProgressChoice::Json => line(&event.to_json().to_string()),
            ProgressChoice::None => match event {
                Event::Warning { .. } | Event::UnitFailed { .. } => Self::plain(&mut state, event),
                _ => {}
            },
        }
    }
}

fn line(text: &str) {
    // If standard error is closed, nothing can be reported.
    let _ = std::io::stderr().write_all(format!("{text}\n").as_bytes());
}

//! `chainage work`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use chainage::run::{CancelToken, PassFigures, Units, memory_budget, work};

use crate::allocator;
use crate::cli::commands::next;
use crate::cli::drive_args::WorkerSettings;
use crate::cli::exit::Outcome;
use crate::cli::numbers::whole;
use crate::cli::print::{self, JsonOutput};
use crate::cli::progress::{Kind, Progress};
use crate::cli::{exit, interrupt};

// Many workers write to one terminal or log.
#[derive(Debug, clap::Args)]
#[command(mut_arg("progress", |progress| progress.default_value("none")))]
pub(crate) struct WorkArgs {
    /// Output directory of a run
    out: PathBuf,
    /// The pass, as `chainage next` names it
    #[arg(long, value_name = "PASS")]
    pass: String,
    /// Its units, for example 3..7,12 (without 7) [default: all that are missing]
    #[arg(long, value_name = "LIST", value_parser = units)]
    units: Option<Numbers>,
    /// Wait up to this many seconds for files of other workers: other hosts see a new file late
    #[arg(long, value_name = "SECONDS", default_value_t = 60, value_parser = whole::<u64>(0..=u64::MAX, 60))]
    wait: u64,
    #[command(flatten)]
    show: Kind,
    #[command(flatten)]
    json: JsonOutput,
    #[command(flatten)]
    settings: WorkerSettings,
}

/// Numbers of units.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Numbers(Vec<usize>);

impl WorkArgs {
    pub(crate) fn run(&self) -> Outcome {
        let cancel = Arc::new(CancelToken::default());
        interrupt::listen(&cancel)?;
        let units = self.units.clone().map_or(Units::All, |numbers| Units::Some(numbers.0));
        let progress = Progress::new(self.show.progress());
        // The settings of the run, and how this machine is used.
        let resolve = |of_run: &Path| {
            let config = self.settings.resolve_over(of_run)?;
            // No other thread allocates now: the only one waits for Ctrl-C.
            allocator::keep_blocks_within(memory_budget(&config.run));
            Ok(config)
        };
        let shared = next::shared(&self.out, self.wait);
        let figures = work(&shared, (&self.pass, &units), resolve, &progress, &cancel)?;
        self.json.show(&figures, || page(&figures))?;
        Ok(exit::DONE)
    }
}

fn page(figures: &PassFigures) -> String {
    let PassFigures { pass, units, resumed, seconds, .. } = figures;
    let computed = print::counted((units - resumed) as u64, "unit");
    format!("  pass {pass}: {computed} computed, {resumed} already stored, {seconds:.2} s\n")
}

/// Largest number of units in a list: a slip like 0..1000000000000 must not fill the memory.
const MOST: usize = 10_000_000;

/// Reads numbers and half-open ranges.
fn units(text: &str) -> Result<Numbers, String> {
    let wrong = || format!("{text} is not a list of units like 3..7,12");
    let number = |text: &str| text.parse::<usize>().map_err(|_| wrong());
    let mut numbers = Vec::new();
    for part in text.split(',') {
        let (from, to) = match part.split_once("..") {
            Some((from, to)) => (number(from)?, number(to)?),
            None => (number(part)?, number(part)?.saturating_add(1)),
        };
        if from >= to {
            return Err(wrong());
        }
        if to - from > MOST - numbers.len() {
            return Err(format!("{text} names more than {} units", print::count(MOST as u64)));
        }
        numbers.extend(from..to);
    }
    Ok(Numbers(numbers))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_numbers_and_half_open_ranges() {
        assert_eq!(units("3..7,12"), Ok(Numbers(vec![3, 4, 5, 6, 12])));
        assert_eq!(units("0"), Ok(Numbers(vec![0])));
        for text in ["", "3..3", "7..3", "a", "1,,2", "3..", "-1", "18446744073709551615.."] {
            assert!(units(text).unwrap_err().contains("like 3..7,12"), "{text}");
        }
        for text in ["0..99999999999", "0,1..10000001", "0..20000000"] {
            assert_eq!(units(text), Err(format!("{text} names more than 10,000,000 units")));
        }
    }
}

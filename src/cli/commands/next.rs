//! `chainage next`.

use std::path::PathBuf;
use std::time::Duration;

use chainage::run::{DueUnits, Registries, SharedRun, next};

use crate::cli::exit;
use crate::cli::exit::Outcome;
use crate::cli::print::{self, JsonOutput};

#[derive(Debug, clap::Args)]
pub(crate) struct NextArgs {
    /// Output directory of a run
    out: PathBuf,
    #[command(flatten)]
    json: JsonOutput,
}

impl NextArgs {
    pub(crate) fn run(&self) -> Outcome {
        let due = next(&shared(&self.out, 0))?;
        self.json.show(&due, || page(&due))?;
        Ok(exit::DONE)
    }
}

/// A run in a directory that other processes may be working in.
pub(super) fn shared(out: &std::path::Path, wait_s: u64) -> SharedRun<'static> {
    let wait = Duration::from_secs(wait_s);
    SharedRun { out: out.to_owned(), wait, registries: Registries::default() }
}

/// The due pass and its units, for a person.
pub(super) fn page(due: &DueUnits) -> String {
    let Some(pass) = &due.pass else {
        return "  finished: every output is complete\n".to_owned();
    };
    let units = print::counted(due.of as u64, "unit");
    if due.units.is_empty() {
        format!("  pass {pass}: all of {units} are there, due is chainage reduce OUT --after {pass}\n")
    } else {
        format!("  pass {pass}: {} of {units} due: --pass {pass} --units {}\n", due.units.len(), due.ranges)
    }
}

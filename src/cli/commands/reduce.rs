//! `chainage reduce`.

use std::path::PathBuf;

use chainage::run::{is_output, reduce};

use crate::cli::commands::{next, run};
use crate::cli::exit;
use crate::cli::exit::Outcome;
use crate::cli::numbers::whole;
use crate::cli::print::JsonOutput;
use crate::cli::progress::{Progress, ProgressChoice};

#[derive(Debug, clap::Args)]
pub(crate) struct ReduceArgs {
    /// Output directory of a run
    out: PathBuf,
    /// The pass to complete, as `chainage next` names it
    #[arg(long, value_name = "PASS")]
    after: String,
    /// Wait up to this many seconds for missing units: other hosts see a new file late
    #[arg(long, value_name = "SECONDS", default_value_t = 60, value_parser = whole::<u64>(0..=u64::MAX, 60))]
    wait: u64,
    #[command(flatten)]
    json: JsonOutput,
}

impl ReduceArgs {
    pub(crate) fn run(&self) -> Outcome {
        self.json.spares(&self.out, is_output)?;
        let progress = Progress::new(ProgressChoice::None);
        let reduced = reduce(&next::shared(&self.out, self.wait), &self.after, &progress)?;
        self.json.show(&reduced.next, || {
            let mut text = reduced
                .finished
                .as_ref()
                .map_or_else(String::new, |(summary, output)| run::page(summary, &self.out, output));
            text.push_str(&next::page(&reduced.next));
            text
        })?;
        Ok(exit::DONE)
    }
}

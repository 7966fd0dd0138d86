//! `chainage demo`.

use std::path::{Path, PathBuf};

use chainage::config::Config;
use chainage::run::is_output;

use crate::cli::commands::run::{page, process, show_settings};
use crate::cli::exit;
use crate::cli::exit::{CliError, Outcome};
use crate::cli::print::{self, JsonOutput};
use crate::cli::progress::Show;

/// The sample: one sweep of a vehicle scanner on a road with two rows of trees, see NOTICE.
pub(super) const SAMPLE: &[u8] = include_bytes!("../../../tests/data/tree_road_sweep.laz");
pub(super) const SAMPLE_NAME: &str = "tree_road_sweep.laz";

/// Smaller objects are accepted, because one sweep has about a hundredth of the points of a drive.
const SETTING: &str = "street.min_points=10";

#[derive(Debug, clap::Args)]
pub(crate) struct DemoArgs {
    /// Output directory
    #[arg(short, long, value_name = "DIRECTORY", value_parser = print::folder(), default_value = "chainage-demo")]
    out: PathBuf,
    #[command(flatten)]
    show: Show,
    #[command(flatten)]
    json: JsonOutput,
}

impl DemoArgs {
    pub(crate) fn run(&self) -> Outcome {
        let progress = self.show.progress();
        let folder = self.out.join("input");
        let input = folder.join(SAMPLE_NAME);
        let failed = |source| CliError::Write { target: input.display().to_string(), source };
        if std::fs::read(&input).map_or(true, |bytes| bytes != SAMPLE) {
            std::fs::create_dir_all(&folder).and_then(|()| std::fs::write(&input, SAMPLE)).map_err(failed)?;
        }
        let out = self.out.join("output");
        self.json.spares(&out, is_output)?;
        let config = Config::resolve(None, &[SETTING.to_owned()]).map_err(chainage::Error::from)?;
        if self.show.verbose() {
            show_settings(&config)?;
        }
        let output = config.output.clone();
        let summary = process(vec![input], &out, config, false, progress)?;
        let open = |out: &Path| {
            let name = out.join(SAMPLE_NAME);
            format!(
                "  for your own files: chainage run FILES... -o OUT (the demo adds --set {SETTING})\n  to see it: chainage view {}, or open {} in a browser, or {} in a viewer of point clouds and colour it by cluster_id\n",
                out.display(),
                out.join("report.html").display(),
                name.display()
            )
        };
        self.json.show(&summary, || page(&summary, &out, &output) + &open(&out))?;
        Ok(exit::DONE)
    }
}

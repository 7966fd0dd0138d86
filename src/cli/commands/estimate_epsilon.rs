//! `chainage estimate-epsilon`: the radius of `dbscan` from the distances of neighbours, for a drive or a
//! table.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use chainage::cluster::dbscan::epsilon::DriveEpsilon;
use chainage::cluster::dbscan::epsilon::{self, Estimate};
use chainage::config::ConfigError;
use chainage::run::{CancelToken, EstimateRequest, Registries, estimate_epsilon};
use serde_json::{Value, json};

use crate::cli::drive_args::{Inputs, Settings};
use crate::cli::exit::{CliError, Outcome};
use crate::cli::numbers::whole;
use crate::cli::print::{JsonOutput, deliver, is_standard_output};
use crate::cli::progress::{Kind, Progress};
use crate::cli::quantities::count;
use crate::cli::table_points::{self, TablePoints};
use crate::cli::{exit, interrupt, print, scratch};

/// Estimate the radius epsilon of `dbscan` from the distances between points.
///
/// The curve is the mean distance to the k-th nearest neighbour over k. A polynomial is fitted to it. Epsilon
/// is its value where its slope equals that of its chord (Wang et al. 2019, doi:10.3390/s19010172). The
/// points are all points of a drive that are neither ground nor noise, or the rows of one table (*.csv,
/// *.txt, *.tsv). The result does not depend on tiles or threads.
#[derive(Debug, clap::Args)]
pub(crate) struct EstimateArgs {
    #[command(flatten)]
    inputs: Inputs,
    /// Fields that make up the distance. x, y and z alone are in metres. With intensity, red, green, blue or
    /// nir, every field is divided by its standard deviation over the drive. For a table: columns by name or
    /// number [default: x,y,z; for a table: all numeric columns]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    fields: Vec<String>,
    /// Weight of each field after the division, in the order of --fields [default: 1]
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',')]
    weights: Vec<f64>,
    /// Number of neighbours of the first curve, the point itself included, 8 to 200 [default: 40]
    #[arg(
        long,
        value_name = "K",
        value_parser = whole::<u64>(epsilon::SMALLEST_K as u64..=epsilon::LARGEST_K as u64, 32)
    )]
    k: Option<u64>,
    /// Approximate limit of the points whose neighbours are searched, for example 500k or 2M; 0: every point
    /// [default: 2M]
    #[arg(long, value_name = "N", value_parser = count)]
    max_queries: Option<u64>,
    /// Write a drawing of the curve, the fit and the result as SVG (-: to standard output)
    #[arg(long, value_name = "FILE", value_parser = print::target())]
    svg: Option<PathBuf>,
    #[command(flatten)]
    json: JsonOutput,
    /// Keep the state in this directory. The same command resumes, and `chainage run` with the same settings
    /// continues from there [default: a folder in --scratch that is removed at the end]
    #[arg(short, long, value_name = "DIRECTORY", value_parser = print::folder())]
    out: Option<PathBuf>,
    /// Folder for the temporary state [default: the system's temporary folder]
    #[arg(long, value_name = "DIRECTORY", conflicts_with = "out")]
    scratch: Option<PathBuf>,
    /// The table has no header; name columns by number
    #[arg(long)]
    no_header: bool,
    #[command(flatten)]
    show: Kind,
    #[command(flatten)]
    settings: Settings,
}

impl EstimateArgs {
    pub(crate) fn run(&self) -> Outcome {
        // First, because errors have the same format as the progress.
        let progress = Progress::new(self.show.progress());
        if self.svg.as_deref().is_some_and(is_standard_output) && self.json.is_printed() {
            return Err(refused("--svg", "-", "a file when --json is standard output").into());
        }
        if let [table] = &self.inputs.files()?[..]
            && table_points::is_table(table)
        {
            return self.table(table);
        }
        let found = self.drive(&progress)?;
        let name = |axis: &chainage::model::FieldAxis| axis.field.name();
        let names: Vec<&str> = found.space.axes.iter().map(name).collect();
        let cost = &found.cost;
        let more = format!(
            "  {:.3} % of the points needed neighbours more than {:.1} m beyond their tile; {:.2} % more points were read for them\n",
            100.0 * cost.share,
            cost.halo_m,
            100.0 * cost.read_share
        );
        let facts = serde_json::to_value(&found).map_err(|error| CliError::stdout(error.into()))?;
        self.show(&found.estimate, &found.unit, &names, &more, &facts)
    }

    fn drive(&self, progress: &Progress) -> Result<DriveEpsilon, CliError> {
        if self.no_header {
            return Err(refused("--no-header", "a drive", "left out unless the input is one table").into());
        }
        if let Some(method) = self.settings.choices.method.as_deref().filter(|method| *method != "dbscan") {
            return Err(refused("--method", method, "dbscan, which has an epsilon").into());
        }
        let mut set =
            vec![("cluster.method", "\"dbscan\"".to_owned()), ("dbscan.epsilon", "\"auto\"".to_owned())];
        if !self.fields.is_empty() {
            set.push(("dbscan.fields", format!("{:?}", self.fields)));
        }
        if !self.weights.is_empty() {
            set.push(("dbscan.weights", format!("{:?}", self.weights)));
        }
        set.extend(self.k.map(|k| ("epsilon.k", k.to_string())));
        set.extend(self.max_queries.map(|most| ("epsilon.max_queries", most.to_string())));
        let config = self.settings.resolve(&set)?;
        let cancel = Arc::new(CancelToken::default());
        interrupt::listen(&cancel)?;
        // Without --out, the state is temporary and is removed with the folder.
        let (out, _temporary) = match &self.out {
            Some(out) => (out.clone(), None),
            None => {
                let folder = scratch::folder(self.scratch.as_deref(), "estimate")?;
                (folder.path().to_owned(), Some(folder))
            }
        };
        let request =
            EstimateRequest { inputs: self.inputs.files()?, out, config, registries: Registries::default() };
        let (found, _) = estimate_epsilon(&request, progress, &cancel)?;
        Ok(found)
    }

    fn table(&self, path: &Path) -> Outcome {
        for (flag, given) in [
            ("settings of a drive", self.settings.is_any_given()),
            ("--recursive", self.inputs.is_recursive()),
            ("--max-queries", self.max_queries.is_some()),
            ("--out", self.out.is_some()),
            ("--scratch", self.scratch.is_some()),
        ] {
            if given {
                return Err(refused(flag, &path.display().to_string(), "left out for a table").into());
            }
        }
        let weights = (!self.weights.is_empty()).then_some(&self.weights[..]);
        let TablePoints { table, columns, points } =
            TablePoints::read(path, !self.no_header, &self.fields, weights)?;
        let first = self.k.map_or(epsilon::FIRST_K, |k| usize::try_from(k).unwrap_or(usize::MAX));
        let estimate = table_points::estimate(&points, first)?;
        let names: Vec<&str> = columns.iter().map(|&column| table.name(column)).collect();
        let facts = json!({ "table": path.display().to_string(), "columns": names, "weights": self.weights });
        let Value::Object(mut all) = facts else { return Ok(exit::DONE) };
        if let Value::Object(estimate) =
            serde_json::to_value(&estimate).map_err(|error| CliError::stdout(error.into()))?
        {
            all.extend(estimate);
        }
        self.show(&estimate, "", &names, "", &Value::Object(all))
    }

    fn show(&self, found: &Estimate, unit: &str, names: &[&str], more: &str, facts: &Value) -> Outcome {
        let svg = deliver(self.svg.as_deref(), |to| to.write_all(epsilon::svg(found, unit).as_bytes()))?;
        let json = self.json.deliver(facts)?;
        if !svg && !json {
            print::text(&(page(found, unit, names) + more))?;
        }
        Ok(exit::DONE)
    }
}

fn refused(key: &str, value: &str, expected: &str) -> chainage::Error {
    ConfigError::value(key, value, expected).into()
}

/// The curve as a table, up to k = 10 and then every fifth k, and the results.
fn page(found: &Estimate, unit: &str, names: &[&str]) -> String {
    let shown = |k: usize| k <= 10 || k.is_multiple_of(5) || k == found.k;
    let row = |(k, (mean, error)): (usize, (&f64, &f64))| {
        [k.to_string(), format!("{mean:.6}"), format!("{:.6}", found.fit.at(k as f64)), format!("{error:.6}")]
            .to_vec()
    };
    let curve = &found.curve;
    let rows: Vec<Vec<String>> = (2..=found.k)
        .zip(curve.mean.iter().zip(&curve.standard_error))
        .filter(|(k, _)| shown(*k))
        .map(row)
        .collect();
    let mut text = print::table(&["k", "mean distance", "fit", "standard error"], &rows);
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    text.push_str(&format!(
        "\n  neighbours of {} of {} points in {}\n",
        print::count(curve.queries),
        print::count(curve.population),
        names.join(", ")
    ));
    text.push_str(&format!(
        "  epsilon {:.5}{unit} (standard error {:.5}) at k0 = {:.3} of K = {}, R2 {:.5}\n",
        found.epsilon, found.standard_error, found.k0, found.k, found.r_squared
    ));
    text
}

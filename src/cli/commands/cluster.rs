//! `chainage cluster`: reads the rows of a table and writes them with the number of their cluster. The
//! methods are in the library.

use std::path::PathBuf;

use chainage::cluster::DbscanVariant;
use chainage::cluster::dbscan::epsilon;
use chainage::cluster::dbscan::rows::Dbscan;
use chainage::cluster::p_linkage::PLinkage;
use chainage::config::ConfigError;
use chainage::spatial::{Points, SpatialError};
use chainage::table::write_with_column;
use serde_json::{Value, json};

use crate::cli::exit;
use crate::cli::exit::{CliError, Outcome};
use crate::cli::numbers::whole;
use crate::cli::print::{self, JsonOutput, deliver, is_standard_output};
use crate::cli::table_points::{self, TablePoints};

/// Clusters the rows of a table: points of 2 to 8 dimensions.
///
/// The output is the table, byte for byte, with one more column: the number of the cluster, or 0 for noise
/// and outliers. Clusters are numbered in the order of their first rows.
#[derive(Debug, clap::Args)]
pub(crate) struct ClusterArgs {
    /// Table with a header, separated by commas, semicolons, tabs or blanks (-: from standard input)
    #[arg(value_name = "TABLE")]
    table: PathBuf,
    /// File for the labelled table (-: standard output)
    #[arg(short, long, value_name = "FILE", value_parser = print::target())]
    out: PathBuf,
    /// Clustering method
    #[arg(long, value_enum, value_name = "NAME")]
    method: Method,
    /// Columns with the coordinates, by name or by number from 1 [default: all numeric columns]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    columns: Vec<String>,
    /// The table has no header; name columns by number
    #[arg(long)]
    no_header: bool,
    /// Name of the new column
    #[arg(long, value_name = "NAME", default_value = "cluster_id")]
    id_column: String,
    /// Subtract the mean of each column, then divide the column by its standard deviation
    #[arg(long)]
    standardise: bool,
    /// Weight of each column after standardising, in the order of --columns [default: 1]
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',', requires = "standardise")]
    weights: Vec<f64>,
    #[command(flatten)]
    json: JsonOutput,
    #[command(flatten)]
    dbscan: DbscanArgs,
    #[command(flatten)]
    p_linkage: PLinkageArgs,
}

/// Default of --min-points.
const MIN_POINTS: u64 = 5;
/// Default of --scale.
const SCALE: f64 = 5.0;

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Method {
    /// Wang et al. 2019 (doi:10.3390/s19010172) and Ester et al. 1996; epsilon is given or estimated
    Dbscan,
    /// Lu et al. 2016: every point is linked to the nearest denser one
    PLinkage,
}

#[derive(Debug, clap::Args)]
#[command(next_help_heading = "dbscan")]
struct DbscanArgs {
    /// Definition of a cluster: connected points limited by their number, or core points with their border
    #[arg(long, value_enum, value_name = "size|core", default_value = "size")]
    variant: Variant,
    /// Radius of a neighbourhood in the unit of the columns; auto: estimated from the points
    #[arg(long, value_name = "NUMBER|auto", default_value = "auto", value_parser = epsilon_or_auto)]
    epsilon: EpsilonChoice,
    /// Number of neighbours of the first curve of the estimation, the point itself included, 8 to 200
    #[arg(
        long,
        value_name = "K",
        default_value_t = epsilon::FIRST_K as u64,
        value_parser = whole::<u64>(epsilon::SMALLEST_K as u64..=epsilon::LARGEST_K as u64, 32)
    )]
    k: u64,
    /// size: number of rows of the smallest cluster; core: number of rows around a core point, itself
    /// included
    #[arg(long, value_name = "N", default_value_t = MIN_POINTS, value_parser = whole::<u64>(1..=u64::MAX, 10))]
    min_points: u64,
    /// Number of rows of the largest cluster; 0: no limit
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = whole::<u64>(0..=u64::MAX, 1_000))]
    max_points: u64,
    /// Write a drawing of the curve of the estimation as SVG (-: to standard output)
    #[arg(long, value_name = "FILE", value_parser = print::target())]
    svg: Option<PathBuf>,
}

#[derive(Debug, clap::Args)]
#[command(next_help_heading = "p-linkage")]
struct PLinkageArgs {
    /// Cut-off distance as a multiple of the median distance to the nearest neighbour
    #[arg(long, value_name = "NUMBER", default_value_t = SCALE, value_parser = positive)]
    scale: f64,
    /// Merge neighbouring clusters of similar density; for points of uniform density
    #[arg(long)]
    merge: bool,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Variant {
    Size,
    Core,
}

#[derive(Debug, Clone, Copy)]
enum EpsilonChoice {
    Auto,
    Given(f64),
}

fn epsilon_or_auto(text: &str) -> Result<EpsilonChoice, String> {
    if text == "auto" { Ok(EpsilonChoice::Auto) } else { positive(text).map(EpsilonChoice::Given) }
}

fn positive(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| number.is_finite() && *number > 0.0);
    number.ok_or_else(|| format!("{text} is not a number above 0"))
}

/// Result of a method.
struct Found {
    labels: Vec<u32>,
    clusters: u32,
    /// The settings and the values derived from them.
    facts: Value,
    /// The same as one line of text.
    line: String,
}

impl ClusterArgs {
    pub(crate) fn run(&self) -> Outcome {
        self.one_standard_output().map_err(chainage::Error::from)?;
        self.nothing_in_vain().map_err(chainage::Error::from)?;
        let weights = self.standardise.then_some(&self.weights[..]);
        let TablePoints { table, columns, points } =
            TablePoints::read(&self.table, !self.no_header, &self.columns, weights)?;
        table.check_free(&self.id_column).map_err(chainage::Error::from)?;
        let found = match self.method {
            Method::Dbscan => self.dbscan.cluster(&points)?,
            Method::PLinkage => self.p_linkage.cluster(&points).map_err(chainage::Error::from)?,
        };
        let noise = found.labels.iter().filter(|&&label| label == 0).count();
        let names: Vec<&str> = columns.iter().map(|&column| table.name(column)).collect();
        let report = json!({
            "table": self.table.display().to_string(),
            "rows": table.len(),
            "columns": names,
            "standardised": self.standardise,
            "weights": self.weights,
            "method": self.method.name(),
            "result": found.facts,
            "clusters": found.clusters,
            "noise": noise,
        });
        let table_shown =
            deliver(Some(&self.out), |to| write_with_column(&table, &self.id_column, &found.labels, to))?;
        let json_shown = self.json.deliver(&report)?;
        let svg_shown = self.dbscan.svg.as_deref().is_some_and(is_standard_output);
        if !table_shown && !json_shown && !svg_shown {
            print::text(&format!(
                "  {} of {}: {}, {} without a cluster\n  {}\n",
                print::counted(table.len() as u64, "row"),
                names.join(", "),
                print::counted(found.clusters.into(), "cluster"),
                print::counted(noise as u64, "row"),
                found.line
            ))?;
        }
        Ok(exit::DONE)
    }

    /// Refuses more than one output to standard output.
    fn one_standard_output(&self) -> Result<(), ConfigError> {
        let mut taken = is_standard_output(&self.out).then_some("--out");
        let svg_printed = self.dbscan.svg.as_deref().is_some_and(is_standard_output);
        for (flag, printed) in [("--json", self.json.is_printed()), ("--svg", svg_printed)] {
            if printed {
                if let Some(first) = taken {
                    return Err(ConfigError::value(
                        flag,
                        "-",
                        format!("a file when {first} is standard output"),
                    ));
                }
                taken = Some(flag);
            }
        }
        Ok(())
    }

    /// Refuses options of the other method, and a drawing of the estimate if nothing is estimated.
    fn nothing_in_vain(&self) -> Result<(), ConfigError> {
        let DbscanArgs { variant, epsilon, k, min_points, max_points, svg: _ } = &self.dbscan;
        let PLinkageArgs { scale, merge } = &self.p_linkage;
        let epsilon_given = match epsilon {
            EpsilonChoice::Given(epsilon) => Some(epsilon.to_string()),
            EpsilonChoice::Auto => None,
        };
        let of_other: Vec<(&'static str, Option<String>)> = match self.method {
            Method::Dbscan => vec![
                ("--scale", (*scale != SCALE).then(|| scale.to_string())),
                ("--merge", merge.then(|| merge.to_string())),
            ],
            Method::PLinkage => vec![
                ("--variant", matches!(variant, Variant::Core).then(|| "core".to_owned())),
                ("--epsilon", epsilon_given),
                ("--k", (*k != epsilon::FIRST_K as u64).then(|| k.to_string())),
                ("--min-points", (*min_points != MIN_POINTS).then(|| min_points.to_string())),
                ("--max-points", (*max_points != 0).then(|| max_points.to_string())),
            ],
        };
        let changed = |(option, value): (&'static str, Option<String>)| Some((option, value?));
        if let Some((option, value)) = of_other.into_iter().find_map(changed) {
            let expected = format!("left out: --method {} does not use it", self.method.name());
            return Err(ConfigError::value(option, value, expected));
        }
        let estimated = self.method == Method::Dbscan && matches!(self.dbscan.epsilon, EpsilonChoice::Auto);
        match &self.dbscan.svg {
            Some(path) if !estimated => {
                let expected = "left out unless --method dbscan estimates an epsilon (--epsilon auto)";
                Err(ConfigError::value("--svg", path.display(), expected))
            }
            _ => Ok(()),
        }
    }
}

impl Method {
    fn name(self) -> &'static str {
        match self {
            Self::Dbscan => "dbscan",
            Self::PLinkage => "p-linkage",
        }
    }
}

impl DbscanArgs {
    fn cluster(&self, points: &Points) -> Result<Found, CliError> {
        let estimate = match self.epsilon {
            EpsilonChoice::Auto => {
                Some(table_points::estimate(points, usize::try_from(self.k).unwrap_or(usize::MAX))?)
            }
            EpsilonChoice::Given(_) => None,
        };
        let epsilon = match (self.epsilon, &estimate) {
            (EpsilonChoice::Given(epsilon), _) => epsilon,
            (EpsilonChoice::Auto, estimate) => estimate.as_ref().map_or(0.0, |estimate| estimate.epsilon),
        };
        if let (Some(path), Some(estimate)) = (&self.svg, &estimate) {
            deliver(Some(path), |to| to.write_all(epsilon::svg(estimate, "").as_bytes()))?;
        }
        let variant = match self.variant {
            Variant::Size => DbscanVariant::Size,
            Variant::Core => DbscanVariant::Core,
        };
        let dbscan = Dbscan { variant, epsilon, min_points: self.min_points, max_points: self.max_points };
        let (labels, clusters) = dbscan.cluster(points).map_err(chainage::Error::from)?;
        let line = match &estimate {
            Some(estimate) => format!(
                "epsilon {epsilon:.6}, estimated at k0 = {:.3} of K = {} (R2 {:.5})",
                estimate.k0, estimate.k, estimate.r_squared
            ),
            None => format!("epsilon {epsilon}"),
        };
        let facts = json!({ "settings": dbscan, "estimate": estimate });
        Ok(Found { labels, clusters, facts, line })
    }
}

impl PLinkageArgs {
    fn cluster(&self, points: &Points) -> Result<Found, SpatialError> {
        let method = PLinkage { scale: self.scale, merge: self.merge };
        let found = method.cluster(points)?;
        let facts = json!({
            "settings": method,
            "cutoff": found.cutoff,
            "median_density": found.median_density,
        });
        let line =
            format!("cut-off distance {:.6}, median density {:.6}", found.cutoff, found.median_density);
        Ok(Found { labels: found.labels, clusters: found.clusters, facts, line })
    }
}
